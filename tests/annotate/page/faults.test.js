// What goes wrong is told in one line, and by whose fault.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Gone } from "../../../keyrecon/annotate/page/state/api.js";
import { describeFault } from "../../../keyrecon/annotate/page/state/faults.js";

test("what the server says is told in its words, and that it is gone", () => {
  assert.equal(describeFault(new Error("Frame 3 is outside.")), "Frame 3 is outside.");
  assert.match(describeFault(new Gone("")), /does not answer/);
});

test("what the page stumbles over is told in one line, whatever was thrown", () => {
  for (const thrown of [new TypeError("x is\nnot y"), new RangeError("full"), "text", undefined, null])
    assert.match(describeFault(thrown), /^That went wrong on the page \([^\n]+\)\. What is marked is kept/);
});
