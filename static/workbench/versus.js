// An estimator against a baseline: the difference of a figure, whether it is more than chance, and who is best.

import { number } from "../look/format.js";

/** Figures that are compared trial by trial; `less` says whether less is better, null where it is neither. */
export const FIGURES = {
  rmse_m: { label: "RMSE", less: true },
  final_rmse_m: { label: "final error", less: true },
  sigma_m: { label: "σ", less: null },
  final_sigma_m: { label: "final σ", less: null },
};

const minus = (value) => number(value).replace("-", "−");
const signed = (value) => (value > 0 ? "+" : "") + minus(value);

/**
 * An algorithm's difference to a baseline in a figure of a subject: {mean, half, kind}, null where there is none;
 * kind: "better", "worse", "less", "more", "chance", or "one" where one trial leaves nothing to tell chance by.
 */
export function versus(view, figure, subject, name, baseline) {
  const [mean, half] = view?.differences?.[figure]?.[subject]?.[name]?.[baseline] ?? [null, null];
  if (mean === null) return null;
  const kinds = FIGURES[figure].less ? ["better", "worse"] : ["less", "more"];
  const kind = half === null ? "one" : Math.abs(mean) <= half ? "chance" : kinds[mean < 0 ? 0 : 1];
  return { mean, half, kind };
}

export const MARKS = { better: "▼", worse: "▲", less: "▽", more: "△", chance: "n.s.", one: "" };

/** A difference as the table has it: as many decimals as two digits of the interval need. */
export function told({ mean, half }) {
  if (half === null) return signed(mean);
  const decimals = half > 0 ? Math.min(Math.max(0, 1 - Math.floor(Math.log10(half))), 4) : 3;
  return `${mean > 0 ? "+" : ""}${mean.toFixed(decimals).replace("-", "−")} ± ${half.toFixed(decimals)}`;
}

/** A difference in a sentence. */
export function sentence({ mean, half, kind }, figure, baseline, trials) {
  const { label } = FIGURES[figure];
  if (kind === "one") return `${signed(mean)} m in ${label} against ${baseline}. One trial cannot tell whether that is chance.`;
  const found = `Over ${trials} trials, ${signed(mean)} m in ${label} against ${baseline}, paired by trial; 95 % interval ${signed(mean - half)} to ${signed(mean + half)} m`;
  const verdict = {
    better: "It is better, by more than chance.",
    worse: "It is worse, by more than chance.",
    less: "It is less, by more than chance; whether that is good depends on the error.",
    more: "It is more, by more than chance; whether that is good depends on the error.",
    chance: "The interval holds 0: not significant.",
  };
  return `${found}. ${verdict[kind]}`;
}

/**
 * The best of the contenders in a figure of a subject, and those that are not significantly behind:
 * {best, level: Set}; best is null where there are not two to compare, or where less is not better.
 */
export function winners(result, view, figure, subject, contenders) {
  const value = (name) => result.algorithms[name]?.subjects[subject]?.[figure] ?? null;
  const having = contenders.filter((name) => value(name) !== null);
  if (!FIGURES[figure].less || having.length < 2) return { best: null, level: new Set() };
  const best = having.reduce((a, b) => (value(b) < value(a) ? b : a));
  const level = having.filter((name) => name !== best && versus(view, figure, subject, name, best)?.kind === "chance");
  return { best, level: new Set(level) };
}
