// What was measured of a mission's claims: the newest runs of the mission as it is that try them.

import { scenarioOf } from "../state/library.js";
import { persist } from "../state/connection.js";
import * as api from "../wire/api.js";

/** Of each mission this many runs are read at most. */
const MOST_READ = 6;

const results = new Map();

/** Whether a job tells of a mission's claims: the mission unchanged, with as many trials as it asks for. */
function tells(job, mission) {
  return job.scenario === mission.name && !Object.keys(job.changes ?? {}).length && job.trials >= mission.trials;
}

/** The job that is measuring a mission's claims now, if any. */
export function measuring(mission, jobs) {
  return jobs.find((job) => tells(job, mission) && (job.state === "queued" || job.state === "running")) ?? null;
}

/**
 * A mission's claims with what was found: [{claim, found, job}], found as result.json tells it
 * {value, operator, bound, holds, reason}, null where no run has tried it.
 */
export async function evidenceOf(mission, jobs) {
  const scenario = await scenarioOf(mission.name);
  const candidates = jobs.filter((job) => job.state === "done" && tells(job, mission)).slice(0, MOST_READ);
  const evidence = (scenario?.claims ?? []).map((claim) => ({ claim, found: null, job: null }));
  for (const job of candidates) {
    if (evidence.every((e) => e.found)) break;
    const result = await resultOf(job.id);
    for (const entry of evidence) {
      const found = result?.claims.find((c) => c.text === entry.claim.text && c.holds !== null);
      if (!entry.found && found) Object.assign(entry, { found, job });
    }
  }
  return evidence;
}

/** A finished run's result, read once; null where it is gone. */
function resultOf(id) {
  if (!results.has(id)) {
    const reading = persist(() => api.result(id)).catch((error) => {
      results.delete(id);
      if (error instanceof api.Problem) return null;
      throw error;
    });
    results.set(id, reading);
  }
  return results.get(id);
}

/** What to run to measure a mission's claims: its own estimators, and those its claims are about. */
export async function measurement(mission) {
  const scenario = await scenarioOf(mission.name);
  const about = (scenario?.claims ?? []).flatMap((c) => [c.algorithm, c.than?.algorithm]).filter(Boolean);
  return { scenario: mission.name, algorithms: [...new Set([...mission.algorithms, ...about])] };
}
