// A quantity's curves as plotly draws them: bands and bounds as areas beneath, lines above.

import { token } from "../look/plotly.js";

export const MARGIN = { l: 56, r: 14, t: 8, b: 36 };
/** Bands and bounds are drawn with no more corners than this along each side. */
const CORNERS = 250;

/** Seconds of a tick unit that suits a span of time, and its name. */
export function timeUnit(length) {
  if (length <= 600) return [1, "s"];
  return length <= 6 * 3600 ? [60, "min"] : [3600, "h"];
}

/** An axis in the page's colours. */
export const axisOf = () => ({ color: token("--ink-2"), gridcolor: token("--line"), linecolor: token("--line"), zeroline: false, fixedrange: true, automargin: false, tickfont: { size: 11 } });

/** An axis' title. */
export const named = (text, standoff) => ({ text, standoff, font: { size: 12 } });

/** A layout in the page's colours that leaves the pointer to the page. */
export const paper = () => ({
  margin: MARGIN,
  showlegend: false,
  autosize: true,
  dragmode: false,
  hovermode: false,
  paper_bgcolor: "rgba(0,0,0,0)",
  plot_bgcolor: "rgba(0,0,0,0)",
  font: { family: token("--sans"), size: 12, color: token("--ink-2") },
});

/** A curve as plotly's line through x and y. */
export function lineOf({ algorithm, title, colour, dash }, x, y) {
  const dashes = dash ? dash.split(" ").map((d) => `${d}px`).join(",") : "solid";
  return { type: "scatter", mode: "lines", name: title, meta: algorithm, x, y, line: { color: colour, width: 1.8, dash: dashes }, hoverinfo: "skip" };
}

/**
 * {data, layout} of curves and bounds over the span [from, to] s; `title` is the axis', `total` the mission's length.
 */
export function figureOf({ curves, bounds, title, span, total, logarithmic }) {
  const [unit, unitName] = timeUnit(total);
  const range = heights(curves, bounds, span, logarithmic);
  const floor = logarithmic ? 10 ** range[0] : -Infinity;
  const axis = axisOf();
  const data = curves.map((c) => lineOf(c, c.time_s.map((t) => t / unit), c.value));
  const faint = Math.max(0.06, 0.2 - 0.025 * curves.length);
  const shapes = curves.filter((c) => c.low).map((c) => area(c, c.colour, faint, unit, floor));
  if (bounds) shapes.push(area(bounds.time_s ? bounds : { ...bounds, time_s: span }, token("--ink-2"), 0.13, unit, floor));
  const layout = {
    ...paper(),
    xaxis: { ...axis, range: span.map((t) => t / unit), title: named(`mission time (${unitName})`, 6) },
    yaxis: { ...axis, type: logarithmic ? "log" : "linear", range, dtick: logarithmic && range[1] - range[0] > 1.5 ? 1 : null, exponentformat: "SI", title: named(title, 4) },
    shapes: shapes.filter(Boolean),
  };
  return { data, layout };
}

/** The area between low and high as a shape; null for nothing. */
function area({ time_s, low, high }, colour, opacity, unit, floor) {
  const known = time_s.keys().filter((n) => finite(low[n]) && finite(high[n]));
  const all = [...known];
  const step = Math.max(1, Math.ceil(all.length / CORNERS));
  const places = all.filter((_, n) => n % step === 0 || n === all.length - 1);
  if (places.length < 2) return null;
  const corner = (edge) => (n) => `${(time_s[n] / unit).toPrecision(7)},${Math.max(edge[n], floor).toPrecision(6)}`;
  const path = `M${places.map(corner(high)).join("L")}L${places.reverse().map(corner(low)).join("L")}Z`;
  return { type: "path", path, layer: "below", fillcolor: colour, opacity, line: { width: 0 } };
}

const finite = (v) => v !== null && v !== undefined && Number.isFinite(v);

/** What of the axis is needed to show everything within the span; of bounds only what is near the curves. */
function heights(curves, bounds, [from, to], logarithmic) {
  const seen = [];
  for (const { time_s, value, low, high } of curves) {
    for (let n = 0; n < time_s.length; n += 1) {
      if (time_s[n] < from - 1e-9 || time_s[n] > to + 1e-9) continue;
      for (const edge of [value, low, high]) if (edge && finite(edge[n]) && (!logarithmic || edge[n] > 0)) seen.push(edge[n]);
    }
  }
  let least = Infinity;
  let most = -Infinity;
  for (const v of seen) {
    if (v < least) least = v;
    if (v > most) most = v;
  }
  if (!seen.length) return logarithmic ? [-1, 1] : [0, 1];
  if (bounds) {
    most = Math.max(most, ...bounds.high.filter(finite));
    least = Math.min(least, ...bounds.low.filter((v) => finite(v) && (!logarithmic || v > 0)));
  }
  if (logarithmic) {
    const low = Math.log10(least);
    const high = Math.log10(most);
    const room = Math.max(0.04 * (high - low), 0.02);
    return [low - room, high + room];
  }
  const low = Math.min(0, least);
  const room = 0.05 * (most - low) || 0.5;
  return [low < 0 ? low - room : 0, most + room];
}
