// What the mission's source asserts, and whether this run bears it out.

import { el, part } from "../look/dom.js";
import { number } from "../look/format.js";
import { store } from "../state/store.js";

const SIGNS = { "<": "<", "<=": "≤", ">": ">", ">=": "≥", "==": "=" };

export function mountClaims() {
  const room = part("claims");
  store.watch(["result"], ({ result }) => {
    const claims = result?.claims ?? [];
    room.hidden = !claims.length;
    if (!claims.length) return;
    const tried = claims.filter((c) => c.holds !== null);
    const holding = tried.filter((c) => c.holds).length;
    room.replaceChildren(
      el("div", { class: "heading" }, el("h2", {}, "Claims"), el("span", { class: "whose" }, `${holding} of ${tried.length} hold`), source(result)),
      el("ul", {}, claims.map(entry)),
    );
  });
}

function source({ scenario }) {
  return scenario?.source ? el("span", { class: "source" }, scenario.source) : null;
}

function entry({ text, value, operator, bound, holds, reason }) {
  const [word, mark, tone] = holds === null ? ["not tried", "–", "calm"] : holds ? ["holds", "✓", "good"] : ["does not hold", "✗", "bad"];
  const figures = value === null || value === undefined ? reason : `${told(value)} ${SIGNS[operator] ?? operator} ${told(bound)}`;
  return el(
    "li",
    { "data-holds": String(holds) },
    el("span", { class: `verdict ${tone}` }, el("span", { class: "mark", "aria-hidden": "true" }, mark), word),
    el("span", { class: "text" }, text),
    figures ? el("span", { class: "figures" }, figures) : null,
  );
}

function told(value) {
  return typeof value === "number" ? number(value, 4) : String(value);
}
