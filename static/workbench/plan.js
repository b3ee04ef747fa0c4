// A plan of the mission, seen from above, drawn on a canvas: for browsers without WebGL, and for whoever prefers it.

import { vehicleColour } from "../look/palette.js";
import { token } from "../look/plotly.js";
import { indexAt } from "../state/samples.js";

const MARGIN = 26;
const CORNERS = 48;
/** Ellipses along a track, and how long a packet's ray is seen: a share of the mission, at least so many seconds. */
const RINGS = 20;
const RAY_SHARE = 0.006;
const RAY_S = 3;
/** Mahalanobis radius of the 95 % region in the plane. */
const RADIUS_95 = Math.sqrt(-2 * Math.log(0.05));

/** Estimates of a run by algorithm: {time_s, subjects: {S: {mean, cov}}}, of the view, else of what has streamed in. */
function tracksOf({ view, live }, algorithm) {
  const told = view?.algorithms[algorithm];
  if (told && Object.values(told.subjects).some((s) => s.mean.length)) return { time_s: view.time_s, subjects: told.subjects };
  return live?.algorithms[algorithm] ?? null;
}

/** The square of the plane {x, y, half} m that holds everything a run has. */
export function extentOf({ view, live }) {
  const points = [
    ...Object.values(view?.truth ?? {}).flat(),
    ...Object.values(view?.algorithms ?? live?.algorithms ?? {}).flatMap((a) => Object.values(a.subjects).flatMap((s) => s.mean)),
  ].filter((p) => p && Number.isFinite(p[0]) && p[0] !== null && p[1] !== null);
  if (!points.length) return { x: 0, y: 0, half: 500 };
  let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [x, y] of points) [west, east, south, north] = [Math.min(west, x), Math.max(east, x), Math.min(south, y), Math.max(north, y)];
  return { x: (west + east) / 2, y: (south + north) / 2, half: Math.max(east - west, north - south, 10) / 2, wide: (east - west) / 2, high: (north - south) / 2 };
}

/**
 * Draws a run's state into a canvas. `algorithms` are {name, colour}: one in the vehicles' colours (colour null), or several
 * each in its own; `where` {x, y, half} is the square shown; options as of the panes.
 */
export function drawPlan(canvas, state, algorithms, moment, where, options) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !height) return;
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  // Drawn by the processor: thin lines are no work for it, and much for WebGL in software.
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = token("--water");
  pen.fillRect(0, 0, width, height);

  const scale = Math.min((width - 2 * MARGIN) / (2 * (where.wide ?? where.half)), (height - 2 * MARGIN) / (2 * (where.high ?? where.half)));
  const paper = { pen, width, height, scale, place: ([x, y]) => [width / 2 + (x - where.x) * scale, height / 2 - (y - where.y) * scale] };
  grid(paper, where);
  const subjects = state.view?.subjects ?? Object.keys(Object.values(state.live?.algorithms ?? {})[0]?.subjects ?? {}).map((name) => ({ name, kind: "auv" }));
  const shown = subjects.map((s, n) => ({ ...s, colour: vehicleColour(n) })).filter((s) => !options.hidden.has(s.name));
  const truth = Object.fromEntries(shown.map((s) => [s.name, between(state.view?.time_s ?? [], state.view?.truth[s.name] ?? [], moment)]));
  const sigma = options.sigma === 95 ? RADIUS_95 : options.sigma;

  for (const { name, kind } of shown) if (kind !== "fixed") line(paper, state.view?.truth[name] ?? [], { colour: token("--ink-2"), width: 1, dash: [4, 3] });
  if (options.rays && state.view) rays(paper, state.view, truth, shown, moment);
  for (const { name: algorithm, colour } of algorithms) {
    const track = tracksOf(state, algorithm);
    if (!track) continue;
    for (const subject of shown) {
      const belief = track.subjects[subject.name];
      if (!belief?.mean.length) continue;
      const ink = colour ?? subject.colour;
      const n = indexAt(track.time_s, moment);
      const now = between(track.time_s, belief.mean, moment);
      if (!now) continue;
      if (subject.kind !== "fixed" && options.trails) line(paper, [...belief.mean.slice(0, n + 1), now], { colour: ink, width: 1.8 });
      if (subject.kind !== "fixed" && options.ellipses) {
        const step = Math.max(1, Math.floor(track.time_s.length / RINGS));
        for (let k = 0; k <= n; k += step) ring(paper, belief.mean[k], belief.cov[k], sigma, { colour: ink, width: 0.8, alpha: 0.6 });
      }
      if (truth[subject.name]) line(paper, [now, truth[subject.name]], { colour: colour ?? token("--ink-2"), width: 2 });
      ring(paper, now, between(track.time_s, belief.cov, moment), sigma, { colour: ink, width: 2.2 });
      if (algorithms.length === 1) dot(paper, now, ink, subject.kind === "fixed" ? 3.5 : 5);
    }
  }
  for (const subject of shown) {
    const track = algorithms.length ? tracksOf(state, algorithms[0].name) : null;
    const estimate = track?.subjects[subject.name] ? between(track.time_s, track.subjects[subject.name].mean, moment) : null;
    const at = truth[subject.name] ?? estimate;
    if (at && (algorithms.length > 1 || !estimate)) dot(paper, at, subject.colour, 4.5);
    if (at && algorithms.length === 1 && truth[subject.name]) dot(paper, truth[subject.name], token("--ink-2"), 2.5);
    if (at) text(paper, subject.name, (algorithms.length === 1 && estimate) || at);
  }
  bearings(paper);
}

