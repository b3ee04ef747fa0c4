// Studies of the picked mission: how it fares as more packets are lost, and W11's Table I, measured.

import { el, part } from "../look/dom.js";
import { buildReconstructionStudy, reconstructs } from "../smoothing/reconstruction.js";
import { store } from "../state/store.js";
import { buildLossStudy } from "./loss.js";
import { buildTable } from "./table1.js";

export function mountStudies() {
  const root = part("studies");
  let loss = null;
  let table = null;
  let reconstruction = null;
  store.watch(["run", "mission", "scenario"], ({ run, mission, scenario }) => {
    const networked = run === null && scenario?.family === "navigation" && Boolean(scenario.network?.tdma);
    root.hidden = !networked;
    if (!networked) return;
    if (loss === null) {
      loss = buildLossStudy();
      table = buildTable();
      reconstruction = buildReconstructionStudy();
      root.append(reconstruction.root, loss.root, table.root);
    }
    loss.of(mission, scenario);
    loss.root.hidden = reconstructs(scenario);
    reconstruction.of(mission, scenario);
    table.root.hidden = !mission.startsWith("walls2011");
  });
}

/** A study as a card: heading, what it does, controls, how far it is, and its figures. */
export function card(title, words, controls) {
  const status = el("p", { class: "quiet", role: "status" });
  const bar = el("progress", { max: 1, value: 0, hidden: true });
  const figures = el("div", { class: "figures" });
  const root = el("section", { class: "study" }, el("h2", {}, title), el("p", { class: "quiet" }, words), el("div", { class: "controls" }, controls), bar, status, figures);
  return { root, status, bar, figures };
}

/** A button that starts something and, while it runs, ends it; `act` is given a signal. */
export function startButton(words, act) {
  let running = null;
  const button = el("button", { type: "button", class: "go" }, words);
  button.addEventListener("click", async () => {
    if (running) {
      running.abort();
      return;
    }
    running = new AbortController();
    button.textContent = "Stop";
    try {
      await act(running.signal);
    } finally {
      running = null;
      button.textContent = words;
    }
  });
  return button;
}
