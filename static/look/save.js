// A file for the person at the page.

import { el } from "./dom.js";

/** Saves content (text or a Blob) under a name. */
export function save(content, name, type = "") {
  const address = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
}
