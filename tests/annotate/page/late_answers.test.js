// What the page knows where answers come late, twice, in another order, or not at all.
import assert from "node:assert/strict";
import { test } from "node:test";
import { isKeeping, oneByOne } from "../../../keyrecon/annotate/page/state/api.js";
import { createMotionCache } from "../../../keyrecon/annotate/page/state/caches.js";
import { placeJoint } from "../../../keyrecon/annotate/page/state/edits.js";
import { createModel } from "../../../keyrecon/annotate/page/state/model.js";
import { createJobs } from "../../../keyrecon/annotate/page/views/shell.js";

const PROJECT = { id: "p", files: "1", joints: ["neck"], mirror: [], keyframes: [], has: { motion: false }, run: {} };
const rest = () => new Promise((done) => setTimeout(done, 5));

// A page whose server answers a request when it is told to: `answer(path, content)` answers the oldest one of
// a path, `fail(path)` does not; `hear(news)` is news of its stream. What waits for seconds is done at once.
async function createTrial(project = PROJECT) {
  const trial = { asked: [], source: {} };
  const settle = (reply) => async (path, content) => {
    const at = trial.asked.findIndex((request) => request.path === path);
    assert.ok(at >= 0, `nobody asked for ${path}`);
    const [request] = trial.asked.splice(at, 1);
    reply(request, content);
    await rest();
  };
  trial.answer = settle(({ done }, content) => done({ ok: true, status: 200, json: async () => content }));
  trial.answerNewest = async (path, content) => {
    trial.asked.reverse();
    await trial.answer(path, content);
    trial.asked.reverse();
  };
  trial.fail = settle(({ fail }) => fail(new TypeError("Failed to fetch")));
  trial.waits = (path) => trial.asked.filter((request) => request.path === path).length;
  trial.hear = async (name, news) => {
    trial.source[name]({ data: JSON.stringify(news ?? null) });
    await rest();
  };
  globalThis.localStorage = Object.create({ setItem() {}, getItem: () => null, removeItem() {} });
  globalThis.requestAnimationFrame = (draw) => setTimeout(draw);
  globalThis.EventSource = class {
    addEventListener(name, react) {
      trial.source[name] = react;
    }
  };
  globalThis.fetch = (address, { body } = {}) =>
    new Promise((done, fail) => {
      trial.asked.push({ path: address.replace("/api/", ""), body: body && JSON.parse(body), done, fail });
    });
  const made = createModel();
  await trial.answer("project", project);
  trial.model = await made;
  return trial;
}

// Timers of the page that are longer than a moment end at once.
function hurry(context) {
  const real = globalThis.setTimeout;
  globalThis.setTimeout = (work, wait = 0, ...parameters) => real(work, wait > 500 ? 1 : wait, ...parameters);
  context.after(() => (globalThis.setTimeout = real));
}

const withMotion = (run = {}) => ({ ...PROJECT, files: "2", has: { motion: true }, run });

test("of two descriptions of the project the one that was asked for last counts", async () => {
  const { model, answer, answerNewest } = await createTrial();
  model.readProject();
  model.readProject();
  await answerNewest("project", withMotion());
  await answer("project", PROJECT);
  assert.equal(model.project.has.motion, true);
});

test("whether the motion knows the marks is told by the answer that was asked for last", async (context) => {
  hurry(context);
  const { model, answer, hear, waits } = await createTrial(withMotion({ is_current: false }));
  model.listen(async () => {});
  await hear("message", { revision: 1, edits: [{ id: "x", revision: 1, changes: [] }] });
  assert.equal(waits("run"), 1);
  await hear("message", { project: true });
  await answer("project", withMotion({ is_current: true }));
  await answer("run", { is_current: false });
  assert.equal(model.project.run.is_current, true);
});

test("what changed before the stream was open is read, and nothing is read twice", async () => {
  const { model, answer, hear, waits } = await createTrial();
  model.listen(async () => {});
  await hear("message", { revision: 0, files: "1" });
  assert.equal(waits("project"), 0);
  await hear("message", { revision: 0, files: "2" });
  await answer("project", withMotion());
  assert.equal(model.project.has.motion, true);
});

