// The legend: a chip for every estimator and vehicle, which shows or hides it everywhere at once.

import { el } from "../look/dom.js";
import { darkScheme, vehicleColour } from "../look/palette.js";
import { dot, lineSample } from "../look/swatch.js";
import { keepSomethingShown, showAll, showOnly, subjectsOf, toggleShown } from "../state/shown.js";
import { store } from "../state/store.js";

const HINT = "Click: hide or show everywhere. Shift-click, Shift+Enter or double click: this one alone.";

/** The legend of the open run. */
export function buildLegend() {
  const algorithms = el("div", { class: "chips", role: "group", "aria-label": "Estimators shown" });
  const vehicles = el("div", { class: "chips", role: "group", "aria-label": "Vehicles shown" });
  const all = el("button", { type: "button", class: "small", onclick: showAll }, "Show all");
  const root = el("div", { class: "chosen-few" }, algorithms, vehicles, all);

  let drawn = "";
  const draw = (state) => {
    const { job, algorithms: known } = state;
    const subjects = subjectsOf(state);
    root.hidden = job === null;
    const wanted = JSON.stringify([job?.algorithms, known?.length, subjects, darkScheme.matches]);
    if (wanted !== drawn) {
      drawn = wanted;
      const names = job?.algorithms ?? [];
      algorithms.replaceChildren(
        ...names.map((name) => chip("algorithms", name, names, lineSample(name, known ?? []), known?.find((a) => a.name === name)?.title ?? name)),
      );
      const places = subjects.map((s) => s.name);
      vehicles.replaceChildren(...places.map((name, n) => chip("vehicles", name, places, dot(vehicleColour(n)), name)));
    }
    const { hidden } = state;
    for (const button of root.querySelectorAll(".chip")) {
      button.setAttribute("aria-pressed", String(!hidden[button.dataset.kind].has(button.dataset.name)));
    }
    all.hidden = !hidden.algorithms.size && !hidden.vehicles.size;
  };
  store.watch(["job", "algorithms", "view", "live", "hidden"], draw);
  darkScheme.addEventListener("change", () => draw(store.state));
  keepSomethingShown();
  return root;
}

function chip(kind, name, names, sample, title) {
  return el(
    "button",
    {
      type: "button",
      class: "chip",
      "data-kind": kind,
      "data-name": name,
      title: HINT,
      onclick: (event) => (event.shiftKey ? showOnly(kind, name, names) : toggleShown(kind, name)),
      ondblclick: () => showOnly(kind, name, names),
    },
    sample,
    title,
  );
}
