// The span of mission time that slider and plots show: all of it, or what a person has brushed.

import { clock } from "./clock.js";
import { keepInLink, noteLink } from "./link.js";

/** No closer than this, s. */
const SHORTEST_S = 1;

class Zoom {
  /** What was asked for, and the end of the mission it was asked of (null: of whichever comes first). */
  #asked = null;
  #end = null;
  #inside = false;
  #watchers = [];

  constructor() {
    clock.watch(() => this.#follow());
  }

  /** `draw(zoom)` is called whenever the span has changed. */
  watch(draw) {
    this.#watchers.push(draw);
  }

  get on() {
    return this.#asked !== null && clock.end > clock.start;
  }

  /** The span shown, [from, to] s. */
  get span() {
    return this.on ? [...this.#asked] : [clock.start, clock.end];
  }

  /** Shows from..to s, within the mission. */
  show(from, to) {
    const middle = (from + to) / 2;
    const half = Math.max(Math.abs(to - from), SHORTEST_S) / 2;
    const start = Math.max(clock.start, middle - half);
    const end = Math.min(clock.end, middle + half);
    this.#put(end - start >= clock.end - clock.start ? null : [start, end], clock.end);
  }

  /** Closer (above 1) or further, about the clock's time where it is in view. */
  by(factor) {
    const [from, to] = this.span;
    const about = clock.time >= from && clock.time <= to ? clock.time : (from + to) / 2;
    this.show(about - (about - from) / factor, about + (to - about) / factor);
  }

  reset() {
    this.#put(null, null);
  }

  /** As text for an address, or null; and back. */
  write() {
    return this.on ? this.#asked.map((t) => Math.round(t * 10) / 10).join("-") : null;
  }

  read(text) {
    const [from, to] = (text ?? "").split("-").map(Number);
    this.#put(text && from >= 0 && to > from ? [from, to] : null, null);
  }

  #put(asked, end) {
    this.#asked = asked;
    this.#end = end;
    this.#inside = false;
    this.#tell();
  }

  #tell() {
    for (const draw of this.#watchers) draw(this);
  }

  /** Time that runs out of the span takes it along; a mission of another length is shown whole. */
  #follow() {
    if (!this.on) return;
    this.#end ??= clock.end;
    if (this.#end !== clock.end) {
      this.reset();
      return;
    }
    const [from, to] = this.#asked;
    const inside = clock.time >= from && clock.time <= to;
    if (inside || !this.#inside) {
      this.#inside = inside;
      return;
    }
    const length = to - from;
    const start = Math.min(Math.max(clock.start, clock.time - (clock.time > to ? 0.1 : 0.9) * length), clock.end - length);
    this.#asked = [start, start + length];
    this.#tell();
  }
}

export const zoom = new Zoom();

keepInLink("zoom", { write: () => zoom.write(), read: (text) => zoom.read(text) });
zoom.watch(noteLink);