/** A row of numbers interpolated at a time; held at the ends, null where nothing is known. */
function between(times, rows, t) {
  const n = indexAt(times, t);
  const here = rows[Math.max(n, 0)];
  const next = rows[n + 1];
  if (!here || here[0] === null) return null;
  if (n < 0 || !next || next[0] === null) return here;
  const share = (t - times[n]) / (times[n + 1] - times[n]);
  return here.map((v, i) => v + share * (next[i] - v));
}

function line({ pen, place }, points, { colour, width, dash = [], alpha = 1 }) {
  pen.beginPath();
  let up = true;
  for (const point of points) {
    if (!point || point[0] === null) up = true;
    else {
      const [x, y] = place(point);
      if (up) pen.moveTo(x, y);
      else pen.lineTo(x, y);
      up = false;
    }
  }
  Object.assign(pen, { strokeStyle: colour, lineWidth: width, globalAlpha: alpha, lineJoin: "round" });
  pen.setLineDash(dash);
  pen.stroke();
  pen.globalAlpha = 1;
  pen.setLineDash([]);
}

/** The ellipse of a belief, mean m and covariance (xx, xy, yy) m². */
function ring(paper, mean, cov, sigma, style) {
  if (!mean || !cov || mean[0] === null || cov[0] === null) return;
  const [xx, xy, yy] = cov;
  const half = (xx + yy) / 2;
  const root = Math.hypot((xx - yy) / 2, xy);
  const [a, b] = [Math.sqrt(Math.max(half + root, 0)) * sigma, Math.sqrt(Math.max(half - root, 0)) * sigma];
  if (a * paper.scale < 1.5) return;
  const turn = 0.5 * Math.atan2(2 * xy, xx - yy);
  const [c, s] = [Math.cos(turn), Math.sin(turn)];
  const points = Array.from({ length: CORNERS + 1 }, (_, k) => {
    const angle = (2 * Math.PI * k) / CORNERS;
    const [u, v] = [a * Math.cos(angle), b * Math.sin(angle)];
    return [mean[0] + c * u - s * v, mean[1] + s * u + c * v];
  });
  line(paper, points, style);
}

function rays(paper, view, truth, shown, moment) {
  const last = Math.max(RAY_S, RAY_SHARE * (view.time_s.at(-1) ?? 0));
  for (const packet of view.events) {
    if (packet.kind !== "packet" || packet.tol_s > moment || moment > packet.toa_s + last) continue;
    const [from, to] = [truth[packet.from], truth[packet.to]];
    if (!from || !to) continue;
    const age = Math.min(Math.max((moment - packet.toa_s) / last, 0), 1);
    line(paper, [from, to], { colour: packet.heard ? shown.find((s) => s.name === packet.from).colour : token("--mark-lost"), width: 1.6, alpha: 1 - 0.85 * age });
  }
}

function dot({ pen, place }, point, colour, radius) {
  const [x, y] = place(point);
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = colour;
  pen.fill();
}

function text({ pen, place, width }, words, point) {
  const [x, y] = place(point);
  Object.assign(pen, { font: `12px ${token("--sans")}`, textAlign: x > width - 60 ? "right" : "left", textBaseline: "bottom", lineWidth: 3, strokeStyle: token("--water"), fillStyle: token("--ink") });
  pen.strokeText(words, x + (x > width - 60 ? -7 : 7), y - 4);
  pen.fillText(words, x + (x > width - 60 ? -7 : 7), y - 4);
}

/** The next smaller of 1, 2, 5 times a power of ten. */
function round(metres) {
  const power = 10 ** Math.floor(Math.log10(metres));
  return [5, 2, 1].find((n) => n * power <= metres * (1 + 1e-9)) * power;
}

function grid(paper, where) {
  const { pen, width, height, scale } = paper;
  const cell = round(80 / scale);
  const [west, north] = [where.x - width / 2 / scale, where.y + height / 2 / scale];
  pen.strokeStyle = token("--line");
  pen.lineWidth = 1;
  pen.beginPath();
  for (let x = Math.ceil(west / cell) * cell; (x - west) * scale < width; x += cell) {
    pen.moveTo((x - west) * scale, 0);
    pen.lineTo((x - west) * scale, height);
  }
  for (let y = Math.floor(north / cell) * cell; (north - y) * scale < height; y -= cell) {
    pen.moveTo(0, (north - y) * scale);
    pen.lineTo(width, (north - y) * scale);
  }
  pen.stroke();
}

/** A distance scale in the south-west, an arrow to the north in the north-east. */
function bearings({ pen, width, height, scale }) {
  const length = round(Math.min(width / 4, 140) / scale);
  const [x, y] = [12, height - 12];
  Object.assign(pen, { strokeStyle: token("--ink-2"), fillStyle: token("--ink-2"), lineWidth: 1.5, font: `11.5px ${token("--sans")}`, textAlign: "center", textBaseline: "bottom" });
  pen.beginPath();
  pen.moveTo(x, y - 4);
  pen.lineTo(x, y);
  pen.lineTo(x + length * scale, y);
  pen.lineTo(x + length * scale, y - 4);
  const east = width - 18;
  pen.moveTo(east, 44);
  pen.lineTo(east, 20);
  pen.moveTo(east - 4, 26);
  pen.lineTo(east, 20);
  pen.lineTo(east + 4, 26);
  pen.stroke();
  pen.fillText(length >= 1000 ? `${length / 1000} km` : `${length} m`, x + (length * scale) / 2, y - 4);
  pen.fillText("N", east, 18);
}
