// The form of a PyFG file: which robot and point is which vehicle.

import { el } from "../look/dom.js";
import { vehicleName } from "./use.js";

/** A form {root, names()} of a described PyFG file. */
export function graphForm(file, change) {
  const entry = (label, value, attributes) => {
    const text = el("input", { type: "text", value, autocomplete: "off", spellcheck: "false", onchange: change, ...attributes });
    return el("label", { class: "field" }, el("span", {}, el("code", {}, label), " is"), text);
  };
  const robots = el("div", { class: "names" }, Object.keys(file.robots).map((letter) => entry(letter, `robot${letter}`, { "data-robot": letter })));
  const nodes = el("div", { class: "names" }, file.points.map((point) => entry(point, vehicleName(point), { "data-node": point })));
  const beacon = file.moving_points ? el("input", { type: "text", value: "beacon", onchange: change, "aria-label": "Vehicle whose fixes the measured points are" }) : null;
  const reference = el("select", { onchange: change }, [["independent", "an independent truth"], ["own_navigation", "the vehicle's own navigation"], ["none", "nothing to score by"]].map(([v, t]) => el("option", { value: v }, t)));
  const root = el(
    "div",
    { class: "use" },
    el("p", {}, "Robots by the first letter of their poses:"),
    robots,
    file.points.length ? el("p", {}, "Points that are ranged, as fixed nodes:") : null,
    nodes,
    beacon ? el("label", { class: "field" }, el("span", {}, `${file.moving_points} measured points are fixes of`), beacon) : null,
    el("label", { class: "field" }, el("span", {}, "the file's poses are"), reference),
    el("div", { class: "faults", role: "alert" }),
  );
  const read = (list, key) => Object.fromEntries([...list.querySelectorAll("input")].map((i) => [i.dataset[key], i.value.trim()]).filter(([, name]) => name));
  return { root, names: () => ({ robots: read(robots, "robot"), nodes: read(nodes, "node"), moving_beacon: beacon?.value.trim(), reference: reference.value }) };
}
