// W15's Fig. 5: how far reconstructed chains are from what they stand for, against reception rate, as runs of a mission.

import { el, say } from "../look/dom.js";
import { number, percent, plural } from "../look/format.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { loadPlotly, PLAIN, plainLayout } from "../look/plotly.js";
import { lineSample } from "../look/swatch.js";
import { store } from "../state/store.js";
import { runSeries } from "../studies/series.js";
import { card, startButton } from "../studies/studies.js";

const RECEPTIONS = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1];
const MARGIN = { l: 64, r: 12, t: 8, b: 42 };
const FIGURES = [
  { key: "kld", title: "KLD (nat)" },
  { key: "mean_difference", title: "mean difference (m)" },
];
/** Dashes of the page's palette as plotly writes them. */
const dashed = (dash) => (dash ? dash.split(" ").map((n) => `${n}px`).join(",") : "solid");

/** Whether a mission only puts chains together, so that there is something to study. */
export const reconstructs = (scenario) => Object.values(scenario?.options ?? {}).some((o) => o.reconstruct_only);

export function buildReconstructionStudy() {
  const draws = el("select", { "aria-label": "Draws at each rate" }, [100, 30, 10, 3].map((n) => el("option", { value: n }, n)));
  const subject = el("select", { "aria-label": "Chain" });
  const go = startButton("Run the reconstruction study", start);
  const { root, status, bar, figures } = card(
    "Reconstruction against reception (W15 Fig. 5)",
    "Divergence of each reconstructed chain from what the sender's own sensors say, and the mean distance of their poses, with 95 % intervals over the draws.",
    [el("label", {}, "Draws ", draws), el("label", {}, "Chain ", subject), go],
  );
  const legend = el("div", { class: "legend" });
  const plots = FIGURES.map(({ key, title }) => {
    const drawing = el("div", { class: "drawing" });
    return { key, title, drawing, root: el("figure", { class: "plot", "data-figure": key }, drawing) };
  });
  figures.append(legend, el("div", { class: "triple" }, plots.map((p) => p.root)));
  figures.hidden = true;

  let mission = null;
  let algorithms = [];
  let points = [];

  async function start(signal) {
    points = [];
    bar.hidden = false;
    const trials = Number(draws.value);
    try {
      for (const reception of RECEPTIONS) {
        const loss = Math.round((1 - reception) * 100) / 100;
        const body = { scenario: mission, algorithms, trials, set: { "network.loss": loss } };
        const [{ result }] = await runSeries([body], signal, (_done, _total, fraction) => {
          bar.value = (points.length + fraction) / RECEPTIONS.length;
          say(status, `Reception ${percent(reception)}: ${points.length} of ${RECEPTIONS.length} done`);
        });
        points.push({ reception, result });
        draw();
      }
      say(status, `${plural(RECEPTIONS.length, "reception rate")}, ${plural(trials, "draw")} each. ${verdict()}`);
    } catch (error) {
      say(status, error.name === "AbortError" ? "Stopped; what was finished is shown." : error.message);
    }
    bar.hidden = true;
  }

  /** A figure of an algorithm about the chosen chain, at every rate so far. */
  const curve = (name, key) => points.map(({ result }) => result.algorithms[name].subjects[subject.value]?.[key] ?? null);

  /** By how much k-best and k-last come closer than Paull's method on the chosen chain, in words. */
  function verdict() {
    if (!["k_best", "k_last", "paull"].every((name) => algorithms.includes(name))) return "";
    const [best, last, paull] = ["k_best", "k_last", "paull"].map((name) => curve(name, "kld"));
    const ratio = paull.map((value, n) => value / Math.max(best[n], last[n]));
    return `On ${subject.value} Paull's divergence is ${number(Math.min(...ratio), 2)} to ${number(Math.max(...ratio), 2)} times that of k-last and k-best.`;
  }

  async function draw() {
    if (!points.length) return;
    figures.hidden = false;
    const known = store.state.algorithms ?? [];
    const names = Object.keys(points[0].result.algorithms);
    const title = (name) => known.find((a) => a.name === name)?.title ?? name;
    legend.replaceChildren(...names.map((name) => el("span", {}, lineSample(name, known), title(name))));
    const plotly = await loadPlotly();
    for (const { key, title: quantity, drawing } of plots) {
      const traces = names.map((name) => {
        const { colour, dash } = lineStyle(name, known);
        const y = curve(name, key);
        const interval = curve(name, `${key}_interval`);
        const reach = (side) => interval.map((bounds, n) => (bounds && y[n] !== null ? Math.abs(bounds[side] - y[n]) : 0));
        return {
          type: "scatter",
          mode: "lines+markers",
          name,
          x: points.map((p) => p.reception),
          y,
          error_y: { type: "data", symmetric: false, array: reach(1), arrayminus: reach(0), thickness: 1.2, width: 3, color: colour },
          line: { color: colour, dash: dashed(dash), width: 2 },
          marker: { size: 5, color: colour },
          hovertemplate: `${title(name)}, reception %{x:.0%}: %{y:.3g}<extra></extra>`,
        };
      });
      const layout = plainLayout(
        MARGIN,
        { title: { text: "reception rate" }, tickformat: ".0%", range: [0.05, 1.05] },
        { title: { text: quantity }, type: "log", exponentformat: "power", dtick: 1 },
      );
      await plotly.react(drawing, traces, layout, PLAIN);
    }
  }
  subject.addEventListener("change", draw);
  darkScheme.addEventListener("change", draw);

  return {
    root,
    of(name, scenario) {
      root.hidden = !reconstructs(scenario);
      if (name === mission || root.hidden) return;
      mission = name;
      points = [];
      figures.hidden = true;
      say(status, "");
      algorithms = Object.keys(scenario.options).filter((n) => scenario.options[n].reconstruct_only);
      const senders = new Set((scenario.network.tdma?.slots ?? []).map((slot) => slot.vehicle));
      subject.replaceChildren(...scenario.vehicles.filter((v) => v.kind !== "fixed" && senders.has(v.name)).map((v) => el("option", { value: v.name }, v.name)));
    },
  };
}
