// What if: the mission is run again as it is varied, a moment after every change; the newest wins, older ones end.

import * as api from "../wire/api.js";
import { Problem } from "../wire/api.js";
import { follow } from "../wire/events.js";
import { inOrder } from "../whatif/edits.js";
import { suspect } from "./connection.js";
import { replaceInLink } from "./link.js";
import { atWork, replaceRun } from "./run.js";
import { createStore, store } from "./store.js";

/** A change is followed by a run unless another change comes within this time. */
const PAUSE_MS = 120;
/** The mission as it is saved is run, to compare with, once nothing has changed for this long. */
const IDLE_MS = 700;
/** Trials of a what-if, unless a person says otherwise. */
export const USUAL_TRIALS = 30;

/**
 * state: "idle", "waiting", "running", "shown" or "refused"; refusal {title, detail, errors}; took_s of the last one;
 * saved: the result of the mission as it is saved, with the same trials, seed and estimators, or null.
 */
export const whatif = createStore({ state: "idle", refusal: null, took_s: null, saved: null, trials: USUAL_TRIALS, live: true });

let timer = 0;
let idle = 0;
let flying = null;
let shown = null;
let savedFor = null;

/** Whether a run that is open is a what-if of this page's. */
export const isTrial = (id) => id !== null && id === shown;

/** Runs the mission as it is varied now, soon. */
export function again() {
  clearTimeout(timer);
  clearTimeout(idle);
  flying?.abort();
  whatif.set({ state: "waiting", refusal: null });
  timer = setTimeout(fly, PAUSE_MS);
}

/** Another run is opened: what is under way would take its place. */
store.watch(["run"], ({ run }) => run !== shown && rest());

/** Ends what is under way. */
export function rest() {
  clearTimeout(timer);
  clearTimeout(idle);
  flying?.abort();
  if (whatif.state.state !== "refused") whatif.set({ state: "idle" });
}

function submission(changes) {
  const { mission, ticked, varied } = store.state;
  const body = { scenario: mission, algorithms: ticked, trials: whatif.state.trials, set: inOrder(changes), purpose: "what-if" };
  if (varied.seed !== null) body.seed = varied.seed;
  return body;
}

const likeness = ({ scenario, algorithms, trials, seed }) => JSON.stringify([scenario, algorithms, trials, seed ?? null]);

async function fly() {
  const { signal } = (flying = new AbortController());
  const body = submission(store.state.varied.changes);
  const began = performance.now();
  try {
    const { job, view, result } = await flown(body, signal, true);
    const before = shown;
    shown = job.id;
    if (store.state.run !== null && store.state.run === before) replaceInLink(job.id);
    const replaced = replaceRun(job, view, result);
    whatif.set({ state: "shown", took_s: (performance.now() - began) / 1000 });
    if (before !== null && before === replaced) forget(before);
    if (!Object.keys(body.set).length) keep(body, result);
    else if (likeness(body) !== savedFor) {
      whatif.set({ saved: null });
      idle = setTimeout(() => compare(body, signal), IDLE_MS);
    }
  } catch (error) {
    told(error, signal);
  }
}

/** Runs the mission as it is saved, for the comparison. */
async function compare(body, signal) {
  try {
    const { job, result } = await flown({ ...body, set: {} }, signal, false);
    keep(body, result);
    forget(job.id);
  } catch (error) {
    told(error, signal);
  }
}

function keep(body, result) {
  savedFor = likeness(body);
  whatif.set({ saved: result });
}

/** A job that is submitted, followed to its end and read; deleted again where that does not succeed. */
async function flown(body, signal, viewed) {
  const job = await api.submit(body, api.newKey());
  try {
    signal.throwIfAborted();
    if (viewed) whatif.set({ state: "running" });
    const ended = await end(job, signal);
    if (ended.state !== "done") throw new Problem({ title: "The run failed", detail: ended.error?.detail ?? "" });
    const [view, result] = await Promise.all([viewed ? api.view(job.id, signal) : null, api.result(job.id, signal)]);
    signal.throwIfAborted();
    return { job: ended, view, result };
  } catch (error) {
    forget(job.id);
    throw error;
  }
}

async function end(job, signal) {
  let last = job;
  const hear = ({ event, data }) => {
    if (event === "state") last = data;
    return event === "state" && !atWork(data);
  };
  await follow(api.eventsPath(job.id), hear, { signal });
  return last;
}

function told(error, signal) {
  if (signal.aborted) return;
  if (error instanceof Problem) whatif.set({ state: "refused", refusal: error });
  else if (error instanceof api.Unreachable) {
    whatif.set({ state: "idle" });
    suspect();
  } else throw error;
}

/** Deletes a what-if that another has taken the place of, unless a person has marked it. */
async function forget(id) {
  const marked = store.state.jobs?.find((job) => job.id === id);
  if (marked?.pinned || marked?.tags?.length) return;
  try {
    await api.remove(id);
  } catch (error) {
    if (!(error instanceof Problem || error instanceof api.Unreachable)) throw error;
  }
}
