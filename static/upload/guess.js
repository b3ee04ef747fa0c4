// What the columns of a file probably are, by their names and values; a person corrects the rest.

const TIME = /^(t|time|times|stamp|timestamp|unix|utc|secs?|seconds|epoch|toa|posix)([_ (-]|$)/i;
const LIKE = {
  forward_step: /(^|[_ ])(forward|fwd|dx|distance|dist|ds|surge_m)([_ (]|$)/i,
  turn: /(^|[_ ])(turn|dtheta|dyaw|dpsi|dheading|rotation|rot|dth)([_ (]|$)/i,
  forward: /^(u|vx|v_x|surge|vel_?x|forward(_mps)?|v_?forward|speed)([_ (]|$)/i,
  left: /^(left|v_?left|vel_?left)([_ (]|$)/i,
  right: /^(v|vy|v_y|sway|vel_?y|right|v_?right)([_ (]|$)/i,
  east: /^(v_?e|vel_?e|v_?east|east_mps|vx_world)([_ (]|$)/i,
  north: /^(v_?n|vel_?n|v_?north|north_mps|vy_world)([_ (]|$)/i,
  heading: /(heading|hdg|yaw|psi|compass|course|theta)/i,
  depth: /(^|[_ ])(depth|z|pressure)([_ (]|$)/i,
  x: /^(x|east|easting|utm_?e|pos_?x|px)([_ (]|$)/i,
  y: /^(y|north|northing|utm_?n|pos_?y|py)([_ (]|$)/i,
  range: /(^|[_ ])(range|slant|distance|dist|rng)([_ (]|$)/i,
  travel_time: /(owtt|travel|tof|flight)/i,
  sender: /(beacon|sender|source|^from|src|transmitter)/i,
  someone: /(node|^id$|_id$|who)/i,
  receiver: /(receiver|^to$|dst|^rx)/i,
  name: /(name|beacon|node|^id$|_id$|label)/i,
};

const column = (file, pattern, kind = null) => file.columns.find((c) => pattern.test(c.name) && (kind === null || c.kind === kind))?.name;

/** Uses {kind, values} that a described CSV file is probably for; none where that is not to be told. */
export function usesOf(file) {
  const number = (key) => column(file, LIKE[key], "number");
  const stamp = file.columns.find((c) => TIME.test(c.name) && c.kind === "number");
  const time = stamp && { time: stamp.name, time_unit: timeUnit(stamp) };
  const [x, y] = [number("x"), number("y")];
  if (!time) return x && y ? [{ kind: "nodes", values: { name: column(file, LIKE.name) ?? file.columns[0].name, x, y } }] : [];

  const [range, travel] = [number("range"), number("travel_time")];
  const sender = column(file, LIKE.sender) ?? column(file, LIKE.someone);
  const turn = number("turn");
  if (!turn && (range || travel) && (sender || /rang|modem|beacon|acoust/i.test(file.name))) {
    const values = { ...time, range, sender_column: sender, receiver_column: column(file, LIKE.receiver) };
    if (!range) Object.assign(values, { travel_time: travel, travel_time_unit: unitIn(travel) ?? "s" });
    return [{ kind: "ranges", values: { ...values, sort: !stamp.ascending } }];
  }
  const uses = [];
  if (turn && number("forward_step")) {
    uses.push({ kind: "odometry", values: { ...time, forward: number("forward_step"), turn, turn_unit: angleUnit(file, turn, 2) } });
  }
  const [east, north, forward] = [number("east"), number("north"), number("forward")];
  if (east && north) uses.push({ kind: "velocity", values: { ...time, east, north } });
  else if (!uses.length && forward && (number("left") || number("right"))) {
    uses.push({ kind: "velocity", values: { ...time, forward, ...(number("left") ? { left: number("left") } : { right: number("right") }) } });
  }
  const heading = number("heading");
  if (x && y) {
    const angle = heading ? { heading, heading_unit: angleUnit(file, heading, 7), convention: convention(file, heading) } : {};
    const truth = /truth|ground|reference|\bref|lbl|rtk/i.test(file.name);
    uses.push(truth ? { kind: "truth", values: { ...time, x, y, ...angle } } : { kind: "fixes", values: { ...time, x, y } });
  } else if (heading && !turn) {
    uses.push({ kind: "heading", values: { ...time, heading, unit: angleUnit(file, heading, 7), convention: convention(file, heading) } });
  }
  const depth = number("depth");
  if (depth && !(x && y)) uses.push({ kind: "depth", values: { ...time, depth } });
  return uses;
}

const unitIn = (name) => ["ms", "us", "ns"].find((unit) => new RegExp(`(^|[_ (])${unit}([_ )]|$)`, "i").test(name ?? ""));

function timeUnit({ name, max }) {
  return unitIn(name) ?? (max > 1e17 ? "ns" : max > 1e14 ? "us" : max > 1e11 ? "ms" : "s");
}

function angleUnit(file, name, largest) {
  const { min, max } = file.columns.find((c) => c.name === name);
  if (/rad/i.test(name)) return "rad";
  return /deg|°/i.test(name) || Math.max(max, -min) > largest ? "deg" : "rad";
}

/** Degrees from 0 to 360 are a compass's. */
function convention(file, name) {
  const { min, max } = file.columns.find((c) => c.name === name);
  return min >= 0 && max > 190 && max <= 360.5 ? "compass" : "math";
}
