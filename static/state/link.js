// The address tells what is shown, so that whoever is sent it sees the same:
// #run=ID&t=SECONDS&vehicle=NAME&…, #mission=NAME, #room=runs&compare=ID,ID, #room=claims.

import { clock } from "./clock.js";
import { closeRun, openRun } from "./run.js";
import { store } from "./store.js";

/** The address is written at most this often while time runs. */
const PAUSE_MS = 400;
const ROOMS = ["runs", "claims"];

const kept = new Map();
let writing = 0;
/** The address as it was last followed or written; where it is another, somebody has just moved on to it. */
let settled = "";

/**
 * Keeps something of an open run in the address under a key: `write()` gives its text, or null for what is usual;
 * `read(text)` takes it when an address is followed, null where that says nothing. `noteLink()` tells of a change.
 */
export function keepInLink(key, { write, read }) {
  kept.set(key, { write, read });
}

/** What is shown has changed: the address follows soon. */
export function noteLink() {
  writing ||= setTimeout(() => {
    writing = 0;
    put(current());
  }, PAUSE_MS);
}

/** The whole address of what is shown now. */
export function addressNow() {
  put(current());
  return location.href;
}

/** The address of a run, as `href` takes it; `parts` may say {t, vehicle, …}. */
export function runLink(id, parts = {}) {
  const said = Object.entries(parts).filter(([, value]) => value !== null && value !== undefined);
  return `#${new URLSearchParams([["run", id], ...said])}`;
}

export function roomLink(room, parts = {}) {
  return `#${new URLSearchParams({ room, ...parts })}`.replaceAll("%2C", ",");
}

/** Follows the address now, and again whenever a person changes it. */
export function mountLink() {
  window.addEventListener("hashchange", follow);
  follow();
  store.watch(["run", "vehicle", "view", "room", "compared", "mission"], noteLink);
  clock.watch(noteLink);
}

function parts() {
  return new URLSearchParams(location.hash.slice(1));
}

function follow() {
  settled = location.hash;
  const wanted = parts();
  const run = wanted.get("run");
  const room = ROOMS.includes(wanted.get("room")) ? wanted.get("room") : "workbench";
  store.set({ room, compared: wanted.get("compare")?.split(",").filter(Boolean) ?? [] });
  if (room !== "workbench") return;
  if (wanted.has("mission")) store.set({ asked: wanted.get("mission") });
  for (const [key, { read }] of kept) if (run) read(wanted.get(key));
  const text = wanted.get("t");
  const time_s = text !== null && text !== "" && Number.isFinite(Number(text)) ? Number(text) : null;
  const vehicle = wanted.get("vehicle");
  if (run && run !== store.state.run) openRun(run, { time_s, vehicle });
  else if (!run && store.state.run !== null) closeRun();
  else if (run) {
    if (vehicle !== null) store.set({ vehicle });
    if (time_s !== null) clock.seek(time_s);
  }
}

/** The address of what is shown. */
function current() {
  const { room, compared, run, view, vehicle, mission, asked } = store.state;
  if (room !== "workbench") return roomLink(room, compared.length ? { compare: compared.join(",") } : {});
  if (run === null) return asked !== null && asked === mission ? `#${new URLSearchParams({ mission })}` : "";
  if (!view) return parts().get("run") === run ? location.hash : runLink(run, { vehicle });
  const t = clock.following ? null : String(Math.round(clock.time * 10) / 10);
  return runLink(run, { t, vehicle, ...Object.fromEntries([...kept].map(([key, { write }]) => [key, write()])) });
}

/** A run takes the open one's place: the way back does not lead to that. */
export function replaceInLink(id) {
  history.replaceState(null, "", runLink(id));
  settled = location.hash;
}

/** Writes the address; another run or room is a new entry in the browser's history. */
function put(hash) {
  if (hash === location.hash || location.hash !== settled) return;
  const place = (text) => ["room", "run"].map((key) => new URLSearchParams(text.slice(1)).get(key)).join();
  const address = location.pathname + location.search + hash;
  if (place(hash) === place(location.hash)) history.replaceState(null, "", address);
  else history.pushState(null, "", address);
  settled = location.hash;
}
