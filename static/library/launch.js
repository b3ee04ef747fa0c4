// Trials, seed, packet loss; Run and Cancel; and what was wrong with the last try.

import { el, part } from "../look/dom.js";
import { atWork, cancelRun, startRun } from "../state/run.js";
import { store } from "../state/store.js";
import { lossShort } from "./facts.js";

const LOSS = "network.loss";
/** Fields by the key the server knows them under. */
const FIELDS = {
  trials: { label: "Trials", hint: "How many times the mission is flown, each with noise of its own" },
  seed: { label: "Seed", hint: "Same scenario, seed and version: the same numbers" },
  [LOSS]: { label: "Packet loss", hint: "Fraction of packets lost, 0 to 1; empty leaves the mission's own" },
};

export function mountLaunch() {
  const form = part("panel-new");
  const inputs = {};
  const fields = Object.entries(FIELDS).map(([key, { label, hint }]) => {
    inputs[key] = el("input", {
      id: `field-${key}`,
      name: key,
      type: "text",
      inputmode: key === LOSS ? "decimal" : "numeric",
      autocomplete: "off",
      spellcheck: "false",
      title: hint,
      oninput: () => vary(key, entered(inputs[key])),
      onblur: () => fill(store.state),
    });
    return el("label", { class: "field", for: `field-${key}` }, label, inputs[key]);
  });
  const run = el("button", { type: "submit", class: "primary", id: "run" }, "Run");
  const cancel = el("button", { type: "button", id: "cancel", onclick: cancelRun, hidden: true }, "Cancel");
  const why = el("div", { class: "refusal", role: "alert", id: "refusal", hidden: true });
  const others = el("ul", { class: "varied", "aria-label": "Also changed in the mission" });
  part("launch").append(el("div", { class: "fields" }, fields), others, el("div", { class: "buttons" }, run, cancel), why);

  const ready = ({ ticked, mission, missions }) => {
    const available = missions?.find((m) => m.name === mission)?.available;
    run.disabled = sending || !available || !ticked.length;
    run.title = !available ? "Pick a mission" : ticked.length ? "" : "Tick at least one estimator";
  };
  let sending = false;

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (run.disabled) return;
    sending = true;
    ready(store.state);
    try {
      const started = await startRun(submission(inputs), { ofForm: true });
      if (started) part("stage").focus({ preventScroll: true });
    } finally {
      sending = false;
      ready(store.state);
    }
  });

  /** Fields show what a new run varies; one that is being emptied to be typed in anew stays empty. */
  function fill({ mission, missions, varied }) {
    const usual = { trials: missions?.find((m) => m.name === mission)?.trials };
    for (const [key, input] of Object.entries(inputs)) {
      const value = saidOf(varied, key) ?? usual[key] ?? null;
      const emptied = input === document.activeElement && input.value === "" && saidOf(varied, key) === null;
      if (!emptied && entered(input) !== value) input.value = value ?? "";
    }
  }

  store.watch(["mission", "missions", "varied"], (state) => {
    fill(state);
    others.replaceChildren(...Object.entries(beyondFields(state.varied.changes)).map(change));
    others.hidden = !others.children.length;
  });
  store.watch(["scenario"], ({ scenario }) => {
    inputs.seed.placeholder = scenario?.seed === undefined ? "" : String(scenario.seed);
    inputs[LOSS].placeholder = scenario?.network ? lossShort(scenario.network) : "";
    inputs[LOSS].closest("label").hidden = scenario !== null && !scenario.network;
  });
  store.watch(["ticked", "mission", "missions"], ready);
  store.watch(["job"], ({ job }) => {
    cancel.hidden = !atWork(job);
    run.textContent = atWork(job) ? "Run another" : "Run";
  });
  store.watch(["refusal"], ({ refusal }) => {
    for (const input of Object.values(inputs)) input.removeAttribute("aria-invalid");
    why.hidden = refusal === null;
    why.replaceChildren(...(refusal ? reasons(refusal) : []));
    const at = refusal?.errors.map(({ key }) => inputs[fieldOf(key)]).filter(Boolean) ?? [];
    for (const input of at) input.setAttribute("aria-invalid", "true");
    at[0]?.focus();
  });
}

/** What a field holds: a number, else the text as it was typed, for the server to refuse; null for nothing. */
function entered(input) {
  const text = input.value.trim();
  if (text === "") return null;
  return Number.isFinite(Number(text)) ? Number(text) : text;
}

/** What a new run varies under a field's key; null where it is the mission's own, or nothing that a field shows. */
function saidOf(varied, key) {
  if (key !== LOSS) return varied[key];
  const loss = varied.changes[LOSS];
  return loss === undefined || typeof loss === "object" ? null : loss;
}

/** Varies a new run as a person types, before there is a mission as well. */
function vary(key, value) {
  const { varied } = store.state;
  if (key !== LOSS) store.set({ varied: { ...varied, [key]: value } });
  else {
    const { [LOSS]: _, ...others } = varied.changes;
    store.set({ varied: { ...varied, changes: value === null ? others : { ...others, [LOSS]: value } } });
  }
}

/** The job that the form describes. */
function submission(inputs) {
  const { mission, ticked, varied } = store.state;
  const body = { scenario: mission, algorithms: ticked, set: beyondFields(varied.changes) };
  const [trials, seed, loss] = ["trials", "seed", LOSS].map((key) => entered(inputs[key]));
  if (trials !== null) body.trials = trials;
  if (seed !== null) body.seed = seed;
  if (loss !== null && !inputs[LOSS].closest("label").hidden) body.set[LOSS] = loss;
  return body;
}

/** Changes that no field of the form shows. */
function beyondFields(changes) {
  return Object.fromEntries(Object.entries(changes).filter(([key, value]) => key !== LOSS || typeof value === "object"));
}

/** A change in the mission that an earlier run brought along, with a button that drops it. */
function change([key, value]) {
  const drop = () => {
    const { varied } = store.state;
    const changes = Object.fromEntries(Object.entries(varied.changes).filter(([other]) => other !== key));
    store.set({ varied: { ...varied, changes } });
  };
  const told = typeof value === "object" ? JSON.stringify(value) : String(value);
  return el("li", {}, el("code", {}, key), ` ${told}`, el("button", { type: "button", class: "small", "aria-label": `Leave ${key} as the mission has it`, onclick: drop }, "×"));
}

/** The field of a key path; validation below a key belongs to it. */
function fieldOf(key) {
  return Object.keys(FIELDS).find((field) => key === field || key.startsWith(`${field}.`) || key === `set.${field}`);
}

function reasons(problem) {
  if (!problem.errors.length) return [el("strong", {}, problem.title), el("p", {}, problem.detail)];
  return problem.errors.map(({ key, message, remedy }) =>
    el(
      "p",
      {},
      el("code", {}, key),
      ` ${message}.`,
      remedy ? el("span", { class: "remedy" }, ` ${remedy[0].toUpperCase()}${remedy.slice(1)}.`) : null,
    ),
  );
}
