// A choice among an open run's estimators that the address keeps.

import { el } from "../look/dom.js";
import { keepInLink, noteLink } from "./link.js";

/**
 * A select of estimators, its choice kept in the address under a key; `act()` is called when another is chosen.
 * `of(names, usual, title)` says what there is to choose; what was asked for stays if it is there, or else it is the usual.
 */
export function keptChoice(key, label, act) {
  const root = el("select", { "aria-label": label });
  let asked = null;
  let names = [];
  let usual = null;
  const shown = () => (names.includes(asked) ? asked : usual);
  keepInLink(key, {
    write: () => (shown() === usual ? null : asked),
    read(text) {
      asked = text;
      if (!names.length || root.value === shown()) return;
      root.value = shown();
      act();
    },
  });
  root.addEventListener("change", () => {
    asked = root.value;
    noteLink();
    act();
  });
  return {
    root,
    of(those, usually, title) {
      names = those;
      usual = usually;
      root.replaceChildren(...names.map((name) => el("option", { value: name }, title(name))));
      if (names.length) root.value = shown();
    },
  };
}
