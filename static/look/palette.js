// Okabe and Ito's colours: vehicles by dot, algorithms by line, each line with a dash of its own.

const VEHICLES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

const LINES = {
  light: ["#d55e00", "#0072b2", "#009e73", "#b5508a", "#b37a00", "#2a8fc7"],
  dark: ["#f08a4b", "#4aa8e0", "#2fc79a", "#dd93bd", "#e69f00", "#8fd0f5"],
};
const INK = { light: "#1b1f23", dark: "#e8eaec" };
const DASHES = ["6 3", "2 2.5", "9 3 2 3", "12 4", "12 3 2 3 2 3"];
const SOLID = "";

export const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");

/** Colour of the n-th subject of a mission, in panes and chips. */
export function vehicleColour(n) {
  return VEHICLES[n % VEHICLES.length];
}

/**
 * Line of an algorithm: {colour, dash}, dash as SVG writes it ("" is solid).
 * The benchmark is drawn in ink, solid; the others by their place among the family's algorithms.
 */
export function lineStyle(name, algorithms) {
  const scheme = darkScheme.matches ? "dark" : "light";
  const own = algorithms.find((a) => a.name === name);
  const family = algorithms.filter((a) => a.family === own?.family);
  if (own?.centralized && family.find((a) => a.centralized) === own) return { colour: INK[scheme], dash: SOLID };
  const others = family.filter((a) => a !== family.find((b) => b.centralized));
  const place = Math.max(0, others.indexOf(own));
  const colours = LINES[scheme];
  return { colour: colours[place % colours.length], dash: DASHES[place % DASHES.length] };
}
