// One 3D pane per algorithm: a scene of the server in a frame, under a bar with its name and readings.

import { el, part, say } from "../look/dom.js";
import { metres, plural } from "../look/format.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { lineSample, verdictChip } from "../look/swatch.js";
import { clock } from "../state/clock.js";
import { atWork } from "../state/run.js";
import { departure, indexAt, sigmaOf } from "../state/samples.js";
import { store } from "../state/store.js";

export const MOST_PANES = 6;
/** Squared Mahalanobis distance that 95 % of a plane Gaussian's errors stay below. */
const CHI2_95 = 5.991;

export const hasWebGL = Boolean(document.createElement("canvas").getContext("webgl2"));

/** Panes in the section, filled by what the session's server answers; `keys(window)` gets each frame's window. */
export function mountPanes(keys) {
  const room = part("panes");
  const panes = new Map();
  const note = el("p", { class: "quiet note", hidden: true });
  const grid = el("div", { class: "grid" });
  room.append(grid, note);

  function arrange(job) {
    const names = hasWebGL ? (job?.algorithms ?? []).slice(0, MOST_PANES) : [];
    for (const [name, pane] of panes) {
      if (!names.includes(name)) {
        pane.root.remove();
        panes.delete(name);
      }
    }
    names.forEach((name, n) => {
      if (!panes.has(name)) panes.set(name, build(name, keys, unveil));
      const { root } = panes.get(name);
      // A frame that moves in the document loads again, so only what is out of place moves.
      if (grid.children[n] !== root) grid.insertBefore(root, grid.children[n] ?? null);
    });
    const left = (job?.algorithms.length ?? 0) - names.length;
    note.hidden = !job || (hasWebGL && left <= 0);
    note.textContent = hasWebGL
      ? `${plural(left, "more estimator")} in the plots and the table: ${MOST_PANES} panes are the most a browser draws smoothly.`
      : "This browser draws no WebGL, so there are no 3D panes; plots and table show the same run. Switch on hardware acceleration or WebGL in its settings.";
  }

  function label() {
    const { algorithms, job, result, vehicle } = store.state;
    for (const [name, pane] of panes) {
      const known = algorithms?.find((a) => a.name === name);
      pane.title.replaceChildren(known?.title ?? name, lineSample(name, algorithms ?? []));
      pane.root.style.setProperty("--stroke", lineStyle(name, algorithms ?? []).colour);
      pane.frame.title = `3D pane of ${known?.title ?? name}`;
      const metrics = result?.algorithms[name]?.subjects[vehicle];
      pane.verdict.replaceChildren(...(metrics ? [verdictChip(metrics)] : []));
      pane.tag.hidden = !known?.centralized;
      if (job === null) pane.reading.textContent = "";
    }
    read();
  }

  function read() {
    for (const [name, pane] of panes) say(pane.reading, reading(name, pane));
  }

  /** A pane is unveiled when its frame is there and there is something to see in it. */
  function unveil() {
    const { job, view, live } = store.state;
    for (const [name, pane] of panes) {
      if (pane.root.dataset.state === "failed") continue;
      const estimates = Boolean(view?.algorithms[name] || live?.algorithms[name]);
      const ended = job !== null && !atWork(job) && job.state !== "done";
      pane.root.dataset.state = pane.loaded && estimates ? "shown" : "waiting";
      say(pane.veil, ended ? "No estimates were made." : estimates ? "Opening the 3D pane…" : (WAITING[job?.state] ?? "Reading the run…"));
    }
  }

  function sift({ hidden }) {
    for (const [name, pane] of panes) pane.root.hidden = hidden.algorithms.has(name);
    grid.dataset.count = String([...panes.values()].filter((pane) => !pane.root.hidden).length);
  }

  store.watch(["job"], ({ job }) => arrange(job));
  store.watch(["job", "hidden"], sift);
  store.watch(["job", "algorithms", "result", "vehicle", "view", "live"], label);
  store.watch(["job", "view", "live"], unveil);
  clock.watch(read);
  darkScheme.addEventListener("change", label);

  return {
    /** Panes' addresses as the scene server gives them. */
    place(addresses) {
      for (const [name, pane] of panes) {
        const address = addresses[name];
        if (!address) continue;
        pane.root.dataset.state = "waiting";
        if (pane.frame.getAttribute("src") !== address) {
          pane.loaded = false;
          pane.frame.src = address;
        }
        unveil();
      }
    },
    /** The scene server cannot draw: why. */
    fail(detail) {
      for (const pane of panes.values()) {
        pane.root.dataset.state = "failed";
        pane.veil.textContent = detail;
      }
    },
  };
}

const WAITING = {
  queued: "Waiting for a free worker…",
  running: "The mission is under way; estimates come as they are made…",
};

function build(name, keys, unveil) {
  const title = el("h3", {});
  const verdict = el("span", { class: "judged" });
  const reading = el("span", { class: "reading" });
  const tag = el("span", { class: "tag", hidden: true }, "benchmark");
  const frame = el("iframe", { title: name, allow: "" });
  const veil = el("div", { class: "veil" });
  const root = el(
    "article",
    { class: "pane", "data-algorithm": name, "data-state": "waiting" },
    el("header", {}, title, verdict, reading, tag),
    el("div", { class: "view" }, frame, veil),
  );
  const pane = { root, title, verdict, reading, tag, frame, veil, loaded: false };
  frame.addEventListener("load", () => {
    if (!frame.getAttribute("src")) return;
    pane.loaded = true;
    keys(frame.contentWindow);
    unveil();
  });
  return pane;
}

/** Error and sigma of the chosen vehicle in the trial that is drawn, now. */
function reading(name, pane) {
  const { view, live, vehicle } = store.state;
  const belief = view?.algorithms[name]?.subjects[vehicle];
  const shown = belief?.mean.length
    ? { times: view.time_s, mean: belief.mean, cov: belief.cov, truth: view.truth[vehicle] }
    : { times: live?.algorithms[name]?.time_s ?? [], ...live?.algorithms[name]?.subjects[vehicle] };
  const n = indexAt(shown.times, clock.time);
  pane.reading.classList.remove("outside");
  if (n < 0 || !shown.mean) return "";
  const sigma = `σ ${metres(sigmaOf(shown.cov[n]))}`;
  const away = departure(shown.mean[n], shown.cov[n], shown.truth?.[n]);
  if (!away) return sigma;
  const outside = away.nees !== null && away.nees > CHI2_95;
  pane.reading.classList.toggle("outside", outside);
  pane.reading.title = `${vehicle}, the trial drawn: ${outside ? "the truth is outside" : "the truth is inside"} the 95 % ellipse`;
  return `error ${metres(away.error_m)} · ${sigma}`;
}
