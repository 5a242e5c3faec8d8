// Numbers of the report's file: what was packed, and what lies between.
import assert from "node:assert/strict";
import { test } from "node:test";
import { unpack } from "../../keyrecon/report/packed.js";

const UNKNOWN = -32768;
function packed(rows, shape, every) {
  const bytes = new Uint8Array(Int16Array.from(rows.flat()).buffer);
  return { step: 0.5, every, shape, data: btoa(String.fromCharCode(...bytes)) };
}
const unpackRows = (...given) => Array.from(unpack(packed(...given)).values);

test("all rows come back, unknown ones as NaN", () => {
  assert.deepEqual(unpackRows([[2, 4], [UNKNOWN, 8]], [2, 2], 1), [1, 2, NaN, 4]);
});

test("frames between those that are held lie on a straight line, the last ones stay", () => {
  assert.deepEqual(unpackRows([[0], [6], [12]], [8, 1], 3), [0, 1, 2, 3, 4, 5, 6, 6]);
});

test("beside an unknown row the nearer one counts", () => {
  assert.deepEqual(unpackRows([[2], [UNKNOWN], [4]], [10, 1], 4), [1, 1, NaN, NaN, NaN, NaN, 2, 2, 2, 2]);
});

test("no frame lies between those of two shots: each is that of the nearest frame held of its own", () => {
  const unpackShots = (rows, shape, every, cuts) =>
    Array.from(unpack(packed(rows, shape, every), new Set(cuts)).values);
  assert.deepEqual(unpackShots([[0], [6], [20]], [8, 1], 3, [5]), [0, 1, 2, 3, 3, 10, 10, 10]);
  assert.deepEqual(unpackShots([[2], [UNKNOWN], [4]], [10, 1], 4, [3, 7]), [1, 1, 1, NaN, NaN, NaN, NaN, 2, 2, 2]);
  assert.deepEqual(unpackShots([[2], [4]], [6, 1], 5, [2, 4]), [1, 1, NaN, NaN, 2, 2]);
});

test("nothing stays nothing", () => {
  assert.equal(unpack(null), null);
});
