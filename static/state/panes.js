// How the panes show a run: side by side, laid over each other or as a plan; what they draw; where from.

import { keepInLink, noteLink } from "./link.js";
import { createStore } from "./store.js";

export const MOST_PANES = 6;
/** The pane in which all estimators are laid over each other. */
export const OVERLAY = "overlay";

export const LAYOUTS = { side: "Side by side", overlay: "Overlay", plan: "Plan" };

export const hasWebGL = Boolean(document.createElement("canvas").getContext("webgl2"));

/** The place of the camera that scenes begin with: position and point looked at, scene units. */
export const USUAL_CAMERA = [0, -9, 11.2, 0, 0, 0];

/** camera: position and point looked at, scene units; null until somebody has moved it. */
export const paneState = createStore({
  layout: hasWebGL ? "side" : "plan",
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
  camera: null,
});

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

/** Keeps layout and camera in the address; `look(pose)` is told of a pose that an address asks for. */
export function keepPanesInLink(look) {
  const usual = paneState.state.layout;
  keepInLink("layout", {
    write: () => (paneState.state.layout === usual ? null : paneState.state.layout),
    read: (text) => {
      const wanted = text in LAYOUTS ? text : usual;
      paneState.set({ layout: wanted === "plan" || hasWebGL ? wanted : "plan" });
    },
  });
  keepInLink("camera", {
    write: () => written(paneState.state.camera),
    read: (text) => {
      const pose = (text ?? "").split(",").map(Number);
      if (pose.length === 6 && pose.every(Number.isFinite)) {
        paneState.set({ camera: pose });
        look(pose);
      }
    },
  });
  paneState.watch(["layout", "camera"], noteLink);
}
