// What is plotted: quantities over time of one subject, a line per algorithm.

import { metres, number } from "../look/format.js";
import { indexAt, sigmaOf } from "../state/samples.js";
import { shownAlgorithms } from "../state/shown.js";

/** The named one of a subject's curves in a view. */
const own = (key) => (algorithm, vehicle) => algorithm.subjects[vehicle]?.[key];

/** Of the series of a kind that concern a vehicle, the one that comes furthest from zero. */
const series = (kind) => (algorithm, vehicle) => {
  const found = Object.entries(algorithm.series ?? {}).filter(([key, s]) => key.startsWith(`${kind}/`) && s.subjects.includes(vehicle));
  const reach = ([, s]) => Math.max(0, ...s.value.map((v) => Math.abs(v ?? 0)));
  return found.sort((a, b) => reach(b) - reach(a))[0]?.[1].value;
};

/** How far the origin state method's estimate of the drawn trial is from the DEIF's (W12 Fig. 5). */
function fromDeif(algorithm, vehicle, view) {
  const other = view.algorithms.deif;
  if (algorithm !== view.algorithms.mdeif || !other) return undefined;
  const [a, b] = [algorithm, other].map((v) => v.subjects[vehicle]?.mean ?? []);
  return a.map((p, n) => (p && b[n] && p[0] !== null && b[n][0] !== null ? Math.hypot(p[0] - b[n][0], p[1] - b[n][1]) : null));
}

/**
 * Quantities over time. `read(algorithm, vehicle, view)` finds one in a view, `live(subject)` makes it of streamed
 * estimates where that can be done; those marked `extra` are shown only where there is something to show.
 */
export const QUANTITIES = [
  {
    key: "sigma_m",
    title: "Uncertainty σ",
    unit: "m",
    format: metres,
    read: own("sigma_m"),
    how: (trials) => (trials > 1 ? `fourth root of det of the xy covariance, mean over ${trials} trials` : "fourth root of det of the xy covariance"),
    live: (subject) => subject.cov.map(sigmaOf),
  },
  {
    key: "error_m",
    title: "Error",
    unit: "m",
    format: metres,
    read: own("error_m"),
    how: (trials) => (trials > 1 ? `distance to the truth, RMS over ${trials} trials` : "distance to the truth"),
    live: null,
  },
  {
    key: "nees",
    title: "NEES",
    unit: "2 expected",
    format: number,
    read: own("nees"),
    how: (trials) => `squared error relative to the believed covariance, mean over ${trials} trials`,
    live: null,
    extra: true,
  },
  {
    key: "correlation",
    title: "Correlation with another vehicle",
    unit: "1",
    format: number,
    read: series("correlation"),
    how: () => "tr P_ij / sqrt(tr P_ii tr P_jj) as the centralized filter has it, mean over trials (W11 Figs. 3, 4)",
    live: null,
    extra: true,
  },
  {
    key: "origin_correlation",
    title: "Correlation with the origin",
    unit: "1",
    format: number,
    read: series("origin_correlation"),
    how: () => "of the last launch with the origin its packet refers to, mean over trials (W12 Fig. 5)",
    live: null,
    extra: true,
  },
  {
    key: "from_deif",
    title: "Difference MDEIF to DEIF",
    unit: "m",
    format: metres,
    read: fromDeif,
    how: () => "distance between the two estimates of the drawn trial (W12 Fig. 5)",
    live: null,
    extra: true,
  },
];

/** Curves {algorithm: {time_s, value}} of a quantity and subject: of the view, else of the streamed estimates. */
export function curvesOf({ read, live }, state) {
  const { view, vehicle } = state;
  const found = new Map();
  for (const name of shownAlgorithms(state)) {
    const told = view?.algorithms[name];
    const value = told && read(told, vehicle, view);
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
