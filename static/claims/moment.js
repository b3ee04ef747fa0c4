// The moment of a run that shows a claim best.

/** Curves of a view that a metric is made of. */
const CURVE = { rmse_m: "error_m", sigma_m: "sigma_m", anees: "nees", consistent: "nees", verdict: "nees", max_deviation_m: "error_m" };

/**
 * Mission time (s) at which to look: where the two that a claim compares are furthest apart, where one is at its
 * largest; the end for what is of the end, the first loss for what counts packets.
 */
export function momentOf(claim, view) {
  const end = view.time_s.at(-1) ?? 0;
  const metric = claim.metric.split(".")[0];
  if (metric === "packets") return view.events.find((e) => e.kind === "packet")?.tol_s ?? end;
  const key = CURVE[metric];
  if (!key) return end;
  const one = curve(view, claim.algorithm, claim.subject, key);
  const other = claim.than ? curve(view, claim.than.algorithm, claim.than.subject, key) : null;
  let [best, at] = [-1, end];
  one?.forEach((value, n) => {
    if (value === null || (other && (other[n] ?? null) === null)) return;
    const size = other ? Math.abs(value - other[n]) : value;
    if (size > best) [best, at] = [size, view.time_s[n]];
  });
  return at;
}

function curve(view, algorithm, subject, key) {
  const subjects = view.algorithms[algorithm]?.subjects ?? {};
  return (subjects[subject] ?? Object.values(subjects)[0])?.[key];
}
