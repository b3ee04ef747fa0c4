// One pane per algorithm, or one for all: a scene of the server in a frame, or a plan, under a bar with its name and readings.

import { el, part, say } from "../look/dom.js";
import { metres, plural } from "../look/format.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { lineSample, verdictChip } from "../look/swatch.js";
import { clock } from "../state/clock.js";
import { atWork } from "../state/run.js";
import { MOST_PANES, OVERLAY, hasWebGL, paneNames, paneState } from "../state/panes.js";
import { departure, indexAt, sigmaOf } from "../state/samples.js";
import { store } from "../state/store.js";
import { planPane } from "./planpane.js";

/** Squared Mahalanobis distance that 95 % of a plane Gaussian's errors stay below. */
const CHI2_95 = 5.991;

/** Panes in the section, filled by what the session's server answers; `keys(window)` gets each frame's window. */
export function mountPanes(keys) {
  const room = part("panes");
  const panes = new Map();
  const note = el("p", { class: "quiet note", hidden: true });
  const grid = el("div", { class: "grid" });
  room.append(grid, note);

  let drawn = paneState.state.layout;

  function arrange() {
    const { job, hidden } = store.state;
    const { layout } = paneState.state;
    const names = paneNames(job, layout, hidden);
    for (const [name, pane] of panes) {
      if (!names.includes(name) || (layout === "plan") !== (drawn === "plan")) {
        pane.plan?.close();
        pane.root.remove();
        panes.delete(name);
      }
    }
    drawn = layout;
    names.forEach((name, n) => {
      if (!panes.has(name)) panes.set(name, build(name, layout === "plan", keys, unveil));
      const { root } = panes.get(name);
      // A frame that moves in the document loads again, so only what is out of place moves.
      if (grid.children[n] !== root) grid.insertBefore(root, grid.children[n] ?? null);
    });
    const without = (job?.algorithms ?? []).filter((name) => !hidden.algorithms.has(name) && !names.includes(name));
    const left = layout === "overlay" ? 0 : without.length;
    note.hidden = !job || (hasWebGL && left <= 0);
    const more = left > 0 ? `${plural(left, "more estimator")} in the plots and the table: ${MOST_PANES} panes are the most a browser draws smoothly.` : "";
    note.textContent = hasWebGL ? more : `This browser draws no WebGL, so plans take the place of the 3D panes. Hardware acceleration or WebGL in its settings bring them back. ${more}`;
    sift();
    label();
    unveil();
  }

  function label() {
    const { algorithms, job, result, vehicle } = store.state;
    for (const [name, pane] of panes) {
      if (name === OVERLAY) {
        const shown = (job?.algorithms ?? []).filter((a) => !store.state.hidden.algorithms.has(a));
        const titles = shown.map((a) => el("span", { class: "laid" }, lineSample(a, algorithms ?? []), algorithms?.find((b) => b.name === a)?.title ?? a));
        pane.title.replaceChildren(...titles);
        pane.frame.title = "3D pane of all estimators";
        continue;
      }
      const known = algorithms?.find((a) => a.name === name);
      pane.title.replaceChildren(known?.title ?? name, lineSample(name, algorithms ?? []));
      pane.root.style.setProperty("--stroke", lineStyle(name, algorithms ?? []).colour);
      if (pane.frame) pane.frame.title = `3D pane of ${known?.title ?? name}`;
      const metrics = result?.algorithms[name]?.subjects[vehicle];
      if (pane.metrics !== metrics) pane.verdict.replaceChildren(...(metrics ? [verdictChip(metrics)] : []));
      pane.metrics = metrics;
      pane.tag.hidden = !known?.centralized;
      if (job === null) pane.reading.textContent = "";
    }
    read();
  }

  function read() {
    for (const [name, pane] of panes) if (name !== OVERLAY) say(pane.reading, reading(name, pane));
  }

  /** A pane is unveiled when there is a picture and something to see in it. */
  function unveil() {
    const { job, view, live } = store.state;
    for (const [name, pane] of panes) {
      if (pane.root.dataset.state === "failed") continue;
      const told = { ...live?.algorithms, ...view?.algorithms };
      const estimates = name === OVERLAY ? Object.keys(told).length > 0 : Boolean(told[name]);
      const ended = job !== null && !atWork(job) && job.state !== "done";
      pane.root.dataset.state = pane.drawn && estimates ? "shown" : "waiting";
      say(pane.veil, ended ? "No estimates were made." : estimates ? "Opening the pane…" : (WAITING[job?.state] ?? "Reading the run…"));
    }
  }

  function sift() {
    for (const [name, pane] of panes) pane.root.hidden = store.state.hidden.algorithms.has(name);
    grid.dataset.count = String([...panes.values()].filter((pane) => !pane.root.hidden).length);
  }

  store.watch(["job", "hidden"], arrange);
  paneState.watch(["layout"], arrange);
  store.watch(["job", "algorithms", "result", "vehicle", "view", "live"], label);
  store.watch(["job", "view", "live"], unveil);
  clock.watch(read);
  darkScheme.addEventListener("change", label);

  return {
    /** Panes' addresses as the scene server gives them. */
    place(addresses) {
      for (const [name, pane] of panes) {
        const address = addresses[name];
        if (!address || !pane.frame) continue;
        pane.root.dataset.state = "waiting";
        if (pane.frame.getAttribute("src") !== address) {
          pane.drawn = false;
          pane.frame.src = address;
        }
        unveil();
      }
    },
    /** What is on the screen: {root, title, reading, picture: canvas} of every pane that shows something. */
    shown() {
      const seen = [...panes.values()].filter((pane) => !pane.root.hidden && pane.root.dataset.state === "shown");
      return seen.map(({ root, title, reading, frame, plan }) => ({
        root,
        title: title.innerText.trim().replace(/\s*\n\s*/g, " · "),
        reading: reading.textContent,
        picture: plan?.canvas ?? sceneOf(frame),
      }));
    },
    /** The scene server cannot draw: why. */
    fail(detail) {
      for (const pane of panes.values()) {
        if (pane.plan) continue;
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

function build(name, flat, keys, unveil) {
  const title = el("h3", {});
  const verdict = el("span", { class: "judged" });
  const reading = el("span", { class: "reading" });
  const tag = el("span", { class: "tag", hidden: true }, "benchmark");
  const frame = flat ? null : el("iframe", { title: name, allow: "" });
  const plan = flat ? planPane(() => [name], `Plan of ${name}`) : null;
  const veil = el("div", { class: "veil" });
  const root = el(
    "article",
    { class: "pane", "data-algorithm": name, "data-state": "waiting" },
    el("header", {}, title, verdict, reading, tag),
    el("div", { class: "view" }, frame ?? plan.canvas, veil),
  );
  const pane = { root, title, verdict, reading, tag, frame, plan, veil, drawn: flat };
  frame?.addEventListener("load", () => frame.getAttribute("src") && keys(frame.contentWindow));
  frame?.addEventListener("picture", () => {
    pane.drawn = true;
    unveil();
  });
  return pane;
}

/** The canvas that a frame draws its scene on; null where it is not there yet. */
function sceneOf(frame) {
  const all = frame.contentDocument?.querySelectorAll("canvas") ?? [];
  return [...all].find((canvas) => canvas.width > 0 && canvas.height > 0) ?? null;
}

/** Error and sigma of the chosen vehicle in the trial that is drawn, now. */
function reading(name, pane) {
  const { view, live, vehicle } = store.state;
  const belief = view?.algorithms[name]?.subjects[vehicle];
  const shown = belief?.mean.length
    ? { times: view.time_s, mean: belief.mean, cov: belief.cov, truth: view.truth[vehicle] }
    : { times: live?.algorithms[name]?.time_s ?? [], ...live?.algorithms[name]?.subjects[vehicle] };
  const n = indexAt(shown.times, clock.time);
  const away = n < 0 || !shown.mean ? null : departure(shown.mean[n], shown.cov[n], shown.truth?.[n]);
  const outside = (away?.nees ?? 0) > CHI2_95;
  pane.reading.classList.toggle("outside", outside);
  if (n < 0 || !shown.mean) return "";
  const sigma = `σ ${metres(sigmaOf(shown.cov[n]))}`;
  if (!away) return sigma;
  pane.reading.title = `${vehicle}, the trial drawn: ${outside ? "the truth is outside" : "the truth is inside"} the 95 % ellipse`;
  return `error ${metres(away.error_m)} · ${sigma}`;
}
