// What is to be done next.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as workflow from "../../../keyrecon/annotate/page/state/workflow.js";
import { facingOfMarks, undecidedTurn } from "../../../keyrecon/annotate/page/state/facing.js";
import { FIGURE, jointWords } from "../../../keyrecon/annotate/page/state/joint_words.js";
import { purposeOf } from "../../../keyrecon/annotate/page/views/lists.js";
import { KEYS, belongsTo, interpret, keyText } from "../../../keyrecon/annotate/page/views/keyboard.js";

const PROJECT = {
  joints: ["neck", "left_wrist", "left_knee"],
  order: ["neck", "left_wrist", "left_knee"],
  halves: { upper: ["neck", "left_wrist"], lower: ["left_knee"] },
  limbs: [{ name: "left_wrist", parent: "neck" }, { name: "left_knee", parent: "neck" }],
  mirror: [["left_wrist", "right_wrist"]],
  keyframes: [{ frame: 30, half: "upper" }, { frame: 10, half: "both" }],
  has: { keyframes: true, assistant: true },
};
const AT = [1, 1, 2];
const step = (changes) =>
  workflow.nextStep({
    project: PROJECT,
    half: "both",
    marks: {},
    nearer: {},
    suggestion: null,
    pose: null,
    joint: null,
    ...changes,
  });

test("a keyframe is suggested, placed, given depths, and done", () => {
  const all = { neck: AT, left_wrist: AT, left_knee: AT };
  const pose = { limbs: { left_wrist: { sign: 1 } } };
  const suggestion = { joints: { neck: [1, 2, 0.5] } };
  assert.deepEqual(step({ suggestion }).joints, ["neck"]);
  assert.deepEqual(step({ marks: { neck: AT } }), { do: "place", joint: "left_wrist", left: 2 });
  assert.deepEqual(step({ marks: all, pose }), { do: "depth", limbs: ["left_wrist"] });
  assert.deepEqual(step({ marks: all, pose, nearer: { left_wrist: 1 } }), { do: "next" });
});

test("a keyframe of the upper body asks for no legs, and its depths need both ends", () => {
  assert.deepEqual(workflow.requiredJoints(PROJECT, "upper"), ["neck", "left_wrist"]);
  assert.ok(workflow.isDone(PROJECT, { half: "upper" }, { neck: AT, left_wrist: [0, 0, 0] }));
  assert.deepEqual(workflow.placedLimbs(PROJECT.limbs, { neck: AT, left_wrist: [0, 0, 0] }), []);
});

test("a keyframe is marked with most joints of each half that it is asked for, or all that can be said", () => {
  const project = { halves: { upper: ["neck", "left_wrist"], lower: ["left_hip", "left_knee", "left_ankle"] } };
  const marked = (half, ...joints) =>
    workflow.isMarked(project, { half }, Object.fromEntries(joints.map((joint) => [joint, AT])));
  assert.ok(marked("upper", "neck"));
  assert.ok(!marked("lower", "neck", "left_hip"));
  assert.ok(marked("lower", "left_hip", "left_ankle"));
  assert.ok(!marked("both", "neck", "left_hip"));
  assert.ok(marked("both", "neck", "left_hip", "left_knee"));
  const absent = Object.fromEntries(project.halves.lower.map((joint) => [joint, [0, 0, 0]]));
  assert.ok(workflow.isMarked(project, { half: "lower" }, absent));
  assert.ok(!workflow.isMarked(project, { half: "lower" }, { ...absent, left_hip: undefined }));
});

test("what a keyframe is for stands in short lines, and in words under the pointer", () => {
  const row = purposeOf({ stands_for: 10, brings: 0.0049 });
  assert.deepEqual(row.lines, ["stands for 10 frames", "covers +0.5 %"]);
  assert.match(row.title, /Stands for 10 frames .* brings 0.5 % more of the video within reach/);
  assert.deepEqual(purposeOf({ stands_for: 1, brings: null }).lines, ["stands for 1 frame"]);
  assert.deepEqual(purposeOf({ own: true }), { lines: ["added by you"], title: "" });
});

test("joints and keyframes are asked for going round", () => {
  assert.equal(workflow.nextUnmarked(PROJECT.order, { neck: AT }, "left_knee"), "left_wrist");
  const keyframes = [10, 30, 50].map((frame) => ({ frame }));
  assert.equal(workflow.nextOpen(keyframes, 30, ({ frame }) => frame === 50), 10);
  assert.equal(workflow.nextOpen(keyframes, 30, () => true), null);
  const worth = [10, 30, 50].map((frame, row) => ({ frame, brings: [0.2, 0.1, 0.2][row] }));
  assert.equal(workflow.nextOpen(worth, 30, () => false), 50);
  assert.equal(workflow.nextOpen(worth, 30, ({ frame }) => frame === 50), 10);
  assert.equal(workflow.nextOpen(worth, 10, ({ frame }) => frame !== 30), 30);
});

