// A claim's verdict and figures in words.

import { number } from "../look/format.js";

const SIGNS = { "<": "<", "<=": "≤", ">": ">", ">=": "≥", "==": "=" };

/** Whether a claim holds, in a word with its mark and tone; null is for one that was not tried. */
export function verdictOf(holds, untried = "not tried") {
  if (holds === null) return { word: untried, mark: "–", tone: "calm" };
  return holds ? { word: "holds", mark: "✓", tone: "good" } : { word: "does not hold", mark: "✗", tone: "bad" };
}

/** "0.62 < 1.4", or why there is no figure. */
export function figuresOf({ value, operator, bound, reason }) {
  if (value === null || value === undefined) return reason ?? "";
  return `${told(value)} ${SIGNS[operator] ?? operator} ${told(bound)}`;
}

function told(value) {
  return typeof value === "number" ? number(value, 4) : String(value);
}
