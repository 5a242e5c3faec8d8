// The parts whose colours are picked: the three that the method needs, then regions of one colour.

export const NEEDED = [
  { part: "head", text: "head", hint: "the middle of the head", count: 1 },
  { part: "foot", text: "feet", hint: "both shoes, one click each", count: 2 },
];
const USUAL = ["shirt", "shorts", "skin", "hair"];

const counted = (picks, part) => picks.filter((pick) => pick.part === part).length;

// All parts in the order of the list: needed, usual, and what else was picked or named.
export function partsOf(picks, named = []) {
  const regions = [...new Set([...USUAL, ...named, ...picks.map(({ part }) => part)])].filter(
    (part) => !NEEDED.some((needed) => needed.part === part),
  );
  return [
    ...NEEDED.map((needed) => ({ ...needed, picked: counted(picks, needed.part) })),
    ...regions.map((part) => ({
      part,
      text: part,
      hint: `the ${part}, away from its rim`,
      count: 1,
      picked: counted(picks, part),
    })),
  ];
}

// What still has to be clicked before the program can start: head, both feet and one region.
export function stillNeeded(parts) {
  const open = parts.filter(
    ({ part, picked, count }) => NEEDED.some((needed) => needed.part === part) && picked < count,
  );
  const regions = parts.slice(NEEDED.length);
  return regions.some(({ picked }) => picked) ? open : [...open, regions[0]];
}

// Share of the frames to mark that is usual for a video: some 25 keyframes, which is 1.5 % of half a
// minute, and less where little repeats because there is little.
export const usualBudget = (count) => Math.max(0.015, Math.min(0.05, 25 / count));

// Frames spread over the video, to see how well the picks do elsewhere.
export function spread(count, n) {
  const even = Array.from({ length: n }, (_, k) => Math.floor(((k + 0.5) * count) / n));
  return [...new Set(even)]; // a short video has fewer frames than places
}
