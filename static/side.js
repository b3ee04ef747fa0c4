// The side column can be folded away; on a narrow screen it is while a run is open.

import { part } from "./look/dom.js";
import { store } from "./state/store.js";

const narrow = window.matchMedia("(max-width: 1000px)");

export function mountSide() {
  const toggle = part("side-toggle");
  const fold = (folded) => {
    document.body.toggleAttribute("data-folded", folded);
    toggle.setAttribute("aria-expanded", String(!folded));
    toggle.title = folded ? "Show missions and runs" : "Fold missions and runs away";
  };
  toggle.addEventListener("click", () => fold(!document.body.hasAttribute("data-folded")));
  store.watch(["run"], ({ run }) => narrow.matches && fold(run !== null));
  narrow.addEventListener("change", () => fold(narrow.matches && store.state.run !== null));
}
