// A scorecard per paper: every claim in words, what was measured, whether it holds, and where to see it.

import { el, part } from "../look/dom.js";
import { percent, plural } from "../look/format.js";
import { byPaper } from "../library/papers.js";
import { persist } from "../state/connection.js";
import { present, readRuns } from "../state/jobs.js";
import { runLink } from "../state/link.js";
import { store } from "../state/store.js";
import * as api from "../wire/api.js";
import { evidenceOf, measurement, measuring } from "./evidence.js";
import { momentOf } from "./moment.js";
import { figuresOf, verdictOf } from "./words.js";

export function mountScorecard() {
  const room = part("claims-room");
  const sum = el("p", { class: "quiet-inline", role: "status" });
  const all = el("button", { type: "button", class: "primary", id: "measure-all", disabled: true, onclick: () => measure([...cards.values()].map((c) => c.mission)) }, "Measure all that is not");
  const trouble = el("p", { class: "refusal", role: "alert", hidden: true });
  const list = el("div", { class: "papers" });
  const cards = new Map();
  room.append(el("div", { class: "room-tools" }, el("h1", {}, "Claims"), sum, el("span", { class: "spring" }), all), trouble, list);

  /** A card per mission, in sections by paper. */
  function lay(missions) {
    cards.clear();
    const papers = [...byPaper(missions)].map(([paper, members]) => {
      const score = el("span", { class: "score" });
      const button = el("button", { type: "button", class: "small", "aria-label": `Measure the claims of ${paper}`, disabled: true, onclick: () => measure(members) }, "Measure");
      const built = members.map((mission) => card(mission));
      built.forEach((c) => cards.set(c.mission.name, c));
      const section = el("section", { class: "card paper", "aria-label": paper }, el("div", { class: "room-tools" }, el("h2", {}, paper), score, el("span", { class: "spring" }), button), built.map((c) => c.root));
      return { section, score, button, built };
    });
    list.replaceChildren(...papers.map((p) => p.section));
    return papers;
  }

  let papers = [];
  let laid = null;
  let drawing = 0;

  async function draw() {
    const { room: name, missions } = store.state;
    const jobs = present(store.state);
    if (name !== "claims") return;
    if (missions === null || jobs === null) {
      sum.textContent = "Reading the library…";
      return;
    }
    if (laid !== missions) {
      papers = lay(missions.filter((m) => m.available));
      laid = missions;
    }
    const turn = ++drawing;
    for (const paper of papers) {
      for (const c of paper.built) {
        const evidence = await evidenceOf(c.mission, jobs);
        if (turn !== drawing) return;
        c.fill(evidence, measuring(c.mission, jobs));
      }
      paper.section.hidden = paper.built.every((c) => !c.evidence.length);
      paper.score.textContent = scoreOf(paper.built.flatMap((c) => c.evidence));
      paper.button.disabled = paper.built.every((c) => c.busy);
    }
    const evidence = papers.flatMap((p) => p.built.flatMap((c) => c.evidence));
    sum.textContent = scoreOf(evidence);
    all.disabled = evidence.every((e) => e.found) || papers.every((p) => p.built.every((c) => c.busy || c.evidence.every((e) => e.found)));
  }

  /** Runs what measures the claims of missions that are not measured yet; of a single paper or mission, all again. */
  async function measure(missions) {
    trouble.hidden = true;
    const open = missions.filter((m) => !cards.get(m.name).busy && cards.get(m.name).evidence.length);
    const lacking = open.filter((m) => cards.get(m.name).evidence.some((e) => !e.found));
    for (const mission of lacking.length ? lacking : open) {
      cards.get(mission.name).busy = true;
      try {
        const body = await measurement(mission);
        const key = api.newKey();
        await persist(() => api.submit(body, key));
      } catch (error) {
        if (!(error instanceof api.Problem)) throw error;
        trouble.hidden = false;
        trouble.textContent = `${mission.title}: ${error.detail || error.title}`;
        cards.get(mission.name).busy = false;
        break;
      }
    }
    await readRuns();
  }

  function card(mission) {
    const state = el("span", { class: "score" });
    const again = el("button", { type: "button", class: "small", "aria-label": `Measure ${mission.title}`, disabled: true, onclick: () => measure([mission]) }, "Measure");
    const claims = el("ul", { class: "claim-list" });
    const root = el("details", { class: "mission-claims", "data-mission": mission.name }, el("summary", {}, el("span", { class: "title" }, mission.title), state), el("div", { class: "room-tools" }, el("a", { href: `#${new URLSearchParams({ mission: mission.name })}` }, "The mission"), again), claims);
    const built = { mission, root, evidence: [], busy: false, fill };
    let drawn = "";
    function fill(evidence, job) {
      Object.assign(built, { evidence, busy: job !== null });
      root.hidden = !evidence.length;
      state.textContent = job ? `measuring, ${percent(job.progress ?? 0)}` : scoreOf(evidence);
      state.dataset.tone = evidence.some((e) => e.found && !e.found.holds) ? "bad" : "";
      again.disabled = job !== null;
      const now = JSON.stringify(evidence.map((e) => [e.found, e.job?.id]));
      if (now === drawn) return;
      if (evidence.some((e) => e.found && !e.found.holds)) root.open = true;
      drawn = now;
      claims.replaceChildren(...evidence.map(entry));
    }
    return built;
  }

  store.watch(["room", "missions", "jobs", "leaving"], draw);
}

function scoreOf(evidence) {
  const tried = evidence.filter((e) => e.found);
  const holding = tried.filter((e) => e.found.holds).length;
  const left = evidence.length - tried.length;
  if (!tried.length) return `${plural(evidence.length, "claim")}, not measured yet`;
  return `${holding} of ${tried.length} hold${left ? `, ${left} not measured` : ""}`;
}

function entry({ claim, found, job }) {
  const { word, mark, tone } = verdictOf(found?.holds ?? null, "not measured");
  const figures = found ? figuresOf(found) : `${claim.metric} ${claim.operator} ${claim.than ? `${claim.than.metric} of ${claim.than.algorithm}` : claim.bound}`;
  return el(
    "li",
    { "data-holds": String(found?.holds ?? null) },
    el("span", { class: `verdict ${tone}` }, el("span", { class: "mark", "aria-hidden": "true" }, mark), word),
    el("span", { class: "text" }, claim.text),
    el("span", { class: "figures" }, figures),
    job ? showLink(claim, job) : el("span", {}),
  );
}

/** A link to the run, and when it is followed, to the moment in it. */
function showLink(claim, job) {
  const link = el("a", { class: "show", href: runLink(job.id, { vehicle: claim.subject }), "aria-label": `Show: ${claim.text}` }, "Show");
  link.addEventListener("click", async (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const view = await persist(() => api.view(job.id));
    location.hash = runLink(job.id, { t: momentOf(claim, view), vehicle: claim.subject });
  });
  return link;
}
