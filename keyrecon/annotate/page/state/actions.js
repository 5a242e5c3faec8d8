// What a person can do on a keyframe; keys, buttons and the pointer all end here.
import { BESIDE, placeSeen } from "../draw/geometry.js";
import {
  describeEdit,
  nextVisibility,
  partsOf,
  placeJoint,
  placeJoints,
  setLock,
  setNearer,
  setOwnKeyframe,
  swapSides,
} from "./edits.js";
import { TRUNK, firstFacing, undecidedTurn } from "./facing.js";
import {
  joinHalves,
  nextOpen,
  nextStep,
  nextUnmarked,
  placedLimbs,
  requiredJoints,
  suggestedJoints,
} from "./workflow.js";

const NUDGE_MS = 350; // after the last step of the arrow keys, until it is taken as meant

// What can be seen to be undone, page by page.
const BODY = ["mark", "marks", "nearer", "own", "lock"];
const SEEN = {
  keyframes: BODY,
  swing: ["mark", "marks", "shaft", "key"],
  address: ["click", "golf"],
  pick: ["pick"],
};
const OF_THE_WORLD = ["court", "ground"]; // pages whose points are in no journal

// `middle()` is the middle of the picture as it is shown, `opened(frame)` is called when a keyframe is;
// `showInSwing(frame)` shows a frame on the page of the swing.
export function createActions(model, { middle, opened, showInSwing }) {
  const { ui } = model,
    placing = createPlacing(model, middle),
    navigation = createNavigation(model, placing, { opened, showInSwing });
  const { offKeyframe, ready, dropDragged, selectNext, joints } = placing;

  // What a key means: the joint under the pointer, else the selected one.
  const joint = () => ui.hovered?.joint ?? ui.joint;
  // The limb under the pointer, else the one that ends in that joint.
  const limb = () => ui.hovered?.limb ?? joint();

  function visibility(name = joint()) {
    if (!ready() || !name) return;
    const mark = model.marks()[name];
    model.edit(placeJoint(model.state, ui.frame, name, nextVisibility(mark)));
    if (!mark) selectNext(name);
  }

  function clear() {
    const name = joint();
    if (!ready() || !model.marks()[name]) return;
    model.edit(placeJoint(model.state, ui.frame, name, null));
    model.update({ joint: name });
  }

  function swap(pairs) {
    if (ready()) model.edit(swapSides(model.state, ui.frame, pairs));
  }

  function accept() {
    if (!ready()) return;
    const places = Object.entries(
      suggestedJoints(joints(), model.marks(), model.poses.suggestion()),
    );
    if (!places.length) return;
    const to = Object.fromEntries(places.map(([name, [x, y]]) => [name, [x, y, 2]]));
    model.edit(placeJoints(model.state, ui.frame, to));
    selectNext(null);
  }

  function setDepth(name, sign) {
    const known = model.project.limbs.some((one) => one.name === name);
    if (ready() && known && (model.nearer()[name] ?? null) !== sign) {
      model.edit(setNearer(model.state, ui.frame, { [name]: sign }));
    }
  }

  function flip(name = limb()) {
    const sign = model.nearer()[name] ?? model.poses.current()?.limbs?.[name]?.sign;
    if (sign) setDepth(name, -sign);
  }

  // The depth signs of the n-th alternative become the person's; without one, those that are drawn. A
  // pose that is still being computed is waited for, so that no limb is left out.
  async function confirmDepths(n = null) {
    if (!ready()) return;
    const { frame } = ui,
      pose = await model.poses.latest();
    const alternative = n === null ? null : pose?.alternatives?.[n]?.nearer;
    if (ui.frame !== frame || (n !== null && !alternative)) return;
    const to = {};
    for (const { name } of placedLimbs(model.project.limbs, model.marks())) {
      const sign = alternative?.[name] ?? pose?.limbs?.[name]?.sign;
      if (sign && model.nearer()[name] !== sign) to[name] = sign;
    }
    if (Object.keys(to).length) model.edit(setNearer(model.state, frame, to));
  }

  function automaticDepths() {
    const given = Object.keys(model.nearer());
    if (!ready() || !given.length) return;
    model.edit(
      setNearer(model.state, ui.frame, Object.fromEntries(given.map((name) => [name, null]))),
    );
  }

  function lock() {
    if (model.keyframe()) model.edit(setLock(model.state, ui.frame, !model.state.locked[ui.frame]));
  }

  const next = () =>
    nextStep({
      facing: facing(),
      turn: turn(),
      project: model.project,
      half: model.keyframe()?.half,
      marks: model.marks(),
      nearer: model.nearer(),
      suggestion: model.poses.suggestion(),
      pose: model.poses.current(),
      joint: ui.joint,
    });

  // Asked of the first body that tells it, until its marks are as the answer has them: whether left and
  // right are the player's own. The answer is of that frame, and forgotten when nothing is marked there.
  const answered = `facing ${model.project.id}`;
  function facing() {
    const first = firstFacing(model.state.marks);
    const [frame] = (localStorage.getItem(answered) ?? "").split(" ");
    if (!first && !Object.keys(model.state.marks[frame] ?? {}).length) localStorage.removeItem(answered);
    if (!first || first.others || first.frame !== ui.frame) return 0;
    return localStorage.getItem(answered) === `${ui.frame} ${first.facing}` ? 0 : first.facing;
  }
  function answerFacing(towards) {
    const answer = towards ? 1 : -1,
      wrong = facing() !== answer;
    localStorage.setItem(answered, `${ui.frame} ${answer}`);
    if (wrong) {
      swap(model.project.mirror);
      model.notifyOfEdit("Left and right of the body were exchanged; Undo takes that back.");
    }
    model.redraw();
  }

  // Asked as long as nobody has said anything of depth: to which side the chest is turned.
  function turn() {
    const given = Object.values(model.state.nearer).some((limbs) => Object.keys(limbs).length);
    return given ? null : undecidedTurn(model.poses.current()?.alternatives);
  }
  function answerTurn(side) {
    const { nearer } = turn()?.[side] ?? {};
    if (!ready() || !nearer) return;
    const trunk = Object.entries(nearer).filter(([name]) => TRUNK.includes(name));
    model.edit(setNearer(model.state, ui.frame, Object.fromEntries(trunk)));
  }

  const steps = {
    facing: () => answerFacing(true),
    turn: () => answerTurn("left"),
    accept,
    depth: () => confirmDepths(),
    next: navigation.nextKeyframe,
    place() {},
  };

  async function primary() {
    if (ui.dragged?.floating) return placing.placeFloating();
    if (offKeyframe()) return navigation.scrub(0);
    dropDragged();
    if (next().do === "next" && !(await isDone())) return undefined;
    return steps[next().do]();
  }
  // Whether nothing is left to be asked here: of depths nothing is asked before there is a pose.
  async function isDone() {
    const { view, frame } = ui;
    await model.poses.latest();
    return ui.view === view && ui.frame === frame && next().do === "next";
  }

  // The other answer to a question that has two.
  const others = { facing: () => answerFacing(false), turn: () => answerTurn("right") };
  function secondary() {
    return others[next().do]?.();
  }

  return {
    ...placing,
    ...navigation,
    secondary,
    visibility,
    clear,
    swap,
    accept,
    setDepth,
    flip,
    automaticDepths,
    lock,
    next,
    primary,
    confirmAlternative: (n) => confirmDepths(n),
    automaticDepth: () => setDepth(limb(), null),
  };
}

