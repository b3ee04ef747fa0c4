// To keep an edited mission: saved under a name, written to a file, read from one.

import { el } from "../look/dom.js";
import { save as saveFile } from "../look/save.js";
import { readMissions, pickMission } from "../state/library.js";
import { persist } from "../state/connection.js";
import { store } from "../state/store.js";
import * as api from "../wire/api.js";
import { Problem } from "../wire/api.js";
import { inOrder } from "./edits.js";

/** A name as the server takes it, made of any text. */
export function nameOf(text) {
  const plain = text.normalize("NFKD").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "");
  return plain.slice(0, 64).replace(/-+$/, "") || "mission";
}

export function keeping() {
  const name = el("input", { id: "save-name", type: "text", "aria-label": "Name to save it under", autocomplete: "off", spellcheck: "false" });
  const save = el("button", { type: "submit", class: "primary" }, "Save");
  const cancel = el("button", { type: "button", onclick: () => asking(false) }, "Not now");
  const form = el("form", { class: "save-as", hidden: true }, el("label", { for: "save-name" }, "Save the changed mission as"), name, el("div", { class: "buttons" }, save, cancel));
  const file = el("input", { type: "file", accept: ".toml,application/toml", hidden: true, "aria-label": "TOML file of a mission" });
  const word = el("p", { class: "word", role: "status" });
  const ask = el("button", { type: "button", class: "small", onclick: () => asking(true) }, "Save as…");
  const write = el("button", { type: "button", class: "small", title: "The mission as changed, as a TOML file", onclick: download }, "Export TOML");
  const read = el("button", { type: "button", class: "small", title: "A mission from a TOML file, kept among yours", onclick: () => file.click() }, "Import TOML…");
  const root = el("footer", { class: "keeping" }, el("div", { class: "buttons" }, ask, write, read), file, form, word);

  const say = (text, bad = false) => {
    word.textContent = text;
    word.classList.toggle("bad", bad);
  };

  function asking(on) {
    form.hidden = !on;
    ask.hidden = on;
    if (!on) return;
    say("");
    const { mission, missions } = store.state;
    const own = missions.find((m) => m.name === mission && !m.shipped);
    name.value = own ? mission : nameOf(`${mission}-changed`);
    name.focus();
    name.select();
  }

  const current = () => persist(() => api.edited(store.state.mission, inOrder(store.state.varied.changes)));

  /** Does something that the server may refuse, and tells why. */
  async function trying(act) {
    say("");
    try {
      await act();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      say(error.errors.length ? error.errors.map((e) => `${e.key}: ${e.message}; ${e.remedy}`).join("\n") : error.detail, true);
    }
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    trying(async () => {
      const { scenario } = await current();
      const kept = await persist(() => api.saveScenario(name.value.trim(), scenario));
      await taken(kept.name);
      asking(false);
      say(`Saved as ${kept.name}.`);
    });
  });

  function download() {
    trying(async () => {
      const { toml } = await current();
      saveFile(toml, `${store.state.mission}.toml`, "application/toml");
    });
  }

  file.addEventListener("change", () => {
    const [chosen] = file.files;
    file.value = "";
    if (!chosen) return;
    trying(async () => {
      const wanted = nameOf(chosen.name.replace(/\.toml$/i, ""));
      const shipped = store.state.missions.some((m) => m.name === wanted && m.shipped);
      const kept = await persist(async () => api.importToml(shipped ? nameOf(`my-${wanted}`) : wanted, await chosen.text()));
      await taken(kept.name);
      say(`Read ${chosen.name} as ${kept.name}.`);
    });
  });

  return root;
}

/** Picks a mission that has just been saved. */
export async function taken(name) {
  await readMissions();
  store.set({ asked: name });
  pickMission(name);
}
