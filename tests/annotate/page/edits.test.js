// What a person has decided, and how edits change it.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as edits from "../../../keyrecon/annotate/page/state/edits.js";

const PAIRS = [["left_knee", "right_knee"]];
const marked = () => ({
  ...edits.emptyState(),
  marks: { 7: { left_knee: [1, 2, 2], right_knee: [3, 4, 1], neck: [5, 6, 2] } },
  nearer: { 7: { left_knee: 1 } },
});

test("an edit leaves the state it was applied to as it was", () => {
  const before = marked(),
    kept = structuredClone(before);
  const after = edits.apply(before, edits.placeJoint(before, 7, "neck", [9, 9, 2]));
  assert.deepEqual(before, kept);
  assert.deepEqual(after.marks[7].neck, [9, 9, 2]);
});

test("swapping sides twice changes nothing, once exchanges marks and depths", () => {
  const swap = (state) => edits.apply(state, edits.swapSides(state, 7, PAIRS));
  const once = swap(marked());
  assert.deepEqual(once.marks[7].left_knee, [3, 4, 1]);
  assert.deepEqual(once.nearer[7], { right_knee: 1 });
  assert.deepEqual(swap(once), marked());
  assert.equal(edits.swapSides(marked(), 8, PAIRS), null);
});

test("an edit and its inverse together change nothing", () => {
  const state = { ...marked(), picks: [{ id: "a", frame: 1, part: "head", x: 2, y: 3 }] };
  const all = [
    edits.placeJoint(state, 7, "neck", null),
    edits.placeJoints(state, 7, { neck: [1, 1, 2], head_top: [2, 2, 2] }),
    edits.setNearer(state, 7, { left_knee: -1 }),
    edits.setOwnKeyframe(state, 9, "both"),
    edits.setLock(state, 7, true),
    edits.removePick(state.picks[0]),
    edits.swapSides(state, 7, PAIRS),
  ];
  for (const edit of all) {
    const changed = edits.apply(state, edit);
    assert.notDeepEqual(changed, state, edit.kind);
    const back = edits.apply(changed, edits.inverse(edit));
    assert.deepEqual(back, state, edit.kind);
  }
});

test("an edit made anew expects what stands there now", () => {
  const mine = edits.placeJoint(edits.emptyState(), 7, "neck", [9, 9, 2]);
  const anew = edits.rebased(marked(), mine);
  assert.deepEqual([anew.to, anew.from], [[9, 9, 2], [5, 6, 2]]);
  assert.notEqual(anew.id, mine.id);
});

test("a joint is visible, then hidden, then absent, and visible again", () => {
  const seen = [[4, 5, 2]];
  for (let n = 0; n < 3; n++) seen.push(edits.nextVisibility(seen.at(-1)));
  assert.deepEqual(seen, [[4, 5, 2], [4, 5, 1], [4, 5, 0], [4, 5, 2]]);
  assert.deepEqual(edits.nextVisibility(undefined), [0, 0, 0]);
  assert.equal(edits.nextVisibility([0, 0, 0]), null);
});

test("places are kept to a tenth of a pixel", () => {
  const { to } = edits.placeJoint(edits.emptyState(), 7, "neck", [1.26, 2.04, 2]);
  assert.deepEqual(to, [1.3, 2, 2]);
});

test("a change that the server reports touches the cells of the edit that made it", () => {
  const cells = (edit) => edits.cellsOf(edit).toSorted();
  const mine = edits.setNearer(marked(), 7, { left_knee: -1 });
  const reported = { kind: "nearer", frame: 7, limb: "left_knee", from: 1, to: -1 };
  assert.deepEqual(cells(edits.editFromChange(reported)), cells(mine));
  const group = edits.swapSides(marked(), 7, PAIRS);
  assert.equal(edits.cellsOf(group).length, 4);
});

test("what a newer server calls by an unknown kind is left alone", () => {
  const state = marked();
  assert.equal(edits.apply(state, { kind: "unheard of", frame: 1, to: 2 }), state);
});
