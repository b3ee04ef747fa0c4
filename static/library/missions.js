// The mission picker: what can be run, by family and paper, to be searched.

import { el, part } from "../look/dom.js";
import { pickMission, scenarioOf } from "../state/library.js";
import { store } from "../state/store.js";
import { byPaper } from "./papers.js";
import { sketch } from "./sketch.js";

const FAMILIES = {
  navigation: "Cooperative navigation",
  smoothing: "Smoothing",
  tracking: "Target tracking",
  pursuit: "Pursuit",
  slam: "Localization by sound",
};

export function mountMissions() {
  const list = part("missions");
  const search = el("input", { type: "search", id: "find-mission", placeholder: "Search missions", "aria-label": "Search missions", autocomplete: "off" });
  const none = el("p", { class: "quiet", role: "status" });
  const shelf = el("div", {});
  list.before(search);
  list.append(shelf, none);

  const find = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const label of shelf.querySelectorAll(".mission")) {
      const text = label.dataset.text ?? "";
      label.hidden = !words.every((word) => text.includes(word));
    }
    for (const group of shelf.querySelectorAll(".paper-group, .family")) group.hidden = !group.querySelector(".mission:not([hidden])");
    const found = shelf.querySelector(".mission:not([hidden])");
    none.textContent = store.state.missions?.length && !found ? "No mission matches." : "";
    none.hidden = !none.textContent;
  };
  search.addEventListener("input", find);
  search.addEventListener("keydown", (event) => {
    if (event.key === "Enter") {
      event.preventDefault();
      shelf.querySelector(".mission:not([hidden], .missing) input")?.click();
    } else if (event.key === "Escape" && search.value) {
      event.stopPropagation();
      search.value = "";
      find();
    }
  });

  store.watch(["missions"], ({ missions }) => {
    search.disabled = !missions?.length;
    if (missions === null) shelf.replaceChildren(...Array.from({ length: 4 }, () => el("div", { class: "ghost mission" })));
    else if (!missions.length) shelf.replaceChildren(el("p", { class: "quiet" }, "The library holds no missions."));
    else shelf.replaceChildren(...families(missions));
    find();
    sketchAll(shelf);
  });
  store.watch(["mission", "missions"], ({ mission }) => {
    for (const input of shelf.querySelectorAll("input")) input.checked = input.value === mission;
    shelf.querySelector("input:checked")?.closest("label").scrollIntoView({ block: "nearest" });
  });
}

function families(missions) {
  const groups = Map.groupBy(missions, (m) => m.family || "unreadable");
  const order = Object.keys(FAMILIES);
  const place = (family) => (order.includes(family) ? order.indexOf(family) : order.length);
  return [...groups]
    .sort(([a], [b]) => place(a) - place(b))
    .map(([family, members]) => {
      const name = FAMILIES[family] ?? family[0].toUpperCase() + family.slice(1);
      const papers = [...byPaper(members)].map(([paper, own]) =>
        el("div", { class: "paper-group", role: "group", "aria-label": paper }, el("h4", {}, paper), own.map((m) => entry(m, name, paper))),
      );
      return el("div", { class: "family", role: "group", "aria-label": name }, el("h3", {}, name), papers);
    });
}

function entry(mission, family, paper) {
  const text = [mission.title, mission.name, mission.summary, mission.source, family, paper, ...mission.vehicles].join(" ").toLowerCase();
  return el(
    "label",
    { class: mission.available ? "mission" : "mission missing", "data-name": mission.name, "data-text": text, title: mission.summary },
    el("input", {
      type: "radio",
      name: "mission",
      value: mission.name,
      "aria-label": mission.title,
      "aria-description": mission.available ? mission.summary : `Cannot run here: ${mission.missing}`,
      disabled: !mission.available,
      onchange: () => {
        store.set({ asked: mission.name });
        pickMission(mission.name);
      },
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
async function sketchAll(shelf) {
  for (const label of shelf.querySelectorAll("label.mission:not(.missing)")) {
    const scenario = await scenarioOf(label.dataset.name);
    if (!label.isConnected) return;
    label.querySelector(".picture").replaceChildren(sketch(scenario, 52, 40));
  }
}
