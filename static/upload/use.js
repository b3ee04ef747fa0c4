// One use of a CSV file: what it is, and which column says what, from the schema of the scenario file.

import { el } from "../look/dom.js";

export const KINDS = {
  odometry: { label: "Odometry: steps and turns", of: "OdometryFile" },
  velocity: { label: "Velocities", of: "VelocityFile" },
  heading: { label: "Headings", of: "HeadingFile" },
  depth: { label: "Depths", of: "DepthFile" },
  fixes: { label: "Position fixes (GPS)", of: "FixesFile" },
  ranges: { label: "Ranges or travel times", of: "RangesFile" },
  nodes: { label: "Places of fixed nodes", of: "NodesFile" },
  truth: { label: "Truth, to score by", of: "TruthFile" },
};

/** Vehicles are typed or picked from this list. */
export const VEHICLES = "upload-vehicles";

/**
 * A form {root, use() -> {kind, file, values}, fault(problems)} for a use of a described file; change() is called when
 * something is, drop() when the use is to go.
 */
export function useForm(file, schema, wanted, usual, change, drop) {
  const fields = el("div", { class: "fields" });
  const kind = el(
    "select",
    { "aria-label": `What ${file.name} holds`, onchange: () => (build({}), change()) },
    Object.entries(KINDS).map(([key, { label }]) => el("option", { value: key }, label)),
  );
  const faults = el("div", { class: "faults", role: "alert" });
  const root = el(
    "div",
    { class: "use" },
    el("div", { class: "what" }, kind, el("button", { type: "button", class: "small", "aria-label": `Leave this use of ${file.name} out`, onclick: drop }, "×")),
    fields,
    faults,
  );
  let controls = new Map();

  function build(values) {
    controls = new Map();
    root.dataset.kind = kind.value;
    const { properties, required = [] } = schema.$defs[KINDS[kind.value].of];
    const rows = Object.entries(properties)
      .filter(([key]) => key !== "file")
      .map(([key, described]) => control(key, described, values, required.includes(key)))
      .filter(Boolean);
    fields.replaceChildren(...rows);
    renew();
  }

  function control(key, described, values, needed) {
    const value = values[key];
    const type = described.anyOf?.find((choice) => choice.type !== "null") ?? described;
    const name = key === "names" ? "Who is who" : key.replaceAll("_", " ");
    const label = (node, shape = "field") => el("label", { class: shape, title: described.description ?? "" }, el("span", {}, name), node);
    const tell = () => (renew(), change());
    if (key === "names") {
      const rows = el("div", { class: "names" });
      controls.set(key, { read: () => named(rows), rows, kept: value ?? {} });
      return rows;
    }
    if (type.type === "string" && type.maxLength === 200) {
      const list = el("select", { onchange: tell, "data-key": key }, el("option", { value: "" }, needed ? "choose a column…" : "–"), file.columns.map((c) => el("option", { value: c.name }, c.name)));
      list.value = value ?? "";
      controls.set(key, { read: () => list.value || undefined, node: list });
      return label(list);
    }
    const options = type.enum ?? (type.$ref ? schema.$defs[type.$ref.split("/").at(-1)].enum : null);
    if (options) {
      const list = el("select", { onchange: tell, "data-key": key }, options.map((o) => el("option", { value: o }, o)));
      list.value = value ?? described.default;
      controls.set(key, { read: () => (list.value === described.default ? undefined : list.value), node: list });
      return label(list);
    }
    if (type.type === "boolean") {
      const box = el("input", { type: "checkbox", checked: value ?? described.default, onchange: tell, "data-key": key });
      controls.set(key, { read: () => box.checked || undefined, node: box });
      return label(box, "field box");
    }
    if (type.type === "string") {
      const text = el("input", { type: "text", list: VEHICLES, autocomplete: "off", spellcheck: "false", onchange: tell, "data-key": key });
      text.value = value ?? (needed || (key === "receiver" && !values.receiver_column) ? usual : "");
      controls.set(key, { read: () => text.value.trim() || undefined, node: text });
      return label(text);
    }
    if (type.type === "number") {
      const text = el("input", { type: "text", inputmode: "decimal", onchange: tell, "data-key": key, placeholder: String(described.default ?? "") });
      controls.set(key, { read: () => (text.value.trim() === "" ? undefined : Number(text.value)), node: text });
      return label(text);
    }
    return null;
  }

  /** What stands in the columns of names gets a row each; a column and a single name exclude each other. */
  function renew() {
    const read = (key) => controls.get(key)?.read();
    for (const end of ["sender", "receiver"]) {
      const one = controls.get(end)?.node;
      if (!one) continue;
      one.disabled = read(`${end}_column`) !== undefined;
      if (one.disabled) one.value = "";
    }
    const names = controls.get("names");
    if (!names) return;
    const kept = { ...names.kept, ...named(names.rows) };
    const labels = [...new Set(["sender_column", "receiver_column", "name"].flatMap((key) => file.columns.find((c) => c.name === read(key))?.values ?? []))];
    names.rows.replaceChildren(
      ...labels.map((label) => {
        const text = el("input", { type: "text", list: VEHICLES, autocomplete: "off", spellcheck: "false", value: kept[label] ?? vehicleName(label), "data-label": label, "aria-label": `Vehicle called ${label} in ${file.name}`, onchange: change });
        return el("label", { class: "field" }, el("span", {}, el("code", {}, label), " is"), text);
      }),
    );
  }

  kind.value = wanted.kind;
  build({ ...wanted.values });
  return {
    root,
    use: () => ({ kind: kind.value, file: file.name, values: Object.fromEntries([...controls].map(([key, c]) => [key, c.read()])) }),
    fault(problems) {
      faults.replaceChildren(...problems.map(({ message, remedy }) => el("p", {}, `${message}; `, el("span", { class: "remedy" }, remedy))));
      root.toggleAttribute("data-faulty", problems.length > 0);
    },
  };
}

function named(rows) {
  const found = [...rows.querySelectorAll("input")].map((input) => [input.dataset.label, input.value.trim()]);
  return found.length ? Object.fromEntries(found.filter(([, name]) => name)) : undefined;
}

/** A name that a vehicle may have, like what a log calls it. */
export function vehicleName(label) {
  const plain = label.replace(/[^A-Za-z0-9_-]+/g, "-").replace(/^-+|-+$/g, "");
  return /^[A-Za-z]/.test(plain) ? plain.slice(0, 40) : `node${plain}`.slice(0, 40);
}
