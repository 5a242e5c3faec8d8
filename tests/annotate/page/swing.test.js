// A golf swing on the page: what is clicked, what is asked for next, what is drawn.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as edits from "../../../keyrecon/annotate/page/state/edits.js";
import * as swing from "../../../keyrecon/annotate/page/state/swing.js";
import { jointWords } from "../../../keyrecon/annotate/page/state/joint_words.js";
import { stepsOf } from "../../../keyrecon/annotate/page/state/workflow.js";

const clickAll = (state, frame) =>
  swing.CLICKS.reduce((now, joint, n) => edits.apply(now, swing.clickIn(now, frame, joint, [n, n, 2])), state);
const FOUND = {
  keys: { start: 3.2, top: 20, hit: 28.4, finish: 50 },
  club: [[1, 2, 3, 4], [1, 2, 3, 5], [null, 2, 3, 4]],
  seen: [true, false, true],
  doubts: [],
};

test("six joints are asked for one after the other, all in one frame", () => {
  const empty = edits.emptyState();
  assert.deepEqual(swing.nextAddress(empty, 7, null), { do: "click", joint: "head_top" });
  const one = edits.apply(empty, swing.clickIn(empty, 7, "head_top", [1, 2, 2]));
  assert.deepEqual([one.golf.frame, one.clicks], [7, { head_top: [1, 2, 2] }]);
  assert.deepEqual(swing.nextAddress(one, 7, null), { do: "click", joint: "root" });
  assert.deepEqual(swing.nextAddress(one, 9, null), { do: "elsewhere", frame: 7 });
  assert.deepEqual(swing.nextAddress(clickAll(empty, 7), 9, null), { do: "fit" });
  assert.deepEqual(swing.nextAddress(clickAll(empty, 7), 7, "exchanged"), { do: "wrong" });
});

test("every joint that is asked for has words of its own", () => {
  const words = swing.CLICKS.map(swing.clickWords);
  assert.equal(new Set(words).size, 6);
  assert.equal(words[2], "the player's right knee");
  assert.ok(swing.CLICKS.every((joint) => jointWords(joint).length > 10));
});

test("clicks begun anew in another frame are taken back as one edit", () => {
  const before = clickAll(edits.emptyState(), 7),
    anew = swing.beginIn(before, 12),
    after = edits.apply(before, anew);
  assert.deepEqual([after.golf, after.clicks], [{ frame: 12 }, {}]);
  assert.deepEqual(edits.apply(after, edits.inverse(anew)), before);
  const moved = edits.apply(before, swing.clickIn(before, 3, "root", [9, 9, 2]));
  assert.deepEqual([moved.golf, moved.clicks], [{ frame: 3 }, { root: [9, 9, 2] }]);
});

test("what is next with a swing", () => {
  const state = clickAll(edits.emptyState(), 7),
    next = (changes) => swing.nextSwing({ state, found: FOUND, fresh: true, running: null, ...changes }).do;
  assert.equal(next({ state: edits.emptyState() }), "address");
  assert.equal(next({ running: {} }), "wait");
  assert.equal(next({ found: null }), "fit");
  assert.equal(next({ found: { ...FOUND, wrong: "out of order" } }), "wrong");
  assert.equal(next({ fresh: false }), "again");
  assert.equal(next({ found: { ...FOUND, doubts: [{ text: "off", frame: 3 }] } }), "doubt");
  assert.equal(next({}), "files");
});

test("a mark takes the place of what was found", () => {
  let state = edits.emptyState();
  assert.deepEqual(swing.clubAt(state, FOUND, 0), { ends: [1, 2, 3, 4], kind: "seen" });
  assert.equal(swing.clubAt(state, FOUND, 1).kind, "guess");
  assert.equal(swing.clubAt(state, FOUND, 2), null);
  assert.equal(swing.clubAt(state, null, 0), null);
  state = edits.apply(state, edits.setShaft(state, 2, [9.04, 8, 7, 6]));
  assert.deepEqual(swing.clubAt(state, FOUND, 2), { ends: [9, 8, 7, 6], kind: "marked" });
  state = edits.apply(state, edits.setKey(state, "top", 22));
  const keys = swing.keysOf(state, FOUND);
  assert.deepEqual([keys.top, keys.hit], [{ frame: 22, marked: true }, { frame: 28.4, marked: false }]);
  assert.deepEqual(swing.keysOf(edits.emptyState(), null), {});
});

test("marked frames are listed with what is marked", () => {
  let state = edits.emptyState();
  for (const edit of [
    edits.placeJoint(state, 22, "left_wrist", [1, 2, 2]),
    edits.placeJoint(state, 4, "neck", [0, 0, 0]),
    edits.setShaft(state, 22, [1, 2, 3, 4]),
    edits.setKey(state, "top", 22),
    edits.setKey(state, "hit", 30),
  ])
    state = edits.apply(state, edit);
  assert.deepEqual(swing.markedFrames(state), [
    { frame: 22, marks: ["left wrist", "club", "top"] },
    { frame: 30, marks: ["hit"] },
  ]);
});

test("edits of a swing are taken back, made anew on what stands there, and told by the server", () => {
  const state = clickAll(edits.emptyState(), 7);
  for (const edit of [
    edits.placeClick(state, "root", [5, 5, 1]),
    edits.setShaft(state, 3, [1, 2, 3, 4]),
    edits.setKey(state, "top", 9),
    edits.setGolf(state, "left_handed", true),
  ]) {
    const after = edits.apply(state, edit);
    assert.notDeepEqual(after, state);
    assert.deepEqual(edits.apply(after, edits.inverse(edit)), state);
    assert.deepEqual({ ...edits.rebased(state, edit), id: 0 }, { ...edit, id: 0 });
    assert.deepEqual(edits.apply(state, edits.editFromChange(edit)), after);
    assert.equal(new Set(edits.cellsOf(edit)).size, 1);
  }
  const off = edits.apply(state, edits.setGolf(state, "left_handed", false));
  assert.equal(off.golf.left_handed, undefined);
  assert.notDeepEqual(edits.cellsOf({ kind: "key", name: "top" }), edits.cellsOf({ kind: "key", name: "hit" }));
});

test("labels on the strip stand side by side, as near to their places as can be", () => {
  assert.deepEqual(swing.spreadLabels([100, 300], 50, 400), [75, 275]);
  assert.deepEqual(swing.spreadLabels([200, 210, 220], 50, 400), [175, 225, 275]);
  assert.deepEqual(swing.spreadLabels([0, 390, 400], 50, 400), [0, 300, 350]);
});

test("a golf project has pages of its own, and those of keyframes where it has some", () => {
  assert.deepEqual(stepsOf({ golf: false, has: {} }), ["bodies", "keyframes", "motion", "files", "court", "ground"]);
  assert.deepEqual(stepsOf({ golf: true, has: {} }), ["address", "swing", "files"]);
  assert.equal(stepsOf({ golf: true, has: { keyframes: true } }).length, 5);
});
