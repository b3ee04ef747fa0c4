// A small picture of a mission, drawn from its scenario: paths of vehicles, ellipses of sensors, places in a formation.

import { svg } from "../look/dom.js";
import { vehicleColour } from "../look/palette.js";

const turn = ([x, y], degrees) => {
  const a = (degrees * Math.PI) / 180;
  return [x * Math.cos(a) - y * Math.sin(a), x * Math.sin(a) + y * Math.cos(a)];
};
const plus = ([a, b], [c, d]) => [a + c, b + d];

/** Corner points of a path, in metres; curves by enough of them to look round. */
const PATHS = {
  waypoints: (p) => (p.repeat ? [...p.points_m, p.points_m[0]] : p.points_m),
  lawnmower: (p) => {
    const points = [];
    for (let n = 0; n < p.lines; n += 1) {
      const ends = [
        [0, n * p.spacing_m],
        [p.line_length_m, n * p.spacing_m],
      ];
      points.push(...(n % 2 ? ends.reverse() : ends));
    }
    return points.map((point) => plus(p.start_m, turn(point, p.heading_deg ?? 0)));
  },
  loiter: (p) =>
    Array.from({ length: 49 }, (_, n) => {
      const a = (n / 24) * Math.PI;
      const point = [p.radius_m * Math.cos(a), (p.radius_y_m ?? p.radius_m) * Math.sin(a)];
      return plus(p.center_m, turn(point, p.rotation_deg ?? 0));
    }),
  diamond: (p) => {
    const [rx, ry] = [p.radius_m, p.radius_y_m ?? p.radius_m];
    const corners = [[rx, 0], [0, ry], [-rx, 0], [0, -ry], [rx, 0]];
    return corners.map((corner) => plus(p.center_m, corner));
  },
  drift: (p) =>
    Array.from({ length: 33 }, (_, n) => {
      const a = (n / 16) * Math.PI;
      return plus(p.start_m, [p.wander_m * Math.sin(2 * a), p.wander_m * Math.sin(3 * a + 1)]);
    }),
  station: (p) => [p.position_m],
};

function points(vehicle) {
  const draw = PATHS[vehicle.path?.kind];
  return draw ? draw(vehicle.path) : [];
}

const ring = ([rx, ry], degrees = 0) =>
  Array.from({ length: 49 }, (_, n) => turn([rx * Math.cos((n / 24) * Math.PI), ry * Math.sin((n / 24) * Math.PI)], degrees));

/** Lines of a scenario in metres, one for each vehicle or sensor; a single point for what stays. */
const LINES = {
  tracking: ({ sensors = [] }) => [
    [[0, 0]],
    ...sensors.map(({ ellipse, variance_m2 }) =>
      ellipse ? ring([Math.sqrt(ellipse.along_m2), Math.sqrt(ellipse.across_m2)], ellipse.angle_deg) : ring([Math.sqrt(variance_m2), Math.sqrt(variance_m2)]),
    ),
  ],
  pursuit: ({ target, formation }) => {
    if (!formation) return [];
    const length = formation.length_m ?? 1;
    const places = (FORMATIONS[formation.kind] ?? formation.offsets_m).map(([x, y]) => [x * length, y * length]);
    const wander = Array.from({ length: 33 }, (_, n) => [(n / 16 - 2) * length, 0.25 * length * Math.sin((n * Math.PI) / 16)]);
    return [wander.reverse(), ...places.map((place) => [place])].map((line) => line.map((point) => plus(target.start_m ?? [0, 0], point)));
  },
  slam: ({ vehicle, beacon, vehicles = [] }) => [vehicle, beacon, ...vehicles].filter(Boolean).map(points),
};

/** Places about the target, in lengths of the formation (C19 Fig. 3-5). */
const FORMATIONS = {
  inner: [
    [0, 1],
    [-0.87, -0.5],
    [0.87, -0.5],
  ],
  outer: [
    [-0.5, -0.7],
    [0.5, -0.7],
    [0, -1.58],
  ],
  line: [
    [-0.67, -0.8],
    [0, -0.93],
    [0.67, -0.8],
  ],
};

function linesOf(scenario) {
  if (!scenario) return [];
  const lines = LINES[scenario.family]?.(scenario) ?? [];
  return lines.some((line) => line.length) ? lines : (scenario.vehicles ?? []).map(points);
}

/** An SVG of the scenario, or the sign of a recording where there is nothing to draw. */
export function sketch(scenario, width, height) {
  const drawing = svg("svg", { class: "sketch", viewBox: `0 0 ${width} ${height}`, width, height, "aria-hidden": "true" });
  const paths = linesOf(scenario);
  const all = paths.flat();
  if (!all.length) {
    if (scenario) drawing.append(recording(width, height));
    return drawing;
  }
  const [xs, ys] = [all.map((p) => p[0]), all.map((p) => p[1])];
  const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const margin = 0.12 * Math.min(width, height) + 2;
  const scale = Math.min((width - 2 * margin) / (right - left || 1), (height - 2 * margin) / (high - low || 1));
  const place = ([x, y]) => [
    (width / 2 + (x - (left + right) / 2) * scale).toFixed(1),
    (height / 2 - (y - (low + high) / 2) * scale).toFixed(1),
  ];
  paths.forEach((path, n) => {
    if (!path.length) return;
    const colour = vehicleColour(n);
    const line = { points: path.map((p) => place(p).join(",")).join(" "), stroke: colour };
    if (path.length > 1) drawing.append(svg("polyline", line));
    if (scenario.family === "tracking" && path.length > 1) return;
    const [cx, cy] = place(path[0]);
    const r = Math.max(1.8, height / 40);
    drawing.append(svg("circle", { cx, cy, r, fill: colour }));
  });
  return drawing;
}

/** The sign of a recorded log: a trace of readings. */
function recording(width, height) {
  const middle = height / 2;
  const heights = [2, 5, 3, 8, 12, 6, 10, 4, 7, 3, 5, 2].map((h) => (h * height) / 40);
  const step = (0.7 * width) / (heights.length - 1);
  return svg(
    "g",
    { class: "recording" },
    heights.map((h, n) => {
      const x = (0.15 * width + n * step).toFixed(1);
      return svg("line", { x1: x, x2: x, y1: middle - h, y2: middle + h });
    }),
  );
}
