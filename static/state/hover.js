// Mission time under the pointer, in whichever plot or slider that is.

const watchers = [];

export const hover = {
  /** Mission time, s; null where the pointer is elsewhere. */
  time: null,

  /** `draw()` is called whenever the pointer has moved. */
  watch(draw) {
    watchers.push(draw);
  },

  at(time) {
    if (time === hover.time) return;
    hover.time = time;
    for (const draw of watchers) draw();
  },
};
