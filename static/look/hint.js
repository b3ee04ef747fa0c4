// A sentence of explanation for whatever has `data-hint`, when it is pointed at or focused.
// What focus shows stays until the focus goes; what the pointer shows stays while it is there or on the sentence;
// Escape puts either away (WCAG 1.4.13).

import { el } from "./dom.js";

const EDGE = 8;

const bubble = el("div", { id: "hint", class: "hint", role: "tooltip", hidden: true });
/** What the sentence shown is about. */
let about = null;
let focused = null;
let pointed = null;
/** Where the pointer is, and on what. */
let place = "";
let under = null;

/** Shows the sentence of what is pointed at, else of what is focused. */
function show() {
  const node = [pointed, focused].find((n) => n?.isConnected && n.dataset.hint) ?? null;
  if (node !== about) {
    about?.removeAttribute("aria-describedby");
    node?.setAttribute("aria-describedby", "hint");
    about = node;
  }
  bubble.hidden = about === null;
  if (about === null) return;
  if (!bubble.isConnected) document.body.append(bubble);
  bubble.textContent = about.dataset.hint;
  put();
}

/** Touching what it explains, so that the pointer can get there: above, where it hides no row that comes next. */
function put() {
  const box = about.getBoundingClientRect();
  const { width, height } = bubble.getBoundingClientRect();
  bubble.style.left = `${Math.max(EDGE, Math.min(box.left, window.innerWidth - width - EDGE))}px`;
  bubble.style.top = `${box.top - height >= 0 ? box.top - height : box.bottom}px`;
}

const hinted = (node) => node?.closest?.("[data-hint]") ?? null;

/** The pointer has moved. What moves under a pointer that rests is not pointed at, except in the place of what is gone. */
function point(event) {
  const here = `${event.screenX} ${event.screenY}`;
  if (here === place && (under === null || under.isConnected)) return;
  place = here;
  if (bubble.contains(event.target)) return;
  const node = hinted(event.target);
  // Put away by Escape, it comes again when it is pointed at anew.
  if (node === under) return;
  under = pointed = node;
  show();
}

function leave(event) {
  if (event.pointerType !== "mouse" || event.relatedTarget !== null) return;
  under = pointed = null;
  show();
}

for (const kind of ["pointermove", "pointerover"]) document.addEventListener(kind, point);
document.addEventListener("pointerout", leave);
document.addEventListener("focusin", (event) => {
  focused = hinted(event.target);
  show();
});
document.addEventListener("focusout", () => {
  focused = null;
  show();
});
document.addEventListener(
  "scroll",
  () => {
    if (about === null) return;
    under = pointed = null;
    show();
  },
  { capture: true, passive: true },
);
document.addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || about === null) return;
  event.stopPropagation();
  pointed = focused = null;
  show();
});
