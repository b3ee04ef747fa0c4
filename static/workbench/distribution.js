// How the errors of the whole mission are spread: the share of them that is no larger than so much, per estimator.

import { metres } from "../look/format.js";
import { token } from "../look/plotly.js";
import { departure } from "../state/samples.js";
import { shownAlgorithms } from "../state/shown.js";
import { curve } from "./curve.js";
import { axisOf, lineOf, named, paper } from "./figure.js";

/** Percent of the errors that lie below the value at the same place of a curve. */
const PERCENTS = Array.from({ length: 101 }, (_, n) => n);

/** The errors (m) that 0, 1, … 100 % of all do not exceed. */
function quantiles(errors) {
  const sorted = errors.filter((e) => e !== null).sort((a, b) => a - b);
  if (!sorted.length) return [];
  return PERCENTS.map((p) => {
    const place = (p / 100) * (sorted.length - 1);
    const low = Math.floor(place);
    return sorted[low] + (place - low) * (sorted[Math.ceil(place)] - sorted[low]);
  });
}

function spread(state, telling) {
  const { view, vehicle } = state;
  return shownAlgorithms(state).flatMap((name) => {
    const told = view?.algorithms[name]?.subjects[vehicle];
    const truth = view?.truth[vehicle];
    const drawn = () => quantiles((told?.mean ?? []).map((mean, n) => departure(mean, null, truth?.[n])?.error_m ?? null));
    const error = (telling === "first" ? drawn() : told?.distribution_m) ?? [];
    return error.length ? [curve(state, name, { error })] : [];
  });
}

/** {data, layout} of the curves: errors across, shares upward. */
function figureOf({ curves, logarithmic }) {
  const data = curves.map((c) => lineOf(c, c.error, PERCENTS));
  const most = Math.max(0, ...curves.map((c) => c.error[100])) || 1;
  // A logarithmic axis leaves out errors of next to nothing.
  const least = Math.min(most, ...curves.map((c) => c.error.find((e) => e > c.error[100] / 1e4) ?? most));
  const ends = logarithmic ? [Math.log10(least) - 0.05, Math.log10(most) + 0.05] : [0, 1.03 * most];
  const layout = {
    ...paper(),
    xaxis: { ...axisOf(), type: logarithmic ? "log" : "linear", range: ends, exponentformat: "SI", title: named("error (m)", 6) },
    yaxis: { ...axisOf(), range: [0, 102], title: named("errors below (%)", 4) },
    shapes: [50, 95].map((y) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, layer: "below", line: { color: token("--ink-2"), width: 1, dash: "dot" } })),
  };
  return { data, layout };
}

/** A quantity that is no curve over time: how it is drawn, read and saved is its own. */
export const DISTRIBUTION = {
  key: "distribution",
  title: "Distribution of errors",
  about: "How large the errors are at all times of the mission: the share of them that is no larger than so much. Beside the name: what half of them, what 95 % stay below, and the largest",
  unit: "m",
  curves: spread,
  how: (telling, trials) => (telling === "first" ? "the trial drawn" : `all of ${trials} trials`),
  own: {
    figure: figureOf,
    told: ({ error }) => `50 % ${metres(error[50])} · 95 % ${metres(error[95])} · most ${metres(error[100])}`,
    numbers: ({ curves }) => [["errors below (%)", ...curves.map((c) => `${c.title} (m)`)], ...PERCENTS.map((p) => [p, ...curves.map((c) => c.error[p])])],
  },
};
