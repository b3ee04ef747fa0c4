// W11's Table I, every cell measured by runs: five topologies without loss, one with.

import { el, say } from "../look/dom.js";
import { number, percent } from "../look/format.js";
import { store } from "../state/store.js";
import * as api from "../wire/api.js";
import { runSeries } from "./series.js";
import { card, startButton } from "./studies.js";

const TRIALS = 50;
const HEADINGS = {
  consistent: "Consistent",
  bounds_error: "Bounds error",
  arbitrary_topology: "Any topology",
  robust_to_loss: "Robust to loss",
};
const MARKS = { true: "✓", false: "✗", null: "–" };

export function buildTable() {
  const go = startButton("Measure the table", start);
  const { root, status, bar, figures } = card(
    "Table I of Walls and Eustice 2011, measured",
    `All six estimators in the five topologies without loss and in C with loss, ${TRIALS} trials each: about a minute. Point at a cell for the figure that decides it.`,
    [go],
  );

  async function start(signal) {
    bar.hidden = false;
    bar.value = 0;
    try {
      const plan = await api.tablePlan();
      const body = (scenario, set) => ({ scenario, algorithms: plan.algorithms, trials: TRIALS, set });
      const bodies = [...plan.lossless.map((name) => body(name, { "network.loss": 0 })), body(plan.lossy.scenario, plan.lossy.set)];
      const runs = await runSeries(bodies, signal, (done, total, part) => {
        bar.value = (done + part) / total;
        say(status, `${done} of ${total} runs done`);
      });
      const lossless = Object.fromEntries(plan.lossless.map((name, n) => [name, runs[n].id]));
      const rows = await api.tableOf({ lossless, lossy: runs.at(-1).id });
      figures.replaceChildren(table(rows, plan.columns));
      const told = rows.flatMap((row) => plan.columns.map((c) => row[c])).filter((cell) => cell.paper !== null);
      const same = told.filter((cell) => cell.paper === cell.holds).length;
      say(status, `${same} of ${told.length} cells that the paper has agree with it; loss in the last column is ${percent(plan.lossy.set["network.loss"])}.`);
    } catch (error) {
      say(status, error.name === "AbortError" ? "Stopped." : error.message);
    }
    bar.hidden = true;
  }

  return { root };
}

function table(rows, columns) {
  const title = (name) => store.state.algorithms.find((a) => a.name === name)?.title ?? name;
  const head = ["Estimator", ...columns.map((c) => HEADINGS[c] ?? c), "Floats", "Bytes"];
  return el(
    "table",
    { class: "table-1" },
    el("thead", {}, el("tr", {}, head.map((text) => el("th", { scope: "col" }, text)))),
    el(
      "tbody",
      {},
      rows.map((row) =>
        el(
          "tr",
          {},
          el("th", { scope: "row" }, title(row.algorithm)),
          columns.map((c) => cell(row[c])),
          el("td", { class: "figure" }, number(row.floats_per_packet)),
          el("td", { class: "figure" }, number(row.bytes_per_packet)),
        ),
      ),
    ),
  );
}

function cell({ holds, why, paper }) {
  const differs = paper !== null && paper !== holds;
  const tone = holds === null ? "" : holds ? "yes" : "no";
  return el(
    "td",
    { class: `tick ${tone}`, title: why, "aria-label": `${holds === null ? "does not apply" : holds ? "yes" : "no"}: ${why}` },
    MARKS[holds],
    el("span", { class: differs ? "paper differs" : "paper" }, paper === null ? "" : `paper ${MARKS[paper]}`),
  );
}
