// A recorded log of one's own as a mission: files, what their columns are, what was understood, saved under a name.

import { el, part } from "../look/dom.js";
import { count } from "../look/format.js";
import { persist } from "../state/connection.js";
import { store } from "../state/store.js";
import { nameOf, taken } from "../whatif/keeping.js";
import * as api from "../wire/api.js";
import { Problem } from "../wire/api.js";
import { graphForm } from "./graph.js";
import { usesOf } from "./guess.js";
import { csvMission, pyfgMission, pyfgVehicles, vehiclesOf } from "./mission.js";
import { understanding } from "./understood.js";
import { VEHICLES, useForm } from "./use.js";
import { vehicleList } from "./vehicles.js";

const ACCEPTED = ".csv,.tsv,.txt,.pyfg,.fg";
/** A mapping is tried this long after its last change. */
const PAUSE_MS = 250;

export function mountUpload() {
  const open = el("button", { type: "button", id: "bring-log", onclick: () => build().showModal() }, "Bring a recorded log…");
  part("missions").after(el("div", { class: "bring" }, open));
}

function build() {
  const chosen = el("input", { type: "file", multiple: true, accept: ACCEPTED, "aria-label": "Files of the log" });
  const drop = el("div", { class: "drop" }, el("p", {}, "Drop CSV or PyFG files here, or choose them:"), chosen);
  const progress = el("p", { class: "progress", role: "status" });
  const files = el("div", { class: "files" });
  const team = vehicleList(soon);
  const teamRoom = el("section", { hidden: true, "aria-label": "Vehicles" }, el("h3", {}, "Vehicles"), team.root);
  const seen = el("section", { class: "seen", "aria-label": "What was understood", "aria-live": "polite" }, el("p", { class: "quiet" }, "What is understood of the log appears here."));
  const title = el("input", { type: "text", id: "log-title", value: "My recorded mission", onchange: soon });
  const save = el("button", { type: "button", class: "primary", disabled: true, onclick: keep }, "Save the mission");
  const close = el("button", { type: "button", onclick: () => dialog.close() }, "Close");
  const known = el("datalist", { id: VEHICLES });
  const dialog = el(
    "dialog",
    { class: "upload", "aria-labelledby": "upload-heading" },
    el("header", {}, el("h2", { id: "upload-heading" }, "A recorded log as a mission"), close),
    el("div", { class: "sides" }, el("div", { class: "form" }, drop, progress, files, teamRoom), seen),
    el("footer", {}, el("label", { for: "log-title" }, "Title"), title, save),
    known,
  );
  document.body.append(dialog);

  let log = null;
  let kept = false;
  let described = [];
  let forms = [];
  let graph = null;
  let mission = null;
  let timer = 0;
  let trying = null;
  let schema = null;

  dialog.addEventListener("close", () => {
    trying?.abort();
    clearTimeout(timer);
    dialog.remove();
    if (log !== null && !kept) forget(log);
  });
  for (const kind of ["dragover", "drop"]) dialog.addEventListener(kind, (event) => event.preventDefault());
  dialog.addEventListener("drop", (event) => take([...event.dataTransfer.files]));
  chosen.addEventListener("change", () => take([...chosen.files]));

  function say(text, bad = false) {
    progress.textContent = text;
    progress.classList.toggle("bad", bad);
  }

  async function take(given) {
    if (!given.length) return;
    try {
      log ??= await freeName(given[0].name);
      for (const [n, file] of given.entries()) {
        say(`Sending ${file.name}, ${n + 1} of ${given.length}…`);
        await persist(() => api.sendLogFile(log, fileName(file.name), file));
      }
      schema ??= await persist(() => api.schema("navigation"));
      described = (await persist(() => api.describeLog(log))).files;
      say("");
      lay();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      say(error.detail, true);
    }
    chosen.value = "";
  }

  /** Lays out a form for every file, each with the uses it is probably for. */
  function lay() {
    const before = forms.map((f) => f.use());
    forms = [];
    graph = null;
    const csv = described.filter((f) => f.format === "csv" && !f.problem);
    const usual = "vehicle";
    files.replaceChildren(
      ...described.map((file) => {
        const room = el("div", { class: "uses" });
        const told = file.format === "csv" && file.rows ? `${count(file.rows)} rows, ${file.columns.length} columns` : "";
        const head = el("div", { class: "heading" }, el("h3", {}, file.name), el("span", { class: "quiet" }, told));
        if (file.problem) {
          return el("section", { class: "file faulty", "aria-label": file.name }, head, el("p", { class: "faults" }, `${file.problem.message}; ${file.problem.remedy}`));
        }
        if (file.format === "pyfg") {
          graph = { file, form: graphForm(file, soon) };
          room.append(graph.form.root);
          return el("section", { class: "file", "aria-label": file.name }, head, room);
        }
        const add = (wanted) => {
          const form = useForm(file, schema, wanted, usual, soon, () => {
            forms = forms.filter((f) => f !== form);
            form.root.remove();
            soon();
          });
          forms.push(form);
          room.append(form.root);
        };
        const had = before.filter((use) => use.file === file.name);
        for (const wanted of had.length ? had : usesOf(file)) add(wanted);
        const more = el("button", { type: "button", class: "small", onclick: () => (add({ kind: "fixes", values: {} }), soon()) }, room.children.length ? "It also holds…" : "Say what it holds…");
        return el("section", { class: "file", "aria-label": file.name }, head, sample(file), room, more);
      }),
    );
    if (graph && csv.length) say("A PyFG file is a mission of its own: the CSV files beside it are not used.", true);
    soon();
  }

  function current() {
    if (graph) {
      const names = graph.form.names();
      return { vehicles: pyfgVehicles(names), scenario: pyfgMission(log, title.value.trim(), graph.file.name, names, team.about) };
    }
    const uses = forms.map((f) => f.use());
    return { vehicles: vehiclesOf(uses), scenario: csvMission(log, title.value.trim(), uses, team.about) };
  }

  function soon() {
    clearTimeout(timer);
    timer = setTimeout(attempt, PAUSE_MS);
  }

  /** Tries the mapping; the newest counts. */
  async function attempt() {
    trying?.abort();
    const { signal } = (trying = new AbortController());
    if (log === null || !(forms.length || graph)) return;
    const { vehicles, scenario } = current();
    teamRoom.hidden = !vehicles.length;
    team.show(vehicles);
    known.replaceChildren(...vehicles.map((v) => el("option", { value: v.name })));
    try {
      const found = await persist(() => api.previewLog(log, scenario, signal), signal);
      mission = scenario;
      fault([], scenario);
      seen.replaceChildren(understanding(found));
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      mission = null;
      fault(error.errors, scenario);
      const told = error.errors.map((e) => el("li", {}, el("code", {}, e.key), ` ${e.message}; `, el("span", { class: "remedy" }, e.remedy)));
      seen.replaceChildren(el("p", { class: "bad" }, "This cannot be read yet:"), el("ul", { class: "faults" }, told.length ? told : el("li", {}, error.detail)));
    }
    save.disabled = mission === null;
    dialog.dataset.state = mission === null ? "faulty" : "understood";
  }

  /** Marks problems at the forms they are about. */
  function fault(problems, scenario) {
    const mine = (key) => problems.filter((p) => p.key === key || p.key.startsWith(`${key}.`) || p.key.startsWith(`${key}[`));
    const counted = new Map();
    for (const form of forms) {
      const { kind } = form.use();
      const n = counted.get(kind) ?? 0;
      counted.set(kind, n + 1);
      form.fault(mine(`mission.${kind}[${n}]`));
    }
    scenario.vehicles.forEach((_, n) => team.fault(n, mine(`vehicles[${n}]`)));
  }

  async function keep() {
    save.disabled = true;
    try {
      const titled = { ...mission, title: title.value.trim() || mission.title };
      const { name } = await persist(() => api.saveScenario(free(nameOf(titled.title), store.state.missions.map((m) => m.name)), titled));
      kept = true;
      dialog.close();
      await taken(name);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      say(error.detail, true);
      save.disabled = false;
    }
  }

  return dialog;
}

