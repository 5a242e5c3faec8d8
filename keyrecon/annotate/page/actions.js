// What a person can do on a keyframe; keys, buttons and the pointer all end here.
import { nextVisibility, placeJoint, placeJoints, setLock, setNearer, setOwn, swapSides } from "./edits.js";
import { asked, following, limbsShown, nextOpen, nextThing, spoken, suggested } from "./guide.js";

const PAUSE = 350; // ms after the last nudge until it is taken as meant

export function createActions(model) {
  let resting = null;
  const { doing } = model;
  const joints = () => asked(model.project, model.keyframe()?.half);
  const reply = (edit) => model.edit(edit);

  // Context only: off the keyframe nothing is changed.
  const away = () => doing.look !== 0 || doing.frame === null;

  // What is in hand is put down before anything else is changed.
  function ready() {
    keepHeld();
    return !away();
  }

  function select(joint) {
    keepHeld();
    model.do({ joint });
  }

  // After a joint is settled the next unmarked one is asked for.
  const goOn = (joint) => model.do({ joint: following(joints(), model.marks(), joint) });

  function place(joint, at, v = 2) {
    if (away() || !joint) return;
    const fresh = !model.marks()[joint];
    reply(placeJoint(model.state, doing.frame, joint, [...at, v]));
    if (fresh) goOn(joint);
    else model.do({ joint });
  }

  // A nudged joint is held until the arrows rest, so that one undo takes the whole walk back.
  function nudge(dx, dy) {
    const joint = doing.joint, mark = model.marks()[joint];
    if (away() || !joint) return;
    const start = doing.held?.joint === joint ? doing.held.at
      : mark ?? model.ghost()?.joints?.[joint] ?? model.middle();
    model.do({ held: { joint, at: [start[0] + dx, start[1] + dy], floating: !mark } });
    clearTimeout(resting);
    if (mark) resting = setTimeout(keepHeld, PAUSE);
  }

  function keepHeld() {
    clearTimeout(resting);
    const { held } = doing;
    if (!held) return;
    doing.held = null;
    if (held.floating) return;
    place(held.joint, held.at, model.marks()[held.joint]?.[2] || 2);
  }

  function carry(joint, at) {
    if (doing.held?.joint !== joint) keepHeld();
    clearTimeout(resting);
    model.do({ joint, held: { joint, at } });
  }

  function drop(joint, at) {
    doing.held = null;
    place(joint, at, model.marks()[joint]?.[2] || 2);
  }

  function putDown() {
    const { held } = doing;
    if (!held?.floating) return;
    doing.held = null;
    place(held.joint, held.at);
  }

  // What a key means: the joint under the pointer, else the selected one.
  const meant = () => doing.under?.joint ?? doing.joint;

  function visibility() {
    const joint = meant();
    if (!ready() || !joint) return;
    const mark = model.marks()[joint];
    reply(placeJoint(model.state, doing.frame, joint, nextVisibility(mark)));
    if (!mark) goOn(joint);
  }

  function clear() {
    const joint = meant();
    if (!ready() || !joint || !model.marks()[joint]) return;
    reply(placeJoint(model.state, doing.frame, joint, null));
    model.do({ joint });
  }

  function swap(pairs) {
    if (ready()) reply(swapSides(model.state, doing.frame, pairs));
  }

  function accept() {
    if (!ready()) return;
    const places = suggested(joints(), model.marks(), model.ghost());
    const to = Object.fromEntries(Object.entries(places).map(([joint, [x, y]]) => [joint, [x, y, 2]]));
    if (!Object.keys(to).length) return;
    reply(placeJoints(model.state, doing.frame, to));
    goOn(null);
  }

  // The limb under the pointer, else the one that ends in the selected joint.
  const meantLimb = () => doing.under?.limb ?? meant();

  function setDepth(limb, sign) {
    const known = model.project.limbs.some(({ name }) => name === limb);
    if (ready() && known && (model.nearer()[limb] ?? null) !== sign) {
      reply(setNearer(model.state, doing.frame, { [limb]: sign }));
    }
  }

  function flip(limb = meantLimb()) {
    const shown = model.nearer()[limb] ?? model.pose()?.limbs?.[limb]?.sign;
    if (shown) setDepth(limb, -shown);
  }

  // The depths of a whole reading become the person's word; without one, of what is shown.
  function keepDepths(reading) {
    if (!ready()) return;
    const limbs = model.pose()?.limbs ?? {}, to = {};
    for (const { name } of limbsShown(model.project.limbs, model.marks())) {
      const sign = reading?.nearer[name] ?? limbs[name]?.sign;
      if (sign && model.nearer()[name] !== sign) to[name] = sign;
    }
    if (Object.keys(to).length) reply(setNearer(model.state, doing.frame, to));
  }

  function automaticDepths() {
    const given = Object.keys(model.nearer());
    if (ready() && given.length) {
      reply(setNearer(model.state, doing.frame, Object.fromEntries(given.map((limb) => [limb, null]))));
    }
  }

  function open(frame, also = {}) {
    keepHeld();
    model.do({ view: "keyframes", frame, look: 0, held: null, under: null, joint: null, ...also });
    if (!doing.joint) goOn(null);
    model.opened(frame);
  }

  function stepKeyframe(by) {
    const frames = model.keyframes().map(({ frame }) => frame), at = frames.indexOf(doing.frame);
    const next = frames[Math.max(0, Math.min(frames.length - 1, at + by))];
    if (next !== undefined && next !== doing.frame) open(next);
  }

  function stepJoint(by) {
    const all = joints(), at = all.indexOf(doing.joint);
    select(all[(at + by + all.length) % all.length] ?? all[0]);
  }

  const thing = () => nextThing({
    project: model.project, half: model.keyframe()?.half, marks: model.marks(), nearer: model.nearer(),
    ghost: model.ghost(), pose: model.pose(), joint: doing.joint,
  });

  function primary() {
    if (doing.held?.floating) return putDown();
    if (away()) return look(0);
    keepHeld();
    const { do: what } = thing();
    if (what === "accept") return accept();
    if (what === "depth") return keepDepths();
    if (what === "next") return nextKeyframe();
    return undefined;
  }

  function nextKeyframe() {
    const frame = nextOpen(model.keyframes(), doing.frame, model.done);
    if (frame === null) model.do({ view: "motion" });
    else open(frame);
  }

  function look(offset) {
    keepHeld();
    const reach = Math.round(model.project.fps), last = model.project.n_frames - 1 - doing.frame;
    model.do({ look: Math.max(-reach, -doing.frame, Math.min(reach, last, offset)) });
  }

  function addKeyframe(frame, half) {
    if (model.state.own[frame] !== half) reply(setOwn(model.state, frame, half));
    open(frame);
  }

  function lock() {
    if (model.keyframe()) reply(setLock(model.state, doing.frame, !model.state.locked[doing.frame]));
  }

  async function undo(step) {
    keepHeld();
    const edit = await step();
    const part = edit?.kind === "group" ? edit.edits[0] : edit;
    if (part?.frame !== undefined && part.frame !== doing.frame && part.kind !== "own") open(part.frame);
    if (part?.kind === "mark") model.do({ joint: part.joint });
  }

  return {
    select, place, nudge, carry, drop, keepHeld, putDown, visibility, clear, swap, accept, flip, setDepth, keepDepths, automaticDepths,
    open, stepKeyframe, stepJoint, thing, primary, nextKeyframe, look, addKeyframe, lock, away,
    reading: (n) => model.pose()?.alternatives?.[n] && keepDepths(model.pose().alternatives[n]),
    undo: () => undo(model.undo),
    redo: () => undo(model.redo),
    automaticDepth: () => setDepth(meantLimb(), null),
    asked: joints,
    name: spoken,
  };
}
