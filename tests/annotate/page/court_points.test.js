// Points of the court as a person is asked for them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { ASKED, namedInWords, nextPoint } from "../../../keyrecon/annotate/page/state/court_points.js";

test("the next point is the first that is not clicked, until all are", () => {
  assert.equal(nextPoint([]), "near-left");
  assert.equal(nextPoint([{ name: "near-left" }, { name: "far-mark" }]), "near-right");
  assert.equal(nextPoint(ASKED.map((name) => ({ name }))), null);
});

test("every point has a name that a person would say", () => {
  assert.equal(namedInWords("near-left"), "the near left corner of the baseline and the doubles sideline");
  assert.equal(
    namedInWords("far-right-service"),
    "the far right corner of the service line and the singles sideline",
  );
  assert.equal(namedInWords("near-service"), "the near end of the centre line");
  assert.equal(namedInWords("net-left"), "the top of the left post of the net");
  assert.equal(namedInWords("net-right-foot"), "the foot of the post on the right");
});
