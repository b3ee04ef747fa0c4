// A button that opens a sheet of controls: closed by Escape, by a click elsewhere, by what was chosen.

import { el } from "./dom.js";

/** A menu of a class, its button (words or attributes with words), its sheet. */
export function menu(kind, button, sheet) {
  const root = el("details", { class: kind }, button, sheet);
  root.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !root.open) return;
    event.stopPropagation();
    close(root);
  });
  const elsewhere = (event) => {
    if (!root.contains(event.target)) root.open = false;
  };
  // Only while it is open: the document would keep a menu that has left the page.
  root.addEventListener("toggle", () => {
    if (root.open) document.addEventListener("pointerdown", elsewhere);
    else document.removeEventListener("pointerdown", elsewhere);
  });
  return root;
}

/** Closes a menu; the keyboard is at its button again. */
export function close(root) {
  root.open = false;
  root.firstChild.focus();
}
