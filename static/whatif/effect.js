// What the changes do: the error of every estimator, saved mission against edited one.

import { el } from "../look/dom.js";
import { metres } from "../look/format.js";
import { lineSample } from "../look/swatch.js";
import { isTrial } from "../state/whatif.js";

/** The table, or a sentence where there is nothing to compare yet. */
export function effectTable({ run, result, vehicle, algorithms }, { saved }) {
  const trial = isTrial(run) && result ? result : null;
  if (!trial || !vehicle) return el("p", { hidden: true });
  const rows = Object.entries(trial.algorithms).map(([name, told]) => {
    const now = told.subjects[vehicle]?.rmse_m ?? null;
    const before = saved?.algorithms[name]?.subjects[vehicle]?.rmse_m ?? null;
    const title = algorithms?.find((a) => a.name === name)?.title ?? name;
    return el(
      "tr",
      { "data-algorithm": name },
      el("th", { scope: "row", title }, lineSample(name, algorithms ?? []), title),
      el("td", {}, metres(before)),
      el("td", {}, metres(now)),
      el("td", { class: tone(before, now) }, share(before, now)),
    );
  });
  return el(
    "div",
    {},
    el("h3", {}, `Error of ${vehicle}, RMS`),
    el("table", {}, el("thead", {}, el("tr", {}, ["Estimator", "saved", "changed", ""].map((t) => el("th", { scope: "col" }, t)))), el("tbody", {}, rows)),
  );
}

function share(before, now) {
  if (!before || now === null) return "";
  const percent = Math.round(100 * (now / before - 1));
  return percent === 0 ? "same" : `${percent > 0 ? "+" : "−"}${Math.abs(percent)} %`;
}

function tone(before, now) {
  if (!before || now === null || Math.abs(now / before - 1) < 0.05) return "";
  return now > before ? "worse" : "better";
}