test("what did not come when the server was there again is asked for until it comes", async (context) => {
  hurry(context);
  const { model, answer, fail, hear } = await createTrial(),
    done = [];
  model.listen(async () => done.push("jobs"));
  model.disconnected();
  await hear("open");
  await fail("state");
  assert.deepEqual([model.saving.status, done], ["unsaved", []]);
  await rest();
  await answer("state", { revision: 0, marks: {}, nearer: {} });
  await answer("project", withMotion());
  assert.deepEqual([model.saving.status, done], ["saved", ["jobs"]]);
  assert.equal(model.project.has.motion, true);
});

test("a project that could not be read at the end of work is read as soon as it can be", async (context) => {
  hurry(context);
  const { model, answer, fail, hear } = await createTrial();
  model.listen(async () => {});
  await hear("message", { project: true });
  await fail("project");
  await rest();
  await answer("state", { revision: 0, marks: {}, nearer: {} });
  await answer("project", withMotion());
  assert.deepEqual([model.saving.status, model.project.has.motion], ["saved", true]);
});

const change = (to) => [{ kind: "mark", frame: 3, joint: "neck", from: null, to }];

test("news that is older than an answer leaves what the answer said", async () => {
  const { model, answer, hear } = await createTrial();
  model.listen(async () => {});
  const undone = model.undo();
  await answer("undo", { revision: 2, undo: 0, redo: 1, changes: change(null) });
  await undone;
  await hear("message", { revision: 1, undo: 1, redo: 0, edits: [{ id: "x", revision: 1, changes: change([1, 1, 2]) }] });
  assert.deepEqual([model.marks(3), model.state.revision, model.state.undo], [{}, 2, 0]);
  await hear("message", { revision: 3, undo: 1, redo: 0, edits: [{ id: "y", revision: 3, changes: change([4, 4, 2]) }] });
  assert.deepEqual([model.marks(3), model.state.undo], [{ neck: [4, 4, 2] }, 1]);
});

test("marks that come from outside for a frame in no list have the project read again", async () => {
  const { model, answer, hear, waits } = await createTrial();
  model.listen(async () => {});
  const news = (revision, to) => ({ revision, edits: [{ id: `x${revision}`, revision, changes: change(to) }] });
  await hear("message", news(1, [1, 1, 2]));
  assert.equal(waits("project"), 1);
  await answer("project", { ...PROJECT, keyframes: [{ frame: 3, half: "upper" }] });
  await hear("message", news(2, [2, 2, 2]));
  assert.equal(waits("project"), 0);
  assert.deepEqual(model.keyframes().map(({ frame }) => frame), [3]);
});

test("a joint that is moved before an undo of it is answered is moved from where the undo left it", async () => {
  const { model, answer, asked } = await createTrial();
  model.edit(placeJoint(model.state, 3, "neck", [1, 1, 2]));
  await answer("edits", { revision: 1, results: [{ ok: true }] });
  const undone = model.undo();
  model.edit(placeJoint(model.state, 3, "neck", [7, 7, 2]));
  model.edit(placeJoint(model.state, 3, "neck", [8, 8, 2]));
  await answer("undo", { revision: 2, undo: 0, redo: 1, changes: [{ ...change(null)[0], from: [1, 1, 2] }] });
  await undone;
  const { edits } = asked.find(({ path }) => path === "edits").body;
  assert.deepEqual(
    edits.map(({ from, to }) => [from, to]),
    [
      [null, [7, 7, 2]],
      [[7, 7, 2], [8, 8, 2]],
    ],
  );
  assert.deepEqual(model.marks(3), { neck: [8, 8, 2] });
});

test("after a lost answer the page shows what another page has made of its mark since", async (context) => {
  hurry(context);
  const { model, answer, fail, hear, waits } = await createTrial();
  model.listen(async () => {});
  model.edit(placeJoint(model.state, 3, "neck", [1, 1, 2]));
  await fail("edits"); // it was accepted all the same, as revision 1
  await hear("message", { revision: 2, edits: [{ id: "y", revision: 2, changes: change([9, 9, 2]) }] });
  while (!waits("edits")) await rest();
  await answer("edits", { revision: 2, results: [{ ok: true, known: true }] });
  assert.equal(waits("state"), 1);
  await answer("state", { revision: 2, marks: { 3: { neck: [9, 9, 2] } }, nearer: {} });
  assert.deepEqual(model.marks(3), { neck: [9, 9, 2] });
});

