/** Resolves after a pause, or rejects with an AbortError as soon as the signal aborts. */
export function pause(milliseconds, signal) {
  return new Promise((resolve, reject) => {
    const stop = () => {
      clearTimeout(timer);
      reject(new DOMException("aborted", "AbortError"));
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", stop);
      resolve();
    }, milliseconds);
    if (signal?.aborted) stop();
    else signal?.addEventListener("abort", stop, { once: true });
  });
}

/** Pauses between attempts, in milliseconds: short at first, then every five seconds. */
export function backoff(attempt) {
  return Math.min(5000, 300 * 2 ** attempt);
}
