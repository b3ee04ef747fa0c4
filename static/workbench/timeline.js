// The time slider of all panes and plots: play, speed, marks of what happened, steps from mark to mark.

import { el, part, say, svg } from "../look/dom.js";
import { clockTime, count } from "../look/format.js";
import { darkScheme } from "../look/palette.js";
import { SPEEDS, clock } from "../state/clock.js";
import { hover } from "../state/hover.js";
import { atWork } from "../state/run.js";
import { indexAt } from "../state/samples.js";
import { store } from "../state/store.js";
import { zoom } from "../state/zoom.js";
import { happenings } from "./happenings.js";
import { buildLegend } from "./legend.js";

const NOTHING = { heard: [], lost: [], fixes: [], moments: [] };
/** Height of a lane of marks, px; the lanes lie under the slider, inset by half its thumb. */
const LANE = 7;
const INSET = 8;
/** A mark this near to the pointer (px) is meant. */
const NEAR = 6;

/** What happened in the open run, and the times of its moments. */
let events = { ...NOTHING, times: [] };

/** Moves to the next (+1) or previous (-1) event. */
export function stepEvent(direction) {
  const { times } = events;
  const here = clock.time;
  const next = direction > 0 ? times.find((t) => t > here + 0.01) : times.findLast((t) => t < here - 0.01);
  if (next !== undefined) clock.seek(next);
}

/** Moves by report times. */
export function stepTime(direction) {
  const times = store.state.view?.time_s ?? [];
  if (!times.length) return;
  const n = indexAt(times, clock.time);
  const between = times[n] < clock.time - 1e-6;
  const to = direction > 0 ? n + 1 : between ? n : n - 1;
  clock.seek(times[Math.min(Math.max(to, 0), times.length - 1)]);
}

export function mountTimeline() {
  const play = button("play", "Play", () => clock.toggle(), ICONS.play);
  const back = button("back", "Previous event (Shift+←)", () => stepEvent(-1), ICONS.back);
  const forth = button("forth", "Next event (Shift+→)", () => stepEvent(1), ICONS.forth);
  const speed = el(
    "select",
    { id: "speed", "aria-label": "Playback speed", title: "Mission time per real time ([ and ])", onchange: () => clock.setSpeed(Number(speed.value)) },
    SPEEDS.map((s) => el("option", { value: s }, `${s}×`)),
  );
  const now = el("output", { class: "now", for: "time" });
  const end = el("span", { class: "end" });
  const words = el("span", { class: "event" });
  const whole = el("button", { type: "button", class: "small whole", title: "Show the whole mission (Esc)", onclick: () => zoom.reset() });
  const live = el("button", { type: "button", class: "small live", title: "Follow the newest estimates", onclick: () => clock.follow(store.state.live?.latest_s ?? clock.end) }, "● Live");
  const slider = el("input", { id: "time", type: "range", min: 0, max: 1, step: "any", "aria-label": "Mission time", oninput: () => clock.seek(Number(slider.value)) });
  const lanes = el("canvas", { class: "lanes", height: 3 * LANE, "aria-hidden": "true" });
  const key = el("div", { class: "lane-keys" });
  const probe = el("div", { class: "cursor probe", "aria-hidden": "true", hidden: true }, el("span"));
  const track = el("div", { class: "track" }, slider, lanes, probe);
  part("timeline").append(
    el("div", { class: "controls" }, play, back, forth, speed, el("span", { class: "times" }, now, end), live, words, whole, key),
    track,
    buildLegend(),
  );

  const tick = () => {
    const [from, to] = zoom.span;
    slider.min = String(from);
    slider.max = String(to);
    slider.value = String(clock.time);
    slider.disabled = clock.end <= clock.start;
    slider.setAttribute("aria-valuetext", clockTime(clock.time));
    say(now, clockTime(clock.time, true));
    say(end, ` / ${clockTime(clock.end)}`);
    whole.hidden = !zoom.on;
    say(whole, `${clockTime(from)} – ${clockTime(to)} ×`);
    live.hidden = clock.following || !atWork(store.state.job) || !store.state.live;
    if (speed.value !== String(clock.speed)) speed.value = String(clock.speed);
    if (play.dataset.playing !== String(clock.playing)) {
      play.dataset.playing = String(clock.playing);
      play.replaceChildren(icon(clock.playing ? ICONS.pause : ICONS.play));
      play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
      play.title = clock.playing ? "Pause (space)" : "Play (space)";
    }
    const n = indexAt(events.times, clock.time);
    tell(events.moments[n]);
  };
  const tell = (moment) => say(words, moment ? `${clockTime(moment.time_s)} ${moment.words}` : "");
  clock.watch(tick);
  store.watch(["job"], tick);
  tick();

  const draw = () => paint(lanes, events);
  store.watch(["view", "hidden"], ({ view, hidden }) => {
    const found = view ? happenings(view, hidden.vehicles) : NOTHING;
    events = { ...found, times: found.moments.map((m) => m.time_s) };
    key.replaceChildren(
      mark("heard", `${count(events.heard.length)} heard`),
      mark("lost", `${count(events.lost.length)} lost`),
      ...(events.fixes.length ? [mark("fix", "fixes")] : []),
    );
    key.hidden = !view;
    back.disabled = forth.disabled = !events.moments.length;
    draw();
    tick();
  });
  new ResizeObserver(draw).observe(track);
  darkScheme.addEventListener("change", draw);
  zoom.watch(() => {
    draw();
    tick();
  });

  const timeAt = (event) => {
    const box = lanes.getBoundingClientRect();
    const share = (event.clientX - box.left - INSET) / (box.width - 2 * INSET);
    const [from, to] = zoom.span;
    return from + Math.min(Math.max(share, 0), 1) * (to - from);
  };
  hover.watch(() => {
    const [from, to] = zoom.span;
    probe.hidden = hover.time === null || hover.time < from || hover.time > to || to <= from;
    if (probe.hidden) return;
    const x = INSET + ((hover.time - from) / (to - from)) * (lanes.clientWidth - 2 * INSET);
    probe.style.transform = `translateX(${x.toFixed(1)}px)`;
  });
  const seek = (event) => {
    if (event.buttons === 1) clock.seek(timeAt(event));
    else point(event);
  };
  /** The mark under the pointer, in words. */
  const point = (event) => {
    const time = timeAt(event);
    const [from, to] = zoom.span;
    const reach = (NEAR / Math.max(1, lanes.clientWidth)) * (to - from);
    const n = indexAt(events.times, time);
    const near = [n, n + 1].filter((k) => Math.abs(events.times[k] - time) <= reach).sort((a, b) => Math.abs(events.times[a] - time) - Math.abs(events.times[b] - time));
    hover.at(time);
    if (near.length) tell(events.moments[near[0]]);
    else tick();
  };
  lanes.addEventListener("pointerdown", (event) => {
    lanes.setPointerCapture(event.pointerId);
    seek(event);
  });
  lanes.addEventListener("pointermove", seek);
  lanes.addEventListener("pointerleave", () => {
    hover.at(null);
    tick();
  });
}