test("an own version that is wanted before that of another page is here is made on that of the other", async () => {
  const { model, answer, asked } = await createTrial();
  model.edit(placeJoint(model.state, 3, "neck", [1, 1, 2]));
  await answer("edits", { revision: 4, results: [{ ok: false, status: 409, current: {} }] });
  model.notice.offer.act();
  await answer("state", { revision: 4, marks: { 3: { neck: [9, 9, 2] } }, nearer: {} });
  const [{ from, to }] = asked.find(({ path }) => path === "edits").body.edits;
  assert.deepEqual([from, to], [[9, 9, 2], [1, 1, 2]]);
});

test("work begins when all is saved, however long that takes, and not where it cannot be", async (context) => {
  hurry(context);
  const { model, answer, fail, waits } = await createTrial();
  let saved = false;
  model.edit(placeJoint(model.state, 3, "neck", [1, 1, 2]));
  model.whenSaved().then(() => (saved = true));
  for (let n = 0; n < 60; n++) await rest();
  assert.equal(saved, false);
  await answer("edits", { revision: 1, results: [{ ok: true }] });
  assert.equal(saved, true);
  model.edit(placeJoint(model.state, 3, "neck", [2, 2, 2]));
  const refused = assert.rejects(model.whenSaved());
  await fail("edits");
  await refused;
  while (!waits("edits")) await rest(); // it is tried again
  await answer("edits", { revision: 2, results: [{ ok: true }] });
  assert.equal(model.saving.status, "saved");
});

test("a file's trouble that is gone takes no other notice away", async () => {
  const { model, hear } = await createTrial();
  model.listen(async () => {});
  await hear("message", { trouble: "half a file" });
  assert.equal(model.notice.text, "half a file");
  model.notify("Player found in 40 % of the frames.");
  await hear("message", { trouble: null });
  assert.match(model.notice.text, /40 %/);
  model.notify(null);
});

test("why an edit was not taken, and what is wrong with a file, stays until it is closed", async (context) => {
  hurry(context);
  const { model, answer, hear } = await createTrial();
  model.edit(placeJoint(model.state, 3, "neck", [1, 1, 2]));
  await answer("edits", { revision: 1, results: [{ ok: false, status: 400, error: "Frame 3 is outside." }] });
  await rest();
  assert.match(model.notice.text, /Frame 3 is outside/);
  model.listen(async () => {});
  await hear("message", { trouble: "half a file" });
  await rest();
  assert.equal(model.notice.text, "half a file");
  await hear("message", { trouble: null });
  assert.equal(model.notice.text, null);
});

test("a pose that did not come is asked for again when the server is back", async (context) => {
  hurry(context);
  const { model, answer, fail, hear, waits } = await createTrial();
  model.listen(async () => {});
  model.ui.frame = 3;
  model.poses.refresh();
  await fail("pose");
  assert.equal(model.poses.refresh(), null);
  await hear("open");
  await answer("state", { revision: 0, marks: {}, nearer: {} });
  assert.notEqual(model.poses.refresh(), null);
  assert.equal(waits("pose"), 1);
});

test("a pose and a suggestion are asked for again once there is more to make them from", async () => {
  const { model, answer, waits } = await createTrial();
  model.ui.frame = 3;
  model.poses.refresh();
  await answer("pose", {});
  assert.equal(model.poses.refresh(), null);
  model.readProject();
  await answer("project", PROJECT);
  assert.notEqual(model.poses.refresh(), null);
  assert.deepEqual([waits("pose"), waits("suggestion/3")], [1, 1]);
});

