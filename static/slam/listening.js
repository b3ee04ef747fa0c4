// Under the slider of localization by sound: what the newest measurement sounded like, and what it did to the tree.

import { el, part, say } from "../look/dom.js";
import { number, plural } from "../look/format.js";
import { lineSample } from "../look/swatch.js";
import { keptChoice } from "../state/choice.js";
import { clock } from "../state/clock.js";
import { store } from "../state/store.js";
import { graph, growth, icicle, polar, waterfall } from "./figures.js";
import { listeners, momentAt, momentsOf } from "./story.js";

export function mountListening() {
  const room = part("listening");
  const choice = keptChoice("heard", "Estimator", read);
  const swatch = el("span", {});
  const step = (direction, label, sign) => el("button", { type: "button", class: "small", "aria-label": label, title: label, onclick: () => seek(direction) }, sign);
  const words = el("p", { class: "words", role: "status" });
  const figures = el("div", { class: "figures" });
  room.append(el("div", { class: "heading" }, el("h2", {}, "Measurements"), choice.root, swatch, step(-1, "Previous measurement", "‹ factor"), step(1, "Next measurement", "factor ›")), words, figures);

  let moments = [];
  let shown = -2;
  let wanted = "";
  store.watch(["view", "job", "algorithms"], ({ view, job, algorithms }) => {
    const names = job?.state === "done" && algorithms ? listeners(view) : [];
    room.hidden = !names.length;
    const key = names.length ? `${job.id} ${names.join(" ")}` : "";
    if (key === wanted) return;
    wanted = key;
    moments = [];
    choice.of(names, names.find((name) => name.startsWith("sas")) ?? names[0], (name) => algorithms.find((a) => a.name === name)?.title ?? name);
    if (!names.length) return;
    read();
  });
  clock.watch(() => !room.hidden && show());

  async function read() {
    const key = wanted;
    const name = choice.root.value;
    swatch.replaceChildren(lineSample(name, store.state.algorithms));
    const found = await momentsOf(store.state.run, name);
    if (wanted !== key || choice.root.value !== name) return;
    moments = found;
    shown = -2;
    show();
  }

  function show() {
    const n = momentAt(moments, clock.time);
    if (n === shown) return;
    shown = n;
    if (n < 0) {
      say(words, moments.length ? "Nothing was measured yet." : "");
      figures.replaceChildren();
      return;
    }
    const { tree, array, divergence, factors, errors } = moments[n];
    const modes = Object.entries(divergence).map(([beacon, nats]) => `${beacon} ${number(nats, 2)} nats from a Gaussian`);
    const work = tree ? `${plural(tree.parents.length, "clique")}, ${tree.reused.reduce((sum, x) => sum + x, 0)} of them reused` : "";
    say(words, [`Measurement ${n + 1} of ${moments.length}`, ...modes, work].filter(Boolean).join(" · "));
    const figure = (title, drawing) => el("figure", {}, el("figcaption", {}, title), drawing);
    figures.replaceChildren(
      ...(array ? [figure("Matched filter, record by record", waterfall(array)), figure("Beam", polar(array))] : []),
      ...(factors.length ? [figure("Factor graph: new factors dark, fixes square", graph(moments, n))] : []),
      ...(tree?.cliques ? [figure("Bayes tree: messages go up; computed anew dark, reused pale", icicle(tree))] : []),
      ...(errors && Object.keys(divergence).length ? [figure("Errors and divergence against measurements", growth(moments, n))] : []),
    );
  }

  /** Moves to the next (+1) or previous (-1) measurement. */
  function seek(direction) {
    const next = moments[momentAt(moments, clock.time) + direction];
    if (next) clock.seek(next.time_s);
  }
}