function mark(kind, text) {
  return el("span", { class: "key" }, el("i", { class: kind, "aria-hidden": "true" }), text);
}

/** Marks of the events: heard, lost, fixes, each in a lane. */
function paint(canvas, { heard, lost, fixes }) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  if (!width || clock.end <= clock.start) {
    canvas.width = canvas.width;
    return;
  }
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(3 * LANE * ratio);
  // Drawn by the processor: thin lines are no work for it, and much for WebGL in software.
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  pen.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  const [start, end] = zoom.span;
  const x = (t) => INSET + ((t - start) / (end - start)) * (width - 2 * INSET);
  const lane = (n, name, marks) => {
    pen.fillStyle = style.getPropertyValue(`--mark-${name}`);
    for (const [from, to] of marks) if (to >= start && from <= end) pen.fillRect(x(from) - 0.5, n * LANE + 1, Math.max(1, x(to) - x(from)), LANE - 2);
  };
  lane(0, "heard", heard.map((p) => [p.toa_s, p.toa_s]));
  lane(1, "lost", lost.map((p) => [p.tol_s, p.tol_s]));
  lane(2, "fix", fixes.map((f) => [f.from_s, f.to_s]));
}

const ICONS = {
  play: "M4 2.5v11l9-5.5z",
  pause: "M4 2.5h3v11H4zM9 2.5h3v11H9z",
  back: "M12 2.5v11L5 8zM3 2.5h1.6v11H3z",
  forth: "M4 2.5v11L11 8zM11.4 2.5H13v11h-1.6z",
};

function icon(path) {
  return svg("svg", { viewBox: "0 0 16 16", width: 16, height: 16, "aria-hidden": "true" }, svg("path", { d: path }));
}

function button(id, label, act, path) {
  return el("button", { type: "button", id, class: "icon", "aria-label": label, title: label, onclick: act }, icon(path));
}
