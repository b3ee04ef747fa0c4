// What is open and how far it is: title, state, progress.

import { el, part } from "../look/dom.js";
import { count, percent, plural } from "../look/format.js";
import { atWork, cancelRun } from "../state/run.js";
import { store } from "../state/store.js";

const STATES = { queued: "waiting", running: "running", done: "finished", failed: "failed", cancelled: "cancelled" };

export function mountHeadline() {
  const head = part("headline");
  const title = el("span", { class: "title" });
  const about = el("span", { class: "about" });
  const state = el("span", { class: "state", role: "status" });
  const bar = el("progress", { id: "progress", max: 1, "aria-label": "Progress of the run" });
  const cancel = el("button", { type: "button", class: "small", onclick: cancelRun }, "Cancel");
  head.append(title, about, state, bar, cancel);

  store.watch(["run", "job", "progress"], ({ run, job, progress }) => {
    head.hidden = run === null;
    const busy = atWork(job);
    bar.hidden = cancel.hidden = !busy;
    if (!job) {
      title.textContent = "Opening the run…";
      about.textContent = state.textContent = "";
      return;
    }
    title.textContent = job.title;
    about.textContent = `${plural(job.algorithms.length, "estimator")} · ${plural(job.trials, "trial")} · seed ${job.seed}`;
    const fraction = progress?.fraction ?? job.progress ?? 0;
    state.dataset.state = job.state;
    state.textContent = STATES[job.state];
    if (job.state === "running") state.textContent = fraction > 0 ? percent(fraction) : "starting";
    state.title = progress ? `${count(progress.shards_done)} of ${plural(progress.shards, "part")} finished` : "";
    if (job.state === "queued") bar.removeAttribute("value");
    else bar.value = fraction;
  });
}
