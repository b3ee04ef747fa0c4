// What fills the stage while no run is open: the picked mission, and how to go on.

import { el, part } from "../look/dom.js";
import { store } from "../state/store.js";
import { facts } from "./facts.js";
import { sketch } from "./sketch.js";

export function mountPreview() {
  const stage = part("empty");
  store.watch(["run", "mission", "missions", "scenario"], ({ run, mission, missions, scenario }) => {
    stage.hidden = run !== null;
    const entry = missions?.find((m) => m.name === mission);
    if (missions === null) stage.replaceChildren(el("p", { class: "quiet" }, "Reading the library…"));
    else if (!entry) stage.replaceChildren(el("p", { class: "quiet" }, "No mission in the library can run here."));
    else {
      const shown = [
        scenario?.family === "tracking" ? null : el("div", { class: "chart" }, sketch(scenario, 520, 300)),
        el("h1", {}, entry.title),
        el("p", { class: "lead" }, entry.summary),
        entry.source ? el("p", { class: "source" }, entry.source) : null,
        scenario
          ? el("dl", { class: "facts" }, facts(scenario).map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))))
          : null,
        el("p", { class: "how" }, "Tick the estimators to compare and press ", el("b", {}, "Run"), "."),
      ];
      stage.replaceChildren(...shown.filter((node) => node !== null));
    }
  });
}
