// A run's tags: to read, to take off, to add.

import { el } from "../look/dom.js";
import { mark } from "../state/jobs.js";

/** The tags of a job, each with a button that takes it off, and a field for another. */
export function tagEditor(job) {
  const put = (tags) => mark(job.id, { tags });
  const add = el("input", {
    type: "text",
    class: "add-tag",
    placeholder: "+ tag",
    list: "known-tags",
    maxlength: 40,
    autocomplete: "off",
    "aria-label": `Add a tag to ${job.title}`,
  });
  add.addEventListener("change", () => {
    const text = add.value.trim();
    if (text && !job.tags.includes(text)) put([...job.tags, text]);
    add.value = "";
  });
  return el(
    "span",
    { class: "tags" },
    job.tags.map((tag) =>
      el(
        "span",
        { class: "tag" },
        tag,
        el("button", { type: "button", "aria-label": `Take the tag ${tag} off`, onclick: () => put(job.tags.filter((t) => t !== tag)) }, "×"),
      ),
    ),
    add,
  );
}

/** A switch that pins a job as the baseline of comparisons. */
export function pinButton(job) {
  return el(
    "button",
    {
      type: "button",
      class: "pin",
      "aria-pressed": String(job.pinned),
      "aria-label": `Pin ${job.title} as baseline`,
      title: job.pinned ? "Pinned: comparisons measure against it" : "Pin as the baseline of comparisons",
      onclick: () => mark(job.id, { pinned: !job.pinned }),
    },
    job.pinned ? "★" : "☆",
  );
}
