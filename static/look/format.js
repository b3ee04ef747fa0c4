// Numbers and times as a person reads them.

export const NONE = "–";

/** Three significant digits, without exponents where they can be avoided; a dash for nothing. */
export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-3)) return value.toExponential(digits - 1);
  const decimals = size === 0 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(decimals, 4));
}

/** A number somebody wrote down, as they would have: 30, 0.2, 145. */
export function written(value) {
  return String(Number(value.toPrecision(4)));
}

/** A whole number with thin spaces between thousands. */
export function count(value) {
  if (value === null || value === undefined) return NONE;
  return Math.round(value).toString().replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

export function metres(value) {
  return value === null || value === undefined || !Number.isFinite(value) ? NONE : `${number(value)} m`;
}

/** Mission time h:mm:ss, with tenths where `fine`. */
export function clockTime(seconds, fine = false) {
  if (!Number.isFinite(seconds)) return NONE;
  const unit = fine ? 10 : 1;
  const whole = Math.round(Math.max(0, seconds) * unit);
  const s = Math.floor(whole / unit);
  const pad = (n) => String(n).padStart(2, "0");
  const text = `${Math.floor(s / 3600)}:${pad(Math.floor(s / 60) % 60)}:${pad(s % 60)}`;
  return fine ? `${text}.${whole % unit}` : text;
}

/** How long something lasts: 45 s, 12 min, 2 h, 1 h 30 min. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  if (seconds < 90) return `${written(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 60) return `${minutes} min`;
  const rest = minutes % 60;
  return rest ? `${Math.floor(minutes / 60)} h ${rest} min` : `${minutes / 60} h`;
}

export function percent(fraction) {
  return `${Math.floor(100 * fraction + 1e-9)} %`;
}

/** "3 trials", "1 trial". */
export function plural(n, one, many = `${one}s`) {
  return `${count(n)} ${n === 1 ? one : many}`;
}

/** A moment in the past as people say it. */
export function ago(iso, now = Date.now()) {
  const seconds = Math.max(0, (now - Date.parse(iso)) / 1000);
  if (!Number.isFinite(seconds)) return "";
  if (seconds < 45) return "just now";
  if (seconds < 3600) return `${Math.max(1, Math.round(seconds / 60))} min ago`;
  if (seconds < 86400) return `${Math.round(seconds / 3600)} h ago`;
  return new Date(iso).toLocaleDateString(undefined, { day: "numeric", month: "short", year: "numeric" });
}
