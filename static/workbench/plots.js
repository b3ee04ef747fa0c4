// Curves over mission time; cursors are overlays, so that moving them draws nothing anew.

import { el, part, say } from "../look/dom.js";
import { clockTime } from "../look/format.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { loadPlotly } from "../look/plotly.js";
import { lineSample } from "../look/swatch.js";
import { clock } from "../state/clock.js";
import { store } from "../state/store.js";
import { QUANTITIES, curvesOf, valueAt } from "./curves.js";

const MARGIN = { l: 52, r: 14, t: 6, b: 36 };
/** While estimates stream in, curves are drawn at most this often. */
const REDRAW_MS = 400;

/** Mission time under the pointer in any of the plots, or null; the curves' values are read there. */
let hovered = null;
let hover = () => {};

export function mountPlots() {
  const logarithmic = el("input", { type: "checkbox", id: "log" });
  const plots = QUANTITIES.map(build);
  part("plots").append(
    el("label", { class: "toggle" }, logarithmic, "Logarithmic"),
    el("div", { class: "pair" }, plots.map((p) => p.root)),
  );

  let timer = 0;
  let drawnAt = 0;
  const draw = () => {
    timer = 0;
    drawnAt = performance.now();
    for (const plot of plots) show(plot, logarithmic.checked);
  };
  const soon = () => {
    if (!timer) timer = setTimeout(draw, store.state.view ? 0 : Math.max(0, drawnAt + REDRAW_MS - performance.now()));
  };
  store.watch(["job", "view", "live", "vehicle", "algorithms", "hidden"], soon);
  logarithmic.addEventListener("change", soon);
  darkScheme.addEventListener("change", soon);
  clock.watch(() => plots.forEach(point));
  hover = (time) => {
    hovered = time;
    plots.forEach(point);
  };
}

function build(quantity) {
  const whose = el("span", { class: "whose" });
  const legend = el("div", { class: "legend" });
  const drawing = el("div", { class: "drawing" });
  const cursor = el("div", { class: "cursor", "aria-hidden": "true", hidden: true });
  const probe = el("div", { class: "cursor probe", "aria-hidden": "true", hidden: true }, el("span"));
  const empty = el("p", { class: "quiet" });
  const canvas = el("div", { class: "canvas" }, drawing, cursor, probe, empty);
  const caption = el("figcaption", {}, el("span", { class: "name" }, quantity.title), whose, legend);
  const root = el("figure", { class: "plot", "data-quantity": quantity.key }, caption, canvas);
  const plot = { quantity, root, caption, whose, legend, drawing, cursor, probe, canvas, empty, curves: new Map(), values: new Map(), scale: 1 };
  const timeAt = (event) => {
    const box = canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - MARGIN.l) / (box.width - MARGIN.l - MARGIN.r);
    return clock.start + Math.min(Math.max(share, 0), 1) * (clock.end - clock.start);
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    hover(null);
    clock.seek(timeAt(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons === 1) clock.seek(timeAt(event));
    else hover(timeAt(event));
  });
  canvas.addEventListener("pointerleave", () => hover(null));
  new ResizeObserver(() => {
    if (drawing.data) window.Plotly.Plots.resize(drawing);
    point(plot);
  }).observe(canvas);
  return plot;
}

const NOTHING = {
  queued: "Waiting for the first trials…",
  running: "Waiting for the first trials…",
  done: "There is no reference to compare with.",
  failed: "The run failed before there was a curve.",
  cancelled: "The run was cancelled before there was a curve.",
};

