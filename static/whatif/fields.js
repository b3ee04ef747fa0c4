// The values of a scenario that can be turned, found by walking it along its JSON schema.

/** Units by the end of a key's name. */
const UNITS = {
  m: "m", s: "s", mps: "m/s", deg: "°", hz: "Hz", m2: "m²", db: "dB", bps: "bit/s", dps: "°/s", psd: "m²/s³", sigma: "σ",
};

/** Tables of no interest to a what-if. */
const PASSED_OVER = new Set(["schema", "claims", "options", "algorithms", "title", "summary", "source", "seed", "trials", "family"]);

/**
 * Fields {path, value, kind, min, max, above, choices, meaning, unit} of a scenario, kind "number", "integer", "flag" or
 * "choice"; `above` says that min itself is not allowed. A number that is not stated has the value null.
 */
export function fieldsOf(schema, scenario) {
  const found = [];
  const resolve = (node) => (node.$ref ? { ...schema.$defs[node.$ref.split("/").at(-1)], ...omit(node, "$ref") } : node);

  const table = (node, value, path) => {
    for (const [key, described] of Object.entries(node.properties ?? {})) {
      if (path || !PASSED_OVER.has(key)) visit(described, value[key], path ? `${path}.${key}` : key, described.description ?? "");
    }
  };

  const visit = (described, value, path, meaning) => {
    const node = branch(resolve(described), value, resolve);
    if (!node) return;
    const told = { path, meaning: meaning || node.description || "", unit: unitOf(path) };
    if (node.type === "number" || node.type === "integer") found.push({ ...told, ...bounds(node), kind: node.type, value: value ?? null });
    else if (node.type === "boolean" && value !== undefined) found.push({ ...told, kind: "flag", value });
    else if (node.enum && value !== undefined && node.enum.length > 1) found.push({ ...told, kind: "choice", value, choices: node.enum });
    else if (node.type === "array" && Array.isArray(value)) {
      value.forEach((item, n) => visit(node.items ?? {}, item, item?.name ? `${path}.${item.name}` : `${path}[${n}]`, meaning));
    } else if (node.properties && value !== null && typeof value === "object") table(node, value, path);
  };

  table(schema, scenario, "");
  return found;
}

/** Of a schema with alternatives, the one that a value is of; of a number left out, the number's. */
function branch(node, value, resolve) {
  const choices = node.anyOf ?? node.oneOf;
  if (!choices) return node;
  const members = choices.map((choice) => branch(resolve(choice), value, resolve)).filter(Boolean);
  if (value === undefined || value === null) {
    const plain = members.filter((m) => m.type !== "null");
    return plain.length === 1 && ["number", "integer"].includes(plain[0].type) ? plain[0] : null;
  }
  return members.find((member) => fits(member, value)) ?? null;
}

function fits(node, value) {
  if (node.const !== undefined) return node.const === value;
  if (node.enum) return node.enum.includes(value);
  if (node.type === "array") return Array.isArray(value);
  if (node.properties) {
    if (value === null || typeof value !== "object" || Array.isArray(value)) return false;
    return Object.entries(node.properties).every(([key, { const: fixed }]) => fixed === undefined || fixed === value[key]);
  }
  const types = { number: "number", integer: "number", boolean: "boolean", string: "string" };
  return typeof value === types[node.type];
}

function bounds(node) {
  const above = node.exclusiveMinimum !== undefined;
  return { min: node.exclusiveMinimum ?? node.minimum ?? -Infinity, max: node.exclusiveMaximum ?? node.maximum ?? Infinity, above };
}

function unitOf(path) {
  const words = path.replace(/\[\d+\]/g, "").split(".").at(-1).split("_");
  return words.length > 1 ? (UNITS[words.at(-1)] ?? "") : "";
}

function omit(object, key) {
  return Object.fromEntries(Object.entries(object).filter(([other]) => other !== key));
}
