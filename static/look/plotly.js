// plotly, fetched when the first curve is to be drawn, and a layout in the page's own colours.

import { el } from "./dom.js";

let loading = null;

/** The plotly library; rejects where it cannot be loaded, and may be asked again. */
export function loadPlotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = el("script", { src: "/vendor/plotly.min.js" });
    script.addEventListener("load", () => resolve(window.Plotly));
    script.addEventListener("error", () => {
      loading = null;
      script.remove();
      reject(new Error("The plots could not be loaded."));
    });
    document.head.append(script);
  });
  return loading;
}

/** A custom property of the page's style. */
export const token = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** A plain layout for a figure of the given margins and axes. */
export function plainLayout(margin, xaxis, yaxis, extra = {}) {
  const axis = { gridcolor: token("--line"), linecolor: token("--strong-line"), zeroline: false, ticks: "outside", ticklen: 4 };
  return {
    margin,
    xaxis: { ...axis, ...xaxis },
    yaxis: { ...axis, ...yaxis },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: token("--sans"), size: 12, color: token("--ink-2") },
    showlegend: false,
    ...extra,
  };
}

export const PLAIN = { displayModeBar: false, responsive: true };
