// Earlier runs: read, marked, run again, deleted with a moment to think better of it.

import * as api from "../wire/api.js";
import { Problem } from "../wire/api.js";
import { persist } from "./connection.js";
import { closeRun, startRun } from "./run.js";
import { store } from "./store.js";

/** A deleted run can be had back for this long. */
export const UNDO_MS = 8000;

const leaving = new Map();

/** Reads the list again. */
export async function readRuns() {
  store.set({ jobs: await persist(api.jobs) });
}

/** The runs there are, without those about to be deleted. */
export function present({ jobs, leaving }) {
  return jobs?.filter((job) => !leaving.has(job.id)) ?? null;
}

/** Tags a run or pins it: {tags, pinned}. */
export async function mark(id, marks) {
  const put = (job) => store.set({ jobs: store.state.jobs?.map((j) => (j.id === id ? { ...j, ...job } : j)) ?? null });
  put(marks);
  const { tags, pinned } = await persist(() => api.mark(id, marks));
  put({ tags, pinned });
}

/** Deletes runs, unless a person takes it back in time. */
export function removeRuns(jobs) {
  hurry();
  const ids = jobs.map((job) => job.id);
  for (const id of ids) leaving.set(id, null);
  store.set({ leaving: new Set(leaving.keys()) });
  if (ids.includes(store.state.run)) closeRun();
  const compared = store.state.compared.filter((id) => !ids.includes(id));
  if (compared.length !== store.state.compared.length) store.set({ compared });
  const timer = setTimeout(() => go(ids), UNDO_MS);
  for (const id of ids) leaving.set(id, timer);
  const text = jobs.length === 1 ? `Deleted “${jobs[0].title}”.` : `Deleted ${jobs.length} runs.`;
  store.set({ done: { text, act: { label: "Undo", run: () => restore(ids) } } });
}

function restore(ids) {
  clearTimeout(leaving.get(ids[0]));
  for (const id of ids) leaving.delete(id);
  store.set({ leaving: new Set(leaving.keys()), done: null });
}

/** What was deleted before is deleted for good once something else is. */
function hurry() {
  for (const timer of new Set(leaving.values())) clearTimeout(timer);
  if (leaving.size) go([...leaving.keys()]);
}

async function go(ids) {
  store.set({ done: null });
  await Promise.all(ids.map(forget));
  await readRuns();
  for (const id of ids) leaving.delete(id);
  store.set({ leaving: new Set(leaving.keys()) });
}

async function forget(id) {
  try {
    await persist(() => api.remove(id));
  } catch (error) {
    if (!(error instanceof Problem) || error.status !== 404) throw error;
  }
}

window.addEventListener("pagehide", () => {
  for (const id of leaving.keys()) api.removeLast(id);
  leaving.clear();
});

/** Runs a job again as it was, and opens it; whether it was accepted. */
export async function runAgain(job) {
  const { algorithms, trials, seed, changes } = job;
  const known = store.state.missions?.some((m) => m.name === job.scenario);
  if (known) return startRun({ scenario: job.scenario, algorithms, trials, seed, set: changes });
  const { scenario } = await persist(() => api.ranScenario(job.id));
  return startRun({ scenario, algorithms, trials, seed });
}
