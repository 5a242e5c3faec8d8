// Edits on their way to the server. Each is kept in the browser until the server has answered that it
// is on disk; what is still kept when a page opens is sent again, oldest first. An edit's id makes
// that harmless: the server applies it once.
import { Gone } from "./api.js";

const RETRY_MS = [300, 600, 1200, 2500, 5000]; // before trying again
const BATCH = 200; // edits in one message

// Edits kept in the browser for one project, readable by every page of it.
export function pendingEdits(storage, project) {
  const prefix = `keyrecon/${project}/`;
  let count = 0;
  const keys = () =>
    Object.keys(storage)
      .filter((key) => key.startsWith(prefix))
      .sort();
  return {
    keep(edit) {
      const order = `${String(Date.now()).padStart(15, "0")}-${String(count++).padStart(6, "0")}`;
      storage.setItem(`${prefix}${order}/${edit.id}`, JSON.stringify(edit));
    },
    drop(ids) {
      keys()
        .filter((key) => ids.has(key.split("/").at(-1)))
        .forEach((key) => storage.removeItem(key));
    },
    // Keeps an edit in the place of the one of its id.
    replace(edit) {
      for (const key of keys()) if (key.endsWith(`/${edit.id}`)) storage.setItem(key, JSON.stringify(edit));
    },
    all: () => keys().map((key) => JSON.parse(storage.getItem(key))),
  };
}

// `send` takes edits and resolves to the server's answer. Callbacks: `status` ("saved" |
// "saving" | "unsaved", how many wait, and why), `delivered` (the answer and the edits that were sent),
// `rejected` (an edit that the server will never take, and why), `stumbled` (what `delivered` threw).
export function createOutbox({ send, pending, status, delivered, rejected, stumbled, wait = setTimeout }) {
  const turns = []; // what waits for edits made before it: {ahead: how many, work, giveUp}
  let waiting = pending.all(),
    sending = false,
    failures = 0,
    batchSize = BATCH,
    timer = null,
    offline = false,
    why = "";

  function report() {
    if (failures || (offline && !waiting.length)) status("unsaved", waiting.length, why);
    else status(waiting.length ? "saving" : "saved", waiting.length);
    if (failures || offline) turns.splice(0).forEach(({ giveUp }) => giveUp(new Gone(why)));
  }

  function forget(edits) {
    const ids = new Set(edits.map((edit) => edit.id));
    waiting = waiting.filter((edit) => !ids.has(edit.id));
    for (const turn of turns) turn.ahead -= edits.length;
    pending.drop(ids);
  }

  async function flush() {
    if (sending) return;
    if (turns[0]?.ahead === 0) await takeTurn();
    else if (waiting.length) await sendBatch();
    else return;
    if (!failures) flush();
  }

  async function takeTurn() {
    sending = true;
    await turns.shift().work();
    sending = false;
  }

  async function sendBatch() {
    sending = true;
    const batch = waiting.slice(0, Math.min(batchSize, turns[0]?.ahead ?? batchSize));
    let answer = null;
    try {
      answer = await send(batch);
    } catch (fault) {
      if (fault instanceof Gone) retry(fault);
      else reject(batch, fault);
    }
    try {
      if (answer) take(answer, batch);
    } catch (fault) {
      stumbled(fault); // the edits are on the disk; those behind them go on
    } finally {
      sending = false;
      report();
    }
  }

  function take(answer, batch) {
    failures = 0;
    offline = false;
    batchSize = BATCH;
    forget(batch);
    delivered(answer, batch);
  }

  function retry(fault) {
    why = fault.message;
    timer = wait(flush, RETRY_MS[Math.min(failures, RETRY_MS.length - 1)]);
    failures += 1;
  }

  // One bad edit must not hold up the good ones: they go one by one until it is found.
  function reject(batch, fault) {
    failures = 0;
    batchSize = 1;
    if (batch.length > 1) return;
    forget(batch);
    rejected(batch[0], fault.message);
  }

  if (waiting.length) report(); // what an earlier page kept is not saved yet

  return {
    add(edit) {
      try {
        pending.keep(edit); // a browser that is full throws
      } finally {
        waiting.push(edit);
        report();
        if (!failures) flush();
      }
    },
    disconnected(fault) {
      offline = true;
      why = fault?.message ?? "";
      report();
    },
    reconnected() {
      // the server answers again
      clearTimeout(timer);
      offline = false;
      failures = 0;
      report();
      flush();
    },
    waiting: () => waiting,
    // Edits that wait, by id, as they are to be sent instead.
    amend(edits) {
      const byId = new Map(edits.map((edit) => [edit.id, edit]));
      waiting = waiting.map((edit) => byId.get(edit.id) ?? edit);
      edits.forEach(pending.replace);
    },
    // The answer of `work`, which is done once the edits made so far are on the disk and before any later
    // one is sent; Gone where that may take long.
    inTurn(work) {
      return new Promise((done, giveUp) => {
        turns.push({ ahead: waiting.length, work: () => work().then(done, giveUp), giveUp });
        if (!failures) flush();
        report();
      });
    },
  };
}
