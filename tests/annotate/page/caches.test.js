// What the page knows of a motion that does not reach into every frame.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createMotionCache } from "../../../keyrecon/annotate/page/state/caches.js";

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