test("keyframes that a person added stand among those that were chosen", () => {
  const state = { own: { 20: "lower", 30: "lower" }, locked: { 10: true } };
  const rows = workflow.allKeyframes(PROJECT, state);
  assert.deepEqual(
    rows.map(({ frame, half, locked }) => [frame, half, locked]),
    [[10, "both", true], [20, "lower", false], [30, "both", false]],
  );
});

test("a keyframe that was added and taken back stays where it was chosen, too", () => {
  const keyframes = [
    { frame: 10, half: "both", listed: "upper", own: true },
    { frame: 20, half: "lower", listed: null, own: true },
  ];
  const rows = workflow.allKeyframes({ ...PROJECT, keyframes }, { own: {}, locked: {} });
  assert.deepEqual(
    rows.map(({ frame, half, own }) => [frame, half, own]),
    [[10, "upper", false]],
  );
});

test("head, both feet and one region are picked before the program can start", () => {
  const picks = [];
  const missing = () => workflow.missingParts(workflow.partsOf(picks)).map(({ part }) => part);
  assert.deepEqual(missing(), ["head", "foot", "shirt"]);
  for (const part of ["head", "foot", "socks"]) picks.push({ part });
  assert.deepEqual(missing(), ["foot"]);
  picks.push({ part: "foot" });
  assert.deepEqual(missing(), []);
});

test("a video of few frames has each in the strip once", () => {
  for (const count of [1, 2, 6, 7, 12]) {
    const frames = workflow.spreadFrames(count, 7);
    assert.equal(new Set(frames).size, Math.min(count, 7));
    assert.ok(frames.every((frame) => frame >= 0 && frame < count));
  }
});

test("without stored results the page says why it knows nothing of the body", () => {
  const has = { keyframes: true, assistant: false, loaded: true };
  assert.match(workflow.whyNoAssistant({ has }), /stored results are missing/);
  assert.match(workflow.whyNoAssistant({ has: { ...has, loaded: false } }), /are being read/);
  assert.equal(workflow.whyNoAssistant(PROJECT), null);
});

test("a key means one thing on a page, and is written as it stands on the keyboard", () => {
  for (const [page, rows] of Object.entries(KEYS)) {
    const keys = [...rows, ...(page === "any" ? [] : KEYS.any)].flatMap(([names]) => names);
    assert.equal(new Set(keys).size, keys.length, page);
  }
  const key = (parts) => interpret({ ctrlKey: false, altKey: false, ...parts }, "keyframes");
  assert.equal(key({ key: "Z", ctrlKey: true, shiftKey: true }).action, "redo");
  assert.equal(key({ key: "d" }).index, 1);
  assert.equal(key({ key: "F9" }), null);
  assert.equal(keyText("Ctrl+Shift+z"), "Ctrl Shift Z");
});

test("Alt and a digit go to a page also where a keyboard writes something else with them", () => {
  const key = (parts) => interpret({ ctrlKey: false, altKey: true, ...parts }, "keyframes");
  assert.deepEqual([key({ key: "¡", code: "Digit1" })?.action, key({ key: "£", code: "Digit3" })?.index], ["page", 2]);
  assert.equal(key({ key: "4", code: "Digit4" }).index, 3);
  assert.equal(key({ key: "ß", code: "KeyS" }), null);
});

test("Space belongs to a checkbox that has the focus, and no other key does", () => {
  const checkbox = { closest: (selector) => selector.includes("[type=checkbox]") || null };
  assert.equal(belongsTo(checkbox, " "), true);
  for (const key of ["Enter", "q", "ArrowLeft"]) assert.equal(belongsTo(checkbox, key), false);
});

test("Space and Enter belong to a button also where the arrow keys turn what it lies in", () => {
  const button = { closest: (selector) => /button|data-turns/.test(selector) || null };
  assert.deepEqual([" ", "Enter", "ArrowLeft", "q"].map((key) => belongsTo(button, key)), [true, true, true, false]);
});

