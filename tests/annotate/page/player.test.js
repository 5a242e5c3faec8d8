// The clock that plays frames: it waits for pictures, and goes on to the end.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createPlayer } from "../../../keyrecon/annotate/page/views/player.js";

// A player of 25 frames a second whose pictures arrive some ticks of 10 ms after they are asked for.
function play(from, { last, late = () => 0, arrived = [] }) {
  const shown = [],
    here = new Map(arrived.map((frame) => [frame, 0]));
  let ticks = 0,
    next = null;
  globalThis.requestAnimationFrame = (step) => {
    next = step;
  };
  performance.now = () => 10 * ticks;
  const player = createPlayer({
    fps: 25,
    last,
    ready: (frame) => here.has(frame) && here.get(frame) <= ticks,
    load: (frame) => here.has(frame) || here.set(frame, ticks + late(frame)),
    show: (frame) => shown.at(-1) === frame || shown.push(frame),
    active: () => true,
  });
  player.start(from);
  for (; next && ticks < 1000; ticks++) {
    const step = next;
    next = null;
    step(10 * ticks);
  }
  assert.ok(!player.playing());
  return { shown, ticks };
}

const all = (first, last) => Array.from({ length: last - first + 1 }, (_, n) => first + n);

test("frames whose pictures are here are shown in their time", () => {
  const { shown, ticks } = play(3, { last: 9, arrived: all(0, 9) });
  assert.deepEqual(shown, all(3, 9));
  assert.equal(ticks, 25);
});

test("a picture that is late holds the clock up, and nothing goes back", () => {
  for (const slow of all(4, 9)) {
    const late = (frame) => (frame === slow ? 50 : 0);
    const arrived = all(0, 9).filter((frame) => frame !== slow);
    const { shown } = play(3, { last: 9, late, arrived });
    assert.deepEqual(shown, shown.toSorted((a, b) => a - b));
    assert.equal(shown.at(-1), 9, `to the end though ${slow} is late`);
  }
});

test("where every picture is late none is left out", () => {
  const { shown } = play(0, { last: 6, late: () => 12 });
  assert.deepEqual(shown.slice(-6), all(1, 6));
});

test("what is played from its end begins at the beginning", () => {
  assert.deepEqual(play(4, { last: 4, arrived: all(0, 4) }).shown, all(0, 4));
});
