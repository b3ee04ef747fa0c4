// The loss study: error, consistency and bandwidth of every ticked estimator against packet loss.

import { el, say } from "../look/dom.js";
import { percent } from "../look/format.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { loadPlotly, PLAIN, plainLayout, token } from "../look/plotly.js";
import { lineSample } from "../look/swatch.js";
import { store } from "../state/store.js";
import { runSeries } from "./series.js";
import { card, startButton } from "./studies.js";

const STEP = 0.1;
const MARGIN = { l: 56, r: 12, t: 8, b: 42 };
const TRIALS = 100;
/** Dashes of the page's palette as plotly writes them. */
const dashed = (dash) => (dash ? dash.split(" ").map((n) => `${n}px`).join(",") : "solid");

export function buildLossStudy() {
  const largest = el("input", { type: "range", min: 0.1, max: 0.9, step: STEP, value: 0.9, "aria-label": "Largest packet loss" });
  const shown = el("output", {}, percent(0.9));
  largest.addEventListener("input", () => say(shown, percent(Number(largest.value))));
  const subject = el("select", { "aria-label": "Vehicle" });
  const go = startButton("Run the loss study", start);
  const { root, status, bar, figures } = card(
    "Loss study",
    `The ticked estimators at packet losses from none up, ${TRIALS} trials each.`,
    [el("label", {}, "Loss up to ", largest, shown), el("label", {}, "Vehicle ", subject), go],
  );
  const legend = el("div", { class: "legend" });
  const plots = [
    plot("RMSE (m)", (m) => m.rmse_m),
    plot("NEES, its 95 % interval shaded", (m) => m.anees, (m) => m.anees_interval),
    plot("Channel load (bit/s)", (_m, answer) => answer.packets.bits_per_second),
  ];
  figures.append(legend, el("div", { class: "triple" }, plots.map((p) => p.root)));
  figures.hidden = true;

  let mission = null;
  let points = [];

  async function start(signal) {
    const top = Number(largest.value);
    const losses = Array.from({ length: Math.round(top / STEP) + 1 }, (_, n) => Math.round(n * STEP * 10) / 10);
    const { ticked } = store.state;
    if (!ticked.length) {
      say(status, "Tick at least one estimator.");
      return;
    }
    points = [];
    bar.hidden = false;
    try {
      for (const loss of losses) {
        const body = { scenario: mission, algorithms: ticked, trials: TRIALS, set: { "network.loss": loss } };
        const [{ result }] = await runSeries([body], signal, (_done, _total, part) => {
          bar.value = (points.length + part) / losses.length;
          say(status, `Loss ${percent(loss)}: ${points.length} of ${losses.length} done`);
        });
        points.push({ loss, result });
        draw();
      }
      say(status, `${losses.length} losses, ${TRIALS} trials each; every run is in the list of runs.`);
    } catch (error) {
      say(status, error.name === "AbortError" ? "Stopped; what was finished is shown." : error.message);
    }
    bar.hidden = true;
  }

  async function draw() {
    if (!points.length) return;
    figures.hidden = false;
    const { algorithms } = store.state;
    const names = Object.keys(points[0].result.algorithms);
    legend.replaceChildren(...names.map((name) => el("span", {}, lineSample(name, algorithms), algorithms.find((a) => a.name === name)?.title ?? name)));
    const plotly = await loadPlotly();
    for (const { drawing, title, figure, interval } of plots) {
      const traces = names.map((name) => {
        const { colour, dash } = lineStyle(name, algorithms);
        const y = points.map(({ result }) => {
          const answer = result.algorithms[name];
          return figure(answer.subjects[subject.value], answer);
        });
        return { type: "scatter", mode: "lines+markers", x: points.map((p) => p.loss), y, name, line: { color: colour, dash: dashed(dash), width: 2 }, marker: { size: 5 }, hovertemplate: `${name}, loss %{x:.0%}: %{y:.3g}<extra></extra>` };
      });
      const shapes = [];
      if (interval) {
        const bounds = interval(points[0].result.algorithms[names[0]].subjects[subject.value]);
        if (bounds) shapes.push({ type: "rect", xref: "paper", x0: 0, x1: 1, y0: bounds[0], y1: bounds[1], fillcolor: token("--good-soft"), line: { width: 0 }, layer: "below" });
      }
      const layout = plainLayout(MARGIN, { title: { text: "packet loss" }, tickformat: ".0%", range: [-0.02, Number(largest.value) + 0.02] }, { title: { text: title }, rangemode: "tozero" }, { shapes });
      if (interval) layout.yaxis = { ...layout.yaxis, type: "log", rangemode: "normal" };
      await plotly.react(drawing, traces, layout, PLAIN);
    }
  }
  subject.addEventListener("change", draw);
  darkScheme.addEventListener("change", draw);

  function plot(title, figure, interval = null) {
    const drawing = el("div", { class: "drawing" });
    return { root: el("figure", { class: "plot" }, drawing), drawing, title, figure, interval };
  }

  return {
    root,
    of(name, scenario) {
      if (name === mission) return;
      mission = name;
      points = [];
      figures.hidden = true;
      say(status, "");
      subject.replaceChildren(...scenario.vehicles.filter((v) => v.kind !== "fixed").map((v) => el("option", { value: v.name }, v.name)));
    },
  };
}