// Placing joints: dragged by the pointer, moved by the arrow keys, or floating over a first place.
function createPlacing(model, middle) {
  const { ui } = model;
  let nudgeTimer = null;

  const joints = () => requiredJoints(model.project, model.keyframe()?.half);

  // Frames beside the keyframe are context only: nothing is changed there.
  const offKeyframe = () => ui.offset !== 0 || ui.frame === null;

  // What is being dragged is dropped before anything else is changed.
  function ready() {
    dropDragged();
    return !offKeyframe();
  }

  // After a joint was marked the next unmarked one is asked for.
  const selectNext = (joint) =>
    model.update({ joint: nextUnmarked(joints(), model.marks(), joint) });

  // A joint that is seen lies in the picture; a hidden one may be beside it.
  function place(joint, at, v = 2) {
    if (offKeyframe() || !joint) return undefined;
    dropDragged();
    const { width, height } = model.project,
      there = v === 2 ? placeSeen([width, height], at) : at;
    if (!there) return model.notify(`${BESIDE} V says that it cannot be placed.`);
    const fresh = !model.marks()[joint];
    model.edit(placeJoint(model.state, ui.frame, joint, [...there, v]));
    return fresh ? selectNext(joint) : model.update({ joint });
  }

  // A joint on its way is held until the arrow keys rest, so that one undo takes all steps back.
  function nudge(dx, dy) {
    const { joint } = ui,
      mark = model.marks()[joint];
    if (offKeyframe() || !joint) return;
    const start =
      ui.dragged?.joint === joint
        ? ui.dragged.at
        : (mark ?? model.poses.suggestion()?.joints?.[joint] ?? middle());
    model.update({ dragged: { joint, at: [start[0] + dx, start[1] + dy], floating: !mark } });
    clearTimeout(nudgeTimer);
    if (mark) nudgeTimer = setTimeout(dropDragged, NUDGE_MS);
  }

  const replace = (joint, at) => place(joint, at, model.marks()[joint]?.[2] || 2);

  // Ends a drag where the joint is; one that floats is not placed.
  function dropDragged() {
    clearTimeout(nudgeTimer);
    const { dragged } = ui;
    ui.dragged = null;
    if (dragged && !dragged.floating) replace(dragged.joint, dragged.at);
  }

  function drag(joint, at) {
    if (ui.dragged?.joint !== joint) dropDragged();
    clearTimeout(nudgeTimer);
    model.update({ joint, dragged: { joint, at } });
  }

  function drop(joint, at) {
    ui.dragged = null;
    replace(joint, at);
  }

  function placeFloating() {
    const { dragged } = ui;
    if (!dragged?.floating) return;
    ui.dragged = null;
    place(dragged.joint, dragged.at);
  }

  function select(joint) {
    dropDragged();
    model.update({ joint });
  }

  return {
    joints,
    offKeyframe,
    ready,
    selectNext,
    place,
    nudge,
    dropDragged,
    drag,
    drop,
    placeFloating,
    select,
  };
}

