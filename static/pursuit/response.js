// C19's Fig. 3-12: how strongly the error of full-information fixes follows the target's turns, by frequency.

import { el, say } from "../look/dom.js";
import { number, plural } from "../look/format.js";
import { darkScheme, lineStyle } from "../look/palette.js";
import { loadPlotly, PLAIN, plainLayout } from "../look/plotly.js";

const MARGIN = { l: 64, r: 12, t: 8, b: 42 };
/** The break frequency that the thesis reads from its curves, rad/s. */
const THESIS_RPS = 0.047;
const dashed = (dash) => (dash ? dash.split(" ").map((n) => `${n}px`).join(",") : "solid");

/** A folded figure: { root, show(told, algorithms) }. */
export function buildResponse(colourOf) {
  const words = el("p", { class: "quiet" });
  const drawing = el("div", { class: "drawing" });
  const figure = el("figure", { class: "plot" }, drawing);
  const root = el("details", { class: "response" }, el("summary", {}, "Transfer function from the target's turns to the error"), words, figure);
  let told = [];
  let known = [];

  async function draw() {
    if (!root.open || root.hidden) return;
    const plotly = await loadPlotly();
    const traces = told.flatMap(({ name, story }) => {
      const { dash } = lineStyle(name, known);
      const title = known.find((a) => a.name === name)?.title ?? name;
      return Object.entries(story.responses).map(([holder, r]) => ({
        type: "scatter",
        mode: "lines",
        name: `${title}, ${holder}`,
        x: r.frequency_rps,
        y: r.gain_m_per_rps,
        line: { color: ink(colourOf(holder)), dash: dashed(dash), width: 1.8 },
        hovertemplate: `${title}, ${holder}: %{y:.3g} m per rad/s at %{x:.3g} rad/s<extra></extra>`,
      }));
    });
    const layout = plainLayout(
      MARGIN,
      { title: { text: "frequency of turning (rad/s)" }, type: "log" },
      { title: { text: "gain (m per rad/s)" }, type: "log" },
    );
    layout.shapes = [{ type: "line", xref: "x", x0: THESIS_RPS, x1: THESIS_RPS, yref: "paper", y0: 0, y1: 1, line: { width: 1, dash: "dot", color: ink("var(--ink-2)") } }];
    layout.annotations = [{ xref: "x", x: Math.log10(THESIS_RPS), yref: "paper", y: 1, text: `thesis: ${THESIS_RPS} rad/s`, showarrow: false, xanchor: "right", yanchor: "top", font: { size: 11 } }];
    await plotly.react(drawing, traces, layout, PLAIN);
  }
  /** plotly takes no CSS variables. */
  const ink = (colour) => (colour.startsWith("var(") ? getComputedStyle(root).getPropertyValue(colour.slice(4, -1)).trim() : colour);
  root.addEventListener("toggle", draw);
  darkScheme.addEventListener("change", draw);

  return {
    root,
    show(stories, algorithms) {
      told = stories;
      known = algorithms;
      const found = stories.flatMap(({ story }) => Object.values(story.responses));
      root.hidden = !found.length;
      const breaks = found.map((r) => r.break_rps);
      say(words, found.length ? `Break between ${number(Math.min(...breaks), 2)} and ${number(Math.max(...breaks), 2)} rad/s, of ${plural(Math.max(...found.map((r) => r.trials)), "trial")}; smoothed by a 7-point moving average.` : "");
      draw();
    },
  };
}
