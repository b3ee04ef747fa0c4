// A curve of an estimator, in its line's colour and dash.

import { lineStyle } from "../look/palette.js";

/** {algorithm, title, colour, dash, …what it shows}. */
export function curve(state, name, shows) {
  const known = state.algorithms?.find((a) => a.name === name);
  return { algorithm: name, title: known?.title ?? name, ...lineStyle(name, state.algorithms ?? []), ...shows };
}
