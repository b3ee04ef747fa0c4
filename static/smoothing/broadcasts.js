// The packet inspector: every broadcast of the drawn trial, its links and bytes, who received it, what came of it.

import { el, part, say } from "../look/dom.js";
import { clockTime, metres, number, plural } from "../look/format.js";
import { vehicleColour } from "../look/palette.js";
import { dot } from "../look/swatch.js";
import { keptChoice } from "../state/choice.js";
import { clock } from "../state/clock.js";
import { store } from "../state/store.js";
import { drawChain } from "./chain.js";
import { chainAt, storyOf, tellers } from "./story.js";

export function mountBroadcasts() {
  const room = part("broadcasts");
  const whose = keptChoice("broadcasts", "Estimator whose broadcasts are listed", read);
  const tally = el("span", { class: "quiet" });
  const list = el("ul", { role: "listbox", tabindex: 0, "aria-label": "Broadcasts" });
  const detail = el("div", { class: "detail", "aria-live": "polite" });
  room.append(
    el("div", { class: "heading" }, el("h2", {}, "Broadcasts"), whose.root, tally),
    el("div", { class: "inspector" }, list, detail),
  );

  let told = [];
  let chosen = -1;
  let wanted = "";

  store.watch(["view", "job", "algorithms"], ({ view, job, algorithms }) => {
    const names = job?.state === "done" ? tellers(view).filter((name) => !view.algorithms[name].centralized) : [];
    room.hidden = !names.length;
    whose.of(names, names[0], (name) => algorithms?.find((a) => a.name === name)?.title ?? name);
    if (names.length) read();
    else wanted = "";
  });

  async function read() {
    const { run } = store.state;
    const key = `${run} ${whose.root.value}`;
    if (wanted === key) return;
    wanted = key;
    const story = await storyOf(run, whose.root.value);
    if (wanted !== key) return;
    told = story?.broadcasts ?? [];
    list.replaceChildren(...told.map(entry));
    say(tally, story ? `${plural(told.length, "broadcast")} in the trial drawn` : "They could not be read.");
    chosen = -1;
    follow();
  }

  /** The broadcast that is on its way or was the last one at the clock's time. */
  function follow() {
    if (!told.length) {
      detail.replaceChildren();
      return;
    }
    const next = told.findIndex((b) => b.tol_s > clock.time + 0.001);
    choose(next < 0 ? told.length - 1 : Math.max(next - 1, 0));
  }

  function choose(n, { seek = false } = {}) {
    if (seek) clock.seek(told[n].tol_s);
    if (n === chosen) return;
    list.children[chosen]?.setAttribute("aria-selected", "false");
    chosen = n;
    const option = list.children[n];
    option.setAttribute("aria-selected", "true");
    list.setAttribute("aria-activedescendant", option.id);
    const low = option.offsetTop;
    if (low < list.scrollTop) list.scrollTop = low;
    else if (low + option.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = low + option.offsetHeight - list.clientHeight;
    detail.replaceChildren(...describe(told, told[n]));
  }

  clock.watch(() => !room.hidden && told.length && follow());
  list.addEventListener("click", (event) => {
    const n = [...list.children].indexOf(event.target.closest("[role=option]"));
    if (n >= 0) choose(n, { seek: true });
  });
  list.addEventListener("keydown", (event) => {
    const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10, Home: -told.length, End: told.length };
    if (!(event.key in steps) || !told.length || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    choose(Math.min(Math.max(chosen + steps[event.key], 0), told.length - 1), { seek: true });
  });
}

const place = (name) => (store.state.view?.subjects ?? []).findIndex((s) => s.name === name);
const colourOf = (name) => vehicleColour(Math.max(0, place(name)));

function entry(broadcast, n) {
  const { sender, tol_s, receivers } = broadcast;
  const heard = receivers.filter((r) => r.heard).map((r) => r.name);
  const words = heard.length ? `heard by ${heard.join(", ")}` : "lost";
  return el(
    "li",
    { role: "option", id: `broadcast-${n}`, "aria-selected": "false" },
    el("span", { class: "when" }, clockTime(tol_s)),
    dot(colourOf(sender)),
    el("span", { class: "sender" }, sender),
    el("span", { class: "marks", role: "img", "aria-label": words, title: words }, receivers.map((r) => el("i", { class: r.heard ? "heard" : "lost", "--colour": colourOf(r.name) }))),
  );
}

function describe(all, broadcast) {
  const { sender, tol_s, bytes, number: launch, links, receivers } = broadcast;
  return [
    el("h3", {}, dot(colourOf(sender)), `${sender}, launch ${launch} at ${clockTime(tol_s)}`, el("span", { class: "quiet" }, `${plural(bytes, "byte")}, ${plural(links.length, "link")}`)),
    el(
      "div",
      { class: "scroll-x", tabindex: 0, role: "region", "aria-label": "Links in the packet" },
      el(
        "table",
        {},
        el("thead", {}, el("tr", {}, ["Link", "Pose at", "Composed odometry", "σ", "Prior", "σ"].map((text) => el("th", { scope: "col" }, text)))),
        el("tbody", {}, links.map((link) => row(link, launch))),
      ),
    ),
    ...receivers.map((receiver) => arrival(all, broadcast, receiver)),
  ];
}

const at = ([x, y]) => `${number(x, 4)}, ${number(y, 4)} m`;

function row(link, launch) {
  const role = link.number === launch ? "this launch" : "repeated";
  const from = link.origin === 0 ? "from the origin" : `from launch ${link.origin}`;
  return el(
    "tr",
    {},
    el("th", { scope: "row" }, `${link.number} `, el("span", { class: "quiet" }, role)),
    el("td", {}, clockTime(link.time_s)),
    el("td", { title: from }, at(link.xy)),
    el("td", {}, metres(link.sigma_m)),
    el("td", {}, link.prior ? at(link.prior.xy) : "–"),
    el("td", {}, link.prior ? metres(link.prior.sigma_m) : ""),
  );
}

/** What one vehicle made of a broadcast. */
function arrival(all, broadcast, receiver) {
  const head = [el("i", { class: receiver.heard ? "heard" : "lost", "--colour": colourOf(receiver.name), "aria-hidden": "true" }), el("b", {}, receiver.name)];
  if (!receiver.heard) return el("div", { class: "arrival" }, el("p", {}, head, " did not receive it."));
  const chain = chainAt(all, broadcast, receiver.name);
  return el(
    "div",
    { class: "arrival" },
    el("p", {}, head, ` received it at ${clockTime(receiver.toa_s, true)}. `, sentences(broadcast, receiver, chain).join(" ")),
    chain.length > 1 && drawChain(chain, colourOf(broadcast.sender)),
  );
}

function sentences(broadcast, { new: fresh, after, odometry, residual_m, sigma_m, used }, chain) {
  const said = [fresh.length ? `It told something new of ${plural(fresh.length, "link")} (${fresh.join(", ")}).` : "It told nothing new."];
  if (odometry) {
    const lost = chain.filter((l) => l.number > after && l.number < broadcast.number).length;
    const across = lost ? `across ${plural(lost, "lost launch", "lost launches")}` : "with nothing lost in between";
    said.push(`Decomposed odometry from launch ${after}: ${at(odometry.xy)} ± ${metres(odometry.sigma_m)}, ${across}.`);
  }
  if (residual_m !== null && sigma_m) said.push(used ? `The range was ${metres(residual_m)} off what was expected (σ ${metres(sigma_m)}).` : `The range was refused: ${metres(residual_m)} off, where σ is ${metres(sigma_m)}.`);
  return said;
}
