// What can be run: missions and algorithms, and what the person has picked of them.

import * as api from "../wire/api.js";
import { Problem } from "../wire/api.js";
import { persist } from "./connection.js";
import { store } from "./store.js";

const scenarios = new Map();

/** What a new run varies where nobody has said anything. */
const AS_IT_IS = { trials: null, seed: null, changes: {} };

/** Reads the library; picks the mission asked for, else the first that can run, unless one is picked already. */
export async function readLibrary() {
  const [missions, algorithms] = await Promise.all([persist(api.scenarios), persist(api.algorithms)]);
  store.set({ missions, algorithms });
  store.watch(["asked"], ({ asked, mission }) => {
    if (asked !== mission && missions.some((m) => m.name === asked && m.available)) pickMission(asked);
  });
  if (store.state.mission === null) {
    const first = missions.find((m) => m.available);
    if (first) pickMission(first.name);
  }
}

/** Reads the missions again, and their scenarios when they are asked for next. */
export async function readMissions() {
  scenarios.clear();
  store.set({ missions: await persist(api.scenarios) });
}

/** A mission's scenario, read once; null where it cannot be read. */
export function scenarioOf(name) {
  if (!scenarios.has(name)) {
    const reading = persist(() => api.scenario(name)).then(
      (found) => found.scenario,
      (error) => {
        if (!(error instanceof Problem)) scenarios.delete(name);
        return null;
      },
    );
    scenarios.set(name, reading);
  }
  return scenarios.get(name);
}

/**
 * Picks a mission as it is or varied, and ticks its own algorithms or the given ones. The first one is varied as a person
 * has said while the library was being read.
 */
export function pickMission(name, ticked = null, varied = store.state.mission === null ? store.state.varied : AS_IT_IS) {
  const entry = store.state.missions?.find((m) => m.name === name);
  const fitting = fittingAlgorithms(entry).map((a) => a.name);
  const own = (ticked ?? entry?.algorithms ?? []).filter((a) => fitting.includes(a));
  store.set({ mission: name, scenario: null, ticked: own.length ? own : fitting, varied, refusal: null });
  scenarioOf(name).then((scenario) => {
    if (store.state.mission === name) store.set({ scenario });
  });
}

/** Picks what a run that is opened was made of, so that it can be varied and run again; `said` is varied already. */
export function pickAgain(job, said) {
  const known = store.state.missions?.some((m) => m.name === job.scenario && m.available);
  const made = { trials: job.trials, seed: job.seed, ...said, changes: { ...job.changes, ...said.changes } };
  if (known) pickMission(job.scenario, job.algorithms, made);
}

/** Algorithms that can run a mission, in the registry's order. */
export function fittingAlgorithms(entry) {
  const all = store.state.algorithms ?? [];
  if (!entry) return [];
  return all.filter((a) => a.family === entry.family || (a.accepts_families ?? []).includes(entry.family));
}

/** Ticks or unticks an algorithm, keeping the registry's order. */
export function tick(name, on) {
  const { algorithms, ticked } = store.state;
  const chosen = new Set(ticked);
  if (on) chosen.add(name);
  else chosen.delete(name);
  store.set({ ticked: algorithms.map((a) => a.name).filter((a) => chosen.has(a)) });
}
