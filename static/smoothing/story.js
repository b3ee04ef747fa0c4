// What an algorithm tells of its first trial: broadcasts and factor graphs, read once per run.

import { Problem, Unreachable, graph } from "../wire/api.js";

const read = new Map();

/** The story of a run's algorithm, null where it cannot be had. */
export function storyOf(run, algorithm) {
  const key = `${run} ${algorithm}`;
  if (!read.has(key)) {
    const coming = graph(run, algorithm).catch((error) => {
      read.delete(key);
      if (error instanceof Problem || error instanceof Unreachable) return null;
      throw error;
    });
    read.set(key, coming);
  }
  return read.get(key);
}

/** Names of the algorithms of a view that have a story. */
export function tellers(view) {
  return Object.keys(view?.algorithms ?? {}).filter((name) => view.algorithms[name].graph);
}

/**
 * What a receiver has of a sender's chain after a broadcast: [{number, kind, prior}] of the launches up to it, in
 * order, kind being "heard", "told" (lost, its prior repeated later) or "missing".
 */
export function chainAt(broadcasts, broadcast, receiver) {
  const launches = new Map();
  for (const other of broadcasts) {
    if (other.sender !== broadcast.sender) continue;
    const arrived = other.receivers.find((r) => r.name === receiver)?.heard ?? false;
    launches.set(other.number, { number: other.number, kind: arrived ? "heard" : "missing", prior: false });
    if (arrived) {
      for (const link of other.links) {
        const launch = launches.get(link.number);
        if (!launch) continue;
        if (launch.kind === "missing" && link.prior) launch.kind = "told";
        launch.prior ||= link.prior !== null;
      }
    }
    if (other === broadcast) break;
  }
  return [...launches.values()].sort((a, b) => a.number - b.number);
}
