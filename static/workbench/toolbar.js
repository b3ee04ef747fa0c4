// Above the panes: whose curves to read, what the panes draw and how, pictures and films of them.

import { el, part } from "../look/dom.js";
import { menu } from "../look/menu.js";
import { darkScheme, lineStyle, vehicleColour } from "../look/palette.js";
import { dot } from "../look/swatch.js";
import { schedulers } from "../pursuit/story.js";
import { listeners } from "../slam/story.js";
import { tellers } from "../smoothing/story.js";
import { DEPTHS, LAYOUTS, SIZES, draw, hasWebGL, paneState } from "../state/panes.js";
import { store } from "../state/store.js";
import { takings } from "./takings.js";

const TOGGLES = {
  trails: { label: "Trails", hint: "Estimated tracks up to now" },
  ellipses: { label: "Ellipses", hint: "Ellipses along the track; their size is under View" },
  rays: { label: "Rays", hint: "Packets: the sender's colour when heard, grey when lost" },
  graph: { label: "Graph", hint: "Factor graph of the chosen vehicle, smoothed: received poses solid, lost ones hollow, priors square, composed links as arcs" },
  pursuit: { label: "Formation", hint: "Waypoints, the formation kept and the one wanted (dashed), messages under way, and what the chosen vehicle knows: hyperbolas of equal time difference with two sigmas on either side" },
  sound: { label: "Beliefs", hint: "Where beacons may be: lines that hold 20, 40, 60 and 80 % of the belief, the beams of the arrays so far, and dashed the track by odometry alone" },
  follow: { label: "Follow", hint: "Keep the chosen vehicle in the middle" },
  top: { label: "From above", hint: "Look straight down, north up", solid: true },
};
const MORE = {
  cloud: { label: "All trials", hint: "Every trial's estimate as a point about the truth drawn, and the envelope of 90 % of them along the track", solid: true, trials: true },
  contours: { label: "Densities", hint: "Lines of equal density of all trials, which hold 50 and 90 % of them", solid: true, trials: true },
  linked: { label: "Cameras linked", hint: "Panes turn together; unticked each by itself", solid: true },
};

export function mountToolbar(session, panes) {
  const vehicles = el("div", { class: "vehicles", role: "radiogroup", "aria-label": "Vehicle" });
  const boxes = {};
  const toggle = ([name, { label, hint }]) => {
    boxes[name] = el("input", { type: "checkbox", name: `pane-${name}`, onchange: () => draw({ [name]: boxes[name].checked }) });
    return el("label", { class: "toggle", title: hint }, boxes[name], label);
  };
  const layout = select("Panes", LAYOUTS, (value) => paneState.set({ layout: value }));
  const sigma = select("Size of the ellipses", SIZES, (value) => draw({ sigma: Number(value) }));
  const depth = select("Depths stretched", DEPTHS, (value) => draw({ depth: Number(value) }));
  for (const option of layout.options) option.disabled = !hasWebGL && option.value !== "plan";
  const row = (label, node, hint) => el("label", { class: "choice", title: hint }, el("span", {}, label), node);
  const more = menu(
    "view-menu",
    el("summary", {}, "View"),
    el(
      "div",
      { class: "sheet" },
      row("Ellipses", sigma, "How large ellipses are drawn"),
      row("Depths", depth, "How much deeper than true things are drawn"),
      Object.entries(MORE).map(toggle),
      takings(session, panes),
    ),
  );
  const size = el("span", {});
  part("toolbar").append(
    vehicles,
    key(size),
    el("div", { class: "toggles", role: "group", "aria-label": "Panes show" }, Object.entries(TOGGLES).map(toggle), layout, more),
  );

  const tell = () => {
    const { trails, ellipses, rays, sigma, cloud, contours, top, linked, depth, follow, graph, pursuit, sound } = paneState.state;
    const { vehicle, hidden, job, algorithms } = store.state;
    const named = (on) => (on ? vehicle : null);
    const laid = (job?.algorithms ?? []).filter((name) => !hidden.algorithms.has(name));
    const colours = Object.fromEntries(laid.map((name) => [name, rgb(lineStyle(name, algorithms ?? []).colour)]));
    const dark = darkScheme.matches;
    session.options({ trails, ellipses, rays, sigma, cloud, contours, top, linked, depth, sound, dark, colours, hidden: [...hidden.vehicles], follow: named(follow), graph: named(graph), pursuit: named(pursuit) });
  };

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
  paneState.watch(["trails", "ellipses", "rays", "graph", "pursuit", "sound", "follow", "top", "sigma", "cloud", "contours", "linked", "depth", "layout"], (now) => {
    for (const [name, box] of Object.entries(boxes)) box.checked = now[name];
    layout.value = now.layout;
    sigma.value = String(now.sigma);
    depth.value = String(now.depth);
    size.textContent = SIZES[now.sigma];
    for (const [name, { solid }] of Object.entries({ ...TOGGLES, ...MORE })) if (solid) boxes[name].parentElement.hidden = now.layout === "plan";
    depth.parentElement.hidden = now.layout === "plan";
    tell();
  });
  store.watch(["hidden", "algorithms", "job"], tell);
  store.watch(["vehicle"], () => (boxes.follow.checked || boxes.graph.checked || boxes.pursuit.checked) && tell());
  store.watch(["view"], ({ view }) => {
    boxes.graph.parentElement.hidden = !tellers(view).length;
    boxes.pursuit.parentElement.hidden = !schedulers(view).length;
    boxes.sound.parentElement.hidden = !listeners(view).length;
  });
  store.watch(["job"], ({ job }) => {
    const many = (job?.trials ?? 1) > 4 && job?.state === "done";
    for (const [name, { trials }] of Object.entries(MORE)) if (trials) boxes[name].disabled = !many;
  });
  darkScheme.addEventListener("change", tell);
}

function select(label, choices, act) {
  const list = el("select", { "aria-label": label, onchange: () => act(list.value) }, order(choices).map(([value, text]) => el("option", { value }, text)));
  return list;
}

/** Entries in the order written, also where the keys are numbers: 95 % first, then the sigmas. */
function order(choices) {
  return Object.entries(choices).sort(([a], [b]) => (b === "95") - (a === "95"));
}

function rgb(colour) {
  return [1, 3, 5].map((n) => parseInt(colour.slice(n, n + 2), 16));
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

function key(size) {
  const line = (kind, text) => el("span", { class: "key" }, el("i", { class: kind, "aria-hidden": "true" }), text);
  return el("div", { class: "keys" }, line("truth", "truth"), line("estimate", "estimate"), line("ellipse", size));
}
