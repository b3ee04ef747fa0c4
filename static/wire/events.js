// Server-sent events over fetch, so that a new connection can say where the last one stopped.

import { Problem, problemOf } from "./api.js";
import { backoff, pause } from "./wait.js";

/**
 * Reads a stream of events until `hear({event, data, id})` returns true.
 *
 * A connection that ends before is opened again after the last id heard; `gap(lost)` is told of it.
 * Rejects with a Problem where the server refuses, with an AbortError when the signal aborts.
 */
export async function follow(path, hear, { signal, gap = () => {} } = {}) {
  let last = null;
  let attempt = 0;
  const listen = (event) => {
    attempt = 0;
    if (event.id !== null) last = event.id;
    return hear(event);
  };
  for (;;) {
    try {
      const headers = { accept: "text/event-stream", ...(last === null ? {} : { "last-event-id": last }) };
      const response = await fetch(path, { headers, signal, cache: "no-store" });
      if (!response.ok) throw await problemOf(response);
      gap(false);
      if (await read(response.body, listen)) return;
    } catch (error) {
      const refused = error instanceof Problem && error.status < 500;
      if (refused || error.name === "AbortError") throw error;
      gap(true);
    }
    await pause(backoff(attempt++), signal);
  }
}

/** Reads one response; true when `listen` has heard enough. */
async function read(body, listen) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return false;
    text += value;
    const blocks = text.split(/\r?\n\r?\n/);
    text = blocks.pop();
    for (const block of blocks) {
      const event = parse(block);
      if (event && listen(event)) {
        await reader.cancel();
        return true;
      }
    }
  }
}

/** One event of a stream: {event, data (parsed), id}; null for a comment. */
export function parse(block) {
  const event = { event: "message", data: null, id: null };
  const data = [];
  for (const line of block.split(/\r?\n/)) {
    const colon = line.indexOf(":");
    if (colon <= 0) continue;
    const field = line.slice(0, colon);
    const value = line.slice(colon + 1).replace(/^ /, "");
    if (field === "data") data.push(value);
    else if (field === "event") event.event = value;
    else if (field === "id") event.id = value;
  }
  if (!data.length) return null;
  event.data = JSON.parse(data.join("\n"));
  return event;
}
