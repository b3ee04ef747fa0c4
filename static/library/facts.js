// A scenario in a few words and figures.

import { duration, percent, plural, written } from "../look/format.js";

/** Models of packet loss by kind: in words, and in one or two. */
const LOSSES = {
  fixed: (loss) => {
    const rates = (loss.links ?? []).map((link) => link.rate);
    return rates.length ? `${percent(Math.min(...rates))} to ${percent(Math.max(...rates))}, by link` : percent(loss.rate);
  },
  range: (loss) => `grows with range, half at ${written(loss.half_range_m)} m`,
  snr: () => "by signal-to-noise ratio",
  bursty: (loss) => `in bursts of ${written(loss.mean_bad_s)} s`,
  recorded: () => "as recorded",
};

const SHORT = { range: "by range", snr: "by SNR", bursty: "in bursts", recorded: "recorded" };

/** The packet loss of a network as short as a field allows. */
export function lossShort(network) {
  const loss = network?.loss ?? 0;
  if (typeof loss === "number") return String(loss);
  if (loss.kind === "fixed") return loss.links?.length ? "by link" : String(loss.rate);
  return SHORT[loss.kind] ?? loss.kind;
}

/** The packet loss of a network in words. */
export function lossWords(network) {
  const loss = network?.loss ?? 0;
  if (typeof loss === "number") return percent(loss);
  return LOSSES[loss.kind]?.(loss) ?? loss.kind;
}

/** Pairs [name, value] that say what a scenario is like. */
export function facts(scenario) {
  const vehicles = scenario.vehicles ?? [];
  const kinds = new Map();
  for (const { kind } of vehicles) kinds.set(kind, (kinds.get(kind) ?? 0) + 1);
  const words = { auv: "AUV", surface: "surface craft", fixed: "fixed node" };
  const found = [];
  if (scenario.duration_s) found.push(["Duration", duration(scenario.duration_s)]);
  if (vehicles.length) {
    const team = [...kinds].map(([kind, n]) => plural(n, words[kind] ?? kind, kind === "surface" ? "surface craft" : undefined));
    found.push(["Team", team.join(", ")]);
  }
  const { network } = scenario;
  if (network?.tdma) {
    const { slots, cycle_s } = network.tdma;
    found.push(["Broadcasts", `${slots.length} every ${written(cycle_s)} s`]);
  }
  if (network) found.push(["Packet loss", lossWords(network)]);
  found.push(["Trials", String(scenario.trials ?? 1)]);
  return found;
}
