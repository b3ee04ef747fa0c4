// Curves over mission time; which quantities are drawn and how the trials are told is the person's choice.

import { el, part } from "../look/dom.js";
import { darkScheme } from "../look/palette.js";
import { loadPlotly } from "../look/plotly.js";
import { clock } from "../state/clock.js";
import { hover } from "../state/hover.js";
import { keepInLink, noteLink } from "../state/link.js";
import { store } from "../state/store.js";
import { zoom } from "../state/zoom.js";
import { TELLING, quantitiesOf } from "./curves.js";
import { buildPlot } from "./plot.js";

/** While estimates stream in, curves are drawn at most this often. */
const REDRAW_MS = 400;
/** So many quantities are drawn unless a person chooses. */
const USUAL = 4;

export function mountPlots() {
  /** chosen: keys of the quantities drawn, null for the usual ones. */
  const settings = { telling: "band", log: new Set(), chosen: null };
  const telling = el(
    "select",
    { id: "telling", "aria-label": "Trials as", onchange: () => change({ telling: telling.value }) },
    Object.entries(TELLING).map(([key, label]) => el("option", { value: key }, label)),
  );
  const choices = el("div", { class: "chips", role: "group", "aria-label": "Plots" });
  const pair = el("div", { class: "pair" });
  part("plots").append(el("div", { class: "plots-head" }, choices, telling), pair);

  const plots = new Map();
  let offered = "";
  let timer = 0;
  let drawnAt = 0;

  function change(values = {}) {
    Object.assign(settings, values);
    noteLink();
    draw();
  }

  const usual = (quantities) => quantities.slice(0, USUAL).map((q) => q.key);

  function toggle(key) {
    const quantities = quantitiesOf(store.state);
    const now = new Set(settings.chosen ?? usual(quantities));
    if (!now.delete(key)) now.add(key);
    const chosen = quantities.map((q) => q.key).filter((k) => now.has(k));
    change({ chosen: chosen.join() === usual(quantities).join() ? null : chosen });
  }

  function draw() {
    clearTimeout(timer);
    timer = 0;
    drawnAt = performance.now();
    const { state } = store;
    const quantities = quantitiesOf(state);
    const keys = quantities.map((q) => q.key);
    const drawn = settings.chosen?.filter((key) => keys.includes(key)) ?? usual(quantities);
    telling.value = settings.telling;
    telling.hidden = !state.view || (state.job?.trials ?? 1) <= 1;
    offer(quantities);
    for (const button of choices.children) button.setAttribute("aria-pressed", String(drawn.includes(button.dataset.key)));
    for (const [key, plot] of plots) {
      if (drawn.includes(key)) continue;
      plot.close();
      plots.delete(key);
    }
    drawn.forEach((key, n) => {
      const quantity = quantities.find((q) => q.key === key);
      if (plots.get(key)?.quantity.title !== quantity.title) {
        plots.get(key)?.close();
        plots.set(key, buildPlot(quantity, settings, change));
      }
      const { root } = plots.get(key);
      if (pair.children[n] !== root) pair.insertBefore(root, pair.children[n] ?? null);
    });
    for (const plot of plots.values()) plot.show();
  }

  function offer(quantities) {
    const wanted = JSON.stringify(quantities.map((q) => [q.key, q.title]));
    if (wanted === offered) return;
    offered = wanted;
    choices.replaceChildren(
      ...quantities.map((q) => el("button", { type: "button", class: "chip", "data-key": q.key, title: q.about, onclick: () => toggle(q.key) }, q.title)),
    );
  }

  const soon = () => {
    if (!timer) timer = setTimeout(draw, store.state.view ? 0 : Math.max(0, drawnAt + REDRAW_MS - performance.now()));
  };
  store.watch(["job", "view", "live", "vehicle", "algorithms", "hidden"], soon);
  // Plotly comes while the run is being read; where it cannot, the plots say so when they are to be drawn.
  store.watch(["run"], ({ run }) => run !== null && loadPlotly().catch(() => {}));
  darkScheme.addEventListener("change", soon);
  zoom.watch(soon);
  const point = () => plots.forEach((plot) => plot.point());
  let length = 0;
  clock.watch(() => {
    point();
    if (length !== clock.end - clock.start) soon();
    length = clock.end - clock.start;
  });
  hover.watch(point);

  keepInLink("plots", {
    write: () => settings.chosen?.join(",") ?? null,
    read: (text) => change({ chosen: text === null ? null : text.split(",") }),
  });
  keepInLink("log", {
    write: () => [...settings.log].join(",") || null,
    read: (text) => change({ log: new Set(text?.split(",").filter(Boolean)) }),
  });
  keepInLink("trials", {
    write: () => (settings.telling === "band" ? null : settings.telling),
    read: (text) => change({ telling: Object.hasOwn(TELLING, text) ? text : "band" }),
  });
}
