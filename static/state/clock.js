// Mission time: one clock that slider, panes and plots follow.

/** Mission seconds per second of the viewer. */
export const SPEEDS = [0.25, 1, 4, 16, 64, 250, 1000];
/** A mission should play in about this long unless told otherwise. */
const USUAL_PLAY_S = 45;

class Clock {
  time = 0;
  start = 0;
  end = 0;
  speed = 64;
  playing = false;
  /** A live run's clock stays at its newest estimate until a person moves it. */
  following = false;
  #watchers = [];
  #frame = 0;

  /** `tick(clock)` is called whenever time, range, speed or playing have changed. */
  watch(tick) {
    this.#watchers.push(tick);
  }

  #tell() {
    for (const tick of this.#watchers) tick(this);
  }

  /** A new mission: its time range, the time to begin at, a speed that suits it. */
  reset(start, end, time = start) {
    this.pause();
    Object.assign(this, { start, end, following: false });
    this.speed = SPEEDS.findLast((s) => s <= Math.max(1, (end - start) / USUAL_PLAY_S)) ?? 1;
    this.time = this.#within(time);
    this.#tell();
  }

  /** The range of a run that grows; keeps the time. */
  range(start, end) {
    if (start === this.start && end === this.end) return;
    Object.assign(this, { start, end });
    this.time = this.#within(this.time);
    this.#tell();
  }

  /** Time moved by a person. */
  seek(time) {
    this.following = false;
    this.#move(time);
  }

  /** Time moved by a live run. */
  head(time) {
    if (this.following) this.#move(time);
  }

  /** Back to the newest estimate of a live run, and along with it. */
  follow(time) {
    this.pause();
    this.following = true;
    this.#move(time);
    this.#tell();
  }

  #move(time) {
    const within = this.#within(time);
    if (within === this.time) return;
    this.time = within;
    this.#tell();
  }

  #within(time) {
    return Math.min(Math.max(time, this.start), this.end);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.#tell();
  }

  /** The next faster (+1) or slower (-1) speed. */
  shift(direction) {
    const place = SPEEDS.indexOf(this.speed) + direction;
    this.setSpeed(SPEEDS[Math.min(Math.max(place, 0), SPEEDS.length - 1)]);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.playing || this.end <= this.start) return;
    this.following = false;
    if (this.time >= this.end) this.time = this.start;
    this.playing = true;
    let before = performance.now();
    const step = (now) => {
      this.time = this.#within(this.time + (Math.max(0, now - before) / 1000) * this.speed);
      before = now;
      if (this.time >= this.end) this.playing = false;
      else this.#frame = requestAnimationFrame(step);
      this.#tell();
    };
    this.#frame = requestAnimationFrame(step);
    this.#tell();
  }

  pause() {
    if (!this.playing) return;
    cancelAnimationFrame(this.#frame);
    this.playing = false;
    this.#tell();
  }
}

export const clock = new Clock();
