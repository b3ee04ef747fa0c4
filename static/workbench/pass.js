// To pass the open run on: its address, its report, its scenario and numbers as files.

import { copy } from "../look/copy.js";
import { el, part } from "../look/dom.js";
import { close, menu } from "../look/menu.js";
import { save } from "../look/save.js";
import { persist } from "../state/connection.js";
import { addressNow } from "../state/link.js";
import { store } from "../state/store.js";
import * as api from "../wire/api.js";

/** What of a finished run can be had as a file: its words, what it is, where, and the end of its name. */
const FILES = [
  { words: "Report (HTML)", hint: "One page that needs nothing else: figures, tables, scenario, versions, seed", path: api.reportPath, ending: "report.html" },
  { words: "Figures (JSON)", hint: "result.json: scenario, metrics of every estimator and vehicle, claims", path: api.resultPath, ending: "result.json" },
  { words: "Tracks (NPZ)", hint: "arrays.npz: truth, means and covariances of every trial", path: api.arraysPath, ending: "arrays.npz" },
  { words: "Tracks (TUM)", hint: "The trial drawn as text files in a ZIP, for evo and its like: time, position, no rotation", path: api.tracksPath, ending: "tracks.zip" },
];

export function mountPass() {
  const report = el("a", { class: "button", target: "_blank", title: "The run as one page, in a new tab" }, "Report");
  const word = el("span", { class: "word", role: "status" });
  const address = el("button", { type: "button", class: "small", title: "Whoever opens it sees this run as you do: estimators, vehicle, time, camera, layout and what is drawn", onclick: share }, "Copy the address");
  const files = FILES.map(({ words, hint }) => el("a", { class: "button small", title: hint, onclick: () => close(sheet) }, words));
  const scenario = el("button", { type: "button", class: "small", title: "The mission as it was run, with its seed and trials", onclick: saveScenario }, "Scenario (TOML)");
  const sheet = menu("view-menu pass", el("summary", {}, "Share"), el("div", { class: "sheet" }, address, files, scenario, word));
  sheet.addEventListener("toggle", () => (word.textContent = ""));
  part("actions").append(report, sheet);

  store.watch(["job", "room"], ({ job, room }) => {
    part("actions").hidden = job === null || room !== "workbench";
    if (job === null) return;
    const name = (job.scenario ?? job.title).replace(/[^\w.-]+/g, "-");
    for (const link of [report, ...files]) link.hidden = job.state !== "done";
    report.href = api.reportPath(job.id);
    FILES.forEach(({ path, ending }, n) => Object.assign(files[n], { href: path(job.id), download: `${name}-${ending}` }));
  });

  async function share() {
    word.textContent = (await copy(addressNow())) ? "The address is copied." : "This browser does not let the page copy.";
  }

  async function saveScenario() {
    const { job } = store.state;
    const { toml } = await persist(() => api.ranScenario(job.id));
    save(toml, `${job.scenario ?? "scenario"}.toml`, "application/toml");
    close(sheet);
  }
}
