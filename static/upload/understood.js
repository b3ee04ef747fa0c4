// What was understood of a log: figures of every sensor, a plan of tracks, ranges over time.

import { el, svg } from "../look/dom.js";
import { count, duration, metres, number } from "../look/format.js";
import { vehicleColour } from "../look/palette.js";
import { dot } from "../look/swatch.js";

const WIDTH = 380;
const HEIGHT = 250;

export function understanding({ duration_s, notes, vehicles, ranges, pairs }) {
  return el(
    "div",
    { class: "understood" },
    el("p", { class: "span" }, el("b", {}, duration(duration_s)), ` of mission, ${vehicles.length} ${vehicles.length === 1 ? "vehicle" : "vehicles"}`),
    plan(vehicles),
    el("p", { class: "legend" }, "solid: truth · dashed: integrated from odometry or velocities · dots: fixes · squares: fixed nodes"),
    el("ul", {}, vehicles.map((vehicle, n) => el("li", { "data-vehicle": vehicle.name }, dot(vehicleColour(n)), el("b", {}, vehicle.name), ` ${sensors(vehicle)}`))),
    ranges.length ? overTime(ranges, duration_s) : null,
    el("ul", {}, pairs.map((p) => el("li", {}, `${p.from} → ${p.to}: ${count(p.heard)} of ${count(p.of)} ranges${p.range_m ? `, ${number(p.range_m[0])} to ${metres(p.range_m[1])}` : ""}`))),
    notes.map((note) => el("p", { class: "quiet" }, note)),
  );
}

function sensors({ kind, sensors, start_m }) {
  if (!sensors.length) return kind === "fixed" ? `fixed at ${start_m.map((v) => number(v)).join(", ")} m` : "no sensors of its own";
  return sensors.map((s) => `${count(s.readings)} ${s.kind === "fixes" ? "fixes" : `${s.kind} readings`}, ${number(s.from_s)} to ${number(s.to_s)} s`).join("; ");
}

/** Tracks from above, north up. */
function plan(vehicles) {
  const all = vehicles.flatMap((v) => [...v.truth, ...v.reckoned, ...v.fixes, v.start_m]).filter((p) => p[0] !== null);
  const [xs, ys] = [all.map((p) => p[0]), all.map((p) => p[1])];
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const scale = Math.min((WIDTH - 24) / Math.max(x1 - x0, 1), (HEIGHT - 24) / Math.max(y1 - y0, 1));
  const place = ([x, y]) => [WIDTH / 2 + (x - (x0 + x1) / 2) * scale, HEIGHT / 2 - (y - (y0 + y1) / 2) * scale];
  const line = (points, colour, dash) =>
    points.length ? svg("polyline", { points: points.map((p) => place(p).map((v) => v.toFixed(1)).join()).join(" "), fill: "none", stroke: colour, "stroke-width": 1.6, "stroke-dasharray": dash }) : null;
  return svg(
    "svg",
    { class: "plan", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "Plan of the log" },
    vehicles.flatMap((v, n) => {
      const colour = vehicleColour(n);
      const [cx, cy] = place(v.start_m);
      const start = v.kind === "fixed" ? svg("rect", { x: cx - 4, y: cy - 4, width: 8, height: 8, fill: colour }) : svg("circle", { cx, cy, r: 4, fill: colour });
      const fixes = v.fixes.map(place).map(([x, y]) => svg("circle", { cx: x, cy: y, r: 1.4, fill: colour, opacity: 0.6 }));
      return [line(v.truth, colour, null), line(v.reckoned, colour, "5 4"), ...fixes, start];
    }),
  );
}

function overTime(ranges, duration_s) {
  const far = Math.max(...ranges.map((r) => r[1]), 1);
  const dots = ranges.map(([t, r]) => `M${(4 + (t / duration_s) * (WIDTH - 8)).toFixed(1)} ${(74 - (r / far) * 68).toFixed(1)}h.01`);
  return el(
    "figure",
    {},
    el("figcaption", {}, `Ranges over time, up to ${metres(far)}`),
    svg("svg", { class: "plan", viewBox: `0 0 ${WIDTH} 80`, role: "img", "aria-label": "Ranges over time" }, svg("path", { d: dots.join(""), stroke: "currentColor", "stroke-width": 2.2, "stroke-linecap": "round", fill: "none" })),
  );
}
