// Drawings of one moment of localization by sound: records, the beam, the Bayes tree.

import { el, svg } from "../look/dom.js";

const WIDE = 300;
const ROW = 14;
const SIDE = 150;
const GRAPH = { width: 380, height: 112, margin: 12 };
const TREE = { width: 380, height: 150, margin: 8 };
const GROWTH = { width: 380, left: 58, right: 8, top: 16, errors: 78, between: 20, divergence: 40 };
/** What is shown of each measurement's errors: the field, and its name beside the line. */
const ERRORS = { mean: "beacon, mean", mode: "beacon, densest place", poses: "poses, average" };

/** Filter output of an array's records, one row each: range to the right, loudness as ink. */
export function waterfall(array) {
  const { records, ranges_m } = array;
  const height = records.length * ROW;
  const label = `Matched filter output of ${records.length} records between ${Math.round(ranges_m[0])} and ${Math.round(ranges_m[1])} m`;
  const canvas = el("canvas", { width: records[0].length, height: records.length, role: "img", "aria-label": label });
  Object.assign(canvas.style, { width: `${WIDE}px`, height: `${height}px` });
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim() || "#0b5d94";
  const paint = canvas.getContext("2d");
  paint.fillStyle = ink;
  records.forEach((row, y) =>
    row.forEach((loud, x) => {
      paint.globalAlpha = loud;
      paint.fillRect(x, y, 1, 1);
    }),
  );
  const axis = el("div", { class: "range-axis" }, el("span", {}, `${ranges_m[0].toFixed(0)} m`), el("span", {}, "range"), el("span", {}, `${ranges_m[1].toFixed(0)} m`));
  return el("div", { class: "waterfall" }, canvas, axis);
}

/** The beam pattern about the array, north up, and the array's shape within. */
export function polar(array) {
  const { look_rad, beam, places_m } = array;
  const c = SIDE / 2;
  const far = c - 16;
  const at = (angle, r) => `${(c + r * Math.cos(angle)).toFixed(1)},${(c - r * Math.sin(angle)).toFixed(1)}`;
  const rim = look_rad.map((angle, n) => at(angle, far * beam[n])).join(" ");
  const middle = [0, 1].map((i) => places_m.reduce((sum, p) => sum + p[i], 0) / places_m.length);
  const spread = Math.max(1e-6, ...places_m.flatMap((p) => [Math.abs(p[0] - middle[0]), Math.abs(p[1] - middle[1])]));
  const shape = places_m.map((p) => `${(c + (18 * (p[0] - middle[0])) / spread).toFixed(1)},${(c - (18 * (p[1] - middle[1])) / spread).toFixed(1)}`).join(" ");
  const best = look_rad[beam.indexOf(Math.max(...beam))];
  const compass = Math.round((90 - (best * 180) / Math.PI + 720) % 360);
  return svg(
    "svg",
    { viewBox: `0 0 ${SIDE} ${SIDE}`, width: SIDE, height: SIDE, role: "img", "aria-label": `Beam pattern, strongest towards ${compass} degrees`, class: "polar" },
    ...[0.5, 1].map((r) => svg("circle", { cx: c, cy: c, r: far * r, class: "ring" })),
    svg("polygon", { points: rim, class: "beam" }),
    svg("polyline", { points: shape, class: "elements" }),
    svg("text", { x: c, y: 11, class: "north" }, "N"),
  );
}

/** The tree, a clique a bar as wide as its subtree, roots on top: filled where it was computed anew. */
export function icicle({ parents, cliques, reused }) {
  const children = parents.map(() => []);
  const roots = [];
  parents.forEach((parent, n) => (parent < 0 ? roots : children[parent]).push(n));
  const weight = parents.map(() => 0);
  const depth = parents.map(() => 0);
  parents.forEach((parent, n) => (depth[n] = parent < 0 ? 0 : depth[parent] + 1));
  for (let n = parents.length - 1; n >= 0; n -= 1) weight[n] = Math.max(1, children[n].reduce((sum, child) => sum + weight[child], 0));
  const levels = Math.max(...depth) + 1;
  const row = (TREE.height - 2 * TREE.margin) / levels;
  const total = roots.reduce((sum, root) => sum + weight[root], 0);
  const scale = (TREE.width - 2 * TREE.margin) / total;
  const drawn = [];
  const place = (n, x) => {
    const bar = svg("rect", { x: TREE.margin + x * scale, y: TREE.margin + depth[n] * row, width: Math.max(0.5, weight[n] * scale - 0.4), height: Math.max(0.6, row - 0.4), class: reused[n] ? "kept" : "anew" });
    const [frontals, separator] = cliques[n].split(" | ");
    const message = separator ? `; its message to the clique above is about ${separator}` : "";
    bar.append(svg("title", {}, `${frontals}: ${reused[n] ? "reused" : "computed anew"}${message}`));
    drawn.push(bar);
    let from = x;
    for (const child of children[n]) {
      place(child, from);
      from += weight[child];
    }
  };
  let from = 0;
  for (const root of roots) {
    place(root, from);
    from += weight[root];
  }
  const kept = reused.reduce((sum, x) => sum + x, 0);
  return svg("svg", { viewBox: `0 0 ${TREE.width} ${TREE.height}`, width: TREE.width, height: TREE.height, role: "img", "aria-label": `Bayes tree of ${parents.length} cliques, ${kept} reused`, class: "icicle" }, ...drawn);
}

