// Several results side by side: their figures against a baseline's, and what their scenarios differ in.

/**
 * Figures that can be compared: of a subject, or of a whole estimator; whether less is better (null: neither), and
 * whether errors of the trials make it scatter.
 */
export const FIGURES = [
  { key: "rmse_m", label: "RMSE", unit: "m", of: (_, m) => m.rmse_m, less: true, scatters: true },
  { key: "final_rmse_m", label: "Final error", unit: "m", of: (_, m) => m.final_rmse_m, less: true, scatters: true },
  { key: "sigma_m", label: "Mean σ", unit: "m", of: (_, m) => m.sigma_m, less: true },
  { key: "final_sigma_m", label: "Final σ", unit: "m", of: (_, m) => m.final_sigma_m, less: true },
  { key: "anees", label: "ANEES", unit: "2 is right", of: (_, m) => m.anees, less: null },
  { key: "bytes", label: "Packet", unit: "B", of: (a) => (a.packets.sent ? a.packets.bytes_per_packet : null), less: true },
  { key: "cpu_s", label: "CPU", unit: "s", of: (a) => a.cpu_s, less: true },
];

/**
 * Rows of a figure, one for each estimator and subject of any result: {algorithm, subject, cells}, a cell per result:
 * {value, change, chance}: change relative to the baseline's value (null: no such figure), and the largest change that
 * chance explains (0 where the figure does not scatter).
 */
export function rowsOf(figure, results, baseline) {
  const pairs = new Map();
  for (const result of results) {
    for (const [algorithm, answer] of Object.entries(result.algorithms)) {
      for (const subject of Object.keys(answer.subjects)) pairs.set(`${algorithm} ${subject}`, { algorithm, subject });
    }
  }
  return [...pairs.values()].map(({ algorithm, subject }) => {
    const answers = results.map((result) => result.algorithms[algorithm]);
    const values = answers.map((answer) => {
      const metrics = answer?.subjects[subject];
      return metrics ? (figure.of(answer, metrics) ?? null) : null;
    });
    const base = values[baseline];
    const scatter = answers.map((answer) => (figure.scatters ? scatterOf(answer?.subjects[subject]) : 0));
    const cells = values.map((value, n) => ({
      value,
      change: n === baseline || value === null || base === null || base === 0 ? null : value / base - 1,
      chance: Math.hypot(scatter[n], scatter[baseline]),
    }));
    return { algorithm, subject, cells };
  });
}

/**
 * Relative half-width of an RMS error's 95 % interval: its square is distributed as the NEES of as many trials, whose
 * interval [low, high] about 2 a result tells; errors along a mission are taken as one.
 */
function scatterOf(metrics) {
  const [low, high] = metrics?.anees_interval ?? [];
  return low === undefined ? 0 : (Math.sqrt(high / 2) - Math.sqrt(low / 2)) / 2;
}

/** Key paths at which scenarios differ: [{key, values}], a value per scenario (undefined where it has none). */
export function scenarioDifferences(scenarios) {
  const flat = scenarios.map((scenario) => new Map(leaves(scenario)));
  const keys = new Set(flat.flatMap((leaf) => [...leaf.keys()]));
  const found = [...keys].map((key) => ({ key, values: flat.map((leaf) => leaf.get(key)) }));
  return found.filter(({ values }) => new Set(values.map((v) => JSON.stringify(v))).size > 1);
}

/** Words about a scenario say nothing on what it does. */
const WORDS = new Set(["title", "summary", "source", "claims", "algorithms"]);

function* leaves(value, path = "") {
  if (value === null || typeof value !== "object" || Array.isArray(value) && !value.some((v) => v?.name)) {
    yield [path, value];
    return;
  }
  for (const [key, inner] of Object.entries(value)) {
    if (path === "" && WORDS.has(key)) continue;
    const name = Array.isArray(value) ? (inner.name ?? key) : key;
    yield* leaves(inner, path ? `${path}.${name}` : name);
  }
}

/** Rows as CSV text. Text that a spreadsheet would compute (=, +, -, @ first) gets an apostrophe before it; numbers none. */
export function csv(rows) {
  const cell = (value) => {
    let text = value === null || value === undefined ? "" : String(value);
    if (typeof value === "string" && /^[=+\-@\t\r]/.test(text)) text = `'${text}`;
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";
}
