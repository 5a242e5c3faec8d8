// What all parts of the page look at: the project, the marks, and what the person is doing.
// Changing anything asks every part that is drawn to draw itself once, in the next picture.
import * as api from "./api.js";
import { createOutbox, keptEdits } from "./outbox.js";
import { apply, emptyState, fromCell, marksOf, nearerOf, slots } from "./state.js";
import { inverse, newId, rebased } from "./edits.js";
import { allKeyframes, isDone, sidesOf } from "./guide.js";

const READ = 10000; // ms that a notice is shown
const REST = 800; // ms without an edit after which what follows from edits is asked anew

export async function createModel() {
  const model = {
    project: await api.read("project"),
    state: emptyState(),
    doing: { view: null, frame: null, look: 0, joint: null, under: null, held: null },
    saving: { status: "saved", waiting: 0 },
    notice: null,
  };
  const drawers = [],
    settled = [],
    readers = [],
    sent = new Set(),
    takenBack = new Set();
  let asked = false,
    settling = null,
    hiding = null;

  // A hidden page gets no animation frames; it is drawn when it is shown.
  model.changed = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      for (const draw of drawers) draw();
    });
  };
  model.onDraw = (draw) => drawers.push(draw);
  // After edits have come to rest and are on disk: what is computed from them is asked anew.
  model.onSettled = (react) => settled.push(react);
  model.settle = () => {
    clearTimeout(settling);
    settling = setTimeout(() => settled.forEach((react) => react()), REST);
  };

  model.onProject = (react) => readers.push(react);
  model.readProject = async () => {
    model.project = await api.read("project");
    readers.forEach((react) => react());
    model.changed();
  };
  model.sides = sidesOf(model.project);

  const outbox = createOutbox({
    send: (edits) => api.send("edits", { edits }),
    kept: keptEdits(localStorage, model.project.id),
    status(status, waiting, why) {
      model.saving = { status, waiting, why };
      model.changed();
    },
    answered,
    refused(edit, message) {
      model.tell(`One edit was refused: ${message}`);
      model.readState();
    },
  });

  model.readState = async () => {
    const fresh = await api.read("state");
    model.state = outbox.waiting().reduce(apply, { ...emptyState(), ...fresh });
    model.changed();
  };

  model.edit = (edit) => {
    if (!edit) return;
    sent.add(edit.id);
    model.state = apply(model.state, edit);
    outbox.add(edit);
    model.changed();
  };

  function answered({ revision, results, undo, redo }, batch) {
    model.state = {
      ...model.state,
      revision,
      undo: undo ?? model.state.undo + batch.length,
      redo: redo ?? 0,
    };
    const failed = results
      .map((result, n) => ({ ...result, edit: batch[n] }))
      .filter(({ ok }) => !ok);
    if (failed.length) yieldTo(failed);
    model.settle();
  }

  // Somebody else was faster, or the server does not take it: its version stays, ours is one click away.
  async function yieldTo(failed) {
    await model.readState();
    const { edit, error } = failed.at(-1);
    if (error) model.tell(`Not taken: ${error}`);
    else {
      model.tell("Another page changed the same place; its version was kept.", {
        text: "Use mine",
        act: () => model.edit(rebased(model.state, edit)),
      });
    }
  }

  model.tell = (text, offer = null) => {
    model.notice = { text, offer };
    clearTimeout(hiding);
    if (text && !offer) hiding = setTimeout(model.tell, READ, null);
    model.changed();
  };

  // What the server tells: cells that changed. What we are about to say on the same place is settled
  // by its answer.
  function takeIn({ revision, undo, redo }, changes) {
    const ours = new Set(outbox.waiting().flatMap(slots));
    const free = changes
      .map(fromCell)
      .filter((cell) => !slots(cell).some((slot) => ours.has(slot)));
    const counts = undo === undefined ? {} : { undo, redo };
    model.state = { ...free.reduce(apply, model.state), revision, ...counts };
    model.changed();
    model.settle();
  }

  function takeBack(edit) {
    const back = inverse(edit);
    takenBack.add(edit.id).add(back.id);
    model.edit(back);
    return edit;
  }

  // Undo belongs to the server, so that it survives a restart; while it is gone, edits that wait for it
  // are taken back here.
  async function step(direction) {
    if (direction === "undo" && !(await outbox.drained())) {
      const last = outbox.waiting().findLast(({ id }) => !takenBack.has(id));
      if (last) return takeBack(last);
    }
    const id = newId();
    sent.add(id);
    const { changes, ...told } = await api.send(direction, { id });
    takeIn(told, changes);
    return changes.length ? fromCell(changes[0]) : null;
  }
  model.undo = () => step("undo");
  model.redo = () => step("redo");

  model.jobs = new Map();
  model.listen = () =>
    api.listen({
      opened: () =>
        model
          .readState()
          .then(() => outbox.found())
          .catch((fault) => outbox.lost(fault)),
      closed: () => outbox.lost(),
      news({ job, project, trouble, ...told }) {
        if (job) model.jobs.set(job.id, job);
        if (project) model.readProject().catch((fault) => outbox.lost(fault));
        if (trouble !== undefined) model.tell(trouble);
        const others = told.edits?.filter(({ id }) => !sent.has(id));
        if (others?.length)
          takeIn(
            told,
            others.flatMap(({ changes }) => changes),
          );
        model.changed();
      },
    });

  model.marks = (frame = model.doing.frame) => marksOf(model.state, frame);
  model.nearer = (frame = model.doing.frame) => nearerOf(model.state, frame);
  model.keyframes = () => allKeyframes(model.project, model.state);
  model.keyframe = () => model.keyframes().find(({ frame }) => frame === model.doing.frame);
  model.done = (keyframe) => isDone(model.project, keyframe, marksOf(model.state, keyframe.frame));
  model.do = (changes) => {
    Object.assign(model.doing, changes);
    model.changed();
  };
  return model;
}
