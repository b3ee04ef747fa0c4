// What localization by sound tells of its first trial: beliefs, beams, records and the tree as they grew.

import { storyOf } from "../smoothing/story.js";

/** Names of the algorithms of a view that tell how their beliefs grew. */
export function listeners(view) {
  return Object.keys(view?.algorithms ?? {}).filter((name) => view.algorithms[name].sound);
}

/** Moments of a run's algorithm, in order of time; none where they cannot be had. */
export async function momentsOf(run, name) {
  return (await storyOf(run, name))?.moments ?? [];
}

/** The number of the last moment at a time, -1 before the first. */
export function momentAt(moments, time_s) {
  return moments.findLastIndex((m) => m.time_s <= time_s + 1e-6);
}
