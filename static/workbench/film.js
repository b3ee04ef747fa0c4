// A film of the panes: the mission from start to end, or once round the scene, as WebM.

import { clock } from "../state/clock.js";
import { USUAL_CAMERA } from "../state/panes.js";
import { compose } from "./picture.js";

const FRAMES_PER_S = 25;
const KINDS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];
export const canFilm = typeof MediaRecorder === "function" && "captureStream" in HTMLCanvasElement.prototype;

/** What happens in a film, by kind: at(share 0 to 1) moves, end() puts back what was moved. */
const PLOTS = {
  timeline(_, from = clock.start) {
    const before = clock.time;
    return { at: (share) => clock.seek(from + share * (clock.end - from)), end: () => clock.seek(before) };
  },
  turntable(session) {
    const before = session.pose ?? USUAL_CAMERA;
    const [px, py, pz, x, y, z] = before;
    const turned = (angle) => {
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      return [x + c * (px - x) - s * (py - y), y + s * (px - x) + c * (py - y), pz, x, y, z];
    };
    return { at: (share) => session.look(turned(2 * Math.PI * share)), end: () => session.look(before) };
  },
};

/** Films the panes for some seconds; tells how far it is; the film as a Blob, null where the signal aborts it. */
export async function film(kind, seconds, session, panes, { tell, signal }) {
  const canvas = document.createElement("canvas");
  const plot = PLOTS[kind](session);
  clock.pause();
  plot.at(0);
  compose(canvas, panes.shown(), 1);
  const type = KINDS.find((k) => MediaRecorder.isTypeSupported(k));
  const recorder = new MediaRecorder(canvas.captureStream(FRAMES_PER_S), { mimeType: type, videoBitsPerSecond: 6e6 });
  const parts = [];
  recorder.addEventListener("dataavailable", ({ data }) => data.size && parts.push(data));
  const stopped = new Promise((done) => recorder.addEventListener("stop", done));
  recorder.start(1000);
  const start = performance.now();
  let share = 0;
  while (share < 1 && !signal.aborted) {
    await new Promise((done) => requestAnimationFrame(done));
    share = Math.min(1, (performance.now() - start) / 1000 / seconds);
    plot.at(share);
    compose(canvas, panes.shown(), 1);
    tell(share);
  }
  recorder.stop();
  await stopped;
  plot.end();
  return signal.aborted ? null : new Blob(parts, { type: "video/webm" });
}
