// A picture of the panes as they are on the screen, with their names, the mission and its time.

import { clockTime } from "../look/format.js";
import { token } from "../look/plotly.js";
import { clock } from "../state/clock.js";
import { store } from "../state/store.js";

const HEADER = 30;
const FOOTER = 28;

/** Draws panes {root, title, reading, picture} into a canvas; `ratio` pixels per CSS pixel. */
export function compose(canvas, panes, ratio = window.devicePixelRatio || 1) {
  const boxes = panes.map(({ root }) => root.getBoundingClientRect());
  const [west, north] = [Math.min(...boxes.map((b) => b.left)), Math.min(...boxes.map((b) => b.top))];
  const width = Math.max(...boxes.map((b) => b.right)) - west;
  const height = Math.max(...boxes.map((b) => b.bottom)) - north;
  const even = (size) => 2 * Math.round((size * ratio) / 2);
  // A film's frames must all have one size.
  if (canvas.width !== even(width) || canvas.height !== even(height + FOOTER)) Object.assign(canvas, { width: even(width), height: even(height + FOOTER) });
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = token("--paper");
  pen.fillRect(0, 0, width + 2, height + FOOTER + 2);
  panes.forEach(({ root, title, reading, picture }, n) => {
    const [x, y, w, h] = [boxes[n].left - west, boxes[n].top - north, boxes[n].width, boxes[n].height];
    pen.fillStyle = token("--panel");
    pen.fillRect(x, y, w, h);
    pen.fillStyle = getComputedStyle(root).borderTopColor;
    pen.fillRect(x, y, w, 3);
    words(pen, title, x + 10, y + HEADER / 2 + 2, { weight: 600, most: w - 20 });
    words(pen, reading, x + 10, y + HEADER / 2 + 21, { colour: "--ink-2", size: 12 });
    if (!picture) return;
    const view = root.querySelector(".view").getBoundingClientRect();
    pen.drawImage(picture, view.left - west, view.top - north, view.width, view.height);
  });
  words(pen, store.state.job?.title ?? "", 8, height + FOOTER / 2, { colour: "--ink-2", most: width - 120 });
  words(pen, clockTime(clock.time, true), width - 8, height + FOOTER / 2, { align: "right", weight: 600 });
  return canvas;
}

function words(pen, text, x, y, { size = 13, weight = 400, align = "left", colour = "--ink", most = undefined }) {
  Object.assign(pen, { font: `${weight} ${size}px ${token("--sans")}`, textAlign: align, textBaseline: "middle", fillStyle: token(colour) });
  pen.fillText(text, x, y, most);
}
