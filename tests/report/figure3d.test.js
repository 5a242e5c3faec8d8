// The figure in space: where a turned point is seen, and what lies before what.
import assert from "node:assert/strict";
import { test } from "node:test";
import { chestDirection, createProjection, seenFrom, sortBones, turned, viewInWords, wrapWords, zoomed } from "../../keyrecon/report/figure3d.js";

const SCENE = { center: [1, 2, 3], unit: 1.8, scale: 100, size: [400, 300] };
const AHEAD = { yaw: 0, pitch: 0, zoom: 1 };
const project = (view, point) => createProjection(view, SCENE)(point);
const near = (one, other) => assert.ok(Math.abs(one - other) < 1e-9, `${one} is not ${other}`);

test("the center stays in the middle however the figure is turned", () => {
  for (const view of [AHEAD, { yaw: 1, pitch: 0.4 }, { yaw: -3, pitch: -1.5 }]) {
    const [x, y, depth, magnification] = project(view, SCENE.center);
    assert.deepEqual([x, y, depth, magnification], [200, 150, 0, 1]);
  }
});

test("from ahead x is right, y is down, and what is nearer is larger", () => {
  const [x, y] = project(AHEAD, [1.5, 2.5, 3]);
  assert.deepEqual([x, y], [250, 200]);
  assert.ok(project(AHEAD, [1, 2, 2])[3] > 1);
  assert.ok(project(AHEAD, [1, 2, 4])[3] < 1);
});

test("from the side depth becomes width, from above it becomes height", () => {
  const side = project({ yaw: Math.PI / 2, pitch: 0 }, [1, 2, 3.5]);
  near(side[0], 250);
  near(side[2], 0);
  const above = project({ yaw: 0, pitch: Math.PI / 2 }, [1, 2, 3.5]);
  near(above[1], 100);
  near(above[2], 0);
});

test("nobody sees the figure upside down, and the zoom has its limits", () => {
  assert.equal(turned(AHEAD, 0, 9).pitch, Math.PI / 2);
  near(turned(AHEAD, 0.1, 0).yaw, 0.1);
  assert.equal(zoomed(AHEAD, 1e9).zoom, 4);
  assert.equal(zoomed(AHEAD, 1e-9).zoom, 0.4);
});

test("bones are drawn far to near, those of unknown ends not at all", () => {
  const points = { hip: [0, 0, 0], far: [0, 1, 5], near: [0, 1, -5], lost: [NaN, NaN, NaN] };
  const bones = ["near", "far", "lost", "nowhere"].map((to) => ({ from: "hip", to, side: "left" }));
  const sorted = sortBones({ points, bones }, createProjection(AHEAD, SCENE));
  assert.deepEqual(sorted.map(({ to }) => to), ["far", "near"]);
});

test("the chest of somebody who faces the camera points at it, turned away it points away", () => {
  const trunk = ["left", "right", "rightHip", "leftHip"];
  const facing = { left: [1, 0, 0], right: [-1, 0, 0], leftHip: [0.6, 3, 0], rightHip: [-0.6, 3, 0] };
  assert.deepEqual(chestDirection(facing, trunk).map((part) => Math.round(part) + 0), [0, 0, -1]);
  const away = { ...facing, left: facing.right, right: facing.left, leftHip: facing.rightHip, rightHip: facing.leftHip };
  assert.deepEqual(chestDirection(away, trunk).map((part) => Math.round(part) + 0), [0, 0, 1]);
});

test("where the body is seen from is told in words", () => {
  assert.equal(viewInWords({ yaw: 0, pitch: 0 }), "from the camera");
  assert.equal(viewInWords({ yaw: Math.PI / 2, pitch: 0 }), "90° to the right of the camera");
  assert.equal(viewInWords({ yaw: -0.5, pitch: 0.2 }), "29° to the left of the camera, 11° from above");
  assert.equal(viewInWords({ yaw: 1, pitch: Math.PI / 2 }), "from above");
});

test("from an eye the center is straight ahead, as far away as it is", () => {
  const { yaw, pitch, distance } = seenFrom([4, -3, 8], SCENE.center);
  near(distance, Math.hypot(3, 5, 5));
  const [x, y, depth] = createProjection({ yaw, pitch }, SCENE)([4, -3, 8]);
  near(x, 200);
  near(y, 150);
  near(depth, -distance);
});

test("words that are too long for a figure are broken after a comma, and nowhere else", () => {
  const words = "34° to the right of the camera, 14° from above",
    breadth = (text) => text.length;
  assert.deepEqual(wrapWords(words, 50, breadth), [words]);
  assert.deepEqual(wrapWords(words, 40, breadth), ["34° to the right of the camera,", "14° from above"]);
  assert.deepEqual(wrapWords("from above", 5, breadth), ["from above"]);
});
