// Earlier runs: to open again, or to delete.

import { el, part } from "../look/dom.js";
import { ago, percent, plural } from "../look/format.js";
import * as api from "../wire/api.js";
import { persist } from "../state/connection.js";
import { atWork, closeRun, openRun } from "../state/run.js";
import { store } from "../state/store.js";

/** A delete button asks once more, for this long. */
const SURE_MS = 4000;

/** Reads the list again. */
export async function readRuns() {
  store.set({ jobs: await persist(api.jobs) });
}

export function mountRuns() {
  const panel = part("panel-runs");
  const counter = part("runs-count");
  store.watch(["jobs", "run"], ({ jobs, run }) => {
    counter.textContent = jobs?.length ? String(jobs.length) : "";
    if (jobs === null) panel.replaceChildren(el("div", { class: "ghost mission" }), el("div", { class: "ghost mission" }));
    else if (!jobs.length) panel.replaceChildren(el("p", { class: "quiet" }, "No runs yet. They are kept here when they have run."));
    else panel.replaceChildren(el("ul", { class: "runs" }, jobs.map((job) => entry(job, job.id === run))));
  });
  let known = null;
  store.watch(["job"], ({ job }) => {
    const now = job ? `${job.id} ${job.state}` : "";
    if (now !== known) readRuns();
    known = now;
  });
  document.addEventListener("visibilitychange", () => document.hidden || readRuns());
}

function entry(job, current) {
  const state = job.state === "running" ? percent(job.progress ?? 0) : job.state === "done" ? "" : job.state;
  return el(
    "li",
    { class: current ? "current" : null, "data-run": job.id },
    el(
      "button",
      { type: "button", class: "open", "aria-current": current ? "true" : null, onclick: () => openRun(job.id, {}) },
      el("span", { class: "title" }, job.title),
      el(
        "span",
        { class: "about" },
        state ? el("span", { class: "state", "data-state": job.state }, state) : null,
        `${plural(job.algorithms.length, "estimator")} · ${plural(job.trials, "trial")} · ${ago(job.created_at)}`,
      ),
    ),
    remover(job),
  );
}

function remover(job) {
  const button = el("button", { type: "button", class: "small remove", "aria-label": `Delete the run ${job.title}`, title: "Delete" }, "×");
  button.addEventListener("click", async () => {
    if (button.dataset.sure === undefined) {
      button.dataset.sure = "";
      button.textContent = atWork(job) ? "End and delete?" : "Delete?";
      setTimeout(() => {
        delete button.dataset.sure;
        button.textContent = "×";
      }, SURE_MS);
      return;
    }
    button.disabled = true;
    try {
      await persist(() => api.remove(job.id));
    } catch (error) {
      if (!(error instanceof api.Problem) || error.status !== 404) throw error;
    }
    if (store.state.run === job.id) closeRun();
    await readRuns();
  });
  return button;
}
