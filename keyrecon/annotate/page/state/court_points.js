// Points of the court: what they are called, and which one to ask for next.

// Those that are seen most often, most telling first.
export const ASKED = [
  "near-left",
  "near-right",
  "net-middle",
  "near-service",
  "near-left-service",
  "near-right-service",
  "far-left",
  "far-right",
  "net-left",
  "net-right",
];

// The first that is not clicked yet; null when all are.
export function nextPoint(clicks) {
  const done = new Set(clicks.map(({ name }) => name));
  return ASKED.find((name) => !done.has(name)) ?? null;
}

const LINES = {
  "": "corner of the baseline and the doubles sideline",
  singles: "corner of the baseline and the singles sideline",
  service: "corner of the service line and the singles sideline",
};
const NET = { middle: "the middle of the net, on top", foot: "foot of the post" };

// "near-left-service" as a person says it.
export function namedInWords(name) {
  const [end, side, line = ""] = name.split("-");
  if (end === "net") {
    if (side === "middle") return NET.middle;
    return line ? `the ${NET.foot} on the ${side}` : `the top of the ${side} post of the net`;
  }
  if (side === "service") return `the ${end} end of the centre line`;
  if (side === "mark") return `the ${end} centre mark, outside`;
  return `the ${end} ${side} ${LINES[line]}`;
}
