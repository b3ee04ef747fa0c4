// On a plot over time: the cursor at the clock's time, the probe under the pointer, and the brush that zooms.

import { el, say } from "../look/dom.js";
import { clockTime } from "../look/format.js";
import { clock } from "../state/clock.js";
import { hover } from "../state/hover.js";
import { zoom } from "../state/zoom.js";
import { MARGIN } from "./figure.js";

/** A pointer that has moved less than this (px) has clicked, not brushed. */
const STILL = 4;

/**
 * Makes a canvas answer to the pointer; returns `point(wide)`, which puts the lines where they belong on a canvas that is
 * so many px wide: to ask it for its width would have the page laid out for every plot; 0 takes the lines away.
 */
export function overTime(canvas) {
  const cursor = el("div", { class: "cursor", "aria-hidden": "true", hidden: true });
  const probe = el("div", { class: "cursor probe", "aria-hidden": "true", hidden: true }, el("span"));
  const brush = el("div", { class: "brush", "aria-hidden": "true", hidden: true });
  canvas.title = "Click: go there. Drag: zoom. Double click: all of it.";
  canvas.append(cursor, probe, brush);

  function point(wide) {
    const width = wide - MARGIN.l - MARGIN.r;
    const [from, to] = zoom.span;
    const put = (line, time) => {
      line.hidden = time === null || time < from || time > to || to <= from || width <= 0;
      if (!line.hidden) line.style.transform = `translateX(${(MARGIN.l + ((time - from) / (to - from)) * width).toFixed(1)}px)`;
    };
    put(cursor, clock.time);
    put(probe, hover.time);
    if (!probe.hidden) say(probe.firstChild, clockTime(hover.time));
  }

  const share = (event) => {
    const box = canvas.getBoundingClientRect();
    return Math.min(Math.max((event.clientX - box.left - MARGIN.l) / (box.width - MARGIN.l - MARGIN.r), 0), 1);
  };
  const timeAt = (place) => {
    const [from, to] = zoom.span;
    return from + place * (to - from);
  };
  let pressed = null;
  const release = () => {
    pressed = null;
    brush.hidden = true;
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    hover.at(null);
    if (event.shiftKey) clock.seek(timeAt(share(event)));
    else pressed = { x: event.clientX, place: share(event) };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (pressed) {
      const [a, b] = [pressed.place, share(event)].sort((one, other) => one - other);
      brush.hidden = Math.abs(event.clientX - pressed.x) < STILL;
      const width = canvas.clientWidth - MARGIN.l - MARGIN.r;
      brush.style.left = `${MARGIN.l + a * width}px`;
      brush.style.width = `${(b - a) * width}px`;
    } else if (event.buttons === 1 && event.shiftKey) clock.seek(timeAt(share(event)));
    else hover.at(timeAt(share(event)));
  });
  canvas.addEventListener("pointerup", (event) => {
    if (!pressed) return;
    const moved = Math.abs(event.clientX - pressed.x) >= STILL;
    const here = timeAt(share(event));
    if (moved) zoom.show(timeAt(pressed.place), here);
    else clock.seek(here);
    release();
  });
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("lostpointercapture", release);
  canvas.addEventListener("dblclick", () => zoom.reset());
  canvas.addEventListener("pointerleave", () => hover.at(null));
  return point;
}
