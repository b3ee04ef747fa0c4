// A scenario with some values changed by key path, as the server understands them.

const parts = (path) => path.split(/[.[\]]+/).filter(Boolean);

function step(place, key) {
  if (!Array.isArray(place)) return place?.[key];
  return place.find((item) => item?.name === key) ?? place[Number(key)];
}

/** The value at a key path; undefined where there is none. */
export function valueAt(scenario, path) {
  return parts(path).reduce(step, scenario);
}

/** Changes in the order in which they hold: whole tables and lists before what is in them. */
export function inOrder(changes) {
  return Object.fromEntries(Object.entries(changes).sort(([a], [b]) => parts(a).length - parts(b).length));
}

/** The scenario with the changes made; a change of something that is not there is passed over. */
export function edited(scenario, changes) {
  const copy = structuredClone(scenario);
  for (const [path, value] of Object.entries(inOrder(changes))) {
    const keys = parts(path);
    const place = keys.slice(0, -1).reduce(step, copy);
    if (place === undefined || place === null) continue;
    if (Array.isArray(place)) {
      const at = place.findIndex((item) => item?.name === keys.at(-1));
      place[at < 0 ? Number(keys.at(-1)) : at] = structuredClone(value);
    } else place[keys.at(-1)] = structuredClone(value);
  }
  return copy;
}

/** The changes that change something. */
export function effective(scenario, changes) {
  return Object.fromEntries(Object.entries(changes).filter(([path, value]) => !same(valueAt(scenario, path), value)));
}

export function same(a, b) {
  return JSON.stringify(a ?? null) === JSON.stringify(b ?? null);
}

/** A value in a few words. */
export function told(value) {
  if (value === undefined || value === null) return "none";
  if (typeof value === "number") return String(Number(value.toPrecision(6)));
  if (Array.isArray(value)) {
    if (value.length && value.every((item) => item?.name)) return value.map((item) => item.name).join(", ");
    if (value.every((item) => item?.vehicle)) return value.map(({ vehicle, at_s }) => `${vehicle} ${told(at_s)}`).join(", ");
    return JSON.stringify(value);
  }
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}
