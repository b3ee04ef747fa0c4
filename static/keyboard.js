// Time by keyboard: space plays, arrows step, brackets change speed.

import { clock } from "./state/clock.js";
import { store } from "./state/store.js";
import { zoom } from "./state/zoom.js";
import { stepEvent, stepTime } from "./workbench/timeline.js";

const KEYS = {
  " ": () => clock.toggle(),
  ArrowRight: (event) => (event.shiftKey ? stepEvent(1) : stepTime(1)),
  ArrowLeft: (event) => (event.shiftKey ? stepEvent(-1) : stepTime(-1)),
  Home: () => clock.seek(clock.start),
  End: () => clock.seek(clock.end),
  "[": () => clock.shift(-1),
  "]": () => clock.shift(1),
  "+": () => zoom.by(2),
  "-": () => zoom.by(0.5),
  Escape: () => zoom.reset(),
};

/** Keys that an element wants for itself. */
function wants(element, key) {
  if (!element?.matches) return false;
  if (element.matches("textarea, select, input:not([type=range], [type=checkbox], [type=radio])")) return true;
  if (element.matches("input[type=radio]")) return key !== "[" && key !== "]";
  return key === " " && element.matches("button, a, input[type=checkbox], summary");
}

/** Listens in a window: the page's own, or a pane's. */
export function listenKeys(target) {
  target.addEventListener("keydown", (event) => {
    const act = KEYS[event.key];
    if (!act || event.ctrlKey || event.altKey || event.metaKey || store.state.job === null) return;
    if (wants(event.target, event.key)) return;
    event.preventDefault();
    act(event);
  });
}
