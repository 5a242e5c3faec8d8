// Edits on their way to the server. Each is kept in the browser until the server has answered that it
// is on disk; what is still kept when a page opens is sent again, oldest first. An edit's id makes
// that harmless: the server applies it once.
import { Gone } from "./api.js";

const PATIENCE = [300, 600, 1200, 2500, 5000]; // ms before trying again
const MOST = 200; // edits in one message

// Edits kept in the browser for one project, readable by every page of it.
export function keptEdits(storage, project) {
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
    all: () => keys().map((key) => JSON.parse(storage.getItem(key))),
  };
}

// `send` takes edits and resolves to the server's answer. `status` hears ("saved" | "saving" |
// "unsaved", how many wait, and why), `answered` the answer and the edits that were sent, `refused` an edit
// that the server will never take and why.
export function createOutbox({ send, kept, status, answered, refused, wait = setTimeout }) {
  const drains = [];
  let waiting = kept.all(),
    sending = false,
    failures = 0,
    most = MOST,
    timer = null,
    cut = false,
    why = "";

  function tell() {
    if (failures || (cut && !waiting.length)) status("unsaved", waiting.length, why);
    else status(waiting.length ? "saving" : "saved", waiting.length);
    if (!waiting.length || failures || cut)
      drains.splice(0).forEach((done) => done(!waiting.length));
  }

  function forget(edits) {
    const ids = new Set(edits.map((edit) => edit.id));
    waiting = waiting.filter((edit) => !ids.has(edit.id));
    kept.drop(ids);
  }

  async function flush() {
    if (sending || !waiting.length) return;
    sending = true;
    const batch = waiting.slice(0, most);
    try {
      const answer = await send(batch);
      failures = 0;
      cut = false;
      most = MOST;
      forget(batch);
      answered(answer, batch);
    } catch (fault) {
      if (fault instanceof Gone) retry(fault);
      else turnDown(batch, fault);
    } finally {
      sending = false;
      tell();
    }
    if (!failures) flush();
  }

  function retry(fault) {
    why = fault.message;
    timer = wait(flush, PATIENCE[Math.min(failures, PATIENCE.length - 1)]);
    failures += 1;
  }

  // One bad edit must not hold up the good ones: they go one by one until it is found.
  function turnDown(batch, fault) {
    most = 1;
    if (batch.length > 1) return;
    forget(batch);
    refused(batch[0], fault.message);
  }

  return {
    add(edit) {
      kept.keep(edit);
      waiting.push(edit);
      tell();
      if (!failures) flush();
    },
    lost(fault) {
      cut = true;
      why = fault?.message ?? "";
      tell();
    },
    found() {
      // the server answers again
      clearTimeout(timer);
      cut = false;
      failures = 0;
      tell();
      flush();
    },
    waiting: () => waiting,
    // True once nothing waits any more, false when that may take long.
    drained() {
      const drained = new Promise((done) => drains.push(done));
      tell();
      return drained;
    },
  };
}