function sample(file) {
  return el(
    "div",
    { class: "scroll-x" },
    el(
      "table",
      { "aria-label": `First rows of ${file.name}` },
      el("thead", {}, el("tr", {}, file.columns.map((c) => el("th", { scope: "col" }, c.name)))),
      el("tbody", {}, file.sample.slice(0, 3).map((row) => el("tr", {}, row.map((cell) => el("td", {}, cell.length > 24 ? `${cell.slice(0, 23)}…` : cell))))),
    ),
  );
}

/** A name for a file as the server takes it. */
function fileName(text) {
  const plain = text.replace(/[^A-Za-z0-9_.-]+/g, "-").replace(/^[^A-Za-z0-9]+/, "");
  return plain.slice(-100).replace(/^[^A-Za-z0-9]+/, "") || "log.csv";
}

/** A name for the log that no other has yet. */
async function freeName(file) {
  return free(nameOf(file.replace(/\.\w+$/, "")), (await persist(api.logs)).map((l) => l.name));
}

/** A name like the wanted one that is not taken. */
function free(wanted, taken) {
  for (let n = 1; ; n += 1) {
    const name = n === 1 ? wanted : `${wanted.slice(0, 58).replace(/-+$/, "")}-${n}`;
    if (!taken.includes(name)) return name;
  }
}

async function forget(log) {
  try {
    await api.removeLog(log);
  } catch (error) {
    if (!(error instanceof Problem || error instanceof api.Unreachable)) throw error;
  }
}
