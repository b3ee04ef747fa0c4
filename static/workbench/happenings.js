// What happened when: packets and fixes of the trial that is drawn, as marks and moments to step to.

/** Fixes over more than this share of the mission are no event: the vehicle has them always. */
const ALWAYS = 0.8;

/**
 * Events of a view that concern none of the hidden vehicles, sorted into lanes: {heard: [packet], lost: [packet], fixes: [{subject, from_s, to_s}]},
 * and `moments`, the times worth stepping to in order, each {time_s, words}.
 */
export function happenings(view, hidden) {
  const events = view.events.filter((e) => ![e.from, e.to, e.subject].some((name) => hidden.has(name)));
  const packets = events.filter((e) => e.kind === "packet");
  const heard = packets.filter((p) => p.heard);
  const lost = packets.filter((p) => !p.heard);
  const length_s = (view.time_s.at(-1) ?? 0) - (view.time_s[0] ?? 0);
  const fixes = events
    .filter((e) => e.kind === "fix")
    .map((e) => ({ subject: e.subject, from_s: e.time_s, to_s: e.until_s ?? e.time_s }))
    .filter((f) => f.to_s - f.from_s < ALWAYS * length_s);
  const moments = [
    ...heard.map((p) => ({ time_s: p.toa_s, words: `${p.from} → ${p.to} heard` })),
    ...lost.map((p) => ({ time_s: p.tol_s, words: `${p.from} → ${p.to} lost` })),
    ...fixes.map((f) => ({ time_s: f.from_s, words: `${f.subject} gets fixes` })),
  ];
  return { heard, lost, fixes, moments: together(moments.sort((a, b) => a.time_s - b.time_s)) };
}

/** Moments at the same time as one. */
function together(moments) {
  const found = [];
  for (const moment of moments) {
    const last = found.at(-1);
    if (last && moment.time_s - last.time_s < 0.05) last.words += `, ${moment.words}`;
    else found.push({ ...moment });
  }
  return found;
}
