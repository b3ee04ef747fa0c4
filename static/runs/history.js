// All runs in a table: to sort, filter, tag, pin, compare, run again and delete.

import { el } from "../look/dom.js";
import { NONE, ago, count, metres, percent, plural } from "../look/format.js";
import { lineSample } from "../look/swatch.js";
import { present, removeRuns, runAgain } from "../state/jobs.js";
import { runLink } from "../state/link.js";
import { store } from "../state/store.js";
import { reportPath } from "../wire/api.js";
import { KEYS, changesOf, errorOf, matching, sorted, tagsOf } from "./order.js";
import { pinButton, tagEditor } from "./tags.js";

const HEADS = [
  ["title", "Run"],
  ["algorithms", "Estimators"],
  ["trials", "Trials"],
  ["seed", "Seed"],
  ["error", "RMSE"],
  ["state", "State"],
  ["created_at", "Started"],
];
const STATES = ["queued", "running", "done", "failed", "cancelled"];
export const MOST_COMPARED = 8;

/** The table with its tools; `draw()` brings it up to date. */
export function buildHistory() {
  const chosen = new Set();
  let order = { key: "created_at", down: true };

  const search = el("input", { type: "search", id: "find-run", placeholder: "Search runs", "aria-label": "Search runs", autocomplete: "off" });
  const state = el("select", { "aria-label": "State" }, el("option", { value: "" }, "Any state"), STATES.map((s) => el("option", { value: s }, s)));
  const tag = el("select", { "aria-label": "Tag" });
  const whatIfs = el("input", { type: "checkbox", checked: true });
  const whatIfLabel = el("label", { class: "toggle" }, whatIfs, "what-ifs too");
  const whose = el("select", { "aria-label": "Estimator of the errors", title: "Whose RMS error, over all that is located, the table tells" });
  const found = el("span", { class: "quiet-inline", role: "status" });
  const compare = el("button", { type: "button", class: "primary", id: "compare" });
  const remove = el("button", { type: "button", id: "delete-runs" }, "Delete");
  const known = el("datalist", { id: "known-tags" });
  const body = el("tbody");
  const heads = new Map();
  const none = el("p", { class: "quiet" });
  const all = el("input", { type: "checkbox", "aria-label": "Choose all runs shown" });

  const table = el(
    "table",
    { class: "history" },
    el("caption", { class: "unseen" }, "All runs"),
    el(
      "thead",
      {},
      el(
        "tr",
        {},
        el("th", { scope: "col" }, all),
        el("th", { scope: "col" }, el("span", { class: "unseen" }, "Pinned")),
        HEADS.map(([key, label]) => {
          const head = el("th", { scope: "col" }, el("button", { type: "button", class: "sort", onclick: () => sortBy(key) }, label));
          heads.set(key, head);
          return head;
        }),
        el("th", { scope: "col" }, el("span", { class: "unseen" }, "Actions")),
      ),
    ),
    body,
  );
  const root = el(
    "div",
    { class: "all-runs" },
    el("div", { class: "room-tools" }, el("h1", {}, "Runs"), search, state, tag, whose, whatIfLabel, found, el("span", { class: "spring" }), remove, compare),
    known,
    el("div", { class: "scroll-x", tabindex: 0, role: "region", "aria-label": "Table of all runs" }, table),
    none,
  );

  function sortBy(key) {
    order = { key, down: order.key === key ? !order.down : KEYS[key].down };
    draw();
  }

  function shown() {
    const wanted = { text: search.value, state: state.value || null, tag: tag.value || null, whatIfs: whatIfs.checked };
    return sorted(matching(present(store.state) ?? [], wanted), order, whose.value);
  }

  function draw() {
    const jobs = present(store.state);
    for (const [key, head] of heads) {
      if (key === order.key) head.setAttribute("aria-sort", order.down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
    if (jobs === null) {
      none.textContent = "Reading the runs…";
      return;
    }
    const tags = tagsOf(jobs);
    const wanted = tags.includes(tag.value) ? tag.value : "";
    tag.replaceChildren(el("option", { value: "" }, "Any tag"), ...tags.map((t) => el("option", { value: t }, t)));
    tag.value = wanted;
    tag.hidden = !tags.length;
    offer(jobs);
    known.replaceChildren(...tags.map((t) => el("option", { value: t })));
    whatIfLabel.hidden = !jobs.some((job) => job.purpose === "what-if");
    for (const id of chosen) if (!jobs.some((job) => job.id === id)) chosen.delete(id);
    const rows = shown();
    // A field that is being typed in stays in the document.
    const typing = body.contains(document.activeElement) && document.activeElement.type === "text" && document.activeElement.value !== "";
    if (!typing) refill(rows);
    found.textContent = rows.length === jobs.length ? plural(jobs.length, "run") : `${count(rows.length)} of ${plural(jobs.length, "run")}`;
    none.hidden = rows.length > 0;
    none.textContent = jobs.length ? "No run matches." : "No runs yet. Pick a mission in the workbench and press Run; every run is kept here.";
    table.hidden = !rows.length;
    tell();
  }

  /** The estimators that there are errors of. */
  function offer(jobs) {
    const names = new Set(jobs.flatMap((job) => Object.keys(job.rmse_m ?? {})));
    const known = (store.state.algorithms ?? []).filter((a) => names.has(a.name));
    const before = names.has(whose.value) ? whose.value : "";
    whose.replaceChildren(el("option", { value: "" }, "Least error"), ...known.map((a) => el("option", { value: a.name }, `Error of ${a.title}`)));
    whose.value = before;
    whose.hidden = !known.length;
  }

  function refill(rows) {
    const { activeElement } = document;
    const label = body.contains(activeElement) ? activeElement.getAttribute("aria-label") : null;
    const row = activeElement?.closest?.("tr")?.dataset.run;
    body.replaceChildren(...rows.map(entry));
    if (label !== null) body.querySelector(`tr[data-run="${row}"] [aria-label="${CSS.escape(label)}"]`)?.focus();
  }

  function tell() {
    const n = chosen.size;
    compare.disabled = n < 2 || n > MOST_COMPARED;
    compare.textContent = n < 2 ? "Compare" : `Compare ${n} runs`;
    compare.title = n > MOST_COMPARED ? `At most ${MOST_COMPARED} runs` : n < 2 ? "Choose two runs or more" : "";
    remove.hidden = n === 0;
    remove.textContent = n > 1 ? `Delete ${n}` : "Delete";
    const rows = shown();
    all.checked = rows.length > 0 && rows.every((job) => chosen.has(job.id));
    all.indeterminate = n > 0 && !all.checked;
  }

  function entry(job) {
    const { algorithms = [], run } = store.state;
    const tick = el("input", {
      type: "checkbox",
      checked: chosen.has(job.id),
      "aria-label": `Choose ${job.title}, ${ago(job.created_at)}`,
      onchange: () => {
        if (tick.checked) chosen.add(job.id);
        else chosen.delete(job.id);
        tell();
      },
    });
    const changes = changesOf(job);
    const names = job.algorithms.map((name) => algorithms?.find((a) => a.name === name)?.title ?? name);
    return el(
      "tr",
      { "data-run": job.id, class: job.id === run ? "chosen" : null },
      el("td", {}, tick),
      el("td", {}, pinButton(job)),
      el(
        "th",
        { scope: "row" },
        el(
          "div",
          { class: "who" },
          el("a", { class: "open", href: runLink(job.id) }, job.title),
          changes.length ? el("span", { class: "changes", title: "What it changes in its mission" }, changes.join(", ")) : null,
          tagEditor(job),
        ),
      ),
      el(
        "td",
        { class: "estimators", title: names.join(", ") },
        job.algorithms.map((name) => lineSample(name, algorithms ?? [])),
        el("span", { class: "unseen" }, names.join(", ")),
      ),
      el("td", { class: "figure" }, count(job.trials)),
      el("td", { class: "figure" }, String(job.seed)),
      errorCell(job),
      el("td", {}, el("span", { class: "state", "data-state": job.state }, job.state === "running" ? percent(job.progress ?? 0) : job.state)),
      el("td", { title: new Date(job.created_at).toLocaleString() }, ago(job.created_at)),
      el(
        "td",
        { class: "acts" },
        el("button", { type: "button", class: "small again", "aria-label": `Run ${job.title} again`, onclick: () => runAgain(job) }, "Run again"),
        job.state === "done" ? el("a", { class: "button small", href: reportPath(job.id), target: "_blank", "aria-label": `Report of ${job.title}` }, "Report") : null,
        el("button", { type: "button", class: "small remove", "aria-label": `Delete ${job.title}`, title: "Delete", onclick: () => removeRuns([job]) }, "×"),
      ),
    );
  }

  function errorCell(job) {
    const least = errorOf(job, whose.value);
    if (least === null) return el("td", { class: "figure" }, NONE);
    const title = store.state.algorithms?.find((a) => a.name === least.algorithm)?.title ?? least.algorithm;
    return el("td", { class: "figure error", title: `${title}, RMS over all it locates` }, whose.value ? null : lineSample(least.algorithm, store.state.algorithms ?? []), metres(least.error_m));
  }

  search.addEventListener("input", draw);
  for (const tool of [state, tag, whose, whatIfs]) tool.addEventListener("change", draw);
  all.addEventListener("change", () => {
    for (const job of shown()) {
      if (all.checked) chosen.add(job.id);
      else chosen.delete(job.id);
    }
    draw();
  });
  compare.addEventListener("click", () => {
    const ordered = shown().filter((job) => chosen.has(job.id));
    store.set({ compared: ordered.map((job) => job.id) });
  });
  remove.addEventListener("click", () => {
    removeRuns((present(store.state) ?? []).filter((job) => chosen.has(job.id)));
    chosen.clear();
  });
  return { root, draw };
}
