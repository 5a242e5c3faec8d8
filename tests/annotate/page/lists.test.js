// Lists beside the picture and fields: what the server has not said is not known, what somebody typed stays.
import assert from "node:assert/strict";
import { test } from "node:test";

const elements = new Map();
const nothing = () => {};
const made = []; // what was put into elements that were made
function element(id) {
  if (!elements.has(id))
    elements.set(id, {
      value: "",
      textContent: "",
      dataset: {},
      style: {},
      handlers: {},
      classList: { toggle: nothing },
      addEventListener(kind, handle) {
        this.handlers[kind] = handle;
      },
      append: nothing,
      replaceChildren: nothing,
      setAttribute: nothing,
      remove: nothing,
    });
  return elements.get(id);
}
const tabs = ["frames", "checks", "next"].map((name) => {
  const button = element(`tab ${name}`);
  button.dataset.tab = name;
  return button;
});
globalThis.document = {
  getElementById: element,
  createElement: () => ({ ...element(`made ${elements.size}`), append: (...parts) => made.push(...parts) }),
  querySelectorAll: () => tabs,
};
globalThis.ResizeObserver = class {
  observe() {}
};
const { createLists } = await import("../../../keyrecon/annotate/page/views/lists.js");
const { followProject } = await import("../../../keyrecon/annotate/page/views/dom.js");

const CHECK = { frame: 3, joint: "left_knee", kind: "crossed", suspicion: 0.95, text: "Legs look swapped." };

// What the tab of checks says when the server answers so, one time after the other.
async function said(...turns) {
  let answers = null;
  globalThis.fetch = async (path) => {
    const answer = answers[path.split("/").at(-1)];
    return answer !== undefined ? { ok: true, status: 200, json: async () => answer } : { ok: false, status: 500, json: async () => ({ error: "x" }) };
  };
  const model = {
    project: { has: { keyframes: true, assistant: true }, halves: {}, order: [] },
    ui: { frame: null, joint: null },
    checks: [],
    stretches: [],
    keyframes: () => [],
    keyframe: () => null,
    redraw: nothing,
    onIdle: nothing,
    onProject: nothing,
    notify: nothing,
  };
  const lists = createLists(model, {});
  for (answers of turns) await lists.refresh();
  tabs[1].handlers.click();
  lists.draw();
  return element("explanation").textContent;
}

test("checks are shown though another list has no answer", async () => {
  assert.match(await said({ stretches: [], checks: [CHECK] }), /^Most suspicious first/);
});

test("nothing is said to look right before the marks were looked through", async () => {
  assert.equal(await said({ stretches: [], next_frames: [], checks: null }), "The marks were not looked through yet.");
  assert.equal(await said({ stretches: [], next_frames: [], checks: [] }), "Nothing looks wrong.");
});

test("what the marks looked like before is not told where they could not be looked through", async () => {
  const answers = { stretches: [], next_frames: [] };
  for (const before of [[], [CHECK]])
    assert.equal(await said({ ...answers, checks: before }, answers), "The marks could not be looked through.");
});

test("the tick of a keyframe follows whether it counts as marked, with as many marks as before", () => {
  let marked = true;
  const model = {
    project: { has: { keyframes: true, assistant: true }, halves: { upper: ["neck", "head_top"] }, order: ["neck", "head_top"] },
    ui: { frame: 5, joint: null },
    checks: [],
    stretches: [],
    keyframes: () => [{ frame: 5, half: "upper", stands_for: 3, brings: 0, locked: false }],
    keyframe: () => null,
    marks: () => ({ neck: [1, 1, 2] }),
    isMarked: () => marked,
    redraw: nothing,
    onIdle: nothing,
    onProject: nothing,
    notify: nothing,
  };
  Object.assign(element("frame-list"), { clientHeight: 500, scrollTop: 0 });
  globalThis.requestAnimationFrame = (draw) => draw();
  const lists = createLists(model, {}),
    shown = () => made.findLast((part) => typeof part === "string" && part.startsWith("1/2"));
  lists.draw();
  assert.equal(shown(), "1/2 ✓");
  marked = false;
  lists.draw();
  assert.equal(shown(), "1/2 ");
});

test("a field follows the project until somebody types in it", () => {
  const field = element("field");
  let changed = nothing;
  const model = { project: { budget: "1.5" }, onProject: (react) => (changed = react) };
  followProject(model, field, ({ budget }) => budget);
  assert.equal(field.value, "1.5");
  model.project = { budget: "3" };
  changed();
  assert.equal(field.value, "3");
  field.value = "2";
  field.handlers.input();
  changed();
  assert.equal(field.value, "2");
});
