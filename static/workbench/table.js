// The comparison in figures: per estimator and vehicle, against a baseline of the person's choice.

import { copy } from "../look/copy.js";
import { el, part } from "../look/dom.js";
import { NONE, count, number } from "../look/format.js";
import { darkScheme, vehicleColour } from "../look/palette.js";
import { dot, lineSample, verdictChip } from "../look/swatch.js";
import { keepInLink, noteLink } from "../state/link.js";
import { store } from "../state/store.js";
import { asCsv, asLatex } from "./texts.js";
import { FIGURES, MARKS, sentence, told, versus, winners } from "./versus.js";

/** Columns of one subject: [head, unit, what it is, cell, the figure it shows]. */
const SUBJECT = [
  ["RMSE", "m", "Root mean square position error, over trials and time", (m) => number(m.rmse_m), "rmse_m"],
  ["Final", "m", "RMS error at the end, over trials", (m) => number(m.final_rmse_m), "final_rmse_m"],
  ["σ", "m", "Fourth root of the xy covariance's determinant, mean over trials and time", (m) => number(m.sigma_m), "sigma_m"],
  ["Final σ", "m", "The same at the end", (m) => number(m.final_sigma_m), "final_sigma_m"],
  ["ANEES", "", "Normalized error squared, averaged: 2 is right; below, where it is at 95 % of the times if it is", (m) => number(m.anees)],
  ["Verdict", "", "Whether its confidence can be believed", (m, id) => named(verdictChip(m), `verdict-${id}`)],
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

const WAITING = {
  queued: "The figures come when all trials are done.",
  running: "The figures come when all trials are done.",
  failed: "The run failed before there were figures.",
  cancelled: "The run was cancelled before there were figures.",
};

/** More remarks than this are folded away. */
const MOST_OPEN = 4;

/** What a person has chosen to compare with, and in which figure; null is the usual. */
const chosen = { baseline: null, figure: null };

export function mountTable() {
  const room = part("table");
  const draw = () => {
    const { job, result, algorithms } = store.state;
    room.hidden = job === null;
    if (!job) return;
    const focused = room.contains(document.activeElement) ? document.activeElement.id : "";
    const comparison = result ? compared(store.state) : null;
    room.replaceChildren(
      el("div", { class: "heading" }, el("h2", {}, "Comparison"), ...(comparison ? tools(comparison, change) : [])),
      comparison
        ? el("div", { class: "scroll-x", tabindex: 0, role: "region", "aria-label": "Comparison table" }, table(comparison))
        : el("p", { class: "quiet" }, WAITING[job.state] ?? "Reading the result…"),
      ...notes(result, algorithms ?? [], room.querySelector(".remarks")?.open),
    );
    if (focused) document.getElementById(focused)?.focus({ preventScroll: true });
    choose(store.state);
  };
  const change = (values) => {
    Object.assign(chosen, values);
    noteLink();
    draw();
  };
  const choose = ({ vehicle }) => {
    for (const row of room.querySelectorAll("tr[data-subject]")) row.classList.toggle("chosen", row.dataset.subject === vehicle);
  };
  store.watch(["job", "result", "algorithms", "view", "hidden"], draw);
  store.watch(["vehicle"], choose);
  darkScheme.addEventListener("change", draw);
  keepInLink("base", { write: () => chosen.baseline, read: (text) => change({ baseline: text }) });
  keepInLink("figure", { write: () => chosen.figure, read: (text) => change({ figure: Object.hasOwn(FIGURES, text) ? text : null }) });
}

/** What the table is about: the shown rows, the baseline, the figure, who is best. */
function compared(state) {
  const { result, view, hidden } = state;
  const algorithms = state.algorithms ?? [];
  const title = (name) => algorithms.find((a) => a.name === name)?.title ?? name;
  const all = Object.keys(result.algorithms);
  const fliers = all.filter((name) => !algorithms.find((a) => a.name === name)?.centralized);
  const baseline = all.includes(chosen.baseline) ? chosen.baseline : (fliers[0] ?? all[0]);
  const figure = chosen.figure ?? "rmse_m";
  const order = (view?.subjects ?? []).map((s) => s.name);
  const place = (subject) => order.indexOf(subject);
  const best = new Map();
  const winnersOf = (subject) => {
    if (!best.has(subject)) best.set(subject, winners(result, view, figure, subject, fliers.filter((name) => !hidden.algorithms.has(name))));
    return best.get(subject);
  };
  const rows = all
    .filter((name) => !hidden.algorithms.has(name))
    .flatMap((name) =>
      Object.entries(result.algorithms[name].subjects)
        .filter(([subject]) => !hidden.vehicles.has(subject))
        .sort((a, b) => place(a[0]) - place(b[0]))
        .map(([subject, metrics]) => ({
          name,
          subject,
          metrics,
          estimator: title(name),
          vehicle: subject,
          packets: result.algorithms[name].packets,
          difference: name === baseline ? null : versus(view, figure, subject, name, baseline),
          best: winnersOf(subject).best === name,
          level: winnersOf(subject).level.has(name) ? winnersOf(subject).best : null,
        })),
    );
  return { rows, all, algorithms, result, title, baseline, figure, place, trials: result.trials };
}

function tools({ rows, all, title, baseline, figure }, change) {
  const against = { name: baseline, title: title(baseline), figure, label: FIGURES[figure].label };
  const whom = el(
    "select",
    { id: "baseline", "aria-label": "Baseline", onchange: () => change({ baseline: whom.value }) },
    all.map((name) => el("option", { value: name, selected: name === baseline }, title(name))),
  );
  const what = el(
    "select",
    { id: "figure", "aria-label": "Figure compared", onchange: () => change({ figure: what.value === "rmse_m" ? null : what.value }) },
    Object.entries(FIGURES).map(([key, { label }]) => el("option", { value: key, selected: key === figure }, label)),
  );
  const button = (label, text) =>
    el("button", { type: "button", class: "small", "aria-label": `Copy as ${label}`, onclick: (event) => copied(event.currentTarget, label, text()) }, label);
  return [
    el("span", { class: "against" }, "Δ in ", what, " to ", whom),
    el("span", { class: "copies", role: "status" }, "Copy ", button("CSV", () => asCsv(rows, against)), button("LaTeX", () => asLatex(rows, against))),
  ];
}

async function copied(button, label, text) {
  button.textContent = (await copy(text)) ? "copied ✓" : "not possible";
  setTimeout(() => (button.textContent = label), 2000);
}

/** The interval of the ANEES, which depends on the number of trials alone. */
function interval(result) {
  const metrics = Object.values(result.algorithms).flatMap((a) => Object.values(a.subjects));
  const [low, high] = metrics.find((m) => m.anees_interval)?.anees_interval ?? [];
  return low === undefined ? "" : `${number(low)} … ${number(high)}`;
}

function table(comparison) {
  const { rows, result, title, baseline, figure } = comparison;
  const head = ([name, unit, what]) =>
    el("th", { scope: "col", "data-hint": what }, name, el("span", { class: "unit" }, name === "ANEES" ? interval(result) : unit));
  const apart = [`Δ ${FIGURES[figure].label}`, "m", `Difference to ${title(baseline)}, trial by trial: mean and half its 95 % interval (Student's t); n.s.: not significant`];
  const names = [...new Set(rows.map((row) => row.name))];
  return el(
    "table",
    {},
    el("caption", { class: "unseen" }, "Every estimator and vehicle of this run"),
    el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Estimator"), el("th", { scope: "col" }, "Vehicle"), SUBJECT.slice(0, 1).map(head), head(apart), SUBJECT.slice(1).map(head), WHOLE.map(head))),
    names.map((name) => body(rows.filter((row) => row.name === name), comparison)),
  );
}

function body(rows, comparison) {
  const { algorithms, result, baseline, place, figure } = comparison;
  const { name, estimator } = rows[0];
  const known = algorithms.find((a) => a.name === name);
  const span = { rowspan: rows.length };
  const tags = [known?.centralized ? "benchmark" : null, name === baseline ? "baseline" : null].filter(Boolean);
  const cell = (row) => ([, , , write, key]) => {
    if (key !== figure || !(row.best || row.level)) return el("td", {}, write(row.metrics, `${name}-${row.subject}`));
    const hint = row.best ? `The least ${FIGURES[figure].label} of the estimators shown that could fly` : `Not significantly more than ${comparison.title(row.level)}'s, the least`;
    return el("td", { class: row.best ? "best" : "level", "data-hint": hint }, el("span", { class: "rank" }, row.best ? "★ " : "≈ "), write(row.metrics));
  };
  return el(
    "tbody",
    { "data-algorithm": name },
    rows.map((row, n) =>
      el(
        "tr",
        { "data-subject": row.subject, onclick: () => store.set({ vehicle: row.subject }) },
        n ? null : el("th", { scope: "rowgroup", class: "who", ...span }, lineSample(name, algorithms), estimator, tags.map((tag) => el("span", { class: "tag" }, tag))),
        el("th", { scope: "row" }, dot(vehicleColour(Math.max(0, place(row.subject)))), row.subject),
        SUBJECT.slice(0, 1).map(cell(row)),
        difference(row, comparison),
        SUBJECT.slice(1).map(cell(row)),
        n ? null : WHOLE.map(([, , , write]) => el("td", span, write(result.algorithms[name]))),
      ),
    ),
  );
}

/** What has an id keeps the focus when the table is drawn anew. */
function named(node, id) {
  node.id = id;
  return node;
}

function difference({ difference: found }, { figure, title, baseline, trials }) {
  if (!found) return el("td", { class: "versus" }, NONE);
  const hint = sentence(found, figure, title(baseline), trials);
  return el("td", { class: `versus ${found.kind}`, "data-kind": found.kind, "data-hint": hint }, told(found), el("span", { class: "kind" }, MARKS[found.kind]));
}

/** What the estimators themselves remark: assumptions not met, ranges refused. */
function notes(result, algorithms, open) {
  const remarks = Object.entries(result?.algorithms ?? {}).flatMap(([name, { notes }]) =>
    notes.map((text) => el("li", {}, el("b", {}, algorithms.find((a) => a.name === name)?.title ?? name), ` ${text}`)),
  );
  if (!remarks.length) return [];
  const list = el("ul", { "aria-label": "Remarks of the estimators" }, remarks);
  const words = `${remarks.length} ${remarks.length === 1 ? "remark" : "remarks"} of the estimators`;
  return [el("details", { class: "remarks", open: open ?? remarks.length <= MOST_OPEN }, el("summary", {}, words), list)];
}
