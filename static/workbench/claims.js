// What the mission's source asserts, whether this run bears it out, and the moment that shows it.

import { momentOf } from "../claims/moment.js";
import { figuresOf, verdictOf } from "../claims/words.js";
import { el, part } from "../look/dom.js";
import { clock } from "../state/clock.js";
import { store } from "../state/store.js";

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
      el("ul", {}, claims.map((found, n) => entry(found, result.scenario?.claims?.[n]))),
    );
  });
}

function source({ scenario }) {
  return scenario?.source ? el("span", { class: "source" }, scenario.source) : null;
}

function entry(found, claim) {
  const { word, mark, tone } = verdictOf(found.holds);
  const figures = figuresOf(found);
  return el(
    "li",
    { "data-holds": String(found.holds) },
    el("span", { class: `verdict ${tone}` }, el("span", { class: "mark", "aria-hidden": "true" }, mark), word),
    el("span", { class: "text" }, found.text),
    el("span", { class: "figures" }, figures),
    claim && found.holds !== null ? el("button", { type: "button", class: "small show", "aria-label": `Show: ${found.text}`, onclick: () => show(claim) }, "Show") : null,
  );
}

/** Moves to the moment that shows a claim, and to the vehicle it is about. */
function show(claim) {
  const { view } = store.state;
  if (!view) return;
  if (view.subjects.some((s) => s.name === claim.subject)) store.set({ vehicle: claim.subject });
  clock.seek(momentOf(claim, view));
  part("stage").scrollTo({ top: 0 });
}
