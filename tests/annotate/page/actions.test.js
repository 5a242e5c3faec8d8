// What a person does on a keyframe, and what is asked and told.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createActions } from "../../../keyrecon/annotate/page/state/actions.js";
import * as edits from "../../../keyrecon/annotate/page/state/edits.js";
import { allKeyframes } from "../../../keyrecon/annotate/page/state/workflow.js";

const FRONT = { left_shoulder: [60, 20, 2], right_shoulder: [40, 20, 2], left_hip: [55, 60, 2], right_hip: [45, 60, 2] };
const SIDE = { left_shoulder: [51, 20, 2], right_shoulder: [49, 20, 2], left_hip: [50, 60, 2], right_hip: [50, 60, 2] };
const PROJECT = {
  id: "p",
  width: 200,
  height: 100,
  joints: Object.keys(FRONT),
  order: Object.keys(FRONT),
  halves: { upper: ["left_shoulder", "right_shoulder"], lower: ["left_hip", "right_hip"] },
  limbs: [],
  mirror: [
    ["left_shoulder", "right_shoulder"],
    ["left_hip", "right_hip"],
  ],
  keyframes: [{ frame: 5, half: "lower" }],
  has: { keyframes: true },
};

// A model of a project without a server, and what can be done with it.
function trial(changes = {}) {
  const model = {
    project: PROJECT,
    state: { ...edits.emptyState(), ...changes },
    ui: { view: "keyframes", frame: 5, offset: 0 },
    poses: { suggestion: () => null, current: () => null },
    edit: (edit) => (model.state = edits.apply(model.state, edit)),
    update: (ui) => Object.assign(model.ui, ui),
    redraw() {},
    notify: (text) => (model.told = text),
    notifyOfEdit: (text) => (model.told = text),
    marks: (frame = model.ui.frame) => edits.marksOf(model.state, frame),
    nearer: (frame = model.ui.frame) => edits.nearerOf(model.state, frame),
    keyframes: () => allKeyframes(PROJECT, model.state),
    keyframe: () => model.keyframes().find(({ frame }) => frame === model.ui.frame),
    isDone: () => false,
    isMarked: () => false,
  };
  const kept = new Map();
  globalThis.localStorage = {
    getItem: (name) => kept.get(name) ?? null,
    setItem: (name, value) => kept.set(name, value),
    removeItem: (name) => kept.delete(name),
  };
  const actions = createActions(model, { middle: () => [0, 0], opened() {}, showInSwing() {} });
  return { model, actions };
}

test("whether the player faces you is asked though elsewhere a mark was cleared, or tells nothing of it", () => {
  for (const other of [{}, { neck: [1, 1, 2] }, SIDE, { ...FRONT, left_hip: [0, 0, 0] }])
    assert.equal(trial({ marks: { 2: other, 5: FRONT } }).actions.next().do, "facing");
  assert.equal(trial({ marks: { 2: FRONT, 5: FRONT } }).actions.next().do, "next");
});

test("whether the player faces you is asked again where the answer's exchange was taken back", () => {
  const { model, actions } = trial({ marks: { 5: FRONT } });
  const before = model.state;
  actions.secondary();
  assert.deepEqual(model.marks().left_hip, FRONT.right_hip);
  assert.equal(actions.next().do, "next");
  model.state = before; // as an undo leaves it
  assert.equal(actions.next().do, "facing");
  actions.primary();
  assert.equal(actions.next().do, "next");
  assert.deepEqual(model.marks(), FRONT);
});

test("whether the player faces you is asked of another first body, and of an exchanged one", () => {
  const { model, actions } = trial({ marks: { 5: FRONT } });
  actions.primary();
  assert.equal(actions.next().do, "next");
  model.edit(edits.swapSides(model.state, 5, PROJECT.mirror));
  assert.equal(actions.next().do, "facing");
  actions.primary();
  model.state = { ...model.state, marks: {} };
  actions.next();
  model.state = { ...model.state, marks: { 5: FRONT } };
  assert.equal(actions.next().do, "facing");
  actions.primary();
  model.state = { ...model.state, marks: { 9: FRONT } };
  model.ui.frame = 9;
  assert.equal(actions.next().do, "facing");
});

test("whether the player faces you is not asked again where a joint is taken away and placed again", () => {
  const { model, actions } = trial({ marks: { 5: FRONT } });
  actions.primary();
  const whole = model.state,
    { left_hip: _, ...others } = FRONT;
  model.state = { ...whole, marks: { 5: others } };
  actions.next();
  model.state = whole;
  assert.equal(actions.next().do, "next");
});

test("a click where a cross was moved by the arrow keys ends the cross", () => {
  const { left_hip: at, ...others } = FRONT,
    { model, actions } = trial({ marks: { 5: others } });
  model.ui.joint = "left_hip";
  actions.nudge(1, 0);
  assert.ok(model.ui.dragged.floating);
  actions.place("left_hip", at.slice(0, 2));
  assert.equal(model.ui.dragged, null);
  assert.deepEqual(model.marks().left_hip, at);
  actions.placeFloating();
  assert.deepEqual(model.marks().left_hip, at);
});

