// What is drawn over a picture lies where the picture has it: pixel centres are at integers.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createStrip } from "../../../keyrecon/annotate/page/views/strip.js";
import { createViewer } from "../../../keyrecon/annotate/page/draw/viewer.js";

const PROJECT = { width: 64, height: 36, n_frames: 3 };

// A canvas of 640 x 400 CSS pixels that keeps what is drawn on it.
function canvas(drawn) {
  const pen = new Proxy({}, { get: (_, name) => (...given) => drawn.push([name, ...given]), set: () => true });
  return { clientWidth: 640, clientHeight: 400, width: 640, height: 400, getContext: () => pen, addEventListener() {} };
}

function fakeBrowser() {
  globalThis.ResizeObserver = class {
    observe() {}
  };
  globalThis.window = { devicePixelRatio: 1 };
}

// {viewer, drawn}: a viewer that has drawn nothing yet, and all that it draws of a picture.
function open() {
  fakeBrowser();
  const drawn = [],
    canvases = [canvas(drawn), canvas([])],
    root = { querySelectorAll: () => canvases, dataset: {}, classList: { toggle() {} } };
  const frames = { get: () => ({ width: PROJECT.width }) };
  return { viewer: createViewer({ root, project: PROJECT, frames, redraw() {} }), drawn };
}

// {viewer, placed}: a viewer that has drawn frame 1, and where: left, top, width, height.
function drawOne() {
  const { viewer, drawn } = open();
  viewer.drawPicture(1);
  const [, , ...placed] = drawn.find(([name]) => name === "drawImage");
  return { viewer, placed };
}

test("a mark on a pixel is drawn on its middle, and a click on its middle marks it", () => {
  const { viewer, placed } = drawOne(),
    [left, top, width, height] = placed,
    side = width / PROJECT.width;
  assert.equal(height / PROJECT.height, side);
  for (const [column, row] of [[0, 0], [10, 20], [63, 35]]) {
    const middle = [left + (column + 0.5) * side, top + (row + 0.5) * side];
    for (const [got, expected] of [
      [viewer.toScreen([column, row]), middle],
      [viewer.toPicture(middle), [column, row]],
    ])
      got.forEach((value, axis) => assert.ok(Math.abs(value - expected[axis]) < 1e-9, `${got} ${expected}`));
  }
});

// An element that keeps its text, on which anything can be called.
const element = () => ({ ...canvas([]), append() {}, setAttribute() {}, replaceChildren() {}, textContent: "" });

test("how well the colours do is not told of clicks that were taken away", async () => {
  fakeBrowser();
  const byName = new Map(),
    answers = [{ ok: true, json: async () => ({ frames: [], confidence: 0.9 }) }, { ok: false, status: 400, json: async () => ({}) }];
  globalThis.document = {
    createElement: element,
    getElementById: (name) => byName.get(name) ?? byName.set(name, element()).get(name),
  };
  globalThis.fetch = async () => answers.shift();
  const strip = createStrip({ project: PROJECT, redraw() {} }, { get: () => null }, () => {}),
    told = async () => {
      await strip.refresh();
      strip.draw(0);
      return byName.get("strip-note").textContent;
    };
  assert.match(await told(), /agree on 90 %/);
  assert.equal(await told(), "");
});

test("keys that come before the picture is drawn do no harm", () => {
  const { viewer } = open();
  viewer.toggleZoom();
  viewer.zoom(viewer.toScreen(viewer.middle()), 1.25);
  assert.deepEqual(viewer.middle(), [31.5, 17.5]);
  viewer.drawPicture(1);
  viewer.middle().forEach((value, axis) => assert.ok(Math.abs(value - [31.5, 17.5][axis]) < 1e-9));
});
