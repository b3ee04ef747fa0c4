// Whether the server answers: asked when something else has failed, and again until it does.

import * as api from "../wire/api.js";
import { backoff, pause } from "../wire/wait.js";
import { store } from "./store.js";

let asking = null;

/** Something went unanswered: find out whether the server is gone, and wait for it. */
export function suspect() {
  asking ??= ask().finally(() => (asking = null));
  return asking;
}

async function ask() {
  for (let attempt = 0; ; attempt += 1) {
    try {
      await api.health(AbortSignal.timeout(4000));
      store.set({ connected: true });
      return;
    } catch (error) {
      // Any answer, even a refusal, is an answer.
      if (error instanceof api.Problem && error.status < 500) {
        store.set({ connected: true });
        return;
      }
      store.set({ connected: false });
    }
    await pause(backoff(attempt));
  }
}

/** Does something that needs the server, again after it has been away; other errors pass. */
export async function persist(act, signal) {
  for (;;) {
    try {
      return await act();
    } catch (error) {
      if (!(error instanceof api.Unreachable)) throw error;
      signal?.throwIfAborted();
      await suspect();
      await pause(200, signal);
    }
  }
}
