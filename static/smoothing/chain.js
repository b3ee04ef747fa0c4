// A sender's chain as a receiver has it, drawn: launches heard solid, missing hollow, composed links as arcs.

import { svg } from "../look/dom.js";

const STEP = 26;
const BASE = 40;
const EDGE = 16;
/** No more launches are drawn than these, the latest. */
const MOST = 24;

export function drawChain(launches, colour) {
  const shown = launches.slice(-MOST);
  const width = 2 * EDGE + STEP * Math.max(shown.length - 1, 0);
  const x = (n) => EDGE + STEP * n;
  const heard = shown.flatMap(({ kind }, n) => (kind === "heard" ? [n] : []));
  const links = heard.slice(1).map((n, k) => {
    const before = heard[k];
    const path = n - before === 1 ? `M${x(before)} ${BASE}H${x(n)}` : `M${x(before)} ${BASE}Q${(x(before) + x(n)) / 2} ${BASE - 12 - 9 * (n - before)} ${x(n)} ${BASE}`;
    return svg("path", { d: path, class: n - before === 1 ? "link" : "link composed" });
  });
  const marks = shown.map(({ number, kind, prior }, n) => {
    const words = { heard: "received", told: "lost, but its prior was repeated later", missing: "missing" }[kind];
    return svg(
      "g",
      {},
      svg("title", {}, `launch ${number}: ${words}${prior ? ", prior known" : ""}`),
      prior && svg("rect", { x: x(n) - 7.5, y: BASE - 7.5, width: 15, height: 15, class: "prior" }),
      svg("circle", { cx: x(n), cy: BASE, r: 4.5, class: kind === "heard" ? "solid" : "hollow" }),
      (shown.length < 13 || number % 2 === shown.at(-1).number % 2) && svg("text", { x: x(n), y: BASE + 21 }, number),
    );
  });
  const missing = launches.filter((l) => l.kind !== "heard").length;
  const label = `Chain of ${launches.length} launches: ${launches.length - missing} received, ${missing} lost`;
  return svg("svg", { class: "chain", role: "img", "aria-label": label, viewBox: `0 0 ${width} ${BASE + 26}`, width, height: BASE + 26, "--colour": colour }, links, marks);
}
