// What the page knows while the server is slow, refuses, or another page was faster.
import assert from "node:assert/strict";
import { test } from "node:test";
import { placeJoint, setLock } from "../../../keyrecon/annotate/page/state/edits.js";
import { createModel } from "../../../keyrecon/annotate/page/state/model.js";

const PROJECT = { id: "p", joints: ["neck", "left_knee"], mirror: [], keyframes: [], has: {} };
const rest = () => new Promise((done) => setTimeout(done, 5));

// A page whose server answers edits as `answer(edits)` does, once `arrive()` is called.
async function createTrial(answer) {
  const trial = { received: [], waiting: [], states: [] };
  const arrived = () => new Promise((done) => trial.waiting.push(done));
  trial.arrive = async () => {
    trial.waiting.splice(0).forEach((done) => done());
    await rest();
  };
  const answers = {
    "/api/project": () => PROJECT,
    async "/api/state"() {
      const state = trial.states.shift();
      if (state) await arrived();
      return state ?? { revision: 0 };
    },
    async "/api/edits"({ edits }) {
      await arrived();
      trial.received.push(...edits.map(({ joint }) => joint));
      return { revision: 1, results: edits.map(answer) };
    },
    async "/api/undo"() {
      await arrived();
      const name = trial.received.at(-1);
      trial.received.push("undo");
      const change = { kind: "mark", frame: 3, joint: name, from: [1, 1, 2], to: null };
      return { revision: 2, undo: 0, redo: 1, changes: [change] };
    },
  };
  globalThis.localStorage = Object.create({
    setItem: () => {},
    getItem: () => null,
    removeItem: () => {},
  });
  globalThis.requestAnimationFrame = (draw) => setTimeout(draw);
  globalThis.fetch = async (path, { body } = {}) => {
    const content = await answers[path](body && JSON.parse(body));
    return { ok: true, status: 200, json: async () => structuredClone(content) };
  };
  return Object.assign(trial, { model: await createModel() });
}

const place = (model, joint, x) => model.edit(placeJoint(model.state, 3, joint, [x, 1, 2]));

test("an edit made after an undo on a slow disk is not the one that is taken back", async () => {
  const { model, arrive, received } = await createTrial(() => ({ ok: true }));
  place(model, "neck", 1);
  const undone = model.undo();
  assert.deepEqual(model.marks(3), {});
  place(model, "left_knee", 2);
  for (let n = 0; n < 3; n++) await arrive();
  assert.equal((await undone).joint, "neck");
  assert.deepEqual(received, ["neck", "undo", "left_knee"]);
  assert.deepEqual(model.marks(3), { left_knee: [2, 1, 2] });
});

test("a joint placed anew after an undo is placed where nothing is", async () => {
  const sent = [];
  const { model, arrive } = await createTrial((edit) => {
    sent.push(edit);
    return { ok: true };
  });
  place(model, "neck", 1);
  model.undo();
  place(model, "neck", 7);
  for (let n = 0; n < 3; n++) await arrive();
  assert.deepEqual(sent.at(-1).from, null);
  assert.deepEqual(model.marks(3), { neck: [7, 1, 2] });
});

test("two undos on a slow disk take the last two edits back", async () => {
  const { model, arrive, received } = await createTrial(() => ({ ok: true }));
  place(model, "neck", 1);
  place(model, "left_knee", 2);
  model.undo();
  model.undo();
  assert.deepEqual(model.marks(3), {});
  for (let n = 0; n < 4; n++) await arrive();
  assert.deepEqual(received.slice(0, 4), ["neck", "left_knee", "undo", "undo"]);
});

test("all edits for which another page was faster are offered, and what was refused is told", async () => {
  const answers = {
    neck: { ok: false, status: 409, current: {} },
    left_knee: { ok: false, status: 400, error: "Frame 3 is outside." },
  };
  const { model, arrive, received } = await createTrial(({ joint }) => answers[joint]);
  place(model, "neck", 1);
  place(model, "neck", 2);
  place(model, "left_knee", 3);
  await arrive();
  await arrive();
  assert.match(model.notice.text, /Frame 3 is outside.*changed the same 2 places/);
  answers.neck = { ok: true };
  received.length = 0;
  model.notice.offer.act();
  for (let n = 0; n < 3; n++) await arrive();
  assert.deepEqual(received, ["neck", "neck"]);
  assert.deepEqual(model.marks(3), { neck: [2, 1, 2] });
});

test("a state that was read before an edit arrived does not take the edit off the page", async () => {
  const { model, arrive, states } = await createTrial(() => ({ ok: true })),
    marked = { 3: { neck: [1, 1, 2] } };
  place(model, "neck", 1);
  states.push({ revision: 0, marks: {} }, { revision: 1, marks: marked });
  const read = model.readState();
  for (let n = 0; n < 3; n++) await arrive();
  await read;
  assert.deepEqual(model.marks(3), marked[3]);
  assert.deepEqual(states, []);
});

test("of a server that was put back to an older state that state is taken", async () => {
  const { model, arrive, states } = await createTrial(() => ({ ok: true }));
  place(model, "neck", 1);
  await arrive();
  states.push({ revision: 0, marks: {} });
  const read = model.readState();
  await arrive();
  await read;
  assert.deepEqual(model.marks(3), {});
});

test("only edits of marks make the marks others than those that a motion was made from", async () => {
  const { model, arrive } = await createTrial(() => ({ ok: true })),
    made = model.state.revision;
  assert.ok(model.marksAreOf(made));
  model.edit(setLock(model.state, 3, true));
  await arrive();
  assert.equal(model.state.revision, 1);
  assert.ok(model.marksAreOf(made));
  place(model, "neck", 1);
  await arrive();
  assert.ok(!model.marksAreOf(made));
});

test("what is told of an edit goes when that edit is taken back, and when another is made", async () => {
  const { model, arrive } = await createTrial(() => ({ ok: true }));
  place(model, "neck", 1);
  await arrive();
  model.notifyOfEdit("Placed; Undo takes that back.");
  const undone = model.undo();
  assert.equal(model.notice?.text ?? null, null);
  await arrive();
  await undone;
  model.notifyOfEdit("Taken back. Redo brings it back.");
  place(model, "left_knee", 2);
  assert.equal(model.notice?.text ?? null, null);
  model.notify("The work failed.");
  place(model, "left_knee", 3);
  assert.equal(model.notice.text, "The work failed.");
  model.notify(null);
  for (let n = 0; n < 2; n++) await arrive();
});

test("edits that another page overruled are still offered when another notice has come and gone", async () => {
  const { model, arrive } = await createTrial(() => ({ ok: false, status: 409, current: {} }));
  place(model, "neck", 1);
  for (let n = 0; n < 2; n++) await arrive();
  model.notify("Work has ended.");
  assert.equal(model.notice.text, "Work has ended.");
  place(model, "left_knee", 2);
  for (let n = 0; n < 2; n++) await arrive();
  assert.equal(model.notice.offer.overruled.length, 2);
  model.notify("The work failed.", {});
  model.notify(null);
  assert.equal(model.notice.offer.text, "Use mine");
  model.notify(null);
  assert.equal(model.notice.text, null);
});
