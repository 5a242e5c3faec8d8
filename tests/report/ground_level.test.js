// Where the ground lies under the figure.
import assert from "node:assert/strict";
import { test } from "node:test";
import { groundLevel } from "../../keyrecon/report/ground_level.js";

const level = (lowest, t, radius, ...cuts) => groundLevel(lowest, t, radius, new Set(cuts));

test("it lies at the mean of the lower foot around a frame", () => {
  assert.equal(level([0, 1, 2, 3, 4], 2, 1), 2);
  assert.equal(level(Float32Array.from([0, 1, 2]), 0, 1), 0.5);
});

test("frames without a figure, and those of other shots, do not count", () => {
  assert.equal(level([5, 5, NaN, NaN, 5], 1, 3), 5);
  assert.equal(level([5, 5, 9, 9, 9], 1, 3, 2), 5);
  assert.equal(level([5, 5, 9, 9, 9], 2, 3, 2), 9);
  assert.equal(level([5, 5, 9, 7, 7], 2, 3, 2, 3), 9);
});

test("it is unknown where no foot of the shot is known", () => {
  assert.ok(Number.isNaN(level([NaN, 5], 0, 1, 1)));
});