async function show(plot, logarithmic) {
  const { state } = store;
  const { quantity, legend, empty } = plot;
  plot.curves = curvesOf(quantity, state);
  say(plot.whose, state.vehicle ? ` of ${state.vehicle}` : "");
  plot.caption.title = quantity.how(state.view ? (state.job?.trials ?? 1) : 1);
  plot.root.hidden = Boolean(quantity.extra) && plot.curves.size === 0;
  empty.hidden = plot.curves.size > 0;
  empty.textContent = NOTHING[state.job?.state] ?? "";
  plot.values = new Map();
  legend.replaceChildren(
    ...[...plot.curves.keys()].map((name) => {
      const value = el("span", { class: "value" });
      plot.values.set(name, value);
      const title = titleOf(name, state);
      return el("span", { class: "entry", title }, lineSample(name, state.algorithms ?? []), el("span", { class: "title" }, title), value);
    }),
  );
  point(plot);
  if (!state.job || !(plot.curves.size || plot.drawing.data)) return;
  try {
    const Plotly = await loadPlotly();
    if (store.state.job === null) return;
    const drawn = figure(plot, store.state, logarithmic);
    await Plotly.react(plot.drawing, drawn.data, drawn.layout, { displayModeBar: false, responsive: false, doubleClick: false });
  } catch (error) {
    empty.hidden = false;
    empty.textContent = error.message;
    return;
  }
  point(plot);
}

function titleOf(name, { algorithms }) {
  return algorithms?.find((a) => a.name === name)?.title ?? name;
}

/** Seconds of a tick unit that suits a mission's length. */
function timeUnit(length) {
  if (length <= 600) return [1, "s"];
  return length <= 6 * 3600 ? [60, "min"] : [3600, "h"];
}

function figure(plot, state, logarithmic) {
  const style = getComputedStyle(plot.root);
  const ink = style.getPropertyValue("--ink-2").trim();
  const grid = style.getPropertyValue("--line").trim();
  const [unit, unitName] = timeUnit(clock.end - clock.start);
  const axis = { color: ink, gridcolor: grid, linecolor: grid, zeroline: false, fixedrange: true, automargin: false, tickfont: { size: 11 } };
  const data = [...plot.curves].map(([name, { time_s, value }]) => {
    const { colour, dash } = lineStyle(name, state.algorithms ?? []);
    return {
      type: "scatter",
      mode: "lines",
      name: titleOf(name, state),
      meta: name,
      x: time_s.map((t) => t / unit),
      y: value,
      line: { color: colour, width: 1.8, dash: dash ? dash.split(" ").map((d) => `${d}px`).join(",") : "solid" },
      hoverinfo: "skip",
    };
  });
  const layout = {
    margin: MARGIN,
    showlegend: false,
    autosize: true,
    dragmode: false,
    hovermode: false,
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: style.fontFamily, size: 12, color: ink },
    xaxis: { ...axis, range: [clock.start / unit, clock.end / unit], title: { text: `mission time (${unitName})`, standoff: 6, font: { size: 12 } } },
    yaxis: {
      ...axis,
      type: logarithmic ? "log" : "linear",
      rangemode: logarithmic ? "normal" : "tozero",
      title: { text: `${plot.quantity.title.toLowerCase()} (${plot.quantity.unit})`, standoff: 4, font: { size: 12 } },
    },
  };
  return { data, layout };
}

/** Puts the cursor where the clock is and the probe under the pointer, and the curves' values there into the legend. */
function point(plot) {
  const width = plot.canvas.clientWidth - MARGIN.l - MARGIN.r;
  const shown = clock.end > clock.start && plot.curves.size > 0 && width > 0;
  const put = (line, time) => {
    line.hidden = !shown || time === null;
    if (line.hidden) return;
    const share = (time - clock.start) / (clock.end - clock.start);
    line.style.transform = `translateX(${(MARGIN.l + share * width).toFixed(1)}px)`;
  };
  put(plot.cursor, clock.time);
  put(plot.probe, hovered);
  if (hovered !== null) say(plot.probe.firstChild, clockTime(hovered));
  for (const [name, value] of plot.values) say(value, plot.quantity.format(valueAt(plot.curves.get(name), hovered ?? clock.time)));
}
