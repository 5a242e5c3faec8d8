// Edits on their way to the server: none is lost, none is sent in another order.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Gone, latestOnly } from "../../../keyrecon/annotate/page/state/api.js";
import { createOutbox, pendingEdits } from "../../../keyrecon/annotate/page/state/outbox.js";

// What a browser keeps, as far as it is used; its keys are properties, as in a browser.
function createStorage() {
  const storage = {};
  const hidden = (value) => ({ value, enumerable: false, configurable: true });
  Object.defineProperties(storage, {
    setItem: hidden((key, text) => {
      storage[key] = text;
    }),
    getItem: hidden((key) => storage[key]),
    removeItem: hidden((key) => delete storage[key]),
  });
  return storage;
}

// Until all that could go on has gone on.
const rest = () => new Promise((done) => setTimeout(done));

// An outbox whose server answers as `answer(edits)` does; retries wait until `retry()`.
function createTrial(answer, storage = createStorage(), delivered = () => {}) {
  const trial = { storage, sent: [], statuses: [], rejected: [], faults: [], timers: [] };
  trial.outbox = createOutbox({
    async send(edits) {
      trial.sent.push(edits.map(({ id }) => id));
      return answer(edits);
    },
    pending: pendingEdits(storage, "p"),
    status: (...status) => trial.statuses.push(status),
    delivered,
    rejected: (edit, why) => trial.rejected.push([edit.id, why]),
    stumbled: (fault) => trial.faults.push(fault.message),
    wait: (work) => trial.timers.push(work),
  });
  trial.retry = async () => {
    trial.timers.splice(0).forEach((work) => work());
    await rest();
  };
  return trial;
}

const edit = (id) => ({ id, kind: "mark" });

test("edits reach the server in order and are then forgotten", async () => {
  const trial = createTrial(() => ({}));
  for (const id of ["a", "b", "c"]) trial.outbox.add(edit(id));
  await rest();
  assert.deepEqual(trial.sent.flat(), ["a", "b", "c"]);
  assert.deepEqual(Object.keys(trial.storage), []);
  assert.deepEqual(trial.statuses.at(-1).slice(0, 2), ["saved", 0]);
});

test("an edit that the browser has no room to keep is sent all the same, and the fault is told", async () => {
  const trial = createTrial(() => ({}));
  const full = () => {
    throw new RangeError("full");
  };
  Object.defineProperty(trial.storage, "setItem", { value: full });
  assert.throws(() => trial.outbox.add(edit("a")), /full/);
  await rest();
  assert.deepEqual(trial.sent, [["a"]]);
  assert.deepEqual(trial.outbox.waiting(), []);
});

test("a fault of the page with an answer neither loses what waits nor takes back what is saved", async () => {
  const trial = createTrial(() => ({}), createStorage(), () => {
    if (trial.sent.length === 1) throw new TypeError("a fault");
  });
  trial.outbox.add(edit("a"));
  trial.outbox.add(edit("b"));
  const turn = trial.outbox.inTurn(async () => trial.sent.flat());
  assert.deepEqual(await turn, ["a", "b"]);
  await rest();
  assert.deepEqual([trial.rejected, trial.faults], [[], ["a fault"]]);
  assert.deepEqual(Object.keys(trial.storage), []);
});

test("while the server is gone edits are kept and tried again", async () => {
  let gone = true;
  const trial = createTrial(() => {
    if (gone) throw new Gone("disk full");
    return {};
  });
  trial.outbox.add(edit("a"));
  trial.outbox.add(edit("b"));
  await rest();
  assert.deepEqual(trial.statuses.at(-1), ["unsaved", 2, "disk full"]);
  await assert.rejects(trial.outbox.inTurn(async () => "done"), Gone);
  gone = false;
  await trial.retry();
  assert.deepEqual(trial.outbox.waiting(), []);
  assert.deepEqual(trial.sent, [["a"], ["a", "b"]]);
});

test("what waits for its turn comes after earlier edits and before later ones", async () => {
  const trial = createTrial(() => ({}));
  trial.outbox.add(edit("a"));
  trial.outbox.add(edit("b"));
  const answer = trial.outbox.inTurn(async () => trial.sent.flat());
  trial.outbox.add(edit("c"));
  assert.deepEqual(await answer, ["a", "b"]);
  await rest();
  assert.deepEqual(trial.sent.flat(), ["a", "b", "c"]);
});

test("edits kept by a page that was closed are sent by the next one, oldest first", async () => {
  const closed = createTrial(() => {
    throw new Gone("");
  });
  for (const id of ["b", "a"]) closed.outbox.add(edit(id));
  await rest();
  const next = createTrial(() => ({}), closed.storage);
  assert.deepEqual(next.outbox.waiting().map(({ id }) => id), ["b", "a"]);
  next.outbox.reconnected();
  await rest();
  assert.deepEqual(next.sent, [["b", "a"]]);
});

test("a page that opens with kept edits never says that all is saved before it is", () => {
  const first = createTrial(() => {
    throw new Gone("away");
  });
  first.outbox.add(edit("a"));
  const next = createTrial(() => ({}), first.storage);
  assert.deepEqual(next.statuses, [["saving", 1]]);
});

test("one edit that the server never takes holds up no other", async () => {
  const trial = createTrial((edits) => {
    if (edits.some(({ id }) => id === "bad")) throw new Error("no such joint");
    return {};
  });
  trial.outbox.disconnected();
  for (const id of ["a", "bad", "c"]) trial.outbox.add(edit(id));
  await rest();
  await rest();
  assert.deepEqual(trial.rejected, [["bad", "no such joint"]]);
  assert.deepEqual(trial.outbox.waiting(), []);
  assert.ok(trial.sent.flat().includes("c"));
});

test("edits that the server takes only one by one are sent after a failed try, too", async () => {
  let gone = true;
  const trial = createTrial((edits) => {
    if (gone) throw new Gone("away");
    if (edits.length > 1) throw new Error("no such joint");
    return {};
  });
  for (const id of ["a", "b", "c"]) trial.outbox.add(edit(id));
  await rest();
  gone = false;
  await trial.retry();
  await rest();
  assert.deepEqual(trial.outbox.waiting(), []);
  assert.deepEqual(trial.statuses.at(-1).slice(0, 2), ["saved", 0]);
});

test("another project's edits are left alone", () => {
  const storage = createStorage();
  pendingEdits(storage, "other").keep(edit("x"));
  pendingEdits(storage, "p").keep(edit("y"));
  assert.deepEqual(pendingEdits(storage, "p").all(), [edit("y")]);
});

test("of requests that wait only the newest is made", async () => {
  const made = [],
    release = [];
  const request = latestOnly(
    (n) => {
      made.push(n);
      return new Promise((done) => release.push(done));
    },
    () => {},
  );
  const done = [1, 2, 3].map((n) => request(n)).at(-1);
  release[0]();
  await rest();
  release[1]();
  await done;
  assert.deepEqual(made, [1, 3]);
});

test("a server that is gone is no answer, one that refuses is", async () => {
  const failures = [];
  const request = latestOnly(
    async (fault) => {
      throw fault;
    },
    (fault) => failures.push(fault.message),
  );
  await request(new Gone("gone"));
  await request(new Error("too few picks"));
  assert.deepEqual(failures, ["too few picks"]);
});