test("a stretch of the motion that does not come is not asked for without a pause", async () => {
  let asked = 0,
    ended = false;
  globalThis.fetch = async () => {
    asked += 1;
    throw new TypeError("Failed to fetch");
  };
  const motion = createMotionCache({ joints: ["neck"], n_frames: 3 }, () => ended || motion.points(0, "points3d"));
  motion.points(0, "points3d");
  for (let n = 0; n < 10; n++) await rest();
  assert.equal(asked, 1);
  ended = true;
});

test("what is to be kept is not saved before it was answered", async () => {
  const { keep } = oneByOne(() => {}, () => {});
  let release = null;
  keep(() => new Promise((_, fail) => (release = fail)));
  await rest();
  assert.equal(isKeeping(), true);
  release(new Error("no"));
  await rest();
  assert.equal(isKeeping(), false);
});

test("requests go one after the other, and an answer that a later one will overtake is left", async () => {
  const taken = [],
    failures = [],
    release = [];
  const { ask } = oneByOne((answer) => taken.push(answer), ({ message }) => failures.push(message));
  const request = () => new Promise((done, fail) => release.push([done, fail]));
  ask(request);
  ask(request);
  await rest();
  assert.equal(release.length, 1);
  release[0][0]("first");
  await rest();
  assert.deepEqual(taken, []);
  release[1][1](new Error("no"));
  await rest();
  assert.deepEqual([taken, failures], [["first"], ["no"]]);
});

// The jobs of a page and what is gone to.
async function createWork() {
  const trial = await createTrial(),
    gone = [];
  trial.model.ui.view = "keyframes";
  const jobs = createJobs(trial.model, (view) => gone.push(view));
  trial.model.listen(jobs.refreshJobs);
  return { ...trial, ...jobs, gone };
}
const job = (state, text = "") => ({ id: 7, kind: "run", state, text });

test("work that is asked for twice begins once", async () => {
  const { startJob, waits, answer } = await createWork();
  startJob("run", { height: 1.8 });
  startJob("run", { height: 1.8 });
  await rest();
  assert.equal(waits("jobs"), 1);
  await answer("jobs", { job: job("running") });
  startJob("run", { height: 1.8 });
  await rest();
  assert.equal(waits("jobs"), 1); // asks what is at work
});

test("work that has ended before it is known what is at work is news", async () => {
  const { model, startJob, noteEnds, answer } = await createWork();
  startJob("run");
  await rest();
  await answer("jobs", { job: job("running") });
  await answer("jobs", [job("done", "Player found in 99 % of 100 frames.")]);
  noteEnds();
  assert.match(model.notice.text, /99 %/);
});

test("why work failed stays until it is closed", async (context) => {
  hurry(context);
  const { model, hear, refreshJobs, noteEnds, answer } = await createWork();
  const listed = refreshJobs();
  await answer("jobs", [job("running")]);
  await listed;
  noteEnds();
  await hear("message", { job: job("failed", "No player was found.") });
  noteEnds();
  await rest();
  assert.equal(model.notice.text, "No player was found.");
});

test("news of work that comes after its end does not begin it again, and the end is told once", async () => {
  const { model, hear, refreshJobs, noteEnds, runningJob, answer } = await createWork();
  await hear("message", { job: job("running") });
  const listed = refreshJobs();
  await answer("jobs", [job("failed", "The work failed.")]);
  await listed;
  noteEnds();
  model.notify(null);
  await hear("message", { job: job("running") });
  noteEnds();
  await hear("message", { job: job("failed", "The work failed.") });
  noteEnds();
  assert.deepEqual([model.notice.text, runningJob()], [null, undefined]);
});

for (const [moved, seen] of [
  [null, ["motion"]],
  ["files", []],
])
  test(`work is at work until what it made was read, and leads to it${moved ? ", but nobody away from another page" : ""}`, async () => {
    const { model, hear, refreshJobs, noteEnds, runningJob, answer, gone } = await createWork();
    const listed = refreshJobs();
    await answer("jobs", []);
    await listed;
    await hear("message", { job: job("running") });
    await hear("message", { job: job("done") });
    noteEnds();
    assert.equal(runningJob().id, 7);
    if (moved) model.ui.view = moved;
    await answer("project", withMotion());
    assert.equal(runningJob(), undefined);
    assert.deepEqual(gone, seen);
  });
