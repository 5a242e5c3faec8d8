// What is asked of the person on a keyframe, in which order, and what the one next thing is.

export function asked(project, half) {
  const wanted = half === "both" || !half ? null : new Set(project.halves[half]);
  return project.order.filter((joint) => !wanted || wanted.has(joint));
}

export const unmarked = (joints, marks) => joints.filter((joint) => !marks[joint]);

// The next unmarked joint after one, going round; null when all are marked.
export function following(joints, marks, after) {
  const start = joints.indexOf(after) + 1;
  return [...joints.slice(start), ...joints.slice(0, start)].find((joint) => !marks[joint]) ?? null;
}

// Where the suggestion may be taken: unmarked joints that it knows.
export function suggested(joints, marks, ghost) {
  return Object.fromEntries(
    unmarked(joints, marks)
      .filter((joint) => ghost?.joints?.[joint])
      .map((joint) => [joint, ghost.joints[joint]]),
  );
}

// Limbs whose depth can be told: both ends are placed.
export function limbsShown(limbs, marks) {
  const placed = (joint) => marks[joint]?.[2] > 0;
  return limbs.filter(({ name, parent }) => placed(name) && placed(parent));
}

// {do: "accept" | "place" | "depth" | "next", ...}: the one next thing on this keyframe.
export function nextThing({ project, half, marks, nearer, ghost, pose, joint }) {
  const joints = asked(project, half),
    offered = Object.keys(suggested(joints, marks, ghost));
  const missing = unmarked(joints, marks);
  if (offered.length) return { do: "accept", joints: offered, joint: joint ?? missing[0] };
  if (missing.length)
    return {
      do: "place",
      joint: missing.includes(joint) ? joint : missing[0],
      left: missing.length,
    };
  const open = limbsShown(project.limbs, marks).filter(
    ({ name }) => pose?.limbs?.[name] && !nearer[name],
  );
  if (open.length) return { do: "depth", limbs: open.map(({ name }) => name) };
  return { do: "next" };
}

export function isDone(project, keyframe, marks) {
  return unmarked(asked(project, keyframe.half), marks).length === 0;
}

// The next keyframe that is not done after a frame, going round; null when all are.
export function nextOpen(keyframes, frame, done) {
  const after = keyframes.filter((keyframe) => keyframe.frame > frame);
  const before = keyframes.filter((keyframe) => keyframe.frame < frame);
  return [...after, ...before].find((keyframe) => !done(keyframe))?.frame ?? null;
}

// Keyframes that were chosen and those that a person added, by frame.
export function allKeyframes(project, state) {
  const byFrame = new Map(project.keyframes.map((keyframe) => [keyframe.frame, keyframe]));
  for (const [frame, half] of Object.entries(state.own)) {
    const chosen = byFrame.get(Number(frame));
    byFrame.set(Number(frame), {
      why: "added by you",
      ...chosen,
      frame: Number(frame),
      half: joinHalves(chosen?.half, half),
      own: true,
    });
  }
  return [...byFrame.values()]
    .filter(({ frame, own }) => !own || state.own[frame])
    .map((keyframe) => ({ ...keyframe, locked: Boolean(state.locked[keyframe.frame]) }))
    .sort((a, b) => a.frame - b.frame);
}

const joinHalves = (a, b) => (!a || a === b ? b : "both");

// "right_ankle" -> "right ankle"
export const spoken = (joint) => joint.replaceAll("_", " ");

// "left", "right" or "middle" for every joint.
export function sidesOf(project) {
  const sides = Object.fromEntries(project.joints.map((joint) => [joint, "middle"]));
  for (const [left, right] of project.mirror) [sides[left], sides[right]] = ["left", "right"];
  return sides;
}

// Where the server can say nothing of the body: why, and what helps; else null.
export function whyNoHelp({ has }) {
  if (!has.keyframes || has.help) return null;
  return "The stored results are missing or of another version. Make the motion, and this works again.";
}
