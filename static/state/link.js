// The address tells what is shown: #run=ID&t=SECONDS&vehicle=NAME.

/** What the address asks for: {run, time_s, vehicle}, null where it does not say. */
export function readLink() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  const time = wanted.get("t");
  return {
    run: wanted.get("run"),
    time_s: time !== null && Number.isFinite(Number(time)) ? Number(time) : null,
    vehicle: wanted.get("vehicle"),
  };
}

/** Writes the address without a new entry in the browser's history, except for another run. */
export function writeLink({ run, time_s, vehicle }) {
  const parts = new URLSearchParams();
  if (run) parts.set("run", run);
  if (run && time_s !== null) parts.set("t", String(Math.round(time_s * 10) / 10));
  if (run && vehicle) parts.set("vehicle", vehicle);
  const hash = parts.size ? `#${parts}` : "";
  if (hash === location.hash) return;
  const address = location.pathname + location.search + hash;
  if (readLink().run === (run ?? null)) history.replaceState(null, "", address);
  else history.pushState(null, "", address);
}
