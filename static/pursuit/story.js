// What pursuits tell of their first trial's schedule.

import { storyOf } from "../smoothing/story.js";

/** Updates as the engine numbers them. */
export const KINDS = ["none", "partial", "full"];

/** Names of the algorithms of a view that tell of a schedule. */
export function schedulers(view) {
  return Object.keys(view?.algorithms ?? {}).filter((name) => view.algorithms[name].schedule);
}

/** Schedules of a run by algorithm; those that cannot be had are left out. */
export async function schedules(run, names) {
  const told = await Promise.all(names.map((name) => storyOf(run, name)));
  return names.map((name, n) => ({ name, story: told[n] })).filter(({ story }) => story);
}

/** Number of the slot whose transmission had begun by a time, -1 before the first. */
export function slotAt(slots, time) {
  let [low, high] = [0, slots.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (slots[middle].start_s <= time + 1e-6) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Everybody who could have heard a slot: the vehicles but its sender, and the shore where it listens. */
export function listeners(story, slot) {
  const shore = story.holders[0] === "shore" && story.vehicles.includes(slot.sender) ? ["shore"] : [];
  return [...story.vehicles.filter((name) => name !== slot.sender), ...shore];
}

/** What happened in a slot, in words. */
export function words(story, slot) {
  const whose = { target: "The target's ping", shore: "The shore's command" }[slot.sender] ?? `${slot.sender}'s message`;
  if (!slot.spoke) return `${slot.sender === "shore" ? "The shore" : slot.sender} had nothing to say.`;
  const missed = listeners(story, slot).filter((name) => !slot.heard.includes(name));
  const heard = slot.heard.length ? `heard by ${slot.heard.join(", ")}` : "heard by nobody";
  const updates = story.holders.flatMap((name, h) => (slot.kinds[h] ? [`${KINDS[slot.kinds[h]]} update of ${name}`] : []));
  return `${whose}: ${heard}${missed.length ? `, lost by ${missed.join(", ")}` : ""}${updates.length ? `; ${updates.join(", ")}` : ""}.`;
}
