// Curves of several runs in one plot: a colour per run, a dash per estimator.

import { clockTime, metres, number } from "../look/format.js";
import { lineStyle, vehicleColour } from "../look/palette.js";
import { PLAIN, loadPlotly, plainLayout } from "../look/plotly.js";

/** Quantities that can be laid over each other. */
export const CURVES = {
  error_m: { title: "Error", unit: "m", format: metres },
  sigma_m: { title: "Uncertainty σ", unit: "m", format: metres },
  nees: { title: "NEES", unit: "2 expected", format: number },
};

const dashed = (dash) => (dash ? dash.split(" ").map((n) => `${n}px`).join(",") : "solid");

/** Traces of a quantity and subject: `runs` are {label, view, names}, names the estimators to draw. */
export function traces(quantity, subject, runs, algorithms) {
  return runs.flatMap(({ label, view, names }, n) =>
    names.flatMap((name) => {
      const value = view.algorithms[name]?.subjects[subject]?.[quantity];
      if (!value?.some((v) => v !== null)) return [];
      const title = algorithms.find((a) => a.name === name)?.title ?? name;
      const { dash } = lineStyle(name, algorithms);
      return [
        {
          type: "scatter",
          mode: "lines",
          name: `${label}, ${title}`,
          x: view.time_s,
          y: value,
          text: view.time_s.map((t) => clockTime(t)),
          line: { color: vehicleColour(n), width: 1.8, dash: dashed(dash) },
          hovertemplate: `%{text} · %{y:.3g}<extra>${label.replaceAll("<", "&lt;")}, ${title}</extra>`,
        },
      ];
    }),
  );
}

/** Draws traces of a quantity into a node. */
export async function drawOverlay(node, quantity, data, logarithmic) {
  const Plotly = await loadPlotly();
  const { title, unit } = CURVES[quantity];
  const layout = plainLayout(
    { l: 56, r: 14, t: 10, b: 42 },
    { title: { text: "mission time (s)", standoff: 6 } },
    { title: { text: `${title.toLowerCase()} (${unit})`, standoff: 6 }, type: logarithmic ? "log" : "linear", rangemode: logarithmic ? "normal" : "tozero" },
    { hovermode: "closest" },
  );
  await Plotly.react(node, data, layout, PLAIN);
}
