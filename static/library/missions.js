// The mission picker: what can be run, by family.

import { el, part } from "../look/dom.js";
import { pickMission, scenarioOf } from "../state/library.js";
import { store } from "../state/store.js";
import { sketch } from "./sketch.js";

const FAMILIES = {
  navigation: "Cooperative navigation",
  tracking: "Target tracking",
  pursuit: "Pursuit",
  smoothing: "Smoothing",
  slam: "SLAM",
};

export function mountMissions() {
  const list = part("missions");
  store.watch(["missions"], ({ missions }) => {
    if (missions === null) list.replaceChildren(...Array.from({ length: 4 }, () => el("div", { class: "ghost mission" })));
    else if (!missions.length) list.replaceChildren(el("p", { class: "quiet" }, "The library holds no missions."));
    else list.replaceChildren(...families(missions));
    sketchAll(list);
  });
  store.watch(["mission", "missions"], ({ mission }) => {
    for (const input of list.querySelectorAll("input")) input.checked = input.value === mission;
    list.querySelector("input:checked")?.closest("label").scrollIntoView({ block: "nearest" });
  });
}

function families(missions) {
  const groups = Map.groupBy(missions, (m) => m.family || "unreadable");
  return [...groups].map(([family, members]) =>
    el(
      "div",
      { class: "family", role: "group", "aria-label": FAMILIES[family] ?? family },
      el("h3", {}, FAMILIES[family] ?? family[0].toUpperCase() + family.slice(1)),
      members.map(entry),
    ),
  );
}

function entry(mission) {
  return el(
    "label",
    { class: mission.available ? "mission" : "mission missing", "data-name": mission.name, title: mission.summary },
    el("input", {
      type: "radio",
      name: "mission",
      value: mission.name,
      "aria-label": mission.title,
      "aria-description": mission.available ? mission.summary : `Cannot run here: ${mission.missing}`,
      disabled: !mission.available,
      onchange: () => pickMission(mission.name),
    }),
    el("span", { class: "picture" }),
    el(
      "span",
      { class: "words" },
      el("span", { class: "title" }, mission.title, mission.shipped ? null : el("span", { class: "tag" }, "yours")),
      mission.summary ? el("span", { class: "summary" }, mission.summary) : null,
      mission.source ? el("span", { class: "source" }, mission.source) : null,
      mission.available ? null : el("span", { class: "why" }, `Cannot run here: ${mission.missing}`),
    ),
  );
}

/** Draws the pictures one after the other, so as not to ask for all scenarios at once. */
async function sketchAll(list) {
  for (const label of list.querySelectorAll("label.mission:not(.missing)")) {
    const scenario = await scenarioOf(label.dataset.name);
    if (!label.isConnected) return;
    label.querySelector(".picture").replaceChildren(sketch(scenario, 52, 40));
  }
}
