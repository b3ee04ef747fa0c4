// The comparison as text to paste elsewhere: CSV for a spreadsheet, LaTeX for a paper.

import { number } from "../look/format.js";
import { csv } from "../runs/differences.js";
import { told } from "./versus.js";

/**
 * `rows` are {estimator, vehicle, metrics, packets, difference, best}, difference being {mean, half} or null;
 * `against` names the baseline and the figure that the differences are in.
 */
export function asCsv(rows, against) {
  const head = ["estimator", "vehicle", "rmse_m", "final_rmse_m", "sigma_m", "final_sigma_m", "anees", "verdict", `${against.figure}_minus_${against.name}`, "low", "high", "packets", "bytes_per_packet", "bits_per_second"];
  const body = rows.map(({ estimator, vehicle, metrics: m, packets: p, difference: d }) => {
    const half = d?.half ?? null;
    const edges = half === null ? [null, null] : [d.mean - half, d.mean + half];
    return [estimator, vehicle, m.rmse_m, m.final_rmse_m, m.sigma_m, m.final_sigma_m, m.anees, m.verdict, d?.mean ?? null, ...edges, p.sent, p.bytes_per_packet, p.bits_per_second];
  });
  return csv([head, ...body]);
}

/** A booktabs tabular; the best of a vehicle in bold. */
export function asLatex(rows, against) {
  const head = ["Estimator", "Vehicle", "RMSE [m]", "Final [m]", "$\\sigma$ [m]", "ANEES", `$\\Delta$ ${tex(against.label)} to ${tex(against.title)} [m]`, "Verdict"];
  const body = rows.map(({ estimator, vehicle, metrics: m, difference: d, best }, n) => {
    const figure = (key) => (best && key === against.figure ? `\\textbf{${value(m[key])}}` : value(m[key]));
    const again = n > 0 && rows[n - 1].estimator === estimator;
    return [again ? "" : tex(estimator), tex(vehicle), figure("rmse_m"), figure("final_rmse_m"), value(m.sigma_m), value(m.anees), apart(d), tex(m.verdict ?? "")];
  });
  const lines = [head, ...body].map((cells) => `${cells.join(" & ")} \\\\`);
  return ["% needs \\usepackage{booktabs}", "\\begin{tabular}{llrrrrrl}", "\\toprule", lines[0], "\\midrule", ...lines.slice(1), "\\bottomrule", "\\end{tabular}", ""].join("\n");
}

const value = (v) => (v === null || v === undefined ? "--" : number(v));

const apart = (difference) => (difference ? `$${told(difference).replace("−", "-").replace("±", "\\pm")}$` : "--");

const ESCAPES = { "\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", σ: "$\\sigma$" };

/** Text that LaTeX sets as it is. */
function tex(text) {
  return text.replace(/[\\~^σ&%$#_{}]/g, (c) => ESCAPES[c] ?? `\\${c}`);
}
