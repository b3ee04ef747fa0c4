// Buttons that save a picture or a film of the panes.

import { el } from "../look/dom.js";
import { percent } from "../look/format.js";
import { save } from "../look/save.js";
import { paneState } from "../state/panes.js";
import { store } from "../state/store.js";
import { canFilm, film } from "./film.js";
import { compose } from "./picture.js";

const name = (ending) => `${store.state.job?.scenario ?? "run"}.${ending}`;
const SECONDS = [6, 12, 30];

/** The controls, for the scenes of a session and the panes that show them. */
export function takings(session, panes) {
  let filming = null;
  const word = el("span", { class: "word", role: "status" });
  const picture = el("button", { type: "button", class: "small", onclick: take }, "Picture (PNG)");
  const seconds = el("select", { "aria-label": "Length of a film", title: "Length of a film" }, SECONDS.map((s) => el("option", { value: s }, `${s} s`)));
  seconds.value = "12";
  const time = el("button", { type: "button", class: "small", title: "The mission from start to end", onclick: () => shoot("timeline") }, "Film of the mission");
  const turn = el("button", { type: "button", class: "small", title: "Once round the scene", onclick: () => shoot("turntable") }, "Film round the scene");
  const stop = el("button", { type: "button", class: "small", hidden: true, onclick: () => filming?.abort() }, "Stop");

  function take() {
    const seen = panes.shown();
    if (!seen.length) return void (word.textContent = "There is nothing to be seen yet.");
    word.textContent = "";
    compose(document.createElement("canvas"), seen).toBlob((blob) => save(blob, name("png")));
  }

  async function shoot(kind) {
    if (!panes.shown().length) return void (word.textContent = "There is nothing to be seen yet.");
    filming = new AbortController();
    busy(true);
    try {
      const blob = await film(kind, Number(seconds.value), session, panes, { tell: (share) => (word.textContent = `Filming, ${percent(share)}`), signal: filming.signal });
      word.textContent = blob ? "The film is saved." : "";
      if (blob) save(blob, name("webm"));
    } finally {
      filming = null;
      busy(false);
    }
  }

  function busy(on) {
    picture.disabled = time.disabled = turn.disabled = on || !canFilm;
    picture.disabled = on;
    stop.hidden = !on;
  }

  busy(false);
  paneState.watch(["layout"], ({ layout }) => (turn.hidden = layout === "plan"));
  return el("div", { class: "takings" }, picture, el("div", { class: "films" }, time, turn, seconds), stop, canFilm ? word : el("span", { class: "word" }, "This browser records no films."));
}
