// The what-if panel: knobs of the picked mission, what they change in it, and what that does to the estimates.

import { el, part } from "../look/dom.js";
import { persist } from "../state/connection.js";
import { store } from "../state/store.js";
import { again, rest, whatif } from "../state/whatif.js";
import * as api from "../wire/api.js";
import { changesList } from "./changes.js";
import { edited, effective } from "./edits.js";
import { effectTable } from "./effect.js";
import { fieldsOf } from "./fields.js";
import { keeping } from "./keeping.js";
import { knobRow } from "./knob.js";
import { knobOf, knobsOf } from "./knobs.js";

/** So many of the keys that are searched for are shown. */
const MOST_FOUND = 14;

const schemas = new Map();

export function mountWhatIf() {
  const room = part("panel-whatif");
  const title = el("h2", {});
  const status = el("p", { class: "status", role: "status" });
  const trials = el("input", { id: "whatif-trials", type: "text", inputmode: "numeric", autocomplete: "off", value: whatif.state.trials, title: "How many times a what-if is flown: fewer are faster" });
  const live = el("input", { type: "checkbox", id: "whatif-live", checked: true, onchange: () => whatif.set({ live: live.checked }) });
  const first = el("div", { class: "knobs", role: "group", "aria-label": "What to change" });
  const search = el("input", { type: "search", id: "find-key", placeholder: "Any other key: depth, gps, gate…", "aria-label": "Search the mission's keys", autocomplete: "off" });
  const found = el("div", { class: "knobs found", role: "group", "aria-label": "Keys found" });
  const changes = el("section", { class: "changes", "aria-label": "Changes to the saved mission" });
  const effect = el("section", { class: "effect", "aria-label": "What the changes do" });
  const none = el("p", { class: "quiet" }, "Pick a mission first.");
  const body = el(
    "div",
    { class: "body" },
    el(
      "div",
      { class: "how" },
      el("label", { class: "toggle", title: "Run again as a slider moves" }, live, "Run as I drag"),
      el("label", { class: "toggle", for: "whatif-trials" }, trials, "trials"),
    ),
    status,
    first,
    search,
    found,
    changes,
    effect,
  );
  room.append(el("header", {}, title), none, body, keeping());

  let saved = null;
  let schema = null;
  let rows = [];
  let built = "";

  /** Makes a change of the mission: values by key path. */
  function change(values) {
    const { varied } = store.state;
    const next = effective(saved, { ...varied.changes, ...values });
    store.set({ varied: { ...varied, changes: next } });
    if (whatif.state.live) again();
  }

  function revert(paths) {
    const { varied } = store.state;
    const next = Object.fromEntries(Object.entries(varied.changes).filter(([path]) => !paths.includes(path)));
    store.set({ varied: { ...varied, changes: next } });
    if (whatif.state.live) again();
  }

  const current = () => edited(saved, effective(saved, store.state.varied.changes));

  function build() {
    const now = current();
    const fields = fieldsOf(schema, now);
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const hits = words.length ? fields.filter((f) => words.every((w) => `${f.path} ${f.meaning}`.toLowerCase().includes(w))) : [];
    const knobs = knobsOf(now, fields);
    const shape = JSON.stringify([store.state.mission, knobs.map((k) => [k.id, k.keys]), hits.map((f) => [f.path, f.kind]).slice(0, MOST_FOUND)]);
    if (shape !== built) {
      built = shape;
      const make = (knob) => knobRow(knob, saved, current, change);
      const [top, below] = [knobs.map(make), hits.slice(0, MOST_FOUND).map((f) => make(knobOf(f)))];
      rows = [...top, ...below];
      first.replaceChildren(...top.map((r) => r.root));
      found.replaceChildren(...below.map((r) => r.root));
      if (words.length && hits.length !== below.length) found.append(el("p", { class: "quiet" }, `${hits.length - below.length} more keys match; type more words.`));
      if (words.length && !hits.length) found.append(el("p", { class: "quiet" }, "No key of this mission matches."));
    }
    for (const row of rows) row.show(now);
  }

  async function meet({ scenario, mission, missions }) {
    const entry = missions?.find((m) => m.name === mission);
    none.hidden = scenario !== null;
    body.hidden = scenario === null;
    title.textContent = entry?.title ?? "What if";
    if (scenario === null) return;
    const { family } = scenario;
    if (!schemas.has(family)) schemas.set(family, persist(() => api.schema(family)));
    const known = await schemas.get(family);
    if (store.state.scenario !== scenario) return;
    if (saved !== scenario) {
      whatif.set({ saved: null });
      built = "";
      if (scenario.mission?.kind === "recorded" && !scenario.network?.loss) trials.value = String(scenario.trials);
      whatif.set({ trials: Number(trials.value) });
    }
    saved = scenario;
    schema = known;
    build();
    changes.replaceChildren(changesList(saved, effective(saved, store.state.varied.changes), revert));
  }

  store.watch(["scenario", "missions", "varied"], meet);
  store.watch(["mission"], rest);
  search.addEventListener("input", () => schema && build());
  search.addEventListener("keydown", (event) => event.key === "Enter" && event.preventDefault());
  trials.addEventListener("change", () => {
    const wanted = Number(trials.value);
    const fits = Number.isInteger(wanted) && wanted >= 1;
    trials.toggleAttribute("aria-invalid", !fits);
    if (!fits) return;
    whatif.set({ trials: wanted });
    if (whatif.state.live && whatif.state.state !== "idle") again();
  });
  whatif.watch(["state", "refusal", "took_s"], (now) => {
    room.dataset.state = now.state;
    status.replaceChildren(...statusOf(now));
    for (const row of rows) row.refuse(now.refusal);
  });
  const compare = () => effect.replaceChildren(effectTable(store.state, whatif.state));
  store.watch(["result", "vehicle", "algorithms"], compare);
  whatif.watch(["saved", "state"], compare);
}

function statusOf({ state, refusal, took_s }) {
  if (state === "refused") {
    if (!refusal.errors.length) return [el("strong", {}, refusal.title), ` ${refusal.detail}`];
    return refusal.errors.slice(0, 3).map(({ key, message, remedy }) => el("span", { class: "fault" }, el("code", {}, key), ` ${message}; ${remedy}.`));
  }
  if (state === "waiting" || state === "running") return ["Flying it again…"];
  if (state === "shown") return [`Shown: the mission as changed, after ${took_s.toFixed(1)} s.`];
  return ["Move a slider: the mission is flown again, and the curves follow."];
}
