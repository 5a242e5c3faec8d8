// Where things are on the screen.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as geometry from "../../../keyrecon/annotate/page/draw/geometry.js";

const close = (one, other, within = 1e-9) =>
  one.forEach((value, n) => assert.ok(Math.abs(value - other[n]) <= within, `${one} ${other}`));
const VIEW = { scale: 1.5, x: 40, y: -20 };

test("the screen and the picture map to one another", () => {
  close(geometry.toPicture(VIEW, geometry.toScreen(VIEW, [12, 34])), [12, 34]);
});

test("zooming keeps what is under the pointer, and keeps to its limits", () => {
  const nearer = geometry.zoomAt(VIEW, [300, 200], 2.5, [0.1, 20]);
  close(geometry.toPicture(nearer, [300, 200]), geometry.toPicture(VIEW, [300, 200]));
  assert.equal(geometry.zoomAt(VIEW, [0, 0], 1e6, [0.1, 20]).scale, 20);
});

test("a box that is fitted lies in the middle and touches the margin", () => {
  const view = geometry.fit([10, 20, 110, 70], [400, 300], 20);
  const [left, top] = geometry.toScreen(view, [10, 20]);
  const [right, bottom] = geometry.toScreen(view, [110, 70]);
  close([left + right, top + bottom], [400, 300]);
  close([Math.min(left, top)], [20]);
});

test("a picture cannot be pushed off its canvas", () => {
  const far = geometry.clampToCanvas({ scale: 1, x: 9999, y: -9999 }, [400, 300], [640, 360]);
  assert.deepEqual([far.x, far.y], [320.5, 80 - 359.5]);
});

test("a click on half a pixel at the edge is one on that pixel, and one beside the picture is none", () => {
  assert.deepEqual(geometry.placeIn([64, 36], [-0.4, 35.4]), [0, 35]);
  assert.deepEqual(geometry.placeIn([64, 36], [10.04, 20.26]), [10, 20.3]);
  for (const outside of [[-0.6, 3], [63.6, 3], [3, 35.6]])
    assert.equal(geometry.placeIn([64, 36], outside), null);
});

test("what is seen a hair beside the picture is at its edge", () => {
  assert.deepEqual(geometry.placeSeen([640, 360], [-3, 362]), [0, 359]);
  assert.equal(geometry.placeSeen([640, 360], [-4, 300]), null);
});

test("a keyframe opens on all that is marked there", () => {
  assert.deepEqual(geometry.enclosing([10, 20, 30, 40], [[5, 30, 2], [20, 60, 1]]), [5, 20, 30, 60]);
  assert.equal(geometry.enclosing(undefined, [[5, 30, 2]]), null);
});

test("the distance to a segment is that of its nearest point", () => {
  const [a, b] = [[3, -2], [17, 9]];
  for (const point of [[0, 0], [10, 4], [30, 5], [3, -2]]) {
    const along = Array.from({ length: 2001 }, (_, n) => n / 2000);
    const distances = along.map((s) =>
      Math.hypot(a[0] + s * (b[0] - a[0]) - point[0], a[1] + s * (b[1] - a[1]) - point[1]),
    );
    close([geometry.distanceToSegment(point, a, b)], [Math.min(...distances)], 1e-2);
  }
  close([geometry.distanceToSegment([3, 4], [0, 0], [0, 0])], [5]);
});

test("the nearest joint within the radius is meant, and a limb between two places", () => {
  const places = { knee: [0, 0], hip: [0, 10] };
  assert.equal(geometry.nearestPlace([1, 3], places, 11), "knee");
  assert.equal(geometry.nearestPlace([40, 40], places, 11), null);
  const limbs = [{ name: "knee", parent: "hip" }, { name: "ankle", parent: "knee" }];
  assert.equal(geometry.nearestLimb([2, 5], limbs, places, 7), "knee");
  assert.equal(geometry.nearestLimb([20, 5], limbs, places, 7), null);
});
