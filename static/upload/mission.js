// The mission that a mapping describes, as a scenario file has it.

/** Noise of a vehicle's sensors until a person says otherwise: key path below sensors -> value. */
export const USUAL_NOISE = {
  modem: { range_sigma_m: 1 },
  dvl: { along_sigma_mps: 0.1, cross_sigma_mps: 0.1 },
  heading: { sigma_deg: 2 },
  depth: { sigma_m: 0.2 },
  gps: { sigma_m: 3 },
  odometry: { "per_sqrt_m.forward_sigma_m": 0.1, "per_sqrt_m.left_sigma_m": 0.05, "per_sqrt_m.turn_sigma_deg": 1 },
};

const SENSORS = { odometry: ["odometry"], velocity: ["dvl", "heading"], heading: ["heading"], depth: ["depth"], fixes: ["gps"] };

/** Vehicles that a mapping speaks of, in order: {name, kind} with what sensors each needs noise for. */
export function vehiclesOf(uses) {
  const found = new Map();
  const meet = (name, kind, sensors = []) => {
    if (!name) return;
    const known = found.get(name) ?? { name, kind, sensors: new Set() };
    if (kind === "moves") known.kind = kind;
    for (const sensor of sensors) known.sensors.add(sensor);
    found.set(name, known);
  };
  for (const { kind, values } of uses) if (values.vehicle) meet(values.vehicle, "moves", SENSORS[kind]);
  for (const { kind, values } of uses) {
    if (kind !== "ranges") continue;
    for (const name of [values.receiver, values.sender, ...Object.values(values.names ?? {})]) meet(name, "fixed", ["modem"]);
  }
  for (const { kind, values } of uses) if (kind === "nodes") for (const name of Object.values(values.names ?? {})) meet(name, "fixed");
  return [...found.values()].map((v) => ({ ...v, sensors: [...v.sensors] }));
}

/** The scenario of mapped CSV files; about(vehicle) says {kind, position_sigma_m, position_m, heading_deg, noise}. */
export function csvMission(log, title, uses, about) {
  const mission = { kind: "recorded", format: "csv", log };
  for (const { kind, file, values } of uses) {
    const said = Object.fromEntries(Object.entries(values).filter(([, v]) => v !== undefined && v !== "" && v !== null));
    (mission[kind] ??= []).push({ file, ...said });
  }
  return scenario(title, mission, vehiclesOf(uses), about);
}

/** The scenario of a PyFG file: `names` {robots, nodes, moving_beacon}, reference. */
export function pyfgMission(log, title, file, { robots, nodes, moving_beacon, reference }, about) {
  const mission = { kind: "recorded", format: "pyfg", log, file, robots, nodes, reference, ...(moving_beacon ? { moving_beacon } : {}) };
  return scenario(title, mission, pyfgVehicles({ robots, nodes, moving_beacon }), about);
}

export function pyfgVehicles({ robots, nodes, moving_beacon }) {
  return [
    ...Object.values(robots).map((name) => ({ name, kind: "moves", sensors: ["modem"] })),
    ...(moving_beacon ? [{ name: moving_beacon, kind: "moves", sensors: ["modem"] }] : []),
    ...Object.values(nodes).map((name) => ({ name, kind: "fixed", sensors: ["modem"] })),
  ];
}

function scenario(title, mission, vehicles, about) {
  return {
    schema: 1,
    title: title || "Recorded mission",
    source: "A log of one's own",
    family: "navigation",
    algorithms: ["dead_reckoning", "cekf", "nekf"],
    network: { gate_sigma: 4 },
    mission,
    vehicles: vehicles.map((vehicle) => described(vehicle, about(vehicle))),
  };
}

function described({ name, sensors }, { kind, position_sigma_m, position_m, heading_deg, noise }) {
  const initial = { position_sigma_m };
  if (position_m) initial.position_m = position_m;
  if (heading_deg !== null && heading_deg !== undefined) initial.heading_deg = heading_deg;
  const stated = {};
  for (const sensor of sensors) {
    for (const path of Object.keys(USUAL_NOISE[sensor])) put(stated, `${sensor}.${path}`, noise[`${sensor}.${path}`] ?? USUAL_NOISE[sensor][path]);
  }
  return { name, kind, initial, sensors: stated };
}

function put(table, path, value) {
  const keys = path.split(".");
  const last = keys.pop();
  keys.reduce((place, key) => (place[key] ??= {}), table)[last] = value;
}
