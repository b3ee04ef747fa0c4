// A series of runs one after the other, as jobs like any other: they stay in the list of runs.

import { persist } from "../state/connection.js";
import * as api from "../wire/api.js";
import { pause } from "../wire/wait.js";

const POLL_MS = 400;

/**
 * Submits each body as a job and waits for it; told(done, total, fraction of the current one).
 * Resolves to [{id, result}] in order. Aborting cancels the job under way.
 */
export async function runSeries(bodies, signal, told) {
  const finished = [];
  for (const [n, body] of bodies.entries()) {
    const key = api.newKey();
    const { id } = await persist(() => api.submit(body, key), signal);
    try {
      for (;;) {
        const job = await persist(() => api.findJob(id, signal), signal);
        if (job.state === "done") break;
        if (job.state === "failed") throw new Error(job.error?.detail ?? "A run of the series failed.");
        if (job.state === "cancelled") throw new Error("A run of the series was cancelled.");
        told(n, bodies.length, job.progress ?? 0);
        await pause(POLL_MS, signal);
      }
    } catch (error) {
      if (error.name === "AbortError") await api.cancel(id);
      throw error;
    }
    finished.push({ id, result: await persist(() => api.result(id, signal), signal) });
    told(n + 1, bodies.length, 0);
  }
  return finished;
}