/** The factor graph so far: poses joined by odometry below, beacons above, fixes as squares; what is new is dark. */
export function graph(moments, n) {
  const { width, height, margin } = GRAPH;
  const poses = moments[n].pose + 1;
  const beacons = [...new Set(moments.slice(0, n + 1).flatMap((m) => m.factors.map((f) => f[2])))].filter(Boolean);
  const x = (pose) => margin + ((width - 2 * margin) * pose) / Math.max(1, poses - 1);
  const at = (beacon) => (width * (beacons.indexOf(beacon) + 1)) / (beacons.length + 1);
  const [top, chain] = [22, height - 26];
  const drawn = [svg("line", { x1: x(0), y1: chain, x2: x(poses - 1), y2: chain, class: "odometry" })];
  let [measured, fixes] = [0, 0];
  moments.slice(0, n + 1).forEach((moment, k) => {
    const age = k === n ? "anew" : "kept";
    for (const [first, last, beacon] of moment.factors) {
      if (beacon === null) {
        fixes += 1;
        drawn.push(svg("rect", { x: x(first) - 3, y: chain + 8, width: 6, height: 6, class: `fix ${age}` }));
        continue;
      }
      measured += 1;
      const middle = (x(first) + x(last)) / 2;
      drawn.push(svg("line", { x1: middle, y1: chain, x2: at(beacon), y2: top, class: `tie ${age}` }));
      if (last > first) drawn.push(svg("line", { x1: x(first), y1: chain, x2: x(last), y2: chain, class: `span ${age}` }));
    }
  });
  for (const beacon of beacons) {
    drawn.push(svg("circle", { cx: at(beacon), cy: top, r: 5, class: "beacon" }));
    drawn.push(svg("text", { x: at(beacon) + 8, y: top - 4 }, beacon));
  }
  const label = `Factor graph: ${poses} poses, ${measured} measurements, ${fixes} fixes`;
  return svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label, class: "factors" }, ...drawn);
}

/** Errors of beacons and poses (m), and the divergence from a Gaussian (nats), against the factors so far; n is marked. */
export function growth(moments, n) {
  const { width, left, right, top, errors, between, divergence } = GROWTH;
  const height = top + errors + between + divergence + 18;
  let factors = 0;
  const told = moments.some((m) => m.factors.length);
  const counts = moments.map((m) => (factors += told ? m.factors.filter((f) => f[2] !== null).length : 1));
  const x = (k) => left + ((width - left - right) * (counts[k] - counts[0])) / Math.max(1, factors - counts[0]);
  const beacons = [...new Set(moments.flatMap((m) => Object.keys(m.divergence)))];
  const lines = { mean: [], mode: [], poses: [moments.map((m) => m.errors.poses_m)] };
  for (const beacon of beacons) {
    lines.mean.push(moments.map((m) => m.errors.beacons[beacon]?.mean_m ?? null));
    lines.mode.push(moments.map((m) => m.errors.beacons[beacon]?.mode_m ?? null));
  }
  const nats = beacons.map((beacon) => moments.map((m) => m.divergence[beacon] ?? null));
  const drawn = [];
  const panel = (from, high, rows, unit) => {
    const known = rows.flatMap((row) => row.values).filter((v) => v !== null);
    if (!known.length) return;
    const decade = (v) => Math.log10(Math.max(v, 0.01));
    const low = Math.floor(Math.min(...known.map(decade)));
    const most = Math.max(low + 1, Math.ceil(Math.max(...known.map(decade))));
    const y = (v) => from + high * (1 - (decade(v) - low) / (most - low));
    for (let power = low; power <= most; power += 1) {
      drawn.push(svg("line", { x1: left, x2: width - right, y1: y(10 ** power), y2: y(10 ** power), class: "grid" }));
      if (power === low || power === most) drawn.push(svg("text", { x: left - 4, y: y(10 ** power) + 3.5, class: "tick" }, `${10 ** power} ${unit}`));
    }
    for (const { name, values } of rows) {
      const points = values.flatMap((v, k) => (v === null ? [] : [`${x(k).toFixed(1)},${y(v).toFixed(1)}`])).join(" ");
      drawn.push(svg("polyline", { points, class: name }));
      if (values[n] !== null) drawn.push(svg("circle", { cx: x(n), cy: y(values[n]), r: 2.5, class: name }));
    }
  };
  panel(top, errors, Object.entries(lines).flatMap(([name, all]) => all.map((values) => ({ name, values }))), "m");
  panel(top + errors + between, divergence, nats.map((values) => ({ name: "nats", values })), "nats");
  drawn.push(svg("line", { x1: x(n), x2: x(n), y1: top, y2: height - 18, class: "now" }));
  let at = 0;
  for (const [name, words] of Object.entries(ERRORS)) {
    drawn.push(svg("line", { x1: at, x2: at + 16, y1: 7, y2: 7, class: name }), svg("text", { x: at + 20, y: 10.5 }, words));
    at += 32 + 5.6 * words.length;
  }
  drawn.push(svg("text", { x: left, y: top + errors + between - 6 }, "divergence from a Gaussian"));
  drawn.push(svg("text", { x: width - right, y: height - 4, class: "tick" }, `${counts[0]} to ${factors} measurements`));
  const e = moments[n].errors;
  const off = [...beacons.map((b) => [b, e.beacons[b]?.mode_m]), ["poses", e.poses_m]].filter(([, v]) => v !== null && v !== undefined);
  const label = `Errors after ${counts[n]} of ${factors} measurements: ${off.map(([what, v]) => `${what} ${v.toFixed(2)} m`).join(", ") || "no truth is known"}`;
  return svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label, class: "growth" }, ...drawn);
}
