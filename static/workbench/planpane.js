// A plan in a pane: a canvas that is drawn again when the run, the clock, the options or its size change.

import { el } from "../look/dom.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { clock } from "../state/clock.js";
import { paneState } from "../state/panes.js";
import { store } from "../state/store.js";
import { drawPlan, extentOf } from "./plan.js";

const CLOSEST = 200;

/** What all plans show: moved by hand {x, y} m and zoom; null as long as everything is to be seen. */
const moved = { by: null, zoom: 1 };
const plans = new Set();
let frame = 0;
let extent = null;

/** A canvas that shows the plan of some algorithms, by `names()`. */
export function planPane(names, label) {
  const canvas = el("canvas", { class: "plan", role: "img", tabindex: 0, "aria-label": `${label}; wheel or plus and minus zoom, drag moves, zero shows all` });
  const plan = { canvas, names };
  plans.add(plan);
  const size = new ResizeObserver(soon);
  size.observe(canvas);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 400));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const act = { "+": () => zoom(1.3), "=": () => zoom(1.3), "-": () => zoom(1 / 1.3), 0: () => ((moved.zoom = 1), (moved.by = null), soon()) }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons !== 1) return;
    const { wide, high, half } = whole();
    const scale = Math.min(canvas.clientWidth / (2 * (wide ?? half)), canvas.clientHeight / (2 * (high ?? half))) * moved.zoom;
    moved.by = { x: (moved.by?.x ?? 0) - event.movementX / scale, y: (moved.by?.y ?? 0) + event.movementY / scale };
    soon();
  });
  soon();
  return {
    canvas,
    close() {
      size.disconnect();
      plans.delete(plan);
    },
  };
}

function zoom(factor) {
  moved.zoom = Math.min(Math.max(moved.zoom * factor, 0.5), CLOSEST);
  soon();
}

function whole() {
  extent ??= extentOf(store.state);
  return extent;
}

function soon() {
  frame ||= requestAnimationFrame(() => {
    frame = 0;
    drawPlans();
  });
}

/** Draws all plans now. */
export function drawPlans() {
  const { state } = store;
  if (!plans.size || (!state.view && !state.live)) return;
  const options = { ...paneState.state, hidden: state.hidden.vehicles };
  const { x, y, half, wide, high } = whole();
  const centre = (options.follow && followed(state)) || { x: x + (moved.by?.x ?? 0), y: y + (moved.by?.y ?? 0) };
  const zoomed = moved.zoom * (options.follow ? 2 : 1);
  const where = { ...centre, half: half / zoomed, wide: (wide || half) / zoomed, high: (high || half) / zoomed };
  for (const { canvas, names } of plans) {
    const many = names();
    const algorithms = many.map((name) => ({ name, colour: many.length > 1 ? lineStyle(name, state.algorithms ?? []).colour : null }));
    drawPlan(canvas, state, algorithms, clock.time, where, options);
  }
}

/** Where the chosen vehicle truly is. */
function followed({ view, vehicle }) {
  const track = view?.truth[vehicle];
  if (!track) return null;
  const n = view.time_s.findLastIndex((t) => t <= clock.time);
  const point = track[Math.max(n, 0)];
  return point && point[0] !== null ? { x: point[0], y: point[1] } : null;
}

let of = null;
store.watch(["job", "view", "live", "hidden", "vehicle", "algorithms"], ({ view, live, job }) => {
  const mission = job?.scenario ?? job?.id ?? null;
  if (mission !== of) Object.assign(moved, { by: null, zoom: 1 });
  of = mission;
  if (view || live) extent = null;
  soon();
});
paneState.watch(["trails", "ellipses", "sigma", "rays", "follow"], soon);
clock.watch(soon);
darkScheme.addEventListener("change", soon);
