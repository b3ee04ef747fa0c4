// Two runs or more against each other: their curves in one plot, their figures and scenarios in tables.

import { el, svg } from "../look/dom.js";
import { NONE, number, percent, plural } from "../look/format.js";
import { darkScheme, lineStyle, vehicleColour } from "../look/palette.js";
import { save as saveFile } from "../look/save.js";
import { dot } from "../look/swatch.js";
import { persist } from "../state/connection.js";
import { roomLink, runLink } from "../state/link.js";
import { store } from "../state/store.js";
import * as api from "../wire/api.js";
import { FIGURES, csv, rowsOf, scenarioDifferences } from "./differences.js";
import { CURVES, drawOverlay, traces } from "./overlay.js";

/** Differences smaller than this share are not marked as better or worse. */
const MARKED = 0.01;

/** The comparison of the runs in `store.state.compared`, read anew when they change. */
export function buildComparison() {
  const heads = el("ol", { class: "compared" });
  const subject = el("select", { id: "compared-subject", "aria-label": "Vehicle of the curves" });
  const figure = el("select", { id: "compared-figure", "aria-label": "Figure to compare" }, FIGURES.map(({ key, label, unit }) => el("option", { value: key }, `${label} (${unit})`)));
  const logarithmic = el("input", { type: "checkbox" });
  const names = el("div", { class: "names", role: "group", "aria-label": "Estimators in the plots" });
  const drawings = Object.keys(CURVES).map((quantity) => ({ quantity, node: el("div", { class: "drawing" }) }));
  const figures = el("div", { class: "scroll-x", tabindex: 0, role: "region", "aria-label": "Differences in figures" });
  const scenario = el("div", { class: "scroll-x", tabindex: 0, role: "region", "aria-label": "Differences in scenarios" });
  const status = el("p", { class: "quiet", role: "status" });
  const save = el("button", { type: "button", class: "small" }, "CSV");
  const shown = el(
    "div",
    { class: "shown" },
    el(
      "section",
      { class: "card", "aria-label": "Curves" },
      el(
        "div",
        { class: "room-tools" },
        el("h2", {}, "Curves"),
        el("label", {}, "of ", subject),
        names,
        el("label", { class: "toggle" }, logarithmic, "Logarithmic"),
      ),
      el(
        "div",
        { class: "overlays" },
        drawings.map(({ quantity, node }) => el("figure", { class: "overlay", "data-quantity": quantity, "aria-label": `${CURVES[quantity].title} of all runs` }, el("figcaption", {}, CURVES[quantity].title), node)),
      ),
    ),
    el("section", { class: "card", "aria-label": "Figures" }, el("div", { class: "room-tools" }, el("h2", {}, "Differences"), el("label", {}, "in ", figure), el("span", { class: "spring" }), save), figures),
    el("section", { class: "card", "aria-label": "Scenarios" }, el("h2", {}, "What differs in the scenarios"), scenario),
  );
  const root = el("div", { class: "comparison" }, el("div", { class: "room-tools" }, el("a", { class: "back", href: roomLink("runs") }, "← All runs"), el("h1", {}, "Comparison")), heads, status, shown);

  let runs = [];
  let left = new Set();
  let reading = new AbortController();

  async function read(ids) {
    reading.abort();
    const { signal } = (reading = new AbortController());
    runs = [];
    shown.hidden = true;
    heads.replaceChildren();
    status.hidden = false;
    status.textContent = "Reading the runs…";
    const answers = await Promise.all(ids.map((id) => readRun(id, signal)));
    if (signal.aborted) return;
    const failed = answers.filter((a) => a.reason);
    runs = answers.filter((a) => !a.reason);
    left = new Set();
    status.hidden = !failed.length;
    status.textContent = failed.map((a) => a.reason).join(" ");
    label();
    draw();
  }

  /** Runs are named by what tells them apart. */
  function label() {
    const same = new Set(runs.map((r) => r.job.title)).size < runs.length;
    for (const [n, run] of runs.entries()) run.label = `${String.fromCharCode(65 + n)}${same ? "" : ` ${run.job.title}`}`;
  }

  function baseline() {
    const pinned = runs.findIndex(({ job }) => store.state.jobs?.find((j) => j.id === job.id)?.pinned);
    return Math.max(0, pinned);
  }

  function draw() {
    shown.hidden = runs.length < 2;
    heads.replaceChildren(...runs.map(head));
    if (runs.length < 2) return;
    const subjects = [...new Set(runs.flatMap(({ result }) => Object.values(result.algorithms).flatMap((a) => Object.keys(a.subjects))))];
    const before = subject.value || store.state.vehicle;
    subject.replaceChildren(...subjects.map((s) => el("option", { value: s }, s)));
    subject.value = subjects.includes(before) ? before : subjects[0];
    const known = [...new Set(runs.flatMap(({ job }) => job.algorithms))];
    names.replaceChildren(
      ...known.map((name) => {
        const box = el("input", {
          type: "checkbox",
          checked: !left.has(name),
          onchange: () => {
            if (box.checked) left.delete(name);
            else left.add(name);
            plot();
          },
        });
        return el("label", { class: "toggle" }, box, dashSample(name), titleOf(name));
      }),
    );
    plot();
    tables();
  }

  function head({ job, label }, n) {
    return el(
      "li",
      { "data-run": job.id },
      dot(vehicleColour(n)),
      el("b", {}, label.charAt(0)),
      el("a", { href: runLink(job.id) }, job.title),
      el("span", { class: "quiet-inline" }, `${plural(job.trials, "trial")}, seed ${job.seed}`),
      n === baseline() ? el("span", { class: "tag" }, "baseline") : null,
      el("button", { type: "button", class: "small", "aria-label": `Take ${label} out of the comparison`, onclick: () => store.set({ compared: store.state.compared.filter((id) => id !== job.id) }) }, "×"),
    );
  }

  async function plot() {
    const drawn = runs.map(({ label, view, job }) => ({ label, view, names: job.algorithms.filter((a) => !left.has(a)) }));
    try {
      for (const { quantity, node } of drawings) {
        const data = traces(quantity, subject.value, drawn, store.state.algorithms ?? []);
        node.closest("figure").hidden = !data.length;
        if (data.length) await drawOverlay(node, quantity, data, logarithmic.checked);
      }
    } catch (error) {
      status.hidden = false;
      status.textContent = error.message;
    }
  }

  function tables() {
    const wanted = FIGURES.find(({ key }) => key === figure.value);
    const rows = rowsOf(wanted, runs.map((r) => r.result), baseline());
    figures.replaceChildren(figureTable(wanted, rows));
    const differing = scenarioDifferences(runs.map((r) => r.result.scenario));
    scenario.replaceChildren(differing.length ? scenarioTable(differing) : el("p", { class: "quiet" }, "Nothing: the same scenario, run again."));
  }

  const columns = () =>
    runs.map(({ job, label }, n) => el("th", { scope: "col", title: job.title }, dot(vehicleColour(n)), label.charAt(0), n === baseline() ? el("span", { class: "unit" }, "baseline") : el("span", { class: "unit" }, "")));

  function figureTable({ label, unit, less }, rows) {
    const last = {};
    return el(
      "table",
      { class: "differences" },
      el("caption", { class: "unseen" }, `${label} (${unit}) of every estimator and vehicle in each run, and its difference from the baseline's`),
      el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Estimator"), el("th", { scope: "col" }, "Vehicle"), columns())),
      el(
        "tbody",
        {},
        rows.map(({ algorithm, subject, cells }) => {
          const first = last.algorithm !== algorithm;
          last.algorithm = algorithm;
          return el(
            "tr",
            { "data-algorithm": algorithm, "data-subject": subject },
            el("th", { scope: "row" }, first ? [dashSample(algorithm), titleOf(algorithm)] : el("span", { class: "unseen" }, titleOf(algorithm))),
            el("th", { scope: "row" }, subject),
            cells.map((cell) => el("td", {}, number(cell.value), changeMark(cell, less))),
          );
        }),
      ),
    );
  }

  function scenarioTable(differing) {
    const told = (value) => (value === undefined ? NONE : typeof value === "object" ? JSON.stringify(value) : String(value));
    return el(
      "table",
      { class: "differences" },
      el("caption", { class: "unseen" }, "Keys whose values differ between the scenarios"),
      el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Key"), columns())),
      el("tbody", {}, differing.map(({ key, values }) => el("tr", {}, el("th", { scope: "row" }, el("code", {}, key)), values.map((v) => el("td", {}, told(v)))))),
    );
  }

  save.addEventListener("click", () => {
    const wanted = FIGURES.find(({ key }) => key === figure.value);
    const lines = rowsOf(wanted, runs.map((r) => r.result), baseline()).map(({ algorithm, subject, cells }) => [algorithm, subject, ...cells.map((c) => c.value)]);
    saveFile(csv([["algorithm", "subject", ...runs.map(({ job }) => `${wanted.key} ${job.id}`)], ...lines]), `comparison-${wanted.key}.csv`, "text/csv");
  });
  subject.addEventListener("change", plot);
  logarithmic.addEventListener("change", plot);
  figure.addEventListener("change", tables);
  darkScheme.addEventListener("change", () => runs.length > 1 && draw());

  let asked = "";
  store.watch(["compared", "room", "algorithms"], ({ compared, room }) => {
    const now = compared.join();
    if (room !== "runs" || now === asked) return;
    asked = now;
    if (compared.length > 1) read(compared);
  });
  store.watch(["jobs"], () => runs.length > 1 && heads.isConnected && tables());
  return { root };
}

