// What the page knows; modules watch the parts they draw.

/**
 * A store of named values. `watch(names, draw)` draws now and whenever one of them has changed,
 * once per turn of the event loop however many changes there were.
 */
export function createStore(initial) {
  const state = { ...initial };
  const watchers = [];
  let changed = new Set();

  function flush() {
    const names = changed;
    changed = new Set();
    for (const { among, draw } of watchers) if (among.some((name) => names.has(name))) draw(state);
  }

  return {
    state,
    set(values) {
      for (const [name, value] of Object.entries(values)) {
        if (!(name in state)) throw new Error(`the store has no value ${name}`);
        if (Object.is(state[name], value)) continue;
        state[name] = value;
        if (!changed.size) queueMicrotask(flush);
        changed.add(name);
      }
    },
    watch(among, draw) {
      watchers.push({ among, draw });
      draw(state);
    },
  };
}

export const store = createStore({
  /** What fills the stage: "workbench", "runs" or "claims"; and the runs that are compared there, by id. */
  room: "workbench",
  compared: [],
  /** Entries of the library and the installed algorithms; null until they have come. */
  missions: null,
  algorithms: null,
  /** Name of the mission a person asked for, of the mission picked, its scenario once read, and the ticked algorithms. */
  asked: null,
  mission: null,
  scenario: null,
  ticked: [],
  /** What a new run changes in its mission: trials and seed (null: the mission's own), and values by key path. */
  varied: { trials: null, seed: null, changes: {} },
  /** The run that is open: its id from the address on, its job, view and result as they arrive. */
  run: null,
  job: null,
  progress: null,
  live: null,
  view: null,
  result: null,
  /** The subject that curves and readings are about. */
  vehicle: null,
  /** Names of the estimators and vehicles that are hidden everywhere. */
  hidden: { algorithms: new Set(), vehicles: new Set() },
  /** Earlier runs, newest first; null until they have come. And ids of those that are about to be deleted. */
  jobs: null,
  leaving: new Set(),
  /** Whether the server answers. */
  connected: true,
  /** The last refusal of a submission (Problem), and messages about the open run [{tone, title, text, …}]. */
  refusal: null,
  notices: [],
  /** What was just done, for a while: {text, act: {label, run}}; null for nothing. */
  done: null,
});
