// The comparison in figures: per algorithm and subject.

import { el, part } from "../look/dom.js";
import { NONE, count, number } from "../look/format.js";
import { darkScheme, vehicleColour } from "../look/palette.js";
import { dot, lineSample, verdictChip } from "../look/swatch.js";
import { store } from "../state/store.js";

/** Columns of one subject: [head, unit, what it is, cell]. */
const SUBJECT = [
  ["RMSE", "m", "Root mean square position error, over trials and time", (m) => number(m.rmse_m)],
  ["Final", "m", "RMS error at the end, over trials", (m) => number(m.final_rmse_m)],
  ["σ", "m", "Fourth root of the xy covariance's determinant, mean over trials and time", (m) => number(m.sigma_m)],
  ["Final σ", "m", "The same at the end", (m) => number(m.final_sigma_m)],
  ["ANEES", "", "Normalized error squared, averaged: 2 is right; below, where it is at 95 % of the times if it is", (m) => number(m.anees)],
  ["Verdict", "", "Whether its confidence can be believed", (m) => verdictChip(m)],
  ["Deviation", "m", "Largest distance between its mean and the centralized benchmark's", (m) => number(m.max_deviation_m)],
];

/** Columns of a whole algorithm. */
const WHOLE = [
  ["Sent", "", "Packets broadcast, over all trials", (a) => count(a.packets.sent)],
  ["Heard", "", "Packets received, over all trials", (a) => count(a.packets.received)],
  ["Packet", "B", "Mean length of an encoded packet", (a) => (a.packets.sent ? number(a.packets.bytes_per_packet) : NONE)],
  [
    "Load",
    "bit/s",
    "Mean load on the shared channel; ! where it is more than the scenario's channel carries",
    (a) => (a.packets.sent ? number(a.packets.bits_per_second) + (a.packets.exceeds_capacity ? " !" : "") : NONE),
  ],
  ["CPU", "s", "Processor time of the estimator, over all trials", (a) => number(a.cpu_s, 2)],
];

/** The interval of the ANEES, which depends on the number of trials alone. */
function interval(result) {
  const metrics = Object.values(result.algorithms).flatMap((a) => Object.values(a.subjects));
  const [low, high] = metrics.find((m) => m.anees_interval)?.anees_interval ?? [];
  return low === undefined ? "" : `${number(low)} … ${number(high)}`;
}

export function mountTable() {
  const room = part("table");
  const draw = ({ job, result, algorithms, view }) => {
    room.hidden = job === null;
    if (!job) return;
    room.replaceChildren(
      el("div", { class: "heading" }, el("h2", {}, "Comparison")),
      result
        ? el("div", { class: "scroll-x", tabindex: 0, role: "region", "aria-label": "Comparison table" }, table(result, algorithms ?? [], view))
        : el("p", { class: "quiet" }, WAITING[job.state] ?? "Reading the result…"),
      ...notes(result, algorithms ?? []),
    );
    choose(store.state);
  };
  const choose = ({ vehicle }) => {
    for (const row of room.querySelectorAll("tr[data-subject]")) row.classList.toggle("chosen", row.dataset.subject === vehicle);
  };
  store.watch(["job", "result", "algorithms", "view", "hidden"], draw);
  store.watch(["vehicle"], choose);
  darkScheme.addEventListener("change", () => draw(store.state));
}

const WAITING = {
  queued: "The figures come when all trials are done.",
  running: "The figures come when all trials are done.",
  failed: "The run failed before there were figures.",
  cancelled: "The run was cancelled before there were figures.",
};

function table(result, algorithms, view) {
  const order = (view?.subjects ?? []).map((s) => s.name);
  const head = ([name, unit, what]) =>
    el("th", { scope: "col", title: what }, name, el("span", { class: "unit" }, name === "ANEES" ? interval(result) : unit));
  return el(
    "table",
    {},
    el("caption", { class: "unseen" }, "Every estimator and vehicle of this run"),
    el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Estimator"), el("th", { scope: "col" }, "Vehicle"), SUBJECT.map(head), WHOLE.map(head))),
    Object.entries(result.algorithms)
      .filter(([name]) => !store.state.hidden.algorithms.has(name))
      .map(([name, answer]) => body(name, answer, algorithms, order, result)),
  );
}

function body(name, answer, algorithms, order, result) {
  const known = algorithms.find((a) => a.name === name);
  const subjects = Object.entries(answer.subjects).filter(([subject]) => !store.state.hidden.vehicles.has(subject)).sort((a, b) => order.indexOf(a[0]) - order.indexOf(b[0]));
  const span = { rowspan: Math.max(1, subjects.length) };
  return el(
    "tbody",
    { "data-algorithm": name },
    subjects.map(([subject, metrics], n) =>
      el(
        "tr",
        { "data-subject": subject, onclick: () => store.set({ vehicle: subject }) },
        n ? null : el("th", { scope: "rowgroup", class: "who", ...span }, lineSample(name, algorithms), known?.title ?? name, known?.centralized ? el("span", { class: "tag" }, "benchmark") : null),
        el("th", { scope: "row" }, dot(vehicleColour(Math.max(0, order.indexOf(subject)))), subject),
        SUBJECT.map(([head, , , cell]) => el("td", { class: isBest(head, metrics, subject, result, algorithms) ? "best" : null }, cell(metrics))),
        n ? null : WHOLE.map(([, , , cell]) => el("td", span, cell(answer))),
      ),
    ),
  );
}

/** Whether an estimator has the smallest RMSE of a subject among those that could fly. */
function isBest(head, metrics, subject, result, algorithms) {
  if (head !== "RMSE" || metrics.rmse_m === null) return false;
  const contenders = Object.entries(result.algorithms).filter(([name]) => !algorithms.find((a) => a.name === name)?.centralized);
  const errors = contenders.map(([, a]) => a.subjects[subject]?.rmse_m).filter((v) => v !== null && v !== undefined);
  return errors.length > 1 && contenders.some(([, a]) => a.subjects[subject] === metrics) && metrics.rmse_m === Math.min(...errors);
}

/** What the estimators themselves remark: assumptions not met, ranges refused. */
function notes(result, algorithms) {
  const remarks = Object.entries(result?.algorithms ?? {}).flatMap(([name, { notes }]) =>
    notes.map((text) => el("li", {}, el("b", {}, algorithms.find((a) => a.name === name)?.title ?? name), ` ${text}`)),
  );
  return remarks.length ? [el("ul", { class: "remarks", "aria-label": "Remarks of the estimators" }, remarks)] : [];
}
