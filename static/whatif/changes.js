// The edited mission against the saved one: key, old value, new value, and a way back for each.

import { el } from "../look/dom.js";
import { told, valueAt } from "./edits.js";
import { fleetKeys } from "./fleet.js";

/** The list of changes; revert(paths) takes some back. A team and its schedule go back together. */
export function changesList(saved, changes, revert) {
  const paths = Object.keys(changes);
  const team = [...new Set([...fleetKeys(saved), "network.tdma.slots", "network.tdma.cycle_s"])];
  const back = (path) => (team.includes(path) ? paths.filter((p) => team.includes(p) || (path === "vehicles" && p.startsWith("vehicles."))) : [path]);
  return el(
    "div",
    {},
    el(
      "div",
      { class: "heading" },
      el("h3", {}, paths.length ? `Changed: ${paths.length} ${paths.length === 1 ? "key" : "keys"}` : "As it is saved"),
      paths.length ? el("button", { type: "button", class: "small", onclick: () => revert(paths) }, "Revert all") : null,
    ),
    el(
      "ul",
      {},
      paths.map((path) =>
        el(
          "li",
          { "data-key": path },
          el("code", {}, path),
          el("span", { class: "diff" }, el("del", {}, told(valueAt(saved, path))), " → ", el("ins", {}, told(changes[path]))),
          el("button", { type: "button", class: "small", "aria-label": `Revert ${path}`, title: back(path).length > 1 ? `Goes back together with ${back(path).filter((p) => p !== path).join(", ")}` : "As it is saved", onclick: () => revert(back(path)) }, "↺"),
        ),
      ),
    ),
  );
}
