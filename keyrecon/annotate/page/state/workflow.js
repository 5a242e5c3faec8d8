// What is to be done, in which order: joints and depths of a keyframe, keyframes, colours to pick.

export function requiredJoints(project, half) {
  const wanted = half === "both" || !half ? null : new Set(project.halves[half]);
  return project.order.filter((joint) => !wanted || wanted.has(joint));
}

export const unmarked = (joints, marks) => joints.filter((joint) => !marks[joint]);

// The next unmarked joint after one, going round; null when all are marked.
export function nextUnmarked(joints, marks, after) {
  const start = joints.indexOf(after) + 1;
  return [...joints.slice(start), ...joints.slice(0, start)].find((joint) => !marks[joint]) ?? null;
}

// Where the suggestion may be taken: unmarked joints that it knows.
export function suggestedJoints(joints, marks, suggestion) {
  return Object.fromEntries(
    unmarked(joints, marks)
      .filter((joint) => suggestion?.joints?.[joint])
      .map((joint) => [joint, suggestion.joints[joint]]),
  );
}

// Limbs whose depth sign can be given: both ends are placed.
export function placedLimbs(limbs, marks) {
  const placed = (joint) => marks[joint]?.[2] > 0;
  return limbs.filter(({ name, parent }) => placed(name) && placed(parent));
}

// {do: "accept" | "place" | "facing" | "turn" | "depth" | "next", ...}: the one next step on this
// keyframe. `facing` and `turn` tell what the person is asked of them, if anything.
export function nextStep({ project, half, marks, nearer, suggestion, pose, joint, facing, turn }) {
  const joints = requiredJoints(project, half),
    suggested = Object.keys(suggestedJoints(joints, marks, suggestion));
  const missing = unmarked(joints, marks);
  if (suggested.length) return { do: "accept", joints: suggested, joint: joint ?? missing[0] };
  if (missing.length)
    return {
      do: "place",
      joint: missing.includes(joint) ? joint : missing[0],
      left: missing.length,
    };
  if (facing) return { do: "facing", facing };
  const open = placedLimbs(project.limbs, marks).filter(
    ({ name }) => pose?.limbs?.[name] && !nearer[name],
  );
  if (open.length && turn) return { do: "turn" };
  if (open.length) return { do: "depth", limbs: open.map(({ name }) => name) };
  return { do: "next" };
}

export function isDone(project, keyframe, marks) {
  return unmarked(requiredJoints(project, keyframe.half), marks).length === 0;
}

export const LEAST_MARKED = 0.5; // of a half's joints, as the program has it that makes the motion

// Whether a keyframe counts as marked: most joints of each half that it is asked for are placed, as the
// motion needs it, or all that can be said of them is.
export function isMarked({ halves }, { half }, marks) {
  const asked = half && half !== "both" ? [half] : ["upper", "lower"];
  return asked.every((name) => {
    const placed = halves[name].filter((joint) => marks[joint]?.[2] > 0);
    return placed.length >= LEAST_MARKED * halves[name].length || !unmarked(halves[name], marks).length;
  });
}

// The next keyframe that is not done: the one that brings most; among equals, and where that is not
// known, the first after a frame, going round. Null when all are done.
export function nextOpen(keyframes, frame, done) {
  const after = keyframes.filter((keyframe) => keyframe.frame > frame);
  const before = keyframes.filter((keyframe) => keyframe.frame < frame);
  const open = [...after, ...before].filter((keyframe) => !done(keyframe)),
    most = Math.max(...open.map(({ brings }) => brings ?? 0));
  return open.find(({ brings }) => (brings ?? 0) === most)?.frame ?? null;
}

// What is to be done before there are keyframes: a whole body in a clear frame, more of them where the
// program is least sure, then the choice. {do: "frame" | "mark" | "follow" | "choose", frame, left}
export function nextBeginning(project, keyframes, done) {
  if (project.has.keyframes) return { do: "choose" };
  const bodies = keyframes.filter(({ half }) => half === "both"),
    open = bodies.filter((body) => !done(body));
  if (open.length) return { do: "mark", frame: open[0].frame, left: open.length };
  if (!bodies.length) return { do: "frame" };
  return { do: project.bodies ? "choose" : "follow" };
}

// Keyframes that were chosen and those that a person added, by frame; one that was added and taken back
// stays where it was chosen, too.
export function allKeyframes(project, state) {
  const known = new Map(project.keyframes.map((keyframe) => [keyframe.frame, keyframe]));
  const frames = new Set([...known.keys(), ...Object.keys(state.own).map(Number)]);
  return [...frames]
    .sort((a, b) => a - b)
    .map((frame) => {
      const keyframe = known.get(frame),
        listed = keyframe?.own ? keyframe.listed : keyframe?.half,
        added = state.own[frame];
      return {
        why: "added by you",
        ...keyframe,
        frame,
        half: added ? joinHalves(listed, added) : listed,
        own: Boolean(added),
        locked: Boolean(state.locked[frame]),
      };
    })
    .filter(({ half }) => half);
}

// "upper", "lower" or "both", of what is asked for in one frame by two.
export const joinHalves = (a, b) => (!a || a === b ? b : "both");

