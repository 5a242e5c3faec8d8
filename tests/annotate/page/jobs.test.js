// What the page knows of long work, whichever of answers and news comes first.
import assert from "node:assert/strict";
import { test } from "node:test";
import { noteJob } from "../../../keyrecon/annotate/page/state/model.js";
import { createJobs } from "../../../keyrecon/annotate/page/views/shell.js";

// Jobs of a page whose server answers `listed` once `arrive()` is called; `said` are its notices.
function createTrial() {
  const trial = { said: [], jobs: new Map() };
  globalThis.fetch = () =>
    new Promise((done) => {
      trial.arrive = (listed) => done({ ok: true, status: 200, json: async () => listed });
    });
  const model = {
    jobs: trial.jobs,
    noteJob: (job) => noteJob(trial.jobs, job),
    redraw() {},
    notify: (text) => trial.said.push(text),
    readProject: async () => {},
  };
  return { ...createJobs(model), trial };
}

test("work that has begun since the server was asked is not taken for broken off", async () => {
  const { refreshJobs, noteEnds, runningJob, trial } = createTrial();
  const answer = refreshJobs();
  trial.jobs.set(7, { id: 7, kind: "run", state: "running" });
  trial.arrive([]);
  await answer;
  noteEnds();
  assert.equal(runningJob().id, 7);
  assert.deepEqual(trial.said, []);
});

test("work that a server started anew does not know has broken off, and that is told once", async () => {
  const { refreshJobs, noteEnds, runningJob, trial } = createTrial();
  trial.jobs.set(7, { id: 7, kind: "run", state: "running" });
  const answer = refreshJobs();
  trial.arrive([]);
  await answer;
  noteEnds();
  noteEnds();
  assert.equal(runningJob(), undefined);
  assert.equal(trial.said.length, 1);
});

test("an older answer does not begin again what has ended", async () => {
  const { refreshJobs, runningJob, trial } = createTrial();
  const answer = refreshJobs();
  trial.jobs.set(7, { id: 7, kind: "run", state: "done" });
  trial.arrive([{ id: 7, kind: "run", state: "running" }]);
  await answer;
  assert.equal(runningJob(), undefined);
});
