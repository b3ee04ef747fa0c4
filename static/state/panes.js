// How the panes show a run: side by side, laid over each other or as a plan; what they draw; where from.

import { keepInLink, noteLink } from "./link.js";
import { createStore } from "./store.js";

export const MOST_PANES = 6;
/** The pane in which all estimators are laid over each other. */
export const OVERLAY = "overlay";

export const LAYOUTS = { side: "Side by side", overlay: "Overlay", plan: "Plan" };
export const SIZES = { 95: "95 %", 1: "1 σ", 2: "2 σ", 3: "3 σ" };
export const DEPTHS = { 0: "as suits", 1: "true", 2: "× 2", 5: "× 5", 10: "× 10", 20: "× 20" };
const FIGURES = { sigma: SIZES, depth: DEPTHS };

export const hasWebGL = Boolean(document.createElement("canvas").getContext("webgl2"));

/** The place of the camera that scenes begin with: position and point looked at, scene units. */
export const USUAL_CAMERA = [0, -9, 11.2, 0, 0, 0];

/** What panes draw, and how, until somebody chooses. */
const USUAL = {
  trails: true,
  ellipses: true,
  sigma: 95,
  rays: true,
  cloud: false,
  contours: false,
  graph: false,
  pursuit: true,
  sound: true,
  follow: false,
  top: false,
  linked: true,
  depth: 0,
};

/** camera: position and point looked at, scene units; null until somebody has moved it. */
export const paneState = createStore({ layout: hasWebGL ? "side" : "plan", ...USUAL, camera: null });

/** What a person chooses of USUAL; whoever looks from above, or no longer, leaves the place the camera was moved to. */
export function draw(choice) {
  paneState.set("top" in choice ? { ...choice, camera: null } : choice);
}

/** Names of the panes that a run is shown in. */
export function paneNames(job, layout, hidden) {
  if (!job) return [];
  if (layout === "overlay") return [OVERLAY];
  const { algorithms } = job;
  return (algorithms.length > MOST_PANES ? algorithms.filter((name) => !hidden.algorithms.has(name)) : algorithms).slice(0, MOST_PANES);
}

/** A camera as the address has it; null for the usual one. */
function written(camera) {
  if (camera === null || camera.every((v, n) => Math.abs(v - USUAL_CAMERA[n]) < 0.05)) return null;
  return camera.map((v) => Math.round(1000 * v) / 1000).join(",");
}

/** What differs from the usual, as the address has it: "cloud,-rays,sigma2"; null where nothing does. */
function chosen(state) {
  const others = Object.keys(USUAL).filter((name) => state[name] !== USUAL[name]);
  return others.map((name) => (name in FIGURES ? `${name}${state[name]}` : state[name] ? name : `-${name}`)).join(",") || null;
}

/** What such words choose of everything; nothing where there are none. */
function choices(words) {
  if (words === null) return {};
  const found = { ...USUAL };
  for (const word of words.split(",")) {
    const [, no, name, figure] = /^(-?)([a-z]+)(\d*)$/.exec(word) ?? [];
    if (Object.hasOwn(FIGURES, name)) found[name] = Object.hasOwn(FIGURES[name], figure) ? Number(figure) : USUAL[name];
    else if (Object.hasOwn(USUAL, name) && figure === "") found[name] = !no;
  }
  return found;
}

/** Keeps layout, camera and what is drawn in the address; `look(pose)` is told of a pose that an address asks for. */
export function keepPanesInLink(look) {
  const usual = paneState.state.layout;
  keepInLink("layout", {
    write: () => (paneState.state.layout === usual ? null : paneState.state.layout),
    read: (text) => {
      const wanted = Object.hasOwn(LAYOUTS, text) ? text : usual;
      paneState.set({ layout: wanted === "plan" || hasWebGL ? wanted : "plan" });
    },
  });
  keepInLink("draw", { write: () => chosen(paneState.state), read: (text) => paneState.set(choices(text)) });
  keepInLink("camera", {
    write: () => written(paneState.state.camera),
    read: (text) => {
      const pose = (text ?? "").split(",").map(Number);
      if (pose.length === 6 && pose.every(Number.isFinite)) {
        paneState.set({ camera: pose });
        queueMicrotask(() => look(pose)); // once it is told what is drawn: looking from above turns the cameras
      }
    },
  });
  paneState.watch(["layout", "camera", ...Object.keys(USUAL)], noteLink);
}
