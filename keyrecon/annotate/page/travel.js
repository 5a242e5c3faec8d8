// Getting around: from keyframe to keyframe, from joint to joint, a second around a keyframe, and back
// and forth in time by undo and redo.
import { setOwn } from "./edits.js";
import { nextOpen } from "./guide.js";

export function createTravel(model, hand) {
  const { doing } = model;

  function open(frame, also = {}) {
    hand.keepHeld();
    model.do({ view: "keyframes", frame, look: 0, under: null, joint: null, ...also });
    if (!doing.joint) hand.goOn(null);
    model.opened(frame);
  }

  function stepKeyframe(by) {
    const frames = model.keyframes().map(({ frame }) => frame),
      at = frames.indexOf(doing.frame);
    const next = frames[Math.max(0, Math.min(frames.length - 1, at + by))];
    if (next !== undefined && next !== doing.frame) open(next);
  }

  function stepJoint(by) {
    const all = hand.joints(),
      at = all.indexOf(doing.joint);
    hand.select(all[(at + by + all.length) % all.length] ?? all[0]);
  }

  function nextKeyframe() {
    const frame = nextOpen(model.keyframes(), doing.frame, model.done);
    if (frame === null) model.do({ view: "motion" });
    else open(frame);
  }

  function look(offset) {
    hand.keepHeld();
    const reach = Math.round(model.project.fps),
      last = model.project.n_frames - 1 - doing.frame;
    model.do({ look: Math.max(-reach, -doing.frame, Math.min(reach, last, offset)) });
  }

  function addKeyframe(frame, half) {
    if (model.state.own[frame] !== half) model.edit(setOwn(model.state, frame, half));
    open(frame);
  }

  // What an undo changed is shown.
  async function step(turn) {
    hand.keepHeld();
    const edit = await turn();
    const part = edit?.kind === "group" ? edit.edits[0] : edit;
    const elsewhere = part?.frame !== undefined && part.frame !== doing.frame;
    if (elsewhere && model.keyframes().some(({ frame }) => frame === part.frame)) open(part.frame);
    if (part?.kind === "mark" && part.frame === doing.frame) model.do({ joint: part.joint });
  }

  return {
    open,
    stepKeyframe,
    stepJoint,
    nextKeyframe,
    look,
    addKeyframe,
    undo: () => step(model.undo),
    redo: () => step(model.redo),
  };
}
