// One plot: its curves, the cursor at the clock's time, the values there or under the pointer, its menu.

import { el, part, say } from "../look/dom.js";
import { clockTime } from "../look/format.js";
import { close as closeMenu, menu } from "../look/menu.js";
import { loadPlotly } from "../look/plotly.js";
import { sample } from "../look/swatch.js";
import { clock } from "../state/clock.js";
import { hover } from "../state/hover.js";
import { store } from "../state/store.js";
import { zoom } from "../state/zoom.js";
import { drawingOf, valueAt } from "./curves.js";
import { savePlot } from "./export.js";
import { MARGIN, figureOf } from "./figure.js";

/** A pointer that has moved less than this (px) has clicked, not brushed. */
const STILL = 4;

const NOTHING = {
  queued: "Waiting for the first trials…",
  running: "Waiting for the first trials…",
  failed: "The run failed before there was a curve.",
  cancelled: "The run was cancelled before there was a curve.",
};

/** A plot of a quantity; `settings` is {telling, log: Set of keys}, `changed()` is called when its menu changes them. */
export function buildPlot(quantity, settings, changed) {
  const whose = el("span", { class: "whose" });
  const how = el("span", { class: "how" });
  const log = el("button", { type: "button", class: "small log", title: "Logarithmic axis", onclick: () => turn() }, "log");
  const keep = menu(
    "menu",
    el("summary", { "aria-label": `Save ${quantity.title}` }, "Save"),
    el("div", { class: "choices" }, ["PNG", "SVG", "CSV"].map((format) => el("button", { type: "button", class: "small", onclick: () => save(format.toLowerCase()) }, format))),
  );
  const legend = el("div", { class: "legend" });
  const drawing = el("div", { class: "drawing" });
  const cursor = el("div", { class: "cursor", "aria-hidden": "true", hidden: true });
  const probe = el("div", { class: "cursor probe", "aria-hidden": "true", hidden: true }, el("span"));
  const brush = el("div", { class: "brush", "aria-hidden": "true", hidden: true });
  const empty = el("p", { class: "quiet" });
  const canvas = el("div", { class: "canvas", title: "Click: go there. Drag: zoom. Double click: all of it." }, drawing, cursor, probe, brush, empty);
  const head = el("div", { class: "head" }, el("span", { class: "name", title: quantity.about }, quantity.title), whose, how, log, keep);
  const root = el("figure", { class: "plot", "data-quantity": quantity.key }, el("figcaption", {}, head, legend), canvas);

  let shown = { curves: [], bounds: null };
  let values = [];
  let visible = false;
  let stale = false;

  function turn() {
    if (!settings.log.delete(quantity.key)) settings.log.add(quantity.key);
    changed();
  }

  function plotted() {
    const { job, vehicle } = store.state;
    return {
      ...shown,
      axis: `(${quantity.unit})`,
      title: `${quantity.title} (${quantity.unit})`,
      span: zoom.span,
      total: clock.end - clock.start,
      logarithmic: !quantity.linear && settings.log.has(quantity.key),
      heading: [`${quantity.title} of ${vehicle}`, shown.how, job.title].filter(Boolean).join(" · "),
      name: [job.scenario ?? "run", vehicle, quantity.key].join("-").replace(/[^\w.-]+/g, "_"),
    };
  }

  async function save(format) {
    closeMenu(keep);
    await savePlot(format, plotted());
  }

  /** Takes the state in; draws now if it can be seen, else when it can. */
  function show() {
    const { state } = store;
    shown = drawingOf(quantity, state, settings.telling);
    say(whose, state.vehicle ? ` of ${state.vehicle}` : "");
    say(how, shown.how);
    log.hidden = Boolean(quantity.linear);
    log.setAttribute("aria-pressed", String(settings.log.has(quantity.key)));
    keep.hidden = !shown.curves.length;
    empty.hidden = shown.curves.length > 0;
    const none = state.view && state.hidden.algorithms.size ? "Nothing of what is shown has this." : "There is none of this vehicle.";
    empty.textContent = (state.job?.state === "done" || state.view ? none : NOTHING[state.job?.state]) ?? "";
    values = [];
    legend.replaceChildren(
      ...shown.curves.map((curve) => {
        const value = el("span", { class: "value" });
        values.push([value, curve]);
        return el("span", { class: "entry", title: curve.title }, sample(curve), el("span", { class: "unseen" }, curve.title), value);
      }),
    );
    point();
    stale = true;
    if (visible) draw();
  }

  async function draw() {
    stale = false;
    if (!store.state.job || !(shown.curves.length || drawing.data)) return;
    try {
      const Plotly = await loadPlotly();
      if (store.state.job === null) return;
      const { data, layout } = figureOf(plotted());
      await Plotly.react(drawing, data, layout, { displayModeBar: false, responsive: false, doubleClick: false });
    } catch (error) {
      empty.hidden = false;
      empty.textContent = error.message;
    }
  }

  /** Puts the cursor where the clock is and the probe under the pointer, and the curves' values there into the legend. */
  function point() {
    const width = canvas.clientWidth - MARGIN.l - MARGIN.r;
    const [from, to] = zoom.span;
    const put = (line, time) => {
      line.hidden = time === null || time < from || time > to || to <= from || !shown.curves.length || width <= 0;
      if (!line.hidden) line.style.transform = `translateX(${(MARGIN.l + ((time - from) / (to - from)) * width).toFixed(1)}px)`;
    };
    put(cursor, clock.time);
    put(probe, hover.time);
    if (!probe.hidden) say(probe.firstChild, clockTime(hover.time));
    for (const [node, curve] of values) say(node, quantity.format(valueAt(curve, hover.time ?? clock.time)));
  }

  const share = (event) => {
    const box = canvas.getBoundingClientRect();
    return Math.min(Math.max((event.clientX - box.left - MARGIN.l) / (box.width - MARGIN.l - MARGIN.r), 0), 1);
  };
  const timeAt = (place) => {
    const [from, to] = zoom.span;
    return from + place * (to - from);
  };
  let pressed = null;
  const release = () => {
    pressed = null;
    brush.hidden = true;
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    hover.at(null);
    if (event.shiftKey) clock.seek(timeAt(share(event)));
    else pressed = { x: event.clientX, place: share(event) };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (pressed) {
      const [a, b] = [pressed.place, share(event)].sort((one, other) => one - other);
      brush.hidden = Math.abs(event.clientX - pressed.x) < STILL;
      const width = canvas.clientWidth - MARGIN.l - MARGIN.r;
      brush.style.left = `${MARGIN.l + a * width}px`;
      brush.style.width = `${(b - a) * width}px`;
    } else if (event.buttons === 1 && event.shiftKey) clock.seek(timeAt(share(event)));
    else hover.at(timeAt(share(event)));
  });
  canvas.addEventListener("pointerup", (event) => {
    if (!pressed) return;
    const moved = Math.abs(event.clientX - pressed.x) >= STILL;
    const here = timeAt(share(event));
    if (moved) zoom.show(timeAt(pressed.place), here);
    else clock.seek(here);
    release();
  });
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("lostpointercapture", release);
  canvas.addEventListener("dblclick", () => zoom.reset());
  canvas.addEventListener("pointerleave", () => hover.at(null));
  const size = new ResizeObserver(() => {
    if (drawing.data && canvas.clientWidth) window.Plotly.Plots.resize(drawing);
    point();
  });
  const sight = new IntersectionObserver(
    ([entry]) => {
      visible = entry.isIntersecting;
      if (visible && stale) draw();
    },
    { root: part("stage"), rootMargin: "300px" },
  );
  size.observe(canvas);
  sight.observe(canvas);

  /** Takes it off the page. What observes it, and plotly, would keep it. */
  function close() {
    size.disconnect();
    sight.disconnect();
    if (drawing.data) window.Plotly.purge(drawing);
    root.remove();
  }

  return { quantity, root, show, point, close };
}