// The pages of a project, in the order of the work; a golf swing has pages of its own.
export const stepsOf = ({ golf, has }) =>
  golf
    ? ["address", "swing", ...(has.keyframes ? ["keyframes", "motion"] : []), "files"]
    : ["bodies", "keyframes", "motion", "files", "court", "ground"];

// "right_ankle" -> "right ankle"
export const label = (joint) => joint.replaceAll("_", " ");

// "left", "right" or "middle" for every joint.
export function sidesOf(project) {
  const sides = Object.fromEntries(project.joints.map((joint) => [joint, "middle"]));
  for (const [left, right] of project.mirror) [sides[left], sides[right]] = ["left", "right"];
  return sides;
}

// Where the server can say nothing of the body: why, and what helps; else null.
export function whyNoAssistant({ has }) {
  if (!has.keyframes || has.assistant) return null;
  if (!has.loaded) return "The stored results are being read.";
  return "The stored results are missing or of another version. Make the motion, and this works again.";
}

const HEIGHTS = [0.5, 2.6]; // of a player, metres

// A height as it was typed: {metres, said, wrong}; metres is null for an empty field. Centimetres are
// taken as such: nobody is 188 m tall.
export function heightIn(text) {
  const [, number, unit] = text.trim().replace(",", ".").match(/^([\d.]+)\s*(cm|m)?$/i) ?? [],
    typed = Number(number);
  if (!text.trim()) return { metres: null, said: "empty: in body heights", wrong: false };
  const centimetres = unit ? unit.toLowerCase() === "cm" : typed > 10,
    metres = Math.round(centimetres ? typed * 10 : typed * 1000) / 1000;
  if (metres >= HEIGHTS[0] && metres <= HEIGHTS[1])
    return { metres, said: centimetres ? `taken as ${metres.toFixed(2)} m` : "metres", wrong: false };
  return { metres: null, said: "metres or centimetres: 1.80, 180", wrong: true };
}

const FIELDS_OF_VIEW = [3, 150]; // of a camera, degrees across the picture

// A field of view as it was typed: {degrees, said, wrong}; degrees is null for an empty field. `lens`
// is what tells it where nothing is typed, {degrees, told_by}.
export function fieldOfViewIn(text, lens = null) {
  const [, number] = text.trim().replace(",", ".").match(/^([\d.]+)\s*(?:°|deg|degrees)?$/i) ?? [],
    degrees = Number(number);
  const known = lens ? `${lens.degrees.toFixed(0)} degrees by ${lens.told_by}` : "not told";
  if (!text.trim()) return { degrees: null, said: `empty: ${known}`, wrong: false };
  if (degrees > FIELDS_OF_VIEW[0] && degrees < FIELDS_OF_VIEW[1])
    return { degrees, said: "degrees across the picture", wrong: false };
  return { degrees: null, said: "degrees across the picture: 62", wrong: true };
}

// Parts whose colours are picked: those that the tracker cannot do without, then regions of one colour.
export const REQUIRED_PARTS = [
  { part: "head", text: "head", hint: "the middle of the head", count: 1 },
  { part: "foot", text: "feet", hint: "both shoes, one click each", count: 2 },
];
const COMMON_PARTS = ["shirt", "shorts", "skin", "hair"];

const counted = (picks, part) => picks.filter((pick) => pick.part === part).length;

// All parts in the order of the list: required, common, and what else was picked or named.
export function partsOf(picks, named = []) {
  const regions = [...new Set([...COMMON_PARTS, ...named, ...picks.map(({ part }) => part)])].filter(
    (part) => !REQUIRED_PARTS.some((required) => required.part === part),
  );
  return [
    ...REQUIRED_PARTS.map((required) => ({ ...required, picked: counted(picks, required.part) })),
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
export function missingParts(parts) {
  const open = parts.filter(
    ({ part, picked, count }) => REQUIRED_PARTS.some((required) => required.part === part) && picked < count,
  );
  const regions = parts.slice(REQUIRED_PARTS.length);
  return regions.some(({ picked }) => picked) ? open : [...open, regions[0]];
}

// What is asked for next: what cannot be done without, then each common part once; null after that.
export const nextPart = (parts) =>
  missingParts(parts)[0] ?? parts.find(({ part, picked }) => !picked && COMMON_PARTS.includes(part)) ?? null;

// The share that a project was set to, or the usual one, in per cent.
export const budgetText = ({ settings, usual_budget: usual }) =>
  String(Math.round(10000 * (settings.budget ?? usual)) / 100);

// The share that is asked for by per cent in a field; null, as much as is needed, where the field says
// what is usual and the project was not set to a share.
export function budgetIn(percent, project) {
  const unchanged = String(percent) === budgetText(project);
  return unchanged ? project.settings.budget : percent / 100;
}

// Frames spread over the video, to see how well the picks do elsewhere.
export function spreadFrames(count, n) {
  const even = Array.from({ length: n }, (_, k) => Math.floor(((k + 0.5) * count) / n));
  return [...new Set(even)]; // a short video has fewer frames than places
}
