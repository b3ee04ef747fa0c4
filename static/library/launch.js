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
      const started = await startRun(submission(inputs));
      if (started) part("stage").focus({ preventScroll: true });
    } finally {
      sending = false;
      ready(store.state);
    }
  });

  store.watch(["mission", "missions", "varied"], ({ mission, missions, varied }) => {
    const trials = varied.trials ?? missions?.find((m) => m.name === mission)?.trials;
    inputs.trials.value = trials ? String(trials) : "";
    inputs.seed.value = varied.seed === null ? "" : String(varied.seed);
    inputs[LOSS].value = typeof varied.changes[LOSS] === "number" ? String(varied.changes[LOSS]) : "";
    others.replaceChildren(...Object.entries(beyondFields(varied.changes)).map(change));
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

/** The job that the form describes; what is not a number goes as it was typed, for the server to refuse. */
function submission(inputs) {
  const { mission, ticked, varied } = store.state;
  const body = { scenario: mission, algorithms: ticked, set: beyondFields(varied.changes) };
  const value = (key) => {
    const text = inputs[key].value.trim();
    return text !== "" && Number.isFinite(Number(text)) ? Number(text) : text;
  };
  if (value("trials") !== "") body.trials = value("trials");
  if (value("seed") !== "") body.seed = value("seed");
  if (value(LOSS) !== "" && !inputs[LOSS].closest("label").hidden) body.set[LOSS] = value(LOSS);
  return body;
}

/** Changes that no field of the form shows. */
function beyondFields(changes) {
  return Object.fromEntries(Object.entries(changes).filter(([key, value]) => key !== LOSS || typeof value !== "number"));
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
