// What is plotted over time of one vehicle: curves of the estimators that are shown, and where they should lie.

import { metres, number } from "../look/format.js";
import { vehicleColour } from "../look/palette.js";
import { departure, indexAt, sigmaOf } from "../state/samples.js";
import { shownAlgorithms } from "../state/shown.js";
import { curve } from "./curve.js";
import { DISTRIBUTION } from "./distribution.js";

/** How the trials are told: {label, of(trials)}. */
export const TELLING = {
  band: "Median and 5–95 % of the trials",
  mean: "Mean of the trials (errors: RMS)",
  first: "The trial that the panes draw",
};

/**
 * A curve over time: {…, time_s, value, low, high}; low and high, where there are any, are the band that nine of ten
 * trials lie in, or what `edges` says.
 */
const overTime = (state, name, time_s, value, rest = {}) => curve(state, name, { time_s, value, ...rest });

const some = (values) => values?.some((v) => v !== null && v !== undefined);

/** A figure of the subject that the view has over trials, or of the trial that is drawn. */
function figure(key, ofFirst) {
  return (state, telling) => {
    const { view, vehicle } = state;
    return shownAlgorithms(state).flatMap((name) => {
      const told = view?.algorithms[name]?.subjects[vehicle];
      if (!told) return [];
      if (telling === "first") {
        const value = told.mean.map((mean, n) => ofFirst(mean, told.cov[n], view.truth[vehicle]?.[n]));
        return some(value) ? [overTime(state, name, view.time_s, value)] : [];
      }
      const band = telling === "band" && key !== "nees" ? told.band?.[key] : null;
      const [low, value, high] = band ?? [null, told[key], null];
      return some(value) ? [overTime(state, name, view.time_s, value, band ? { low, high } : {})] : [];
    });
  };
}

/** The error of the drawn trial along an axis (0 east, 1 north), and two of the sigmas it should rarely leave. */
function along(axis) {
  return (state) => {
    const { view, vehicle } = state;
    return shownAlgorithms(state).flatMap((name) => {
      const told = view?.algorithms[name]?.subjects[vehicle];
      const value = (told?.mean ?? []).map((mean, n) => difference(mean[axis], view.truth[vehicle]?.[n]?.[axis]));
      if (!some(value)) return [];
      const high = told.cov.map((cov) => (cov[2 * axis] === null ? null : 2 * Math.sqrt(cov[2 * axis])));
      const low = high.map((v) => (v === null ? null : -v));
      return [overTime(state, name, view.time_s, value, { low, high, edges: ["-2 sigma", "+2 sigma"] })];
    });
  };
}

const difference = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : null);

/** Sigma of the estimates that stream in, until there is a view. */
function streamed(state) {
  return shownAlgorithms(state).flatMap((name) => {
    const live = state.live?.algorithms[name];
    const cov = live?.subjects[state.vehicle]?.cov;
    return cov ? [overTime(state, name, live.time_s, cov.map(sigmaOf))] : [];
  });
}

/** Squared innovations in spans of time. */
function surprise(state) {
  return shownAlgorithms(state).flatMap((name) => {
    const told = state.view?.algorithms[name]?.surprise?.[state.vehicle];
    return told?.time_s.length ? [overTime(state, name, told.time_s, told.value, { bounds: told })] : [];
  });
}

/** How far the origin state method's estimate of the drawn trial is from the DEIF's (W12 Fig. 5). */
function fromDeif(state) {
  const { view, vehicle } = state;
  const [a, b] = ["mdeif", "deif"].map((name) => view?.algorithms[name]?.subjects[vehicle]?.mean);
  if (!a?.length || !b?.length || state.hidden.algorithms.has("mdeif")) return [];
  const value = a.map((p, n) => departure(p, null, b[n])?.error_m ?? null);
  return [overTime(state, "mdeif", view.time_s, value)];
}

/** The series of a kind that concern the vehicle, or the fleet; one of a pair has the other's colour. */
function series(kind) {
  return (state, telling) => {
    const { view, vehicle } = state;
    return shownAlgorithms(state).flatMap((name) => {
      const all = Object.entries(view?.algorithms[name]?.series ?? {}).filter(([key]) => kindOf(key) === kind);
      const mine = all.map(([, s]) => s).filter((s) => !s.subjects.length || s.subjects.includes(vehicle));
      return mine.filter((s) => some(s.value)).flatMap((s) => {
        const other = s.subjects.find((subject) => subject !== vehicle);
        if (other !== undefined && state.hidden.vehicles.has(other)) return [];
        const [low, value, high] = (telling === "band" && s.band) || [null, s.value, null];
        const drawn = overTime(state, name, view.time_s, value, low ? { low, high } : {});
        if (other === undefined) return [drawn];
        const place = view.subjects.findIndex((subject) => subject.name === other);
        return [{ ...drawn, title: `${drawn.title}, with ${other}`, colour: vehicleColour(Math.max(0, place)) }];
      });
    });
  };
}

const kindOf = (key) => key.split("/")[0];

const [EAST, NORTH] = ["East", "North"].map((name, axis) => ({
  key: `${name.toLowerCase()}_m`,
  title: `${name} error`,
  unit: "m",
  format: metres,
  about: `Estimate minus truth, ${name.toLowerCase()}. Shaded: two sigmas either side of zero, which it leaves at 5 % of the times if they are right`,
  curves: along(axis),
  only: "first",
  linear: true,
}));

