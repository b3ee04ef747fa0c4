// Help: a sheet of the keys, and a tour in three steps for whoever comes for the first time.

import { el, part } from "./look/dom.js";

const KEYS = [
  ["Space", "play or pause"],
  ["← →", "a report earlier or later"],
  ["Shift ← →", "the event before or after: a packet, a fix"],
  ["Home End", "the beginning, the end"],
  ["[ ]", "slower, faster"],
  ["+ −", "zoom time in or out, in all plots at once"],
  ["Esc", "all of the time again"],
  ["?", "this sheet"],
];

const STEPS = [
  { at: "missions", title: "Pick a mission", text: "A mission is a scenario file: vehicles, sensors, who hears whom and how much is lost. They are grouped by the paper they come from." },
  { at: "algorithms", title: "Tick estimators", text: "Each gets a pane of its own and sees only what its vehicles could know. Those that this mission cannot run are not offered." },
  { at: "launch", title: "Run, then look", text: "Panes fill as estimates come. Drag the time, point at a plot, hover a verdict: green is honest about its error, orange is too sure of itself." },
];

const SEEN = "coopnav.tour";

/** Ends the tour that is shown. */
let endTour = () => {};

export function mountHelp() {
  part("help").append(el("button", { type: "button", class: "icon", "aria-label": "Help", title: "Keys and first steps (?)", onclick: openHelp }, "?"));
  window.addEventListener("keydown", (event) => {
    const typing = event.target.matches?.("textarea, input:not([type=range], [type=checkbox], [type=radio]), select");
    if (event.key === "?" && !typing && !document.querySelector("dialog[open]")) openHelp();
  });
  if (!remembered() && location.hash === "") startTour();
}

function openHelp() {
  const rows = KEYS.map(([keys, what]) => el("tr", {}, el("th", { scope: "row" }, ...keys.split(" ").map((key) => el("kbd", {}, key))), el("td", {}, what)));
  const again = () => {
    dialog.close();
    startTour();
  };
  const dialog = el(
    "dialog",
    { class: "help", "aria-labelledby": "help-title" },
    el("h2", { id: "help-title" }, "Keys"),
    el("table", {}, el("tbody", {}, ...rows)),
    el("p", {}, "Every address can be sent to someone: it holds run, estimators, vehicle, time, camera, layout and what is drawn."),
    el(
      "div",
      { class: "buttons" },
      el("button", { type: "button", onclick: again }, "First steps"),
      el("button", { type: "button", class: "primary", onclick: () => dialog.close() }, "Close"),
    ),
  );
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

function startTour() {
  endTour();
  const title = el("h2", { id: "tour-title" });
  const text = el("p", {});
  const count = el("span", { class: "count" });
  const back = el("button", { type: "button", onclick: () => go(step - 1) }, "Back");
  const next = el("button", { type: "button", class: "primary", onclick: () => go(step + 1) });
  const card = el(
    "section",
    { class: "tour", "aria-labelledby": "tour-title", "aria-live": "polite" },
    title,
    text,
    el("div", { class: "buttons" }, count, el("button", { type: "button", onclick: end }, "Skip"), back, next),
  );
  let step = 0;
  endTour = end;
  part("stage").append(card);
  const over = new AbortController();
  const leave = (event) => {
    if (event.key === "Escape" && !event.defaultPrevented && !document.querySelector("dialog[open]")) end();
  };
  window.addEventListener("keydown", leave, { signal: over.signal });
  part("tab-new").click();
  go(0);

  function go(to) {
    if (to >= STEPS.length) {
      end();
      return;
    }
    step = to;
    mark(STEPS[step].at);
    title.textContent = STEPS[step].title;
    text.textContent = STEPS[step].text;
    count.textContent = `${step + 1} of ${STEPS.length}`;
    back.disabled = step === 0;
    next.textContent = step === STEPS.length - 1 ? "Done" : "Next";
  }

  function end() {
    endTour = () => {};
    over.abort();
    mark(null);
    card.remove();
    remember();
  }
}

/** Outlines the part of the page that a step is about. */
function mark(id) {
  for (const node of document.querySelectorAll(".toured")) node.classList.remove("toured");
  if (id !== null) part(id).classList.add("toured");
}

function remembered() {
  try {
    return localStorage.getItem(SEEN) !== null;
  } catch {
    return true; // a browser that keeps nothing would show the tour at every visit
  }
}

function remember() {
  try {
    localStorage.setItem(SEEN, "seen");
  } catch {
    // then it will be shown again
  }
}