test("a joint is seen in the picture alone: beside it none is placed, and at its edge it is at the edge", () => {
  const { model, actions } = trial();
  actions.place("left_hip", [-40, 50]);
  assert.deepEqual(model.marks(), {});
  assert.match(model.told, /beside the picture/);
  actions.place("left_hip", [-0.8, 50]);
  assert.deepEqual(model.marks().left_hip, [0, 50, 2]);
  actions.drag("left_hip", [20, 130]);
  actions.drop("left_hip", [20, 130]);
  assert.deepEqual(model.marks().left_hip, [0, 50, 2]);
  actions.place("right_hip", [-40, 50], 1); // where a hidden one may be
  assert.deepEqual(model.marks().right_hip, [-40, 50, 1]);
});

test("a keyframe that a person added for the whole body stays whole when half of it is asked for", () => {
  const { model, actions } = trial({ own: { 20: "both", 30: "upper" } });
  const halves = () => Object.fromEntries(model.keyframes().map(({ frame, half }) => [frame, half]));
  actions.addKeyframe(20, "upper");
  actions.addKeyframe(30, "lower");
  actions.addKeyframe(40, "lower");
  assert.deepEqual(halves(), { 5: "lower", 20: "both", 30: "both", 40: "lower" });
});

test("an undo of many joints tells of all of them", async () => {
  const { model, actions } = trial();
  model.ui.view = "motion";
  const mark = (frame, joint) => ({ kind: "mark", frame, joint, to: null });
  const nearer = (frame, limb) => ({ kind: "nearer", frame, to: { [limb]: null } });
  const told = async (...parts) => {
    model.undo = async () => (parts.length > 1 ? edits.together(parts) : parts[0]);
    await actions.undo();
    return model.told.replace(/^Taken back: |\. Redo.*$/g, "");
  };
  const body = (frame) => Object.keys(FRONT).map((joint) => mark(frame, joint));
  assert.equal(await told(mark(5, "left_hip")), "left hip, frame 5");
  assert.equal(await told(mark(5, "left_hip"), mark(5, "neck")), "left hip, neck, frame 5");
  assert.equal(await told(...body(5), nearer(5, "left_hip")), "4 joints and depth of the left hip, frame 5");
  assert.equal(await told(...body(5), ...body(9)), "8 joints in 2 frames");
  assert.equal(await told({ kind: "key", name: "top", to: 9 }), "top of the swing");
});

// A promise, and what fulfils it.
function late() {
  let arrive = null;
  return { promise: new Promise((done) => (arrive = done)), arrive: (value) => arrive(value) };
}

// A keyframe of which all is marked, and another; its pose is still to come.
function marked() {
  const { model, actions } = trial({ marks: { 5: SIDE }, own: { 9: "lower", 13: "lower" } }),
    { promise, arrive } = late();
  model.project = { ...PROJECT, limbs: [{ name: "left_hip", parent: "right_hip" }] };
  model.poses.latest = () => promise;
  return { model, actions, arrive };
}

test("Enter before the pose is there does not pass by the question of the depths", async () => {
  const { model, actions, arrive } = marked();
  assert.equal(actions.next().do, "next");
  const pressed = actions.primary();
  model.poses.current = () => ({ limbs: { left_hip: { sign: 1 } } });
  arrive();
  await pressed;
  assert.deepEqual([model.ui.frame, actions.next().do], [5, "depth"]);
  assert.deepEqual(model.nearer(), {}); // nobody has seen which
});

test("Enter twice before the pose is there goes to the next keyframe, not beyond", async () => {
  const { model, actions, arrive } = marked();
  const pressed = [actions.primary(), actions.primary()];
  arrive();
  await Promise.all(pressed);
  assert.equal(model.ui.frame, 9);
});

test("an undo that is late takes nobody away from what was gone to or is dragged meanwhile", async () => {
  for (const meanwhile of [
    ({ ui }) => (ui.frame = 9),
    ({ ui }) => (ui.dragged = { joint: "left_hip", at: [1, 1] }),
    () => null,
  ]) {
    const { model, actions } = trial({ own: { 7: "both", 9: "lower" } }),
      { promise, arrive } = late();
    model.ui.dragged = null;
    model.undo = () => promise;
    const undone = actions.undo();
    meanwhile(model);
    const { frame, dragged } = model.ui,
      wentOn = frame === 9 || dragged;
    arrive({ kind: "mark", frame: 7, joint: "left_hip", to: null });
    await undone;
    assert.equal(model.ui.frame, wentOn ? frame : 7);
    assert.equal(model.ui.dragged, dragged);
    if (wentOn) assert.match(model.told, /Taken back: left hip, frame 7/);
  }
});