const ESTIMATED = [
  {
    key: "error_m",
    title: "Error",
    unit: "m",
    format: metres,
    about: "Distance between the estimated and the true position",
    curves: figure("error_m", (mean, cov, truth) => departure(mean, cov, truth)?.error_m ?? null),
    mean: "RMS",
  },
  {
    key: "sigma_m",
    title: "Uncertainty σ",
    unit: "m",
    format: metres,
    about: "Fourth root of the determinant of the position's covariance",
    curves: (state, telling) => (state.view ? figure("sigma_m", (_, cov) => sigmaOf(cov))(state, telling) : streamed(state)),
  },
  {
    key: "nees",
    title: "NEES",
    unit: "2 expected",
    format: number,
    about: "Squared error relative to the believed covariance. Shaded: where it is at 95 % of the times if that is right; above, the estimator is overconfident",
    curves: figure("nees", (mean, cov, truth) => departure(mean, cov, truth)?.nees ?? null),
    bounds: ({ view }, telling) => {
      const [low, high] = (telling === "first" ? view?.nees_interval_alone : view?.nees_interval) ?? [];
      return low === undefined ? null : { low: [low, low], high: [high, high], time_s: null };
    },
  },
  {
    key: "nis",
    title: "Innovations (NIS)",
    unit: "1 expected",
    format: number,
    about: "Squared range innovations relative to what was predicted, averaged over all trials in spans of time. Shaded: where that is at 95 % of the times if they are white",
    curves: surprise,
    only: "mean",
    bounds: (state) => surprise(state)[0]?.bounds ?? null,
  },
  DISTRIBUTION,
  EAST,
  NORTH,
  {
    key: "from_deif",
    title: "Difference MDEIF to DEIF",
    unit: "m",
    format: metres,
    about: "Distance between the two estimates of the drawn trial (W12 Fig. 5)",
    curves: fromDeif,
    only: "first",
  },
];

const KINDS = {
  correlation: { title: "Correlation with others", about: "tr P_ij / sqrt(tr P_ii tr P_jj) as the centralized filter has it (W11 Figs. 3, 4); a line per other vehicle, in its colour", linear: true },
  origin_correlation: { title: "Correlation with the origin", about: "Of the last launch with the origin its packet refers to (W12 Fig. 5)" },
  sent_bytes: { title: "Bandwidth", about: "Encoded bytes that all vehicles together have broadcast so far" },
};

function ofKind(kind, { title, unit }) {
  return {
    key: kind,
    kind,
    title: title.replace(/ of .*$/, ""),
    about: title,
    unit,
    format: unit === "m" ? metres : (v) => (unit === "1" ? number(v) : `${number(v)} ${unit}`),
    ...KINDS[kind],
    curves: series(kind),
  };
}

/** The quantities that the open run has, of any vehicle: what each is, where its curves come from. */
export function quantitiesOf({ view }) {
  if (!view) return ESTIMATED.slice(0, 2);
  const algorithms = Object.values(view.algorithms);
  const kinds = new Map(algorithms.flatMap((a) => Object.entries(a.series ?? {})).map(([key, s]) => [kindOf(key), s]));
  const has = {
    nees: algorithms.some((a) => Object.values(a.subjects).some((s) => some(s.nees))),
    nis: algorithms.some((a) => Object.values(a.surprise ?? {}).some((s) => s.time_s.length)),
    ...Object.fromEntries([EAST.key, NORTH.key, DISTRIBUTION.key].map((key) => [key, some(Object.values(view.truth).flat(2))])),
    from_deif: Boolean(view.algorithms.mdeif && view.algorithms.deif),
  };
  const estimated = ESTIMATED.filter((q) => has[q.key] ?? true);
  return [...estimated.slice(0, 3), ...[...kinds].map(([kind, s]) => ofKind(kind, s)).sort(bandwidthLast), ...estimated.slice(3)];
}

const bandwidthLast = (a, b) => (a.key === "sent_bytes") - (b.key === "sent_bytes");

/** Curves of a quantity, what they are in words, and the span they should lie in (null: there is none). */
export function drawingOf(quantity, state, telling) {
  const curves = quantity.curves(state, telling);
  return { curves, how: wordsOf(quantity, state, telling, curves.some((c) => c.low)), bounds: curves.length ? (quantity.bounds?.(state, telling) ?? null) : null };
}

function wordsOf({ only, kind, how, mean = "mean" }, { view }, telling, banded) {
  // Of a run that keeps statistics alone, or has lost trials, fewer have curves than were asked for.
  const trials = Math.max(1, ...Object.values(view?.algorithms ?? {}).map((a) => a.trials));
  if (trials <= 1) return "";
  if (how) return how(telling, trials);
  if (only === "first" || (telling === "first" && !only && !kind)) return "the trial drawn";
  return banded ? `median and 5–95 % of ${trials} trials` : `${mean} of ${trials} trials`;
}

/** Value of a curve at a time. */
export function valueAt({ time_s, value }, t) {
  return value[indexAt(time_s, t)] ?? null;
}
