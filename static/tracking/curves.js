// Fig. 3's curve and Fig. 6's histories of one operating point.

import { loadPlotly, PLAIN, plainLayout, token } from "../look/plotly.js";

const MARGIN = { l: 56, r: 92, t: 8, b: 40 };

/** Colours by fuser, from Okabe and Ito's; the central filter in ink. */
const FUSERS = [
  ["single_sensor", "one sensor", "#8f969e"],
  ["centralized_fusion", "central", null],
  ["naive_fusion", "naive", "#d55e00"],
  ["distributed_fusion", "optimal", "#0072b2"],
  ["covariance_intersection", "CI", "#009e73"],
];

const label = (text, y, colour) => ({
  text,
  xref: "paper",
  x: 1.01,
  xanchor: "left",
  y,
  showarrow: false,
  font: { color: colour, size: 11.5 },
});

/** Pushes labels apart so that none covers another; y in data units, `gap` the least distance. */
function spread(labels, gap) {
  labels.sort((a, b) => a.y - b.y);
  for (let n = 1; n < labels.length; n += 1) labels[n].y = Math.max(labels[n].y, labels[n - 1].y + gap);
  return labels;
}

export async function drawWeights(drawing, told) {
  const plotly = await loadPlotly();
  const ink = token("--ink");
  const level = (y, colour, dash) => ({ type: "scatter", mode: "lines", x: [0, 1], y: [y, y], line: { color: colour, dash, width: 1.5 }, hoverinfo: "skip" });
  const top = Math.max(...told.distributed) * 1.04;
  const bottom = Math.min(told.central, told.naive_believed) * 0.9;
  const traces = [
    level(told.single, "#8f969e", "dash"),
    level(told.central, ink, "solid"),
    { type: "scatter", mode: "lines", x: told.weight, y: told.distributed, line: { color: "#0072b2", width: 2 }, hovertemplate: "weight %{x:.2f}: %{y:.3g} m²<extra></extra>" },
    { type: "scatter", mode: "markers", x: [told.optimal_weight], y: [told.optimal], marker: { color: "#0072b2", size: 9 }, hovertemplate: "optimal %{x:.3f}: %{y:.4g} m²<extra></extra>" },
    {
      type: "scatter",
      mode: "lines+markers",
      x: [told.naive_weight, told.naive_weight],
      y: [told.naive_believed, told.naive],
      line: { color: "#d55e00", dash: "dot", width: 1.5 },
      marker: { color: "#d55e00", size: 8, symbol: ["circle-open", "circle"] },
      hovertemplate: "naive: %{y:.4g} m²<extra></extra>",
    },
  ];
  const labels = spread(
    [label("one sensor", told.single, "#8f969e"), label("central", told.central, ink), label("optimal", told.optimal, "#0072b2"), label("naive", told.naive, "#d55e00")],
    (top - bottom) * 0.075,
  );
  const layout = plainLayout(
    MARGIN,
    { title: { text: "weight of the second sensor" }, range: [0, 1] },
    { title: { text: "variance (m²)" }, range: [bottom, top] },
    { annotations: labels },
  );
  await plotly.react(drawing, traces, layout, PLAIN);
}

export async function drawHistories(drawing, told) {
  const plotly = await loadPlotly();
  const traces = [];
  const labels = [];
  let top = 0;
  for (const [name, words, own] of FUSERS) {
    const history = told[name];
    const colour = own ?? token("--ink");
    const steps = history.actual.map((_, k) => k);
    const line = { type: "scatter", x: steps, line: { color: colour, width: 1.8 } };
    traces.push({ ...line, mode: "lines", y: history.actual, hovertemplate: `${words}, step %{x}: %{y:.3g} m²<extra></extra>` });
    if (name === "naive_fusion") {
      traces.push({ ...line, mode: "lines", y: history.believed, line: { ...line.line, dash: "dash" }, hovertemplate: "naive believes %{y:.3g} m²<extra></extra>" });
      labels.push(label("naive believed", history.believed.at(-1), colour));
    }
    const interval = history.monte_carlo_interval;
    const dots = { type: "scatter", mode: "markers", x: steps, y: history.monte_carlo, marker: { color: colour, size: 4, opacity: 0.55 } };
    const bars = { array: interval.map((b, k) => b[1] - history.monte_carlo[k]), arrayminus: interval.map((b, k) => history.monte_carlo[k] - b[0]) };
    traces.push({ ...dots, hoverinfo: "skip", error_y: { type: "data", symmetric: false, ...bars, color: colour, thickness: 0.6, width: 0 } });
    labels.push(label(words, history.actual.at(-1), colour));
    top = Math.max(top, ...history.actual.slice(1), ...history.monte_carlo.slice(1));
  }
  const layout = plainLayout(
    MARGIN,
    { title: { text: "step" }, range: [0.5, told.naive_fusion.actual.length - 0.5] },
    { title: { text: "variance (m²)" }, range: [0, top * 1.08] },
    { annotations: spread(labels, top * 0.075) },
  );
  await plotly.react(drawing, traces, layout, PLAIN);
}
