// What the person must know: the server lost, messages about the open run, what was just done and can be undone.

import { el, part } from "./look/dom.js";
import { store } from "./state/store.js";

export function mountNotices() {
  const lost = part("lost");
  const status = part("connection");
  let was = true;
  store.watch(["connected"], ({ connected }) => {
    lost.hidden = connected;
    lost.textContent = connected ? "" : "The server does not answer. What you see stays; trying again…";
    status.textContent = connected ? (was ? "" : "connected again") : "";
    was = connected;
  });

  const done = part("done");
  store.watch(["done"], (state) => {
    const { text, act } = state.done ?? {};
    done.replaceChildren(...(text ? [el("span", {}, text), el("button", { type: "button", class: "small", onclick: act.run }, act.label)] : []));
  });

  const room = part("notices");
  store.watch(["notices"], ({ notices }) => {
    room.replaceChildren(
      ...notices.map((notice) =>
        el(
          "div",
          { class: `notice ${notice.tone}` },
          el("strong", {}, notice.title),
          notice.text ? el("span", {}, notice.text) : null,
          el("button", { type: "button", class: "small", "aria-label": "Dismiss", onclick: () => store.set({ notices: store.state.notices.filter((n) => n !== notice) }) }, "×"),
        ),
      ),
    );
  });
}
