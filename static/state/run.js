// The run that is open: followed while it is at work, read when it is done.

import * as api from "../wire/api.js";
import { Problem } from "../wire/api.js";
import { follow } from "../wire/events.js";
import { clock } from "./clock.js";
import { persist, suspect } from "./connection.js";
import { store } from "./store.js";

const FINAL = new Set(["done", "failed", "cancelled"]);
/** While a run is at work its view is read at most this often. */
const VIEW_PAUSE_MS = 1500;

let open = new AbortController();

export const atWork = (job) => job !== null && !FINAL.has(job.state);

/** Opens a run by id; `wanted` may say {time_s, vehicle}. */
export async function openRun(id, wanted = {}, known = null) {
  open.abort();
  const { signal } = (open = new AbortController());
  store.set({ room: "workbench", run: id, job: null, progress: null, live: null, view: null, result: null, notices: [] });
  store.set({ vehicle: wanted.vehicle ?? store.state.vehicle });
  clock.reset(0, 0);
  try {
    const job = known ?? (await persist(() => api.findJob(id, signal), signal));
    store.set({ job });
    if (job.state !== "done") {
      clock.following = wanted.time_s === undefined || wanted.time_s === null;
      await listen(id, signal);
    }
    await read(id, wanted, signal);
  } catch (error) {
    if (signal.aborted) return;
    if (!(error instanceof Problem)) throw error;
    const gone = error.status === 404;
    notice(gone ? "This run does not exist" : error.title, gone ? "It may have been deleted. Pick another under Runs, or start a new one." : error.detail);
    if (gone) store.set({ run: null });
  }
}

/** Shows no run. */
export function closeRun() {
  open.abort();
  open = new AbortController();
  store.set({ run: null, job: null, progress: null, live: null, view: null, result: null, notices: [] });
  clock.reset(0, 0);
}

/** Shows another run that is done in the place of the one that is open, at the same time and vehicle; that one's id. */
export function replaceRun(job, view, result) {
  open.abort();
  open = new AbortController();
  const { run } = store.state;
  const fresh = clock.end <= clock.start;
  store.set({ room: "workbench", run: job.id, job, result, progress: null, live: null, notices: [] });
  take(view);
  if (fresh) clock.reset(clock.start, clock.end, clock.end);
  return run;
}

/** Id of the run that the form has started last, until another is opened. */
let ofTheForm = null;

/** Whether a run that is opened is one that the form has just started: a person may be at the next one there. */
export function startedByForm(id) {
  const so = id === ofTheForm;
  ofTheForm = null;
  return so;
}

/** Submits a run, which the form for new ones may describe, and opens it; a refusal is kept for the form. */
export async function startRun(body, { ofForm = false } = {}) {
  store.set({ refusal: null });
  const key = api.newKey();
  try {
    const job = await persist(() => api.submit(body, key));
    if (ofForm) ofTheForm = job.id;
    openRun(job.id, { vehicle: store.state.vehicle }, job);
    return true;
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    store.set({ refusal: error });
    return false;
  }
}

/** Ends the open run. */
export async function cancelRun() {
  const { run } = store.state;
  try {
    const job = await persist(() => api.cancel(run));
    if (store.state.run === run) store.set({ job });
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    notice(error.title, error.detail);
  }
}

function notice(title, text, tone = "bad") {
  store.set({ notices: [...store.state.notices, { title, text, tone }] });
}

/** Follows a run until it has ended; of one that has, its estimates are told once more. */
async function listen(id, signal) {
  let looking = 0;
  let shards = 0;
  const look = () => {
    looking ||= setTimeout(async () => {
      const view = await viewSoFar(id, signal);
      looking = 0;
      if (view && !signal.aborted && atWork(store.state.job)) take(view);
    }, VIEW_PAUSE_MS);
  };
  const hear = ({ event, data }) => {
    if (event === "state" && (FINAL.has(data.state) || atWork(store.state.job))) store.set({ job: data });
    else if (event === "progress") {
      store.set({ progress: data });
      if (data.shards_done > shards) look();
      shards = data.shards_done;
    } else if (event === "estimates") grow(data);
    return event === "state" && FINAL.has(data.state);
  };
  try {
    await follow(api.eventsPath(id), hear, { signal, gap: (lost) => lost && suspect() });
  } finally {
    clearTimeout(looking);
  }
}

/** Appends streamed estimates of the first trial. */
function grow({ algorithm, time_s, mean, cov }) {
  const algorithms = { ...store.state.live?.algorithms };
  const before = algorithms[algorithm];
  const subjects = { ...before?.subjects };
  for (const name of Object.keys(mean)) {
    const sofar = subjects[name] ?? { mean: [], cov: [] };
    subjects[name] = { mean: sofar.mean.concat(mean[name]), cov: sofar.cov.concat(cov[name] ?? []) };
  }
  const times = (before?.time_s ?? []).concat(time_s);
  algorithms[algorithm] = { time_s: times, subjects };
  const latest_s = Math.max(store.state.live?.latest_s ?? 0, ...time_s);
  store.set({ live: { algorithms, latest_s }, vehicle: store.state.vehicle ?? Object.keys(mean)[0] ?? null });
  const mission = store.state.missions?.find((m) => m.name === store.state.job?.scenario);
  clock.range(0, Math.max(mission?.duration_s ?? 0, clock.end, latest_s));
  clock.head(latest_s);
}

async function viewSoFar(id, signal) {
  try {
    return await api.view(id, signal);
  } catch (error) {
    if (error instanceof Problem || error instanceof api.Unreachable || signal.aborted) return null;
    throw error;
  }
}

/** Takes a view in: its subjects, its time range. */
function take(view) {
  const names = view.subjects.map((s) => s.name);
  const estimated = new Set(Object.values(view.algorithms).flatMap((a) => Object.keys(a.subjects)));
  const candidates = view.subjects.filter((s) => s.kind !== "fixed" && estimated.has(s.name));
  const moving = candidates.find((s) => view.truth?.[s.name]) ?? candidates[0];
  const { vehicle } = store.state;
  const fits = names.includes(vehicle) && estimated.has(vehicle);
  store.set({ view, vehicle: fits ? vehicle : (moving?.name ?? names[0] ?? null) });
  clock.range(view.time_s[0] ?? 0, view.time_s.at(-1) ?? 0);
}

/** Reads what an ended run has left. */
async function read(id, wanted, signal) {
  const { job } = store.state;
  if (job.state === "failed") notice(job.error?.title ?? "The run failed", job.error?.detail ?? "");
  if (job.state !== "done") return;
  const [view, result] = await Promise.all([
    persist(() => api.view(id, signal), signal),
    persist(() => api.result(id, signal), signal),
  ]);
  signal.throwIfAborted();
  store.set({ result });
  settle(view, wanted);
}

/** A view that stays: the clock keeps its time if a person has chosen one, and else stands at the end. */
function settle(view, wanted) {
  const before = { time: clock.time, known: clock.end > clock.start, following: clock.following };
  take(view);
  const end = view.time_s.at(-1) ?? 0;
  const chosen = before.known && !before.following ? before.time : (wanted.time_s ?? end);
  if (!clock.playing) clock.reset(view.time_s[0] ?? 0, end, chosen);
}
