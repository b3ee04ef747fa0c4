// One knob: its name, a slider about the saved value, and the value to type.

import { el } from "../look/dom.js";
import { told, valueAt } from "./edits.js";
import { scaleOf } from "./knobs.js";

const STEPS = 200;

/**
 * A row {root, show(edited), refuse(problem)} for a knob of a saved scenario; current() is the scenario as edited,
 * change(values) edits it.
 */
export function knobRow(knob, saved, current, change) {
  const id = `knob-${knob.id.replace(/[^\w-]/g, "-")}`;
  const control = (knob.kind === "flag" ? flag : knob.kind === "choice" ? choice : slider)(knob, saved, current, change, id);
  const base = valueAt(saved, knob.keys[0]);
  const was = el("span", { class: "was" });
  const name = el("label", { for: id, title: knob.hint }, knob.label, knob.unit ? el("span", { class: "unit" }, ` ${knob.unit}`) : null);
  const root = el("div", { class: "knob", "data-knob": knob.id, title: knob.hint }, name, control.nodes, was);
  return {
    root,
    show(edited) {
      control.show(edited);
      const now = knob.read(edited);
      const differs = JSON.stringify(now ?? null) !== JSON.stringify(savedOf(knob, saved, base) ?? null);
      root.toggleAttribute("data-changed", differs);
      was.textContent = differs ? `was ${told(savedOf(knob, saved, base))}` : "";
    },
    refuse(problem) {
      const wrong = problem?.errors.some(({ key }) => knob.keys.some((own) => key === own || own.startsWith(key) || key.startsWith(`${own}[`)));
      root.toggleAttribute("data-refused", Boolean(wrong));
    },
  };
}

function savedOf(knob, saved, base) {
  return knob.id === "vehicles" ? saved.vehicles.length : base;
}

function slider(knob, saved, current, change, id) {
  const scale = scaleOf(knob, savedOf(knob, saved, valueAt(saved, knob.keys[0])) ?? knob.read(current()));
  const bar = el("input", { id, type: "range", min: 0, max: STEPS, step: "any", "aria-label": knob.label });
  const field = el("input", { type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${knob.label}, value`, placeholder: "none" });
  const set = (value) => change(knob.write(value, current()));
  bar.addEventListener("input", () => {
    const value = scale.value(Number(bar.value) / STEPS);
    if (value !== knob.read(current())) set(value);
  });
  field.addEventListener("change", () => {
    const text = field.value.trim();
    const value = Number(text);
    const typed = text !== "" && Number.isFinite(value) && (knob.kind !== "integer" || Number.isInteger(value));
    field.toggleAttribute("aria-invalid", !typed);
    if (typed) set(value);
  });
  return {
    nodes: [bar, field],
    show(edited) {
      const value = knob.read(edited);
      if (document.activeElement !== bar) bar.value = String(STEPS * scale.place(value ?? 0));
      if (document.activeElement !== field || bar.matches(":active")) field.value = typeof value === "number" ? told(value) : "";
      bar.setAttribute("aria-valuetext", `${told(value)} ${knob.unit}`.trim());
    },
  };
}

function flag(knob, saved, current, change, id) {
  const box = el("input", { id, type: "checkbox", onchange: () => change(knob.write(box.checked, current())) });
  return { nodes: [box], show: (edited) => (box.checked = knob.read(edited) === true) };
}

function choice(knob, saved, current, change, id) {
  const list = el("select", { id, onchange: () => change(knob.write(list.value, current())) }, knob.choices.map((c) => el("option", { value: c }, c)));
  return { nodes: [list], show: (edited) => (list.value = knob.read(edited)) };
}
