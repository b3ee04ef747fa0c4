// The vehicles a mapping speaks of: what each is, where it starts, how noisy its sensors are.

import { el } from "../look/dom.js";
import { USUAL_NOISE } from "./mission.js";

const NOISE = {
  "modem.range_sigma_m": "range σ, m",
  "dvl.along_sigma_mps": "DVL σ forward, m/s",
  "dvl.cross_sigma_mps": "DVL σ across, m/s",
  "heading.sigma_deg": "heading σ, °",
  "depth.sigma_m": "depth σ, m",
  "gps.sigma_m": "fix σ, m",
  "odometry.per_sqrt_m.forward_sigma_m": "odometry σ forward, m per √m",
  "odometry.per_sqrt_m.left_sigma_m": "odometry σ across, m per √m",
  "odometry.per_sqrt_m.turn_sigma_deg": "odometry σ turn, ° per √m",
};

/** A list {root, show(vehicles), about(vehicle), fault(n, problems)} that keeps what was said of a vehicle by its name. */
export function vehicleList(change) {
  const said = new Map();
  const root = el("div", { class: "team" });
  let drawn = "";

  const of = (vehicle) => {
    if (!said.has(vehicle.name)) said.set(vehicle.name, { kind: vehicle.kind === "fixed" ? "fixed" : "auv", position_sigma_m: 1, position: "", heading_deg: null, noise: {} });
    return said.get(vehicle.name);
  };

  function row(vehicle) {
    const mine = of(vehicle);
    const number = (label, value, keep, hint = "") => {
      const field = el("input", { type: "text", inputmode: "decimal", value: value ?? "", placeholder: "–", title: hint });
      field.addEventListener("change", () => {
        const text = field.value.trim();
        const fits = text === "" || Number.isFinite(Number(text));
        field.toggleAttribute("aria-invalid", !fits);
        if (fits) keep(text === "" ? null : Number(text));
        change();
      });
      return el("label", { class: "field", title: hint }, el("span", {}, label), field);
    };
    const kind = el("select", { "aria-label": `What ${vehicle.name} is`, onchange: () => ((mine.kind = kind.value), change()) }, [["auv", "AUV"], ["surface", "surface craft or robot"], ["fixed", "fixed node"]].map(([v, t]) => el("option", { value: v }, t)));
    kind.value = mine.kind;
    const place = el("input", { type: "text", value: mine.position, placeholder: "from the log", spellcheck: "false", onchange: () => ((mine.position = place.value), change()) });
    const noise = vehicle.sensors.flatMap((sensor) => Object.entries(USUAL_NOISE[sensor]).map(([path, usual]) => [`${sensor}.${path}`, usual]));
    return el(
      "div",
      { class: "vehicle-row", "data-vehicle": vehicle.name },
      el("b", {}, vehicle.name),
      kind,
      el("div", { class: "faults", role: "alert" }),
      el(
        "div",
        { class: "fields" },
        el("label", { class: "field", title: "x, y in metres, where no truth, fix or node file says so" }, el("span", {}, "starts at x, y"), place),
        vehicle.kind === "fixed" ? null : number("heading at start, °", mine.heading_deg, (v) => (mine.heading_deg = v), "Counter-clockwise from x (east); empty takes it from the truth"),
        number("start σ, m", mine.position_sigma_m, (v) => (mine.position_sigma_m = v ?? 1)),
        noise.map(([path, usual]) => number(NOISE[path], mine.noise[path] ?? usual, (v) => (v === null ? delete mine.noise[path] : (mine.noise[path] = v)))),
      ),
    );
  }

  return {
    root,
    show(vehicles) {
      const wanted = JSON.stringify(vehicles);
      if (wanted === drawn) return;
      drawn = wanted;
      root.replaceChildren(...vehicles.map(row));
    },
    about(vehicle) {
      const mine = of(vehicle);
      const xy = mine.position.split(/[\s,;]+/).filter(Boolean).map(Number);
      return { ...mine, position_m: xy.length === 2 && xy.every(Number.isFinite) ? xy : null };
    },
    fault(n, problems) {
      const node = root.children[n];
      node?.toggleAttribute("data-faulty", problems.length > 0);
      node?.querySelector(".faults").replaceChildren(...problems.map(({ message, remedy }) => el("p", {}, `${message}; `, el("span", { class: "remedy" }, remedy))));
    },
  };
}
