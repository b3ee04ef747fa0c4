// This page's session with the scene server: one viser scene per pane, moved together in time.

import { backoff } from "./wait.js";

/** An "at" that does not come within this time is taken as given up. */
const PATIENCE_MS = 1500;

/**
 * A websocket that is opened again when it breaks, and then asked for the same panes.
 *
 * `on.scenes({pane: url})`, `on.camera(pose)`, `on.error(detail)`, `on.link(up)`. One seek is in flight at a time; the newest wins.
 */
export class SceneSession {
  constructor(on) {
    this.on = on;
    this.wanted = null;
    this.settings = {};
    this.attempt = 0;
    this.flying = 0;
    this.next = null;
    this.last = null;
    this.pose = null;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = (this.socket = new WebSocket(`${scheme}//${location.host}/api/scenes/session`));
    socket.addEventListener("open", () => {
      this.attempt = 0;
      this.on.link(true);
      if (this.wanted) this.ask();
    });
    socket.addEventListener("message", ({ data }) => this.hear(JSON.parse(data)));
    socket.addEventListener("close", () => {
      this.land();
      this.on.link(false);
      setTimeout(() => this.open(), backoff(this.attempt++));
    });
  }

  /** Shows a job's algorithms, one pane each; null closes the panes' claim on the session. */
  show(job, panes) {
    this.wanted = job === null ? null : { job, panes };
    this.last = this.next = null;
    this.land();
    if (this.wanted) this.ask();
  }

  ask() {
    this.send({ type: "show", ...this.wanted });
    this.send({ type: "options", ...this.settings });
    if (this.pose) this.send({ type: "camera", pose: this.pose });
    if (this.last !== null) this.seek(this.last);
  }

  /** Looks from a position at a point, together six numbers in scene units. */
  look(pose) {
    this.pose = pose;
    this.send({ type: "camera", pose });
  }

  /** What the panes draw, as the server's options have it. */
  options(settings) {
    if (settings.top !== this.settings.top) this.pose = null;
    this.settings = { ...this.settings, ...settings };
    this.send({ type: "options", ...this.settings });
  }

  seek(time_s) {
    this.last = time_s;
    if (this.flying) {
      this.next = time_s;
      return;
    }
    if (this.send({ type: "seek", time_s })) this.flying = setTimeout(() => this.landed(), PATIENCE_MS);
  }

  hear(message) {
    if (message.type === "at") this.landed();
    else if (message.type === "scenes") {
      this.on.scenes(message.panes);
      if (this.last !== null) this.seek(this.last);
    } else if (message.type === "camera") {
      this.pose = message.pose;
      this.on.camera(message.pose);
    } else if (message.type === "error") this.on.error(message.detail);
  }

  landed() {
    this.land();
    const next = this.next;
    this.next = null;
    if (next !== null) this.seek(next);
  }

  land() {
    clearTimeout(this.flying);
    this.flying = 0;
  }

  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