async function readRun(id, signal) {
  try {
    const job = await persist(() => api.findJob(id, signal), signal);
    if (job.state !== "done") return { reason: `“${job.title}” is ${job.state}: it has no figures to compare.` };
    const [view, result] = await Promise.all([persist(() => api.view(id, signal), signal), persist(() => api.result(id, signal), signal)]);
    return { job, view, result };
  } catch (error) {
    if (error.name === "AbortError") return { reason: "" };
    if (!(error instanceof api.Problem)) throw error;
    return { reason: error.status === 404 ? "One of the runs does not exist any more." : error.detail };
  }
}

function titleOf(name) {
  return store.state.algorithms?.find((a) => a.name === name)?.title ?? name;
}

/** The dash of an estimator alone: here colours tell the runs apart. */
function dashSample(name) {
  const { dash } = lineStyle(name, store.state.algorithms ?? []);
  const line = svg("line", { x1: 1, y1: 4, x2: 25, y2: 4, stroke: "currentColor", "stroke-width": 2, "stroke-dasharray": dash || null });
  return svg("svg", { class: "line-sample", viewBox: "0 0 26 8", width: 26, height: 8, "aria-hidden": "true" }, line);
}

/** A relative change in words and colour: less or more, better or worse, or no more than chance. */
function changeMark({ change, chance }, less) {
  if (change === null) return null;
  const size = Math.abs(change);
  const tone = less === null || size < Math.max(MARKED, chance) ? "calm" : change < 0 === less ? "good" : "bad";
  const words = { good: "better", bad: "worse", calm: size < chance ? "not significant" : "" }[tone];
  const why = chance ? `${words}: unpaired trials differ by up to ${percent(chance + 0.005)} by chance (95 %)` : words;
  return el("span", { class: `change ${tone}`, title: why }, `${change < 0 ? "−" : "+"}${percent(size + 0.005)}`, words ? el("span", { class: "unseen" }, ` ${words}`) : null);
}