// From keyframe to keyframe, from joint to joint, a second around a keyframe, and back and forth by
// undo and redo.
function createNavigation(model, placing, { opened, showInSwing }) {
  const { ui } = model;

  function open(frame, also = {}) {
    placing.dropDragged();
    model.update({ view: "keyframes", frame, offset: 0, hovered: null, joint: null, ...also });
    if (!ui.joint) placing.selectNext(null);
    opened(frame);
  }

  function stepKeyframe(by) {
    const frames = model.keyframes().map(({ frame }) => frame),
      at = frames.indexOf(ui.frame);
    const next = frames[Math.max(0, Math.min(frames.length - 1, at + by))];
    if (next !== undefined && next !== ui.frame) open(next);
  }

  function stepJoint(by) {
    const all = placing.joints(),
      at = all.indexOf(ui.joint);
    placing.select(all[(at + by + all.length) % all.length] ?? all[0]);
  }

  function nextKeyframe() {
    const frame = nextOpen(model.keyframes(), ui.frame, model.isMarked);
    if (model.project.golf && !model.project.has.keyframes) model.update({ view: "swing" });
    else if (frame === null) model.update({ view: model.project.has.keyframes ? "motion" : "bodies" });
    else open(frame);
  }

  // Shows a frame beside the keyframe.
  function scrub(offset) {
    placing.dropDragged();
    const second = Math.round(model.project.fps),
      last = model.project.n_frames - 1 - ui.frame;
    model.update({ offset: Math.max(-second, -ui.frame, Math.min(second, last, offset)) });
  }

  // A keyframe that was added for one half, and now for the other, is one of the whole body.
  function addKeyframe(frame, half) {
    const before = model.state.own[frame],
      joined = joinHalves(before, half);
    if (before !== joined) model.edit(setOwnKeyframe(model.state, frame, joined));
    open(frame);
  }

  // Goes to where an undo or redo changed something, and tells what it changed out of sight.
  async function step(turn, told) {
    if (OF_THE_WORLD.includes(ui.view))
      return model.notify("Points of this page are not undone here: Backspace or ✕ takes one away.");
    placing.dropDragged();
    const { view, frame } = ui,
      edit = await turn();
    if (!edit) return undefined;
    const [part] = partsOf(edit),
      wentOn = ui.view !== view || ui.frame !== frame || ui.dragged !== null;
    const isKeyframe = model.keyframes().some((keyframe) => keyframe.frame === part.frame);
    if (!SEEN[ui.view]?.includes(part.kind) || (wentOn && part.frame !== ui.frame)) {
      const offer = isKeyframe && { text: `Show frame ${part.frame}`, act: () => open(part.frame) };
      return model.notifyOfEdit(told(describeEdit(edit)), offer || null);
    }
    if (ui.view === "swing") return showInSwing(part.kind === "key" ? part.to : part.frame);
    if (part.frame !== ui.frame && isKeyframe) open(part.frame);
    if (part.kind === "mark" && part.frame === ui.frame && !wentOn) model.update({ joint: part.joint });
    return undefined;
  }

  return {
    open,
    stepKeyframe,
    stepJoint,
    nextKeyframe,
    scrub,
    addKeyframe,
    undo: () => step(model.undo, (what) => `Taken back: ${what}. Redo brings it back.`),
    redo: () => step(model.redo, (what) => `Done again: ${what}.`),
  };
}
