// A plot as a file: picture, drawing or numbers of what is shown.

import { loadPlotly, token } from "../look/plotly.js";
import { save } from "../look/save.js";
import { csv } from "../runs/differences.js";
import { figureOf } from "./figure.js";

const SIZE = { width: 900, height: 480 };
const TYPES = { png: "image/png", svg: "image/svg+xml", csv: "text/csv" };

/**
 * Saves what a plot shows: `shown` is what `figureOf` takes, with `heading` for its top and `name` for its file; `own`
 * is how a quantity that is no curve over time is drawn and told in numbers.
 */
export async function savePlot(format, shown, own = { figure: figureOf, numbers }) {
  const content = format === "csv" ? csv(own.numbers(shown)) : await picture(format, own.figure(shown), shown.heading);
  save(content, `${shown.name}.${format}`, TYPES[format]);
}

async function picture(format, { data, layout }, heading) {
  const Plotly = await loadPlotly();
  const ink = token("--ink");
  Object.assign(layout, {
    autosize: false,
    ...SIZE,
    margin: { l: 70, r: 20, t: 50, b: 90 },
    title: { text: heading.replaceAll("<", "&lt;"), font: { size: 15, color: ink }, x: 0.02, xanchor: "left" },
    showlegend: true,
    legend: { orientation: "h", y: -0.2, font: { color: ink } },
    paper_bgcolor: token("--panel"),
    plot_bgcolor: token("--panel"),
  });
  const address = await Plotly.toImage({ data, layout }, { format, ...SIZE, scale: format === "png" ? 2 : 1 });
  const body = address.slice(address.indexOf(",") + 1);
  if (format === "svg") return decodeURIComponent(body);
  return Uint8Array.from(atob(body), (c) => c.charCodeAt(0));
}

/** Rows of the shown curves within the span: time, then every curve, with its band where it has one. */
export function numbers({ curves, span: [from, to], axis }) {
  const columns = curves.flatMap((c) =>
    [["", c.value], [c.edges?.[0] ?? "5 %", c.low], [c.edges?.[1] ?? "95 %", c.high]].filter(([, values]) => values).map(([what, values]) => ({ head: [c.title, what, axis].filter(Boolean).join(" "), at: new Map(c.time_s.map((t, n) => [t, values[n]])) })),
  );
  const times = [...new Set(curves.flatMap((c) => c.time_s))].filter((t) => t >= from - 1e-9 && t <= to + 1e-9).sort((a, b) => a - b);
  return [["time_s", ...columns.map((c) => c.head)], ...times.map((t) => [t, ...columns.map((c) => c.at.get(t) ?? null)])];
}
