// Reading sampled curves and beliefs at a time.

/** Index of the last time that is not after t; -1 before the first. */
export function indexAt(times, t) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t + 1e-9) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Fourth root of the determinant of a covariance [xx, xy, yy], m; null where it has none. */
export function sigmaOf(cov) {
  if (!cov || cov.some((v) => v === null)) return null;
  const [xx, xy, yy] = cov;
  const determinant = xx * yy - xy * xy;
  return determinant >= 0 ? Math.sqrt(Math.sqrt(determinant)) : null;
}

/** Distance of a belief from the truth (m) and its squared Mahalanobis distance; null where undefined. */
export function departure(mean, cov, truth) {
  if (!mean || !truth || mean[0] === null || truth[0] === null) return null;
  const dx = mean[0] - truth[0];
  const dy = mean[1] - truth[1];
  const [xx, xy, yy] = cov ?? [null, null, null];
  const determinant = xx === null ? 0 : xx * yy - xy * xy;
  const nees = determinant > 0 ? (dx * dx * yy - 2 * dx * dy * xy + dy * dy * xx) / determinant : null;
  return { error_m: Math.hypot(dx, dy), nees };
}