test("before there are keyframes: a frame, its body, following, more bodies, the choice", () => {
  const begin = (keyframes, { bodies = null, keyframed = false, done = [] } = {}) =>
    workflow.nextBeginning({ has: { keyframes: keyframed }, bodies }, keyframes, ({ frame }) =>
      done.includes(frame),
    );
  const body = (frame) => ({ frame, half: "both" });
  assert.deepEqual(begin([]), { do: "frame" });
  assert.deepEqual(begin([{ frame: 3, half: "upper" }], { done: [3] }), { do: "frame" });
  assert.deepEqual(begin([body(3)]), { do: "mark", frame: 3, left: 1 });
  assert.deepEqual(begin([body(3)], { done: [3] }), { do: "follow" });
  const asked = [body(3), body(20), body(40)];
  assert.deepEqual(begin(asked, { done: [3], bodies: [20, 40] }), { do: "mark", frame: 20, left: 2 });
  assert.deepEqual(begin(asked, { done: [3, 20, 40], bodies: [20, 40] }), { do: "choose" });
  assert.deepEqual(begin([body(3)], { keyframed: true }), { do: "choose" });
});

test("every joint of the figure has words", () => {
  for (const joint of Object.keys(FIGURE)) assert.ok(jointWords(joint), joint);
  assert.equal(Object.keys(FIGURE).length, 15);
  assert.equal(jointWords("tail"), "");
});

test("a height is metres or centimetres, and nothing else", () => {
  assert.equal(workflow.heightIn("188").metres, 1.88);
  assert.equal(workflow.heightIn("188 cm").metres, 1.88);
  assert.equal(workflow.heightIn(" 1,75 m ").metres, 1.75);
  assert.equal(workflow.heightIn("1.8").said, "metres");
  assert.deepEqual(workflow.heightIn("").wrong, false);
  for (const text of ["18", "0", "-1.8", "six feet", "1.8.0", "300", "1e3"])
    assert.equal(workflow.heightIn(text).wrong, true, text);
});

test("a field of view is degrees that a camera can have, or empty", () => {
  for (const text of ["62", " 62,0 ", "62°", "62 degrees"]) assert.equal(workflow.fieldOfViewIn(text).degrees, 62, text);
  assert.deepEqual(workflow.fieldOfViewIn(" "), { degrees: null, said: "empty: not told", wrong: false });
  const lens = { degrees: 61.7, told_by: "the lens that the file names" };
  assert.equal(workflow.fieldOfViewIn("", lens).said, "empty: 62 degrees by the lens that the file names");
  assert.equal(workflow.fieldOfViewIn("70", lens).degrees, 70);
  for (const text of ["0", "3", "-62", "150", "wide", "6.2.0", "1e2", "28 mm"])
    assert.equal(workflow.fieldOfViewIn(text).wrong, true, text);
});

const FRONT = { left_shoulder: [60, 20, 2], right_shoulder: [40, 20, 2], left_hip: [55, 60, 2], right_hip: [45, 60, 2] };

test("marks tell front from back by left and right alone, and nothing from the side", () => {
  assert.equal(facingOfMarks(FRONT), 1);
  const exchanged = { left_shoulder: FRONT.right_shoulder, right_shoulder: FRONT.left_shoulder, left_hip: FRONT.right_hip, right_hip: FRONT.left_hip };
  assert.equal(facingOfMarks(exchanged), -1);
  const side = { ...FRONT, left_shoulder: [51, 20, 2], right_shoulder: [49, 20, 2], left_hip: [50, 60, 2], right_hip: [50, 60, 2] };
  assert.equal(facingOfMarks(side), 0);
  assert.equal(facingOfMarks({ ...FRONT, left_hip: undefined }), 0);
});

test("the turn of the chest is asked for where both sides are likely, not where one is", () => {
  const chest = (z, cost) => ({
    cost,
    nearer: {},
    points3d: { left_shoulder: [0.05, 0, -z], right_shoulder: [-0.05, 0, z], left_hip: [0.05, 0.5, -z], right_hip: [-0.05, 0.5, z] },
  });
  const sides = undecidedTurn([chest(0.15, 0), chest(-0.15, 0.5)]);
  assert.deepEqual([sides.left, sides.right].map(({ cost }) => cost).sort(), [0, 0.5]);
  assert.equal(undecidedTurn([chest(0.15, 0), chest(-0.15, 5)]), null);
  assert.equal(undecidedTurn([chest(0.01, 0), chest(-0.01, 0)]), null);
  assert.equal(undecidedTurn(undefined), null);
});

test("a share that nobody changed is a limit, and one that was typed is asked for", () => {
  const project = { settings: { budget: null }, usual_budget: 0.015 };
  assert.equal(workflow.budgetIn(1.5, project), null);
  assert.equal(workflow.budgetIn(3, project), 0.03);
  assert.equal(workflow.budgetIn(2, { ...project, settings: { budget: 0.02 } }), 0.02);
});
