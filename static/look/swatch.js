import { el, svg } from "./dom.js";
import "./hint.js";
import { lineStyle } from "./palette.js";

/** A short sample of an algorithm's line, as it looks in the plots. */
export function lineSample(name, algorithms) {
  return sample(lineStyle(name, algorithms));
}

/** A short sample of a line: {colour, dash}. */
export function sample({ colour, dash }) {
  return svg(
    "svg",
    { class: "line-sample", viewBox: "0 0 26 8", width: 26, height: 8, "aria-hidden": "true" },
    svg("line", { x1: 1, y1: 4, x2: 25, y2: 4, stroke: colour, "stroke-width": 2.2, "stroke-dasharray": dash || null }),
  );
}

/** A vehicle's dot, in the colour it has in the panes. */
export function dot(colour) {
  return el("span", { class: "dot", "aria-hidden": "true", "--colour": colour });
}

const VERDICTS = {
  consistent: { mark: "✓", tone: "good" },
  conservative: { mark: "◦", tone: "calm" },
  overconfident: { mark: "!", tone: "bad" },
  "no reference": { mark: "?", tone: "calm" },
};

/** Whether an estimator's confidence can be believed, in a word; the sentence that says why when it is pointed at or focused. */
export function verdictChip(metrics) {
  const { mark, tone } = VERDICTS[metrics.verdict] ?? VERDICTS["no reference"];
  return el(
    "span",
    { class: `verdict ${tone}`, tabindex: 0, "data-hint": metrics.explanation ?? "" },
    el("span", { class: "mark", "aria-hidden": "true" }, mark),
    metrics.verdict ?? "no reference",
  );
}
