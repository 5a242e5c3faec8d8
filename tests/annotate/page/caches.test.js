// What the page knows of a motion that does not reach into every frame.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createMotionCache } from "../../../keyrecon/annotate/page/state/caches.js";
import { whyEmpty } from "../../../keyrecon/annotate/page/views/motion.js";

test("nothing is known of errors where the motion has no joints, and of joints without one", async () => {
  const project = { joints: ["neck", "root"], n_frames: 3 },
    answer = { points3d: [[], [], []], expected_error: [[1.5, 2], [null, 2], [null, null]] };
  globalThis.fetch = async () => ({ ok: true, status: 200, json: async () => answer });
  const motion = createMotionCache(project, () => {});
  motion.points(0, "points3d");
  await new Promise((done) => setTimeout(done, 5));
  assert.deepEqual(motion.errors(0), { neck: 1.5, root: 2 });
  assert.deepEqual(motion.errors(1), { root: 2 });
  assert.equal(motion.errors(2), null);
});

test("the next stretch of a motion is asked for before it is played, and none beyond the end", async () => {
  const project = { joints: ["neck"], n_frames: 600 },
    asked = [];
  globalThis.fetch = async (path) => {
    const [from, to] = path.match(/\d+/g).map(Number),
      rows = Array.from({ length: to - from }, () => [[1, 2, 3]]);
    asked.push(from);
    return { ok: true, status: 200, json: async () => ({ points3d: rows }) };
  };
  const motion = createMotionCache(project, () => {}),
    play = async (frame) => {
      motion.points(frame, "points3d");
      await new Promise((done) => setTimeout(done, 5));
      return [...asked];
    };
  assert.equal(motion.isHere(3), false);
  assert.deepEqual(await play(3), [0]);
  assert.equal(motion.isHere(3), true);
  assert.deepEqual(await play(240), [0, 250]);
  assert.deepEqual(await play(490), [0, 250, 500]);
  assert.deepEqual(await play(599), [0, 250, 500]);
});

test("a motion that is on its way is not said to know nothing", () => {
  assert.match(whyEmpty({ exists: true, isHere: false }), /on its way/);
  assert.match(whyEmpty({ exists: true, isHere: true }), /Nothing is known in this frame/);
  assert.match(whyEmpty({ exists: false, isHere: false }), /when it is made/);
});
