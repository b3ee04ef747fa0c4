// The estimators to compare: ticks with the line each has in the plots.

import { el, part } from "../look/dom.js";
import { darkScheme } from "../look/palette.js";
import { lineSample } from "../look/swatch.js";
import { fittingAlgorithms, tick } from "../state/library.js";
import { store } from "../state/store.js";

export function mountAlgorithms() {
  const list = part("algorithms");
  const draw = ({ missions, algorithms, mission }) => {
    if (missions === null || algorithms === null) {
      list.replaceChildren(...Array.from({ length: 3 }, () => el("div", { class: "ghost algorithm" })));
      return;
    }
    const fitting = fittingAlgorithms(missions.find((m) => m.name === mission));
    list.replaceChildren(
      ...(fitting.length ? fitting.map(entry) : [el("p", { class: "quiet" }, "No estimator fits this mission.")]),
    );
    check(store.state);
  };
  const check = ({ ticked }) => {
    for (const input of list.querySelectorAll("input")) input.checked = ticked.includes(input.value);
  };
  store.watch(["missions", "algorithms", "mission"], draw);
  store.watch(["ticked"], check);
  darkScheme.addEventListener("change", () => draw(store.state));
}

function entry(algorithm) {
  const assumes = algorithm.assumes?.length ? `Assumes: ${algorithm.assumes.join("; ")}` : null;
  const about = [algorithm.summary, assumes, algorithm.source].filter(Boolean).join("\n");
  return el(
    "label",
    { class: "algorithm", title: about },
    el("input", {
      type: "checkbox",
      name: "algorithm",
      value: algorithm.name,
      "aria-label": algorithm.title,
      "aria-description": algorithm.summary,
      onchange: (event) => tick(algorithm.name, event.target.checked),
    }),
    el(
      "span",
      { class: "words" },
      el(
        "span",
        { class: "title" },
        algorithm.title,
        lineSample(algorithm.name, store.state.algorithms),
        algorithm.centralized
          ? el("span", { class: "tag", title: "Centralized benchmark: sees what no vehicle could know; a yardstick, not a contender" }, "benchmark")
          : null,
      ),
      el("span", { class: "summary" }, algorithm.summary),
    ),
  );
}
