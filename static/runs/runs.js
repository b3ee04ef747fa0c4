// Earlier runs: the latest beside the workbench, all of them, and their comparison, in a room of their own.

import { el, part } from "../look/dom.js";
import { ago, percent, plural } from "../look/format.js";
import { present, readRuns, removeRuns } from "../state/jobs.js";
import { roomLink } from "../state/link.js";
import { atWork, openRun } from "../state/run.js";
import { store } from "../state/store.js";
import { buildComparison } from "./compare.js";
import { buildHistory } from "./history.js";

/** While runs are at work their list is read again this often. */
const AGAIN_MS = 2000;

export function mountRuns() {
  mountLatest();
  mountRoom();
  let known = null;
  store.watch(["job", "room"], ({ job, room }) => {
    const now = `${job?.id} ${job?.state} ${room}`;
    if (now !== known) readRuns();
    known = now;
  });
  document.addEventListener("visibilitychange", () => document.hidden || readRuns());
  let timer = 0;
  store.watch(["jobs", "room"], ({ jobs, room }) => {
    if (room === "workbench" || document.hidden || !jobs?.some(atWork)) return;
    timer ||= setTimeout(() => {
      timer = 0;
      readRuns();
    }, AGAIN_MS);
  });
}

function mountRoom() {
  const history = buildHistory();
  const comparison = buildComparison();
  part("runs-room").append(history.root, comparison.root);
  store.watch(["room", "jobs", "leaving", "run", "algorithms", "compared"], ({ room, compared }) => {
    history.root.hidden = compared.length > 1;
    comparison.root.hidden = compared.length < 2;
    if (room === "runs" && compared.length < 2) history.draw();
  });
}

/** The list beside the workbench. */
function mountLatest() {
  const panel = part("panel-runs");
  const counter = part("runs-count");
  store.watch(["jobs", "leaving", "run"], (state) => {
    const jobs = present(state);
    counter.textContent = jobs?.length ? String(jobs.length) : "";
    if (jobs === null) panel.replaceChildren(el("div", { class: "ghost mission" }), el("div", { class: "ghost mission" }));
    else if (!jobs.length) panel.replaceChildren(el("p", { class: "quiet" }, "No runs yet. They are kept here when they have run."));
    else {
      const all = el("a", { class: "all", href: roomLink("runs") }, "Search, tag and compare all runs");
      panel.replaceChildren(all, el("ul", { class: "runs" }, jobs.map((job) => entry(job, job.id === state.run))));
    }
  });
}

function entry(job, current) {
  const state = job.state === "running" ? percent(job.progress ?? 0) : job.state === "done" ? "" : job.state;
  return el(
    "li",
    { class: current ? "current" : null, "data-run": job.id },
    el(
      "button",
      { type: "button", class: "open", "aria-current": current ? "true" : null, onclick: () => openRun(job.id, {}) },
      el("span", { class: "title" }, job.pinned ? "★ " : null, job.title),
      el(
        "span",
        { class: "about" },
        state ? el("span", { class: "state", "data-state": job.state }, state) : null,
        `${plural(job.algorithms.length, "estimator")} · ${plural(job.trials, "trial")} · ${ago(job.created_at)}`,
        job.tags.map((tag) => el("span", { class: "tag" }, tag)),
      ),
    ),
    el("button", { type: "button", class: "small remove", "aria-label": `Delete the run ${job.title}`, title: "Delete", onclick: () => removeRuns([job]) }, "×"),
  );
}
