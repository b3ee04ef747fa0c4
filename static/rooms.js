// The rooms of the page: the workbench, all runs, the papers' claims; one of them fills the stage.

import { el, part } from "./look/dom.js";
import { roomLink, runLink } from "./state/link.js";
import { store } from "./state/store.js";

const ROOMS = {
  workbench: { label: "Workbench", hint: "Missions, and the run that is open" },
  runs: { label: "Runs", hint: "All runs: sort, tag, compare" },
  claims: { label: "Claims", hint: "What the papers assert, and what was measured" },
};

export function mountRooms() {
  const links = new Map();
  for (const [room, { label, hint }] of Object.entries(ROOMS)) {
    links.set(room, el("a", { href: room === "workbench" ? "#" : roomLink(room), title: hint, "data-room": room }, label));
  }
  part("rooms").append(...links.values());
  store.watch(["room", "run"], ({ room, run }) => {
    if (document.body.dataset.room !== room) part("stage").scrollTop = 0;
    document.body.dataset.room = room;
    for (const [name, link] of links) {
      if (name === room) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    links.get("workbench").href = run === null ? "#" : runLink(run);
    part("runs-room").hidden = room !== "runs";
    part("claims-room").hidden = room !== "claims";
  });
  store.watch(["room", "job", "compared"], ({ room, job, compared }) => {
    const place = room !== "workbench" ? (compared.length ? "Comparison" : ROOMS[room].label) : job?.title;
    document.title = place ? `${place} · coopnav` : "coopnav";
  });
}
