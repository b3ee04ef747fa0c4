// More and fewer vehicles in a simulated mission, and the schedule they broadcast by.

/** Metres between a vehicle and the one that joins beside it. */
const BESIDE_M = 30;

/** Keys that a change of the team touches. */
export function fleetKeys(scenario) {
  const keys = ["vehicles"];
  if (scenario.network?.tdma) keys.push("network.tdma.slots", "network.tdma.cycle_s");
  if (Array.isArray(scenario.network?.links)) keys.push("network.links");
  if (scenario.network?.loss?.links) keys.push("network.loss.links");
  return keys;
}

/** The scenario without its last vehicle, nor its slots and links; unchanged where nobody else would broadcast. */
export function dropOne(scenario) {
  const gone = scenario.vehicles.at(-1).name;
  const left = structuredClone(scenario);
  left.vehicles.pop();
  const { network } = left;
  const slots = network?.tdma?.slots.filter((slot) => slot.vehicle !== gone);
  if (slots?.length) network.tdma.slots = slots;
  else if (slots) network.tdma.slots = [{ vehicle: left.vehicles[0].name, at_s: 0 }];
  if (Array.isArray(network?.links)) network.links = network.links.filter((pair) => !pair.includes(gone));
  if (network?.loss?.links) network.loss.links = network.loss.links.filter((link) => link.sender !== gone && link.receiver !== gone);
  return left;
}

/** The scenario with another vehicle like the last AUV, beside it, with as many slots at the end of the cycle. */
export function addOne(scenario) {
  const more = structuredClone(scenario);
  const model = more.vehicles.findLast((v) => v.kind === "auv") ?? more.vehicles.at(-1);
  const name = freeName(model.name, more.vehicles);
  more.vehicles.push({ ...structuredClone(model), name, path: shifted(model.path) });
  const { network } = more;
  if (network?.tdma) {
    const { slots, cycle_s, packet_s = 1 } = network.tdma;
    const gap = Math.max(packet_s, cycle_s / slots.length);
    const own = slots.filter((slot) => slot.vehicle === model.name).length;
    for (let n = 0; n < own; n += 1) slots.push({ vehicle: name, at_s: tidy(cycle_s + n * gap) });
    network.tdma.cycle_s = tidy(cycle_s + own * gap);
  }
  if (Array.isArray(network?.links)) {
    const like = network.links.filter((pair) => pair.includes(model.name));
    network.links.push(...like.map((pair) => pair.map((end) => (end === model.name ? name : end))));
  }
  return more;
}

/** Changes that stretch the schedule to a cycle of another length. */
export function spread(scenario, cycle_s) {
  const { tdma } = scenario.network;
  const factor = cycle_s / tdma.cycle_s;
  const slots = tdma.slots.map((slot) => ({ ...slot, at_s: tidy(slot.at_s * factor) }));
  return { "network.tdma.cycle_s": cycle_s, "network.tdma.slots": slots };
}

function freeName(name, vehicles) {
  const stem = name.replace(/[-_]?\d+$/, "");
  const taken = new Set(vehicles.map((v) => v.name.toLowerCase()));
  for (let n = 2; ; n += 1) if (!taken.has(`${stem}${n}`.toLowerCase())) return `${stem}${n}`;
}

/** The same path BESIDE_M further north. */
function shifted(path) {
  if (!path) return path;
  const up = ([x, y]) => [x, y + BESIDE_M];
  const moved = structuredClone(path);
  for (const key of ["start_m", "center_m", "position_m"]) if (moved[key]) moved[key] = up(moved[key]);
  if (moved.points_m) moved.points_m = moved.points_m.map(up);
  return moved;
}

function tidy(value) {
  return Number(value.toPrecision(6));
}
