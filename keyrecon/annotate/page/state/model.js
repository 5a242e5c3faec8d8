// What all views show: the project, the marks, and what the person is doing (`ui`). Changing anything
// asks every view to draw itself once, in the next picture on the screen.
import * as api from "./api.js";
import {
  apply,
  cellsOf,
  describeRefused,
  editFromChange,
  emptyState,
  inverse,
  madeAfter,
  marksOf,
  nearerOf,
  newId,
  rebased,
  same,
  together,
} from "./edits.js";
import { describeFault } from "./faults.js";
import { createOutbox, pendingEdits } from "./outbox.js";
import { createPoses } from "./poses.js";
import { allKeyframes, isDone, isMarked, sidesOf } from "./workflow.js";

const NOTICE_MS = 10000; // that a notice is shown
const AGAIN_MS = 2000; // after which what did not come is asked for again
const IDLE_MS = 800; // without an edit, after which what is computed from edits is asked for anew

// An offer of nothing: the notice stays until it is closed, as somebody has to look at a frame, a mark, a
// shot or a file.
export const KEPT = {};

// An end is an end, whichever of news and answers comes first.
export function noteJob(jobs, job) {
  if ((jobs.get(job.id)?.state ?? "running") === "running") jobs.set(job.id, job);
}

export async function createModel() {
  const model = {
    project: await api.read("project"),
    state: emptyState(),
    // offset: frames from the keyframe; hovered: {joint} or {limb}; dragged: {joint, at, floating}
    ui: { view: null, frame: null, offset: 0, joint: null, hovered: null, dragged: null },
    saving: { status: "saved", waiting: 0 },
    notice: null,
    jobs: new Map(),
    swing: null, // of a golf swing: what the server says of clicks and fit
    checks: [], // marks that look wrong
    stretches: [], // where the program is least sure of itself: {first, last, text, frame, half}
  };
  const drawers = [],
    idleListeners = [],
    projectListeners = [],
    sent = new Set(),
    takenBack = new Set();
  let drawing = false,
    idleTimer = null,
    noticeTimer = null;

  // A hidden page gets no animation frames; it is drawn when it is shown.
  model.redraw = () => {
    if (drawing) return;
    drawing = true;
    requestAnimationFrame(() => {
      drawing = false;
      for (const draw of drawers) draw();
    });
  };
  model.onDraw = (draw) => drawers.push(draw);
  // Called when edits have come to rest and are on disk.
  model.onIdle = (react) => idleListeners.push(react);
  function edited() {
    clearTimeout(idleTimer);
    idleTimer = setTimeout(() => idleListeners.forEach((react) => react()), IDLE_MS);
  }

  model.onProject = (react) => projectListeners.push(react);
  // Answers may overtake one another: what was asked for last counts.
  let asked = 0,
    projectOf = 0, // number of the question of which the project is
    runOf = 0;
  // Done when the swing that belongs to the project is here, too.
  model.readProject = async () => {
    const number = ++asked,
      fresh = await api.read("project");
    if (number < projectOf) return;
    projectOf = number;
    model.project = number < runOf ? { ...fresh, run: model.project.run } : fresh;
    projectListeners.forEach((react) => react());
    model.redraw();
    await model.readSwing();
  };
  model.sides = sidesOf(model.project);

  const outbox = createOutbox({
    send: (edits) => api.send("edits", { edits }),
    pending: pendingEdits(localStorage, model.project.id),
    status(status, waiting, why) {
      model.saving = { status, waiting, why };
      model.redraw();
    },
    delivered,
    rejected: (edit, error) => yieldTo([{ edit, error }]),
    stumbled: (fault) => model.notify(describeFault(fault)),
  });

  // An answer that edits or news have overtaken is read again.
  async function readNewest() {
    const before = model.state.revision,
      fresh = await api.read("state");
    return model.state.revision > Math.max(before, fresh.revision) ? readNewest() : fresh;
  }
  model.readState = async () => {
    const fresh = await readNewest();
    if (!same([fresh.marks, fresh.nearer], [model.state.marks, model.state.nearer])) marksRevision = fresh.revision;
    changedAt.clear();
    readAt = fresh.revision;
    model.state = outbox.waiting().reduce(apply, { ...emptyState(), ...fresh });
    model.redraw();
  };

  // Whether the motion was made from the marks as they are, when edits have come to rest: what was
  // taken back may be what it was made from.
  const readRun = api.latestOnly(
    async () => {
      const number = ++asked,
        run = await api.read("run");
      if (number < projectOf) return;
      runOf = number;
      model.project = { ...model.project, run };
      model.redraw();
    },
    (fault) => model.notify(fault.message),
  );
  model.onIdle(() => model.project.has.motion && readRun());

  // What the server says of a golf swing, when edits have come to rest and after a fit.
  const readSwing = api.latestOnly(
    async () => {
      const { revision } = model.state;
      model.swing = { ...(await api.read("swing")), revision };
      model.redraw();
    },
    (fault) => model.notify(fault.message),
  );
  model.readSwing = () => (model.project.golf ? readSwing() : null);
  model.onIdle(model.readSwing);
  // Whether the fit knows all that is marked at this moment.
  model.swingIsFresh = () =>
    Boolean(model.swing?.fresh) && model.swing.revision === model.state.revision && !outbox.waiting().length;

  model.edit = (edit) => {
    if (!edit) return;
    forgetEdit();
    sent.add(edit.id);
    model.state = apply(model.state, edit);
    outbox.add(edit);
    model.redraw();
  };

  let marksRevision = 0; // of the last change of a mark, or of the depth of a limb, that is known
  function noteMarks(revision, edits) {
    if (edits.flatMap(cellsOf).some((cell) => /^(marks|nearer)[/]/.test(cell))) marksRevision = revision;
  }
  // Whether the marks are still those of a revision.
  model.marksAreOf = (revision) => marksRevision <= revision;

  // News of changes may come after answers that are newer: of each cell the last change counts.
  const changedAt = new Map(); // cell -> revision of the last change of it that is known
  let readAt = 0; // revision of the state that was read last
  const isNew = (revision, edit) =>
    cellsOf(edit).every((cell) => revision >= (changedAt.get(cell) ?? readAt));
  function noteChanges(revision, edits) {
    for (const cell of edits.flatMap(cellsOf)) changedAt.set(cell, revision);
    noteMarks(revision, edits);
  }
  // How many edits there are, and how many can be taken back, unless more is known already.
  const counted = ({ revision, undo, redo }) =>
    revision < model.state.revision ? {} : { revision, ...(undo === undefined ? {} : { undo, redo }) };

  function delivered({ revision, results, undo, redo }, batch) {
    noteChanges(
      revision,
      batch.filter((_, n) => results[n].ok),
    );
    const counts = { revision, undo: undo ?? model.state.undo + batch.length, redo: redo ?? 0 };
    model.state = { ...model.state, ...counted(counts) };
    const failed = results
      .map((result, n) => ({ ...result, edit: batch[n] }))
      .filter(({ ok }) => !ok);
    if (failed.length) yieldTo(failed);
    else if (results.some(({ known }) => known)) model.readState().catch(model.disconnected);
    edited();
  }

  // Somebody else was faster, or the server does not take it: its version stays, ours is one click away.
  function yieldTo(failed) {
    const { text, overruled } = describeRefused(failed, (below ?? model.notice)?.offer?.overruled),
      read = model.readState().catch(model.disconnected);
    async function act() {
      await read; // they are made on what stands there
      overruled.forEach((edit) => model.edit(rebased(model.state, edit)));
    }
    model.notify(text, overruled.length ? { text: "Use mine", overruled, act } : KEPT);
  }

  // Work begins with what is on the disk; Gone where that may take long.
  model.whenSaved = () =>
    outbox
      .inTurn(async () => {})
      .catch((fault) => {
        if (outbox.waiting().length) throw fault;
      });

  // What a person may want back stays beneath other notices, and is there when they are gone.
  let below = null;
  model.notify = (text, offer = null) => {
    if (model.notice?.offer?.overruled && text) below = model.notice;
    if (offer?.overruled) below = null;
    model.notice = text || !below ? { text, offer, since: performance.now() } : below;
    if (!text) below = null;
    clearTimeout(noticeTimer);
    if (text && !offer) noticeTimer = setTimeout(model.notify, NOTICE_MS, null);
    model.redraw();
  };

  // What is true until the next edit, undo or redo.
  model.notifyOfEdit = (text, offer = null) => {
    model.notify(text, offer);
    model.notice.isOfEdit = true;
  };
  const forgetEdit = () => model.notice?.isOfEdit && model.notify(null);

  // Changes that the server reports; those of cells that an edit of ours still waits for are left to
  // the answer to that edit.
  function merge(counts, entries) {
    const ours = new Set(outbox.waiting().flatMap(cellsOf));
    for (const { revision, changes } of entries) {
      const free = changes
        .map(editFromChange)
        .filter((edit) => isNew(revision, edit) && !cellsOf(edit).some((cell) => ours.has(cell)));
      noteChanges(revision, free);
      model.state = free.reduce(apply, model.state);
    }
    model.state = { ...model.state, ...counted(counts) };
    if (entries.flatMap(({ changes }) => changes).some(isUnlisted)) model.readProject().catch(model.disconnected);
    model.redraw();
    edited();
  }
  // Whether it is a mark of a frame that the project does not list yet.
  const isUnlisted = ({ kind, frame, to }) =>
    kind === "mark" && to && !model.keyframes().some((keyframe) => keyframe.frame === frame);

  function takeBack(edit) {
    const back = inverse(edit);
    takenBack.add(back.id);
    model.edit(back);
    return edit;
  }

  // Undo belongs to the server, so that it survives a restart; while it is gone, edits that wait for it
  // are taken back here. What is undone is the last edit at this moment: later ones are sent after it.
  async function step(direction) {
    forgetEdit();
    const id = newId();
    sent.add(id);
    const last =
      direction === "undo" ? outbox.waiting().findLast((edit) => !takenBack.has(edit.id)) : null;
    if (last) {
      takenBack.add(last.id);
      model.state = apply(model.state, inverse(last)); // edits made meanwhile are made without it
      model.redraw();
    }
    try {
      const { changes, ...counts } = await outbox.inTurn(() => turn(direction, id));
      merge(counts, [{ revision: counts.revision, changes }]);
      const edits = changes.map(editFromChange);
      return edits.length > 1 ? together(edits) : (edits[0] ?? null);
    } catch (fault) {
      if (!last || !(fault instanceof api.Gone)) throw fault;
      return takeBack(last);
    }
  }
  // Edits made meanwhile come after it.
  async function turn(direction, id) {
    const answer = await api.send(direction, { id });
    outbox.amend(madeAfter(model.state, outbox.waiting(), answer.changes.map(editFromChange)));
    return answer;
  }
  model.undo = () => step("undo");
  model.redo = () => step("redo");

  model.noteJob = (job) => noteJob(model.jobs, job);

  // What should have come and did not is asked for again, and with it all that may have been missed;
  // `connected` is done each time that the server answers anew.
  let connected = async () => {},
    missed = null; // timer of the next try
  model.disconnected = (fault) => {
    outbox.disconnected(fault);
    clearTimeout(missed);
    missed = setTimeout(catchUp, AGAIN_MS, true);
  };
  async function catchUp(withProject = false) {
    clearTimeout(missed);
    try {
      await model.readState();
      await connected();
      if (withProject) await model.readProject();
      model.poses.askAgain();
      outbox.reconnected();
      edited();
    } catch (fault) {
      model.disconnected(fault);
    }
  }

  let trouble = null; // with the files of the project, as it was told last
  function tellTrouble(text) {
    if (text || model.notice?.text === trouble) model.notify(text, text && KEPT);
    trouble = text;
  }

  // `files` tells the files of the project from what they were: what changed before the stream was opened is
  // in no news.
  function hear(news) {
    const { job, project, files = model.project.files, edits, ...counts } = news;
    if (job) model.noteJob(job);
    if (project || files !== model.project.files) model.readProject().catch(model.disconnected);
    if (news.trouble !== undefined) tellTrouble(news.trouble);
    const others = edits?.filter(({ id }) => !sent.has(id));
    if (others?.length) merge(counts, others);
    model.redraw();
  }
  model.listen = (work) => {
    connected = work;
    api.listen({ opened: () => catchUp(), closed: () => outbox.disconnected(), news: hear });
  };

  model.marks = (frame = model.ui.frame) => marksOf(model.state, frame);
  model.nearer = (frame = model.ui.frame) => nearerOf(model.state, frame);
  model.keyframes = () => allKeyframes(model.project, model.state);
  model.keyframe = () => model.keyframes().find(({ frame }) => frame === model.ui.frame);
  // Where the player is in a frame, keyframe or not; null while that is not known.
  model.box = (frame) =>
    model.keyframes().find((keyframe) => keyframe.frame === frame)?.box ??
    model.project.boxes?.[frame] ??
    null;
  model.isDone = (keyframe) =>
    isDone(model.project, keyframe, marksOf(model.state, keyframe.frame));
  model.isMarked = (keyframe) =>
    isMarked(model.project, keyframe, marksOf(model.state, keyframe.frame));
  // How far the keyframes are: {all, marked, lacking}, the last marked but for single joints.
  model.progress = () => {
    const all = model.keyframes(),
      marked = all.filter(model.isMarked),
      lacking = marked.filter((keyframe) => !model.isDone(keyframe));
    return { all: all.length, marked: marked.length, lacking: lacking.length };
  };
  // The marks, a joint that is being dragged where the pointer has it: name -> [x, y, v].
  model.placed = () => {
    const marks = { ...model.marks() },
      { dragged } = model.ui;
    if (dragged) marks[dragged.joint] = [...dragged.at, marks[dragged.joint]?.[2] || 2];
    return marks;
  };
  model.update = (changes) => {
    Object.assign(model.ui, changes);
    model.redraw();
  };
  model.poses = createPoses(model);
  return model;
}
