// Above the panes: whose curves to read, and what the panes draw.

import { el, part } from "../look/dom.js";
import { vehicleColour } from "../look/palette.js";
import { dot } from "../look/swatch.js";
import { schedulers } from "../pursuit/story.js";
import { tellers } from "../smoothing/story.js";
import { store } from "../state/store.js";

const OPTIONS = {
  trails: { label: "Trails", on: true, hint: "Estimated tracks up to now" },
  ellipses: { label: "Ellipses", on: true, hint: "95 % ellipses along the track" },
  rays: { label: "Rays", on: true, hint: "Packets: the sender's colour when heard, grey when lost" },
  graph: { label: "Graph", on: false, hint: "Factor graph of the chosen vehicle, smoothed: received poses solid, lost ones hollow, priors square, composed links as arcs" },
  pursuit: { label: "Formation", on: true, hint: "Waypoints, the formation kept and the one wanted (dashed), messages under way, and what the chosen vehicle knows: hyperbolas of equal time difference with two sigmas on either side" },
  follow: { label: "Follow", on: false, hint: "Keep the chosen vehicle in the middle" },
  top: { label: "From above", on: false, hint: "Look straight down, north up" },
};

export function mountToolbar(session) {
  const vehicles = el("div", { class: "vehicles", role: "radiogroup", "aria-label": "Vehicle" });
  const boxes = {};
  const tell = () => {
    const chosen = Object.fromEntries(Object.entries(boxes).map(([name, box]) => [name, box.checked]));
    const named = (on) => (on ? store.state.vehicle : null);
    const hidden = [...store.state.hidden.vehicles];
    session.options({ ...chosen, hidden, follow: named(chosen.follow), graph: named(chosen.graph), pursuit: named(chosen.pursuit) });
  };
  const toggles = Object.entries(OPTIONS).map(([name, { label, on, hint }]) => {
    boxes[name] = el("input", { type: "checkbox", name: `pane-${name}`, checked: on, onchange: tell });
    return el("label", { class: "toggle", title: hint }, boxes[name], label);
  });
  part("toolbar").append(vehicles, key(), el("div", { class: "toggles", role: "group", "aria-label": "Panes show" }, toggles));

  let drawn = "";
  store.watch(["view", "live", "vehicle"], ({ view, live, vehicle }) => {
    const streamed = Object.values(live?.algorithms ?? {})[0]?.subjects ?? {};
    const subjects = view?.subjects ?? Object.keys(streamed).map((name) => ({ name }));
    const wanted = JSON.stringify(subjects);
    if (wanted !== drawn) {
      drawn = wanted;
      vehicles.replaceChildren(...subjects.map(choice));
    }
    for (const input of vehicles.querySelectorAll("input")) input.checked = input.value === vehicle;
  });
  store.watch(["hidden"], tell);
  store.watch(["vehicle"], () => (boxes.follow.checked || boxes.graph.checked || boxes.pursuit.checked) && tell());
  store.watch(["view"], ({ view }) => {
    boxes.graph.parentElement.hidden = !tellers(view).length;
    boxes.pursuit.parentElement.hidden = !schedulers(view).length;
  });
}

function choice({ name, kind }, n) {
  const hint = { auv: "AUV", surface: "surface craft", fixed: "fixed node" }[kind] ?? "vehicle";
  return el(
    "label",
    { class: "vehicle", title: `${name} (${hint}): curves and readings are about it` },
    el("input", { type: "radio", name: "vehicle", value: name, onchange: () => store.set({ vehicle: name }) }),
    dot(vehicleColour(n)),
    name,
  );
}

function key() {
  const line = (kind, text) => el("span", { class: "key" }, el("i", { class: kind, "aria-hidden": "true" }), text);
  return el("div", { class: "keys" }, line("truth", "truth"), line("estimate", "estimate"), line("ellipse", "95 %"));
}
