// The TDMA schedule of one pursuit as a tape that runs under a fixed cursor: C19's Figs. 3-3 and 3-4, as it happened.

import { el, say, svg } from "../look/dom.js";
import { clock } from "../state/clock.js";
import { KINDS, listeners, slotAt, words } from "./story.js";

/** Seconds seen on either side of the cursor, and drawn beyond them so that the tape need not be drawn at every tick. */
const REACH_S = 55;
const SPARE_S = 90;
const LANE = 24;
const PING_S = 1.6;

/** A tape: { root, show(), names }; colourOf(name) gives a vehicle's colour. */
export function buildTape({ story, title, swatch, colourOf }) {
  const lanes = ["target", ...story.vehicles, ...(story.holders[0] === "shore" ? ["shore"] : [])];
  const height = lanes.length * LANE + 4;
  const middle = (name) => lanes.indexOf(name) * LANE + LANE / 2;
  const tape = svg("g");
  const cursor = svg("line", { class: "now", y1: 0, y2: height });
  const drawing = svg("svg", { class: "tape", height, "aria-hidden": "true" }, tape, cursor);
  const said = el("p", { class: "said" });
  const labels = lanes.map((name) => el("span", { class: "lane", "--colour": colourOf(name) }, name));
  const root = el(
    "figure",
    { class: "schedule-of" },
    el("figcaption", {}, swatch, el("b", {}, title), el("span", { class: "quiet" }, `${story.cycle_s} s cycle, ${story.slot_s} s slots`), said),
    el("div", { class: "tape-frame" }, el("div", { class: "lanes-of", "aria-hidden": "true" }, labels), drawing),
  );

  let from = Infinity;
  let scale = 1;
  let width = 0;

  function draw() {
    from = clock.time - REACH_S - SPARE_S;
    const to = clock.time + REACH_S + SPARE_S;
    const x = (time) => (time - from) * scale;
    const first = Math.max(slotAt(story.slots, from), 0);
    const marks = lanes.map((name) => svg("line", { class: "rail", x1: 0, x2: x(to), y1: middle(name), y2: middle(name) }));
    for (let n = first; n < story.slots.length && story.slots[n].start_s < to; n++) marks.push(...drawSlot(story.slots[n], x));
    marks.push(...drawStates(first, to, x));
    tape.replaceChildren(...marks);
  }

  function drawSlot(slot, x) {
    const { sender, start_s, end_s, spoke } = slot;
    const ping = sender === "target";
    const until = ping ? start_s + PING_S : start_s + story.message_s;
    const heardAt = ping ? until : Math.max(end_s, until);
    const colour = colourOf(sender);
    const told = svg("title", {}, words(story, slot));
    const marks = [svg("rect", { class: spoke ? "spoke" : "silent", "--colour": colour, x: x(start_s), y: middle(sender) - 7, width: Math.max(2, (until - start_s) * scale), height: 14, rx: 2 }, told)];
    if (!spoke) return marks;
    const others = listeners(story, slot);
    const rows = others.map(middle);
    marks.unshift(svg("line", { class: "spread", "--colour": colour, x1: x(heardAt), x2: x(heardAt), y1: Math.min(middle(sender), ...rows), y2: Math.max(middle(sender), ...rows) }));
    for (const name of others) {
      const heard = slot.heard.includes(name);
      marks.push(svg("circle", { class: heard ? "heard" : "lost", "--colour": colour, cx: x(heardAt), cy: middle(name), r: 4.2 }, svg("title", {}, `${name} ${heard ? "heard" : "missed"} it`)));
    }
    return marks;
  }

  /** Under every holder's lane what it knows of the cycle: a partial estimate, then a full one, until the next ping. */
  function drawStates(first, to, x) {
    const open = new Map();
    const marks = [];
    const close = (name, until) => {
      const state = open.get(name);
      open.delete(name);
      if (!state) return;
      const span = Math.max(1, (until - state.from) * scale);
      const y = middle(name) + LANE / 2 - 5;
      marks.push(svg("rect", { class: `state ${state.kind}`, x: x(state.from), y, width: span, height: 5 }, svg("title", {}, `${name}: ${state.kind} information`)));
      if (span > 12) marks.push(svg("text", { class: "letter", x: x(state.from) + 3, y: y - 1.5 }, state.kind === "full" ? "F" : "P"));
    };
    let n = first;
    for (; n < story.slots.length && story.slots[n].start_s < to; n++) {
      const slot = story.slots[n];
      if (slot.number === 0) for (const name of story.holders) close(name, slot.start_s);
      slot.kinds.forEach((kind, h) => {
        if (!kind) return;
        close(story.holders[h], slot.end_s);
        open.set(story.holders[h], { from: slot.end_s, kind: KINDS[kind] });
      });
    }
    const end = story.slots[n]?.start_s ?? clock.end;
    for (const name of [...open.keys()]) close(name, end);
    return marks;
  }

  function show() {
    if (!width) return;
    const shift = (clock.time - REACH_S - from) * scale;
    if (!(shift >= 0 && shift <= 2 * SPARE_S * scale)) draw();
    tape.setAttribute("transform", `translate(${(-(clock.time - REACH_S - from) * scale).toFixed(1)} 0)`);
    const slot = story.slots[slotAt(story.slots, clock.time)];
    say(said, slot ? words(story, slot) : "");
  }

  new ResizeObserver(([{ contentRect }]) => {
    width = contentRect.width;
    scale = width / (2 * REACH_S);
    for (const end of ["x1", "x2"]) cursor.setAttribute(end, width / 2);
    from = Infinity;
    show();
  }).observe(drawing);
  drawing.addEventListener("pointerdown", (event) => {
    const { left } = drawing.getBoundingClientRect();
    clock.seek(clock.time - REACH_S + (event.clientX - left) / scale);
  });
  return { root, show };
}
