// The tabs of the side column, as the ARIA pattern has them.

import { part } from "./look/dom.js";

export function mountTabs() {
  const tabs = [part("tab-new"), part("tab-whatif"), part("tab-runs")];
  const choose = (chosen, focus) => {
    for (const tab of tabs) {
      const selected = tab === chosen;
      tab.setAttribute("aria-selected", String(selected));
      tab.tabIndex = selected ? 0 : -1;
      part(tab.getAttribute("aria-controls")).hidden = !selected;
    }
    if (focus) chosen.focus();
  };
  tabs.forEach((tab, n) => {
    tab.addEventListener("click", () => choose(tab, false));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (step) {
        event.preventDefault();
        choose(tabs[(n + step + tabs.length) % tabs.length], true);
      }
    });
  });
}
