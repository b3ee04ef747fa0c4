// The map over the two sensors' noise, and the operating point on it, to be dragged or moved by arrow keys.

import { el } from "../look/dom.js";
import { loadPlotly, PLAIN, plainLayout, token } from "../look/plotly.js";
import * as api from "../wire/api.js";

const SIZE = 160;
const RANGE = { smallest: 0.05, largest: 60 };
const MARGIN = { l: 56, r: 12, t: 8, b: 46 };
const KEY_STEP = 1.08;

const COLOURINGS = {
  region: "Safe or dangerous",
  naive_to_single: "Naive actual / single sensor",
  naive_believed_to_actual: "Naive believed / actual",
  central_to_distributed: "Central / optimal distributed",
};

const known = new Map();
const regions = (kind) => {
  if (!known.has(kind)) {
    const asked = api.trackingRegions({ kind, size: SIZE, ...RANGE });
    asked.catch(() => known.delete(kind));
    known.set(kind, asked);
  }
  return known.get(kind);
};

/** The map of `point` {process, r1, r2, prior}; moved(resting) is told when the person changes r1 and r2. */
export function buildMap(point, { moved }) {
  const kind = select({ asymptotic: "Steady state (Fig. 7)", one_step: "One step (Fig. 5)" }, "Map");
  const colouring = select(COLOURINGS, "Colour");
  const drawing = el("div", { class: "drawing" });
  const handle = el("button", {
    type: "button",
    class: "handle",
    "aria-label": "Operating point: drag it, or move it with the arrow keys",
  });
  const canvas = el("div", { class: "canvas map-canvas" }, drawing, handle);
  const root = el("figure", { class: "plot region-map" }, el("figcaption", { class: "map-tools" }, kind.root, colouring.root), canvas);

  /** What the axes are in units of. */
  const unit = () => (kind.value() === "one_step" ? point.prior + point.process : point.process);
  const low = Math.log(RANGE.smallest);
  const high = Math.log(RANGE.largest);
  const clamp = (x) => Math.min(Math.max(x, 0), 1);
  const share = (r) => clamp((Math.log(r / unit()) - low) / (high - low));
  const value = (part) => unit() * Math.exp(low + clamp(part) * (high - low));

  function place() {
    const box = canvas.getBoundingClientRect();
    const width = box.width - MARGIN.l - MARGIN.r;
    const height = box.height - MARGIN.t - MARGIN.b;
    handle.style.setProperty("--x", `${MARGIN.l + share(point.r1) * width}px`);
    handle.style.setProperty("--y", `${MARGIN.t + (1 - share(point.r2)) * height}px`);
  }

  function follow(event) {
    const box = canvas.getBoundingClientRect();
    point.r1 = value((event.clientX - box.left - MARGIN.l) / (box.width - MARGIN.l - MARGIN.r));
    point.r2 = value(1 - (event.clientY - box.top - MARGIN.t) / (box.height - MARGIN.t - MARGIN.b));
  }
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    handle.focus();
    canvas.setPointerCapture(event.pointerId);
    follow(event);
    moved(false);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    follow(event);
    moved(false);
  });
  canvas.addEventListener("pointerup", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    canvas.releasePointerCapture(event.pointerId);
    moved(true);
  });
  handle.addEventListener("keydown", (event) => {
    const by = { ArrowRight: ["r1", KEY_STEP], ArrowLeft: ["r1", 1 / KEY_STEP], ArrowUp: ["r2", KEY_STEP], ArrowDown: ["r2", 1 / KEY_STEP] }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    point[by[0]] = value(share(point[by[0]] * by[1]));
    moved(true);
  });

  async function draw() {
    const [plotly, told] = await Promise.all([loadPlotly(), regions(kind.value())]);
    const mode = colouring.value();
    const scale = kind.value() === "one_step" ? "(P + Q)" : "Q";
    const axis = { type: "log", range: [Math.log10(RANGE.smallest), Math.log10(RANGE.largest)], dtick: 1 };
    const z = mode === "region" ? told.dangerous : told.ratios[mode];
    const field = {
      type: "heatmap",
      x: told.axis,
      y: told.axis,
      z,
      showscale: mode !== "region",
      colorbar: { thickness: 10, outlinewidth: 0 },
      colorscale:
        mode === "region" ? [[0, token("--good-soft")], [1, token("--bad-soft")]] : mode === "naive_to_single" ? "Cividis" : "Cividis",
      hovertemplate: mode === "region" ? "r₁ %{x:.3g}, r₂ %{y:.3g}<extra></extra>" : "r₁ %{x:.3g}, r₂ %{y:.3g}: %{z:.3g}<extra></extra>",
    };
    const edge = { color: token("--bad"), width: 2 };
    const hidden = { hoverinfo: "skip", type: "scatter", mode: "lines", line: edge };
    const marks = {
      type: "scatter",
      mode: "markers+text",
      x: told.figure_6.map((p) => p.r1),
      y: told.figure_6.map((p) => p.r2),
      text: told.figure_6.map((p) => `(${p.name})`),
      textposition: "top center",
      marker: { symbol: "cross", size: 9, color: token("--ink") },
      hovertemplate: "Fig. 6%{text}<extra></extra>",
    };
    const traces = [field, { ...hidden, x: told.axis, y: told.boundary }, { ...hidden, x: told.boundary, y: told.axis }];
    if (kind.value() === "asymptotic") traces.push(marks);
    const layout = plainLayout(
      MARGIN,
      { ...axis, title: { text: `r₁ = R₁ / ${scale}` } },
      { ...axis, title: { text: `r₂ = R₂ / ${scale}` } },
      mode === "region" ? { annotations: names() } : {},
    );
    await plotly.react(drawing, traces, layout, { ...PLAIN, staticPlot: true });
    place();
  }
  kind.root.addEventListener("change", () => draw());
  colouring.root.addEventListener("change", () => draw());
  new ResizeObserver(place).observe(canvas);
  return { root, place, draw };
}

/** The regions' names, written where they lie. */
function names() {
  const words = (text, x, y, colour) => ({ text, x: Math.log10(x), y: Math.log10(y), showarrow: false, font: { color: token(colour), size: 13 } });
  return [words("safe", 0.16, 0.16, "--good"), words("dangerous", 0.25, 25, "--bad"), words("dangerous", 25, 0.25, "--bad")];
}

function select(choices, label) {
  const input = el("select", {}, Object.entries(choices).map(([value, text]) => el("option", { value }, text)));
  return { root: el("label", { class: "choice" }, el("span", {}, label), input), value: () => input.value };
}
