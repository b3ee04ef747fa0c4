// Which estimators and vehicles are shown: panes, plots, table, marks of events and the address follow.

import { keepInLink, noteLink } from "./link.js";
import { store } from "./store.js";

/** What can be hidden, and its key in the address. */
const KEYS = { algorithms: "hide", vehicles: "hide-vehicles" };

for (const [kind, key] of Object.entries(KEYS)) {
  keepInLink(key, {
    write: () => [...store.state.hidden[kind]].join(",") || null,
    read: (text) => hide(kind, new Set(text?.split(",").filter(Boolean))),
  });
}

function hide(kind, names) {
  store.set({ hidden: { ...store.state.hidden, [kind]: names } });
  noteLink();
}

/** Shows what was hidden, hides what was shown. */
export function toggleShown(kind, name) {
  const names = new Set(store.state.hidden[kind]);
  if (!names.delete(name)) names.add(name);
  hide(kind, names);
}

/** Shows one alone of all the names; everything again where it was alone already. */
export function showOnly(kind, name, all) {
  const others = all.filter((n) => n !== name);
  const alone = others.length > 0 && others.every((n) => store.state.hidden[kind].has(n)) && !store.state.hidden[kind].has(name);
  hide(kind, new Set(alone ? [] : others));
}

export function showAll() {
  store.set({ hidden: { algorithms: new Set(), vehicles: new Set() } });
  noteLink();
}

/** The open run's algorithms that are shown. */
export function shownAlgorithms({ job, hidden }) {
  return (job?.algorithms ?? []).filter((name) => !hidden.algorithms.has(name));
}

/** The subjects of the open run, as far as they are known: [{name, kind}]. */
export function subjectsOf({ view, live }) {
  const streamed = Object.values(live?.algorithms ?? {})[0]?.subjects ?? {};
  return view?.subjects ?? Object.keys(streamed).map((name) => ({ name, kind: "auv" }));
}

/** What hides all of another run, or the vehicle that curves are about, gives way. */
export function keepSomethingShown() {
  store.watch(["job"], (state) => {
    if (state.job && !shownAlgorithms(state).length) hide("algorithms", new Set());
  });
  store.watch(["view", "hidden"], ({ view, hidden, vehicle }) => {
    if (!view || !hidden.vehicles.has(vehicle)) return;
    const estimated = new Set(Object.values(view.algorithms).flatMap((a) => Object.keys(a.subjects)));
    const next = view.subjects.find((s) => estimated.has(s.name) && !hidden.vehicles.has(s.name));
    if (next) store.set({ vehicle: next.name });
  });
}
