// May I fuse naively? The map of dangerous regions, an operating point to drag on it, and what follows from it.

import { el, part, say } from "../look/dom.js";
import { darkScheme } from "../look/palette.js";
import { store } from "../state/store.js";
import * as api from "../wire/api.js";
import { drawHistories, drawWeights } from "./curves.js";
import { buildMap } from "./map.js";

/** Trials of the Monte Carlo dots while a point is dragged, and once it rests. */
const TRIALS = { dragging: 200, resting: 4000 };
const STEPS = 30;
const PAUSE_MS = 60;

/** Variances in m², as RC's Fig. 6(b). */
const point = { process: 1, r1: 10, r2: 20, prior: 10 };

export function mountExplorer() {
  const root = part("explorer");
  let built = null;
  store.watch(["job", "run", "mission", "missions", "scenario"], ({ job, run, mission, missions, scenario }) => {
    const family = run === null ? missions?.find((m) => m.name === mission)?.family : job?.family;
    root.hidden = family !== "tracking";
    if (root.hidden) return;
    built ??= build(root);
    if (run === null && scenario?.family === "tracking") built.take(scenario);
  });
  darkScheme.addEventListener("change", () => built?.redraw());
}

function build(root) {
  const verdict = el("p", { class: "verdict-words", role: "status" });
  const fault = el("p", { class: "quiet" });
  const weights = el("div", { class: "drawing" });
  const histories = el("div", { class: "drawing" });
  const fields = [
    field("process", "Target's step Q", "m²"),
    field("r1", "First sensor R₁", "m²"),
    field("r2", "Second sensor R₂", "m²"),
    field("prior", "Prior P", "m²"),
  ];
  const map = buildMap(point, {
    moved(resting) {
      show();
      ask(resting);
    },
  });
  root.append(
    el("header", {}, el("h2", {}, "May I fuse naively?"), verdict),
    el(
      "div",
      { class: "explore" },
      el("div", {}, map.root, el("div", { class: "point-fields" }, fields.map((f) => f.root))),
      el(
        "div",
        { class: "beside" },
        el("figure", { class: "plot" }, el("figcaption", {}, "One step: error variance against the weight of the second sensor (Fig. 3)"), weights),
        el("figure", { class: "plot" }, el("figcaption", {}, "Over time: believed dashed, actual solid, Monte Carlo dots (Fig. 6)"), histories),
        fault,
      ),
    ),
  );

  let last = null;
  const show = () => {
    fields.forEach((f) => f.show());
    map.place();
  };
  const redraw = () => {
    map.draw();
    if (last === null) return;
    drawWeights(weights, last.weights);
    drawHistories(histories, last.histories);
  };
  let asking = null;
  let timer = 0;
  const ask = (resting) => {
    clearTimeout(timer);
    timer = setTimeout(() => fetchAnswer(resting), PAUSE_MS);
  };
  async function fetchAnswer(resting) {
    asking?.abort();
    const mine = (asking = new AbortController());
    try {
      const body = {
        process: point.process,
        sensors: [point.r1, point.r2],
        prior: point.prior,
        steps: STEPS,
        trials: resting ? TRIALS.resting : TRIALS.dragging,
      };
      last = await api.analyseTracking(body, mine.signal);
      say(verdict, last.verdict);
      verdict.classList.toggle("danger", last.verdict.startsWith("Do not"));
      say(fault, "");
      redraw();
    } catch (error) {
      if (error.name !== "AbortError") say(fault, error.message);
    }
  }

  function field(key, label, unit) {
    const input = el("input", { type: "number", min: "0.01", step: "any", inputmode: "decimal", "aria-label": `${label}, ${unit}` });
    input.addEventListener("change", () => {
      const value = Number(input.value);
      if (Number.isFinite(value) && value > 0) {
        point[key] = value;
        map.draw();
        ask(true);
      }
      show();
    });
    return {
      root: el("label", {}, el("span", {}, label), input, el("span", { class: "unit" }, unit)),
      show: () => {
        if (document.activeElement !== input) input.value = String(Number(point[key].toPrecision(4)));
      },
    };
  }

  show();
  map.draw();
  ask(true);
  return {
    redraw,
    take(scenario) {
      const [first, second] = scenario.sensors;
      if (!first.variance_m2 || !second.variance_m2) return;
      const { process_variance_m2: process, prior_variance_m2: prior } = scenario.target;
      Object.assign(point, { process: process || 0.01, prior: prior || 0.01, r1: first.variance_m2, r2: second.variance_m2 });
      show();
      map.draw();
      ask(true);
    },
  };
}
