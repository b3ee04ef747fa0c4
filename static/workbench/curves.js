// What is plotted: quantities over time of one subject, a line per algorithm.

import { indexAt, sigmaOf } from "../state/samples.js";

/** Quantities by their key in a view. `live(subject)` makes them of streamed estimates, where that can be done. */
export const QUANTITIES = [
  {
    key: "sigma_m",
    title: "Uncertainty σ",
    unit: "m",
    how: (trials) => (trials > 1 ? `fourth root of det of the xy covariance, mean over ${trials} trials` : "fourth root of det of the xy covariance"),
    live: (subject) => subject.cov.map(sigmaOf),
  },
  {
    key: "error_m",
    title: "Error",
    unit: "m",
    how: (trials) => (trials > 1 ? `distance to the truth, RMS over ${trials} trials` : "distance to the truth"),
    live: null,
  },
];

/** Curves {algorithm: {time_s, value}} of a quantity and subject: of the view, else of the streamed estimates. */
export function curvesOf({ key, live }, state) {
  const { job, view, vehicle } = state;
  const found = new Map();
  for (const name of job?.algorithms ?? []) {
    const value = view?.algorithms[name]?.subjects[vehicle]?.[key];
    const streamed = state.live?.algorithms[name];
    if (value?.some((v) => v !== null)) found.set(name, { time_s: view.time_s, value });
    else if (live && streamed?.subjects[vehicle]) {
      found.set(name, { time_s: streamed.time_s, value: live(streamed.subjects[vehicle]) });
    }
  }
  return found;
}

/** Value of a curve at a time. */
export function valueAt({ time_s, value }, t) {
  return value[indexAt(time_s, t)] ?? null;
}
