// Where a mission comes from: the paper or data set that its source names first.

/** "Walls and Eustice 2011" of "Walls and Eustice 2011, Fig. 1(a); …"; up to the year where there is one. */
export function paperOf(source) {
  const text = source?.trim() ?? "";
  const dated = text.match(/^[^;:(]*?\b(?:19|20)\d\d\b/);
  return (dated?.[0] ?? text.split(/[,;:(]/)[0]).trim() || "Of your own";
}

/** Missions by paper, in the order they come. */
export function byPaper(missions) {
  return Map.groupBy(missions, (m) => paperOf(m.source));
}
