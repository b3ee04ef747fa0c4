// A sentence of explanation for whatever has `data-hint`, when it is pointed at or focused.

import { el } from "./dom.js";

const EDGE = 8;

const bubble = el("div", { id: "hint", class: "hint", role: "tooltip", hidden: true });
let about = null;

function show(node) {
  if (node === about) return;
  hide();
  if (!node?.dataset.hint) return;
  about = node;
  if (!bubble.isConnected) document.body.append(bubble);
  bubble.textContent = node.dataset.hint;
  bubble.hidden = false;
  node.setAttribute("aria-describedby", "hint");
  place();
}

/** Below what it explains, or above where there is no room. */
function place() {
  const box = about.getBoundingClientRect();
  const { width, height } = bubble.getBoundingClientRect();
  const below = box.bottom + EDGE + height <= window.innerHeight;
  bubble.style.left = `${Math.max(EDGE, Math.min(box.left, window.innerWidth - width - EDGE))}px`;
  bubble.style.top = `${below ? box.bottom + EDGE / 2 : box.top - height - EDGE / 2}px`;
}

function hide() {
  about?.removeAttribute("aria-describedby");
  about = null;
  bubble.hidden = true;
}

/** What is focused keeps its sentence while it is scrolled into view. */
function follow() {
  if (about === null) return;
  if (about === document.activeElement) place();
  else hide();
}

const hinted = (event) => event.target.closest?.("[data-hint]");
document.addEventListener("pointerover", (event) => show(hinted(event)));
document.addEventListener("focusin", (event) => show(hinted(event)));
document.addEventListener("focusout", hide);
document.addEventListener("scroll", follow, { capture: true, passive: true });
document.addEventListener("keydown", (event) => event.key === "Escape" && hide());
