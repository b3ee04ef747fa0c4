// The knobs a person reaches for first: one for what many keys say together.

import { valueAt } from "./edits.js";
import { addOne, dropOne, fleetKeys, spread } from "./fleet.js";

/** Values of one kind all over the team are turned together, in proportion to each other. */
function together(id, label, unit, hint, which) {
  return (scenario, fields) => {
    const members = fields.filter((field) => which.test(field.path) && field.value !== null);
    if (!members.length) return null;
    const first = members[0].value;
    const differ = members.some((m) => m.value !== first);
    return {
      id,
      label,
      unit,
      hint: differ ? `${hint}; that of ${members[0].path}, the others in proportion` : hint,
      kind: "number",
      keys: members.map((m) => m.path),
      min: Math.max(...members.map((m) => m.min)),
      max: Math.min(...members.map((m) => m.max)),
      above: members.some((m) => m.above),
      read: (edited) => valueAt(edited, members[0].path),
      write: (value, edited) => {
        const now = valueAt(edited, members[0].path);
        return Object.fromEntries(members.map(({ path }) => [path, proportional(valueAt(edited, path), now, value)]));
      },
    };
  };
}

function proportional(own, first, value) {
  return own === first || first === 0 ? value : Number(((own * value) / first).toPrecision(6));
}

/** Packet loss as one number, also where the scenario has a model with one rate. */
function loss(scenario, fields) {
  const field = ["network.loss", "network.loss.rate"].map((path) => fields.find((f) => f.path === path)).find((f) => f?.value !== undefined && f?.kind);
  if (!field || typeof field.value !== "number") return null;
  return {
    id: "loss",
    label: "Packet loss",
    unit: "",
    hint: "Fraction of packets lost",
    kind: "number",
    keys: [field.path],
    min: 0,
    max: 1,
    read: (edited) => valueAt(edited, field.path),
    write: (value) => ({ [field.path]: value }),
  };
}

/** The whole schedule stretched or squeezed. */
function period(scenario) {
  const tdma = scenario.network?.tdma;
  if (!tdma) return null;
  const packet = tdma.packet_s ?? 1;
  return {
    id: "period",
    label: "Ping period",
    unit: "s",
    hint: "Length of the broadcast cycle; its slots move along",
    kind: "number",
    keys: ["network.tdma.cycle_s", "network.tdma.slots"],
    min: Math.max(packet * tdma.slots.length, 0.1),
    max: 1e6,
    read: (edited) => edited.network.tdma.cycle_s,
    write: (value, edited) => spread(edited, value),
  };
}

/** One vehicle more or less, with its slots and links. */
function fleet(scenario) {
  if (scenario.family !== "navigation" || scenario.mission?.kind === "recorded") return null;
  return {
    id: "vehicles",
    label: "Vehicles",
    unit: "",
    hint: "The last one leaves, or another like the last AUV joins, 30 m beside it, with slots of its own",
    kind: "integer",
    keys: fleetKeys(scenario),
    min: 1,
    max: 12,
    read: (edited) => edited.vehicles.length,
    write: (value, edited) => {
      let now = edited;
      while (now.vehicles.length > Math.max(1, value)) now = dropOne(now);
      while (now.vehicles.length < Math.min(12, value)) now = addOne(now);
      return Object.fromEntries(fleetKeys(now).map((path) => [path, valueAt(now, path)]));
    },
  };
}

const KNOBS = [
  loss,
  period,
  together("range", "Range noise", "m", "Noise of a measured range", /(^|\.)(modem\.)?range_sigma_m$/),
  together("dvl", "DVL noise", "m/s", "Noise of the Doppler log, forward and across", /\.dvl\.(along|cross)_sigma_mps$/),
  together("speed", "Speed", "m/s", "Speed over ground", /(^target|\.path)\.speed_mps$/),
  fleet,
  together("sensor", "Sensor noise", "m²", "Noise variance of the nodes", /^sensors\..*(variance_m2|along_m2|across_m2)$/),
  together("process", "Process noise", "m²", "Variance of the target's steps", /^target\.process_variance_m2$/),
  together("odometry", "Odometry noise", "m", "Noise of increments per root metre or second", /\.odometry\.per_\w+\.forward_sigma_m$/),
  together("turn", "Turn rate noise", "rad²/s", "How freely the target turns", /^target\.turn_psd$/),
  together("pings", "Ping loss", "", "Fraction of the target's pings lost", /^network\.ping_loss$/),
  together("snr", "Signal to noise", "dB", "After the matched filter", /^water\.snr_db$/),
  together("drift", "Dead reckoning drift", "m/s", "Of each interval's velocity", /^odometry\.drift_mps$/),
  together("duration", "Duration", "s", "Length of the mission", /^duration_s$/),
];

/** The knobs {id, label, unit, hint, kind, keys, min, max, read(edited), write(value, edited) -> changes} of a scenario. */
export function knobsOf(scenario, fields) {
  return KNOBS.map((make) => make(scenario, fields)).filter(Boolean);
}

/** A single field as a knob. */
export function knobOf(field) {
  return {
    ...field,
    id: field.path,
    label: field.path,
    hint: field.meaning,
    keys: [field.path],
    read: (edited) => valueAt(edited, field.path) ?? null,
    write: (value) => ({ [field.path]: value }),
  };
}

/**
 * The scale of a slider {min, max, place(value) -> 0 to 1, value(place)}, about the value that is saved: straight between
 * near bounds and for whole numbers, else by factors.
 */
export function scaleOf({ min, max, kind, above }, saved) {
  const tidy = (value) => (kind === "integer" ? Math.round(value) : Number(value.toPrecision(3)));
  const clip = (value) => Math.min(Math.max(value, above ? Math.max(min, Number.MIN_VALUE) : min), max);
  const from = saved ?? 0;
  if (kind !== "integer" && from > 0 && !(min === 0 && max <= 1)) {
    const [low, high] = [Math.log(Math.max(min, from / 10) || from / 10), Math.log(Math.min(max, from * 10))];
    return { place: (v) => clamp((Math.log(Math.max(v, Number.MIN_VALUE)) - low) / (high - low)), value: (p) => clip(tidy(Math.exp(low + p * (high - low)))) };
  }
  const low = Number.isFinite(min) && min > -1e3 ? min : from - Math.max(Math.abs(from), 10);
  const high = max <= 1000 ? max : Math.max(2 * Math.abs(from), 10) + (from < 0 ? from : 0);
  return { place: (v) => clamp((v - low) / (high - low)), value: (p) => clip(tidy(low + p * (high - low))) };
}

function clamp(share) {
  return Number.isFinite(share) ? Math.min(Math.max(share, 0), 1) : 0;
}
