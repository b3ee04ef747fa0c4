// Under the slider of a pursuit: the schedules of its architectures on one time axis, and how they follow the target.

import { el, part } from "../look/dom.js";
import { vehicleColour } from "../look/palette.js";
import { lineSample } from "../look/swatch.js";
import { clock } from "../state/clock.js";
import { store } from "../state/store.js";
import { buildResponse } from "./response.js";
import { schedulers, schedules, slotAt } from "./story.js";
import { buildTape } from "./tape.js";

export function mountSchedule() {
  const room = part("schedule");
  const tapes = el("div", { class: "tapes" });
  const response = buildResponse(colourOf);
  const step = (direction, label, sign) => el("button", { type: "button", class: "small", title: `${label} slot of any schedule`, "aria-label": `${label} slot`, onclick: () => stepSlot(direction) }, sign);
  const key = (kind, text) => el("span", { class: "key" }, el("i", { class: kind, "aria-hidden": "true" }), text);
  room.append(
    el(
      "div",
      { class: "heading" },
      el("h2", {}, "Schedule"),
      step(-1, "Previous", "‹ slot"),
      step(1, "Next", "slot ›"),
      el("div", { class: "keys" }, key("heard", "heard"), key("lost", "lost"), key("partial", "P: partial information"), key("full", "F: full information")),
    ),
    tapes,
    response.root,
  );

  let shown = [];
  let wanted = "";
  store.watch(["view", "job", "algorithms"], async ({ view, job, algorithms }) => {
    const names = job?.state === "done" && algorithms ? schedulers(view) : [];
    room.hidden = !names.length;
    const key = names.length ? `${job.id} ${names.join(" ")}` : "";
    if (key === wanted) return;
    wanted = key;
    shown = [];
    tapes.replaceChildren();
    if (!names.length) return;
    const told = await schedules(job.id, names);
    if (wanted !== key) return;
    shown = told.map(({ name, story }) => ({
      story,
      tape: buildTape({ story, title: algorithms.find((a) => a.name === name)?.title ?? name, swatch: lineSample(name, algorithms), colourOf }),
    }));
    tapes.replaceChildren(...shown.map(({ tape }) => tape.root));
    response.show(told, algorithms);
  });
  clock.watch(() => !room.hidden && shown.forEach(({ tape }) => tape.show()));

  /** Moves to the next (+1) or previous (-1) slot of any schedule. */
  function stepSlot(direction) {
    const near = shown.flatMap(({ story: { slots } }) => {
      const n = slotAt(slots, clock.time);
      if (direction > 0) return slots[n + 1] ? [slots[n + 1].start_s] : [];
      const here = slots[n] && slots[n].start_s < clock.time - 0.01 ? n : n - 1;
      return slots[here] ? [slots[here].start_s] : [];
    });
    if (near.length) clock.seek(direction > 0 ? Math.min(...near) : Math.max(...near));
  }
}

/** A vehicle's colour as in the panes; the target's and the shore's is ink. */
function colourOf(name) {
  const place = (store.state.view?.subjects ?? []).findIndex((s) => s.name === name);
  return place < 0 ? "var(--ink)" : vehicleColour(place);
}
