// One plot: its curves, what they are at the clock's time or under the pointer, its menu.

import { el, part, say } from "../look/dom.js";
import { close as closeMenu, menu } from "../look/menu.js";
import { loadPlotly } from "../look/plotly.js";
import { sample } from "../look/swatch.js";
import { clock } from "../state/clock.js";
import { hover } from "../state/hover.js";
import { store } from "../state/store.js";
import { zoom } from "../state/zoom.js";
import { drawingOf, valueAt } from "./curves.js";
import { savePlot } from "./export.js";
import { figureOf } from "./figure.js";
import { overTime } from "./timeaxis.js";

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
  const empty = el("p", { class: "quiet" });
  const canvas = el("div", { class: "canvas" }, drawing, empty);
  const head = el("div", { class: "head" }, el("span", { class: "name", title: quantity.about }, quantity.title), whose, how, log, keep);
  const root = el("figure", { class: "plot", "data-quantity": quantity.key }, el("figcaption", {}, head, legend), canvas);

  const { own } = quantity;
  const pointed = own ? null : overTime(canvas);
  let shown = { curves: [], bounds: null };
  let width = 0;
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
    await savePlot(format, plotted(), own);
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
      const { data, layout } = (own?.figure ?? figureOf)(plotted());
      await Plotly.react(drawing, data, layout, { displayModeBar: false, responsive: false, doubleClick: false });
    } catch (error) {
      empty.hidden = false;
      empty.textContent = error.message;
    }
  }

  /** Puts the lines at the clock's and the pointer's time, and the curves' values there into the legend. */
  function point() {
    pointed?.(shown.curves.length ? width : 0);
    for (const [node, curve] of values) say(node, own ? own.told(curve) : quantity.format(valueAt(curve, hover.time ?? clock.time)));
  }

  const size = new ResizeObserver(() => {
    width = canvas.clientWidth;
    if (drawing.data && width) window.Plotly.Plots.resize(drawing);
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
