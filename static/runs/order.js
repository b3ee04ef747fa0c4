// Which runs a list shows, and in what order.

/**
 * RMS error (m) of an estimator of a job over all it locates, {algorithm, error_m}; null where there is none. Of no
 * estimator by name: of the one with the least.
 */
export function errorOf(job, algorithm = "") {
  const found = Object.entries(job.rmse_m ?? {})
    .filter(([name, errors]) => (!algorithm || name === algorithm) && Object.keys(errors).length)
    .map(([name, errors]) => {
      const each = Object.values(errors);
      return { algorithm: name, error_m: Math.sqrt(each.reduce((sum, e) => sum + e * e, 0) / each.length) };
    });
  return found.reduce((least, one) => (least === null || one.error_m < least.error_m ? one : least), null);
}

/**
 * What can be sorted by: a value of a job (null comes last), and whether large or late ones come first at first. Errors
 * are those of an estimator, or the least.
 */
export const KEYS = {
  title: { of: (job) => job.title.toLowerCase(), down: false },
  algorithms: { of: (job) => job.algorithms.length, down: true },
  trials: { of: (job) => job.trials, down: true },
  seed: { of: (job) => job.seed, down: false },
  error: { of: (job, algorithm) => errorOf(job, algorithm)?.error_m ?? null, down: false },
  state: { of: (job) => job.state, down: false },
  created_at: { of: (job) => job.created_at, down: true },
};

/** Jobs that hold every word of a text, are in a state and carry a tag; null asks for nothing. */
export function matching(jobs, { text = "", state = null, tag = null, whatIfs = true }) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return jobs.filter((job) => {
    if (state !== null && job.state !== state) return false;
    if (tag !== null && !job.tags.includes(tag)) return false;
    if (!whatIfs && job.purpose === "what-if") return false;
    const said = [job.title, job.scenario ?? "", job.family, job.state, ...job.algorithms, ...job.tags, ...changesOf(job), `seed ${job.seed}`];
    const all = said.join(" ").toLowerCase();
    return words.every((word) => all.includes(word));
  });
}

/** Jobs in the order of a key; pinned ones first, equal ones newest first. */
export function sorted(jobs, { key, down }, algorithm = "") {
  const compare = (a, b) => (a < b ? -1 : a > b ? 1 : 0);
  const ranked = (a, b) => {
    const [one, other] = [a, b].map((job) => KEYS[key].of(job, algorithm));
    return Number(one === null) - Number(other === null) || (down ? -1 : 1) * compare(one, other);
  };
  return jobs.toSorted((a, b) => Number(b.pinned) - Number(a.pinned) || ranked(a, b) || compare(b.created_at, a.created_at));
}

/** What a job changes in its mission, as "network.loss 0.4". */
export function changesOf(job) {
  return Object.entries(job.changes ?? {}).map(([key, value]) => `${key} ${typeof value === "object" ? JSON.stringify(value) : value}`);
}

/** All tags in use, by name. */
export function tagsOf(jobs) {
  return [...new Set(jobs.flatMap((job) => job.tags))].sort((a, b) => a.localeCompare(b));
}
