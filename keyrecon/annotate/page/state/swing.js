// A golf swing: what is clicked at the address, what was found, and what is to be done next.
import { placeClick, setGolf, together } from "./edits.js";

// The joints a fit begins with, in the order in which they are asked for.
export const CLICKS = ["head_top", "root", "right_knee", "left_knee", "right_ankle", "left_ankle"];
export const ENDS = ["hands", "head"]; // of the club
export const KEYS = ["start", "top", "hit", "finish"];

export const WRONG_HEIGHT = "The height that is typed at the address cannot be: metres or centimetres, 1.80 or 180.";

const PLACES = {
  head_top: "the top of the player's head",
  root: "the middle between the hips",
};
// "the player's right knee"
export const clickWords = (joint) => PLACES[joint] ?? `the player's ${joint.replaceAll("_", " ")}`;

export const nextClick = ({ clicks }) => CLICKS.find((joint) => !clicks[joint]) ?? null;

// The edits that begin the clicks anew in a frame.
const afresh = (state, frame) => [
  setGolf(state, "frame", frame),
  ...Object.keys(state.clicks).map((joint) => placeClick(state, joint, null)),
];
export const beginIn = (state, frame) => together(afresh(state, frame));

// The edit that clicks a joint in a frame. All clicks are of one frame: another one begins anew.
export function clickIn(state, frame, joint, place) {
  const edit = placeClick(state, joint, place);
  if (state.golf.frame === frame) return edit;
  const others = afresh(state, frame).filter((one) => one.joint !== joint);
  return together([...others, edit]);
}

// {do: "click" | "elsewhere" | "wrong" | "fit", joint, frame}: the next step at the address. `shown` is the
// frame in sight, `wrong` says why no golfer can stand as clicked.
export function nextAddress(state, shown, wrong) {
  const joint = nextClick(state),
    begun = Object.keys(state.clicks).length > 0;
  if (joint && begun && state.golf.frame !== shown) return { do: "elsewhere", frame: state.golf.frame };
  if (joint) return { do: "click", joint };
  return wrong ? { do: "wrong" } : { do: "fit" };
}

// {do: "wait" | "address" | "wrong" | "fit" | "again" | "doubt" | "files"}: the next step with a swing.
export function nextSwing({ state, found, fresh, running }) {
  if (running) return { do: "wait" };
  if (nextClick(state)) return { do: "address" };
  if (found?.wrong) return { do: "wrong" };
  if (!found?.keys) return { do: "fit" };
  if (!fresh) return { do: "again" };
  return { do: found.doubts.length ? "doubt" : "files" };
}

// The club in a frame: {ends: [x, y, x, y], kind: "marked" | "seen" | "guess"}; null where none is known.
export function clubAt({ shafts }, found, frame) {
  if (shafts[frame]) return { ends: shafts[frame], kind: "marked" };
  const ends = found?.club?.[frame];
  if (!ends || ends.includes(null)) return null;
  return { ends, kind: found.seen[frame] ? "seen" : "guess" };
}

// What a person marked, by frame: [{frame, marks: ["left wrist", "club", "top"]}].
export function markedFrames({ marks, shafts, keys }) {
  const rows = new Map(),
    add = (frame, what) => rows.set(Number(frame), [...(rows.get(Number(frame)) ?? []), what]);
  for (const [frame, joints] of Object.entries(marks))
    for (const [joint, [, , v]] of Object.entries(joints)) if (v) add(frame, joint.replaceAll("_", " "));
  for (const frame of Object.keys(shafts)) add(frame, "club");
  for (const name of KEYS) if (keys[name] !== undefined) add(Math.round(keys[name]), name);
  return [...rows.entries()].sort(([a], [b]) => a - b).map(([frame, names]) => ({ frame, marks: names }));
}

// The key postures as they are known: {start: {frame, marked}, ...}; a mark takes the place of what was found.
export const keysOf = ({ keys }, found) =>
  Object.fromEntries(
    KEYS.map((name) => [name, { frame: keys[name] ?? found?.keys?.[name] ?? null, marked: name in keys }]).filter(
      ([, { frame }]) => frame !== null,
    ),
  );

// Left edges of labels, each `breadth` wide, as near to their places as they can be side by side on a strip.
export function spreadLabels(places, breadth, width) {
  const lefts = places.map((place) => place - breadth / 2);
  for (let n = 0; n < lefts.length; n++)
    lefts[n] = Math.max(n ? lefts[n - 1] + breadth : 0, lefts[n]);
  for (let n = lefts.length - 1; n >= 0; n--)
    lefts[n] = Math.min(n < lefts.length - 1 ? lefts[n + 1] - breadth : width - breadth, lefts[n]);
  return lefts;
}
