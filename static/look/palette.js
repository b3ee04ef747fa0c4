// Okabe and Ito's colours: vehicles by dot, algorithms by line, each line with a dash of its own.

const VEHICLES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

const LINES = {
  light: ["#d55e00", "#0072b2", "#009e73", "#b5508a", "#b37a00", "#2a8fc7"],
  dark: ["#f08a4b", "#4aa8e0", "#2fc79a", "#dd93bd", "#e69f00", "#8fd0f5"],
};
const INK = { light: "#1b1f23", dark: "#e8eaec" };
const DASHES = ["6 3", "2 2.5", "9 3 2 3", "12 4", "12 3 2 3 2 3", "4 6", "16 3 4 3", "7 2.5 2 2.5 2 2.5 2 2.5", "18 5"];
const SOLID = "";

export const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");

/** Colour of the n-th subject of a mission, in panes and chips. */
export function vehicleColour(n) {
  return VEHICLES[n % VEHICLES.length];
}

/**
 * Line of an algorithm: {colour, dash}, dash as SVG writes it ("" is solid).
 * The first benchmark of those that can run the same missions is drawn in ink, solid; the others by their place among them.
 */
export function lineStyle(name, algorithms) {
  const scheme = darkScheme.matches ? "dark" : "light";
  const own = algorithms.find((a) => a.name === name);
  const together = algorithms.filter((a) => missionsOf(a).some((family) => own && missionsOf(own).includes(family)));
  const benchmark = together.find((a) => a.centralized);
  if (own && own === benchmark) return { colour: INK[scheme], dash: SOLID };
  const place = Math.max(0, together.filter((a) => a !== benchmark).indexOf(own));
  const colours = LINES[scheme];
  return { colour: colours[place % colours.length], dash: DASHES[place % DASHES.length] };
}

/** Families of the missions that an algorithm can run. */
function missionsOf(algorithm) {
  return algorithm.accepts_families ?? [algorithm.family];
}
