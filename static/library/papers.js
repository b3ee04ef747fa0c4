// Where a mission comes from: the paper or data set that its source names first.

/** Names of authors and the year: "Walls, Cunningham and Eustice 2015". */
const CITATION = /^\p{Lu}[\p{L}'’-]+(?:(?:, | and | & )\p{Lu}[\p{L}'’-]+)*(?: et al\.?)? (?:19|20)\d\d\b/u;

/** "Walls and Eustice 2011" of "Walls and Eustice 2011, Fig. 1(a); …", else what comes before the first comma. */
export function paperOf(source) {
  const text = source?.trim() ?? "";
  const dated = text.match(CITATION);
  return (dated?.[0] ?? text.split(/[,;:(]/)[0]).trim() || "Of your own";
}

/** Missions by paper, in the order they come. */
export function byPaper(missions) {
  return Map.groupBy(missions, (m) => paperOf(m.source));
}
