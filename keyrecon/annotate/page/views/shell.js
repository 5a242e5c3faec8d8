// What surrounds every page: the steps, whether all is saved, notices, long work on the server, and
// the table of keys.
import * as api from "../state/api.js";
import { byId, counted, make, numberIn, setText, toggle } from "./dom.js";
import { KEYS, keyText } from "./keyboard.js";
import { KEPT } from "../state/model.js";
import { CLICKS } from "../state/swing.js";
import { budgetIn, stepsOf } from "../state/workflow.js";

const SAVING = {
  saved: () => "All saved",
  saving: () => "Saving …",
  unsaved: (count) => (count ? `Not saved: ${count} kept in this browser` : "Not connected"),
};
const LASTING = { isRead: true }; // an offer of nothing: the notice stays until it is read
const GOOD_NEWS = /^(Player found in|Note: |Wrote |On the (court|ground): |For a report )/;
const READ_MS = 3000; // after which whoever goes on working has read it
const RESULTS = { follow: "bodies", keyframes: "keyframes", golf: "swing", run: "motion" }; // where they are seen
const TITLES = { any: "Everywhere", keyframes: "Keyframes", address: "Address", swing: "Swing", bodies: "Body", pick: "Colours", motion: "Motion", files: "Files", court: "Court", ground: "Ground" };

function keyElements(keys) {
  const shortened = keys.length > 4 ? [keys[0], keys.at(-1)] : keys;
  return shortened.flatMap((key, n) => [
    ...(n && keys.length > 4 ? ["–"] : []),
    make("kbd", {}, keyText(key)),
  ]);
}

function keysTable(project) {
  const shown = new Set(["any", ...stepsOf(project), project.golf ? "keyframes" : "pick"]);
  const tables = [...shown].map((page) => [page, KEYS[page]]);
  const parts = tables.map(([page, rows]) =>
    make(
      "section",
      {},
      make("h2", {}, TITLES[page]),
      make(
        "dl",
        {},
        ...rows.flatMap(([keys, what]) => [
          make("dt", {}, ...keyElements(keys)),
          make("dd", {}, what),
        ]),
      ),
    ),
  );
  const pointer = make(
    "section",
    {},
    make("h2", {}, "Pointer"),
    make(
      "dl",
      {},
      ...[
        ["click", "place the joint that is asked for; else select a joint, turn a limb"],
        ["Shift click", "place it as hidden"],
        ["drag", "move a joint, or the picture"],
        ["wheel", "zoom at the pointer"],
        ["over a joint or limb", "the keys V, F, R and Del mean what is under the pointer"],
      ].flatMap(([what, does]) => [make("dt", {}, what), make("dd", {}, does)]),
    ),
  );
  return [parts[0], pointer, ...parts.slice(1)];
}

export function createShell(model, go) {
  const jobs = createJobs(model, go);
  document
    .querySelectorAll("[data-go]")
    .forEach((button) => button.addEventListener("click", () => go(button.dataset.go)));
  const keys = byId("keys-panel");
  keys.append(
    make(
      "form",
      { method: "dialog" },
      make("button", { className: "plain close", "aria-label": "Close" }, "✕"),
    ),
    make("div", { className: "keys" }, ...keysTable(model.project)),
  );
  const help = () => (keys.open ? keys.close() : keys.showModal());
  byId("help").addEventListener("click", help);
  for (const panel of document.querySelectorAll("dialog")) {
    panel.addEventListener("click", (event) => event.target === panel && panel.close());
  }
  byId("notice-close").addEventListener("click", () => model.notify(null));
  for (const kind of ["pointerdown", "keydown"]) document.addEventListener(kind, leaveRead, true);
  byId("notice-offer").addEventListener("click", () => {
    const { offer } = model.notice;
    model.notify(null);
    offer.act();
  });
  byId("job-cancel").addEventListener("click", () => {
    const job = jobs.runningJob();
    if (job?.state === "running") api.remove(`jobs/${job.id}`).catch((fault) => model.notify(fault.message));
  });
  addEventListener("beforeunload", (event) => {
    if (model.saving.status !== "saved" || api.isKeeping()) event.preventDefault();
  });

  function drawJob() {
    const job = jobs.runningJob();
    byId("job").hidden = job?.state !== "running";
    if (byId("job").hidden) return;
    setText(byId("job-text"), job.text || "Starting");
    if (job.total) byId("job-progress").value = job.done / job.total;
    else byId("job-progress").removeAttribute("value");
  }

  // What long work ended with stays until it is closed, or until somebody who had the time to read
  // it goes on.
  function leaveRead(event) {
    const { offer, since } = model.notice ?? {};
    const here = event.target instanceof Node && byId("notice").contains(event.target);
    if (offer?.isRead && !here && performance.now() - since > READ_MS) model.notify(null);
  }

  // A notice lies over what is looked at, so that it covers no control; a page without a picture makes room.
  function drawNotice() {
    const { text, offer } = model.notice ?? {},
      page = byId(model.ui.view),
      over = page.querySelector(page.dataset.stage ? ".figure" : ".viewer") ?? document.body;
    if (byId("notice").parentElement !== over) over.append(byId("notice"));
    byId("notice").hidden = !text;
    toggle(byId("notice"), "passing", !offer);
    setText(byId("notice-text"), text ?? "");
    byId("notice-offer").hidden = !offer?.text;
    setText(byId("notice-offer"), offer?.text ?? "");
  }

  // How far each step is; bodies that are marked before there are keyframes belong to the first.
  function drawCounts() {
    const { has } = model.project,
      { all, marked, lacking } = model.progress(),
      done = has.keyframes ? marked : marked - lacking,
      counts = all ? `${done} of ${all}` : "",
      picked = model.state.picks.length;
    setText(byId("pick-count"), picked ? counted(picked, "click") : "");
    setText(byId("body-count"), has.keyframes ? "" : counts);
    setText(byId("done-count"), has.keyframes ? counts : "");
    setText(byId("motion-state"), has.motion ? "made" : "");
    const clicked = CLICKS.filter((joint) => model.state.clicks[joint]).length;
    setText(byId("address-count"), clicked ? `${clicked} of ${CLICKS.length}` : "");
    setText(byId("swing-state"), model.swing?.keys ? (model.swing.doubts.length ? "doubtful" : "found") : "");
  }

  function draw() {
    const { waiting, why } = model.saving,
      status = model.saving.status === "saved" && api.isKeeping() ? "saving" : model.saving.status,
      { undo, redo } = model.state;
    const { view } = model.ui;
    document.body.dataset.view = view;
    document.body.inert = false; // it was from the start: before the project is read there is nothing to act on
    for (const page of document.querySelectorAll("main")) page.hidden = page.id !== view;
    document.querySelectorAll("nav [data-go]").forEach((button) => {
      const beginning = view === "pick" || (view === "keyframes" && !model.project.has.keyframes),
        own = button.dataset.go === (beginning ? (model.project.golf ? "swing" : "bodies") : view),
        number = stepsOf(model.project).indexOf(button.dataset.go) + 1;
      button.hidden = !number;
      setText(button.querySelector("b"), String(number));
      button.setAttribute("aria-current", own ? "step" : "false");
    });
    setText(byId("project-name"), model.project.name);
    setText(byId("saving"), SAVING[status](waiting));
    byId("saving").dataset.status = status;
    byId("saving").title =
      status === "unsaved"
        ? why || "The server does not answer; is keyrecon annotate still running?"
        : "";
    byId("undo").disabled = !undo && !waiting;
    byId("redo").disabled = !redo;
    drawCounts();
    drawNotice();
    jobs.noteEnds();
    drawJob();
  }

  return { draw, help, ...jobs };
}

// Long work on the server: starting it, and what its end means for the page.
export function createJobs(model, go = () => {}) {
  const isOver = (job) => job !== undefined && job.state !== "running";
  const states = new Map(); // job -> last state that was acted on
  const settling = new Set(); // jobs that are done, and of which what they made was not read yet
  let listed = false, // whether it is known which jobs are older than the page
    beginning = null; // what was asked for and has not begun yet: {what, begun}

  // A second press before the first is answered asks for nothing more.
  function startJob(kind, options = {}) {
    const what = JSON.stringify([kind, options]);
    if (beginning?.what === what) return beginning.begun;
    const begun = begin(kind, options).finally(() => {
      if (beginning?.begun === begun) beginning = null;
    });
    beginning = { what, begun };
    return begun;
  }

  async function begin(kind, options) {
    try {
      await model.whenSaved();
      const { job } = await api.send("jobs", { kind, options });
      states.set(job.id, "running"); // its end is news, however early it comes
      model.noteJob(job);
      await refreshJobs();
    } catch (fault) {
      model.notify(
        fault instanceof api.Gone
          ? fault.message || "The server does not answer; is keyrecon annotate still running?"
          : fault.message,
      );
    }
  }

  // What the server has at work. News of a beginning or an end may be here before an older answer;
  // what was known before, and not to a server that was started anew, has broken off.
  async function refreshJobs() {
    const before = [...model.jobs.values()],
      jobs = await api.read("jobs");
    for (const job of jobs) {
      model.noteJob(job);
      if (!listed && !states.has(job.id)) states.set(job.id, job.state);
    }
    for (const job of before) {
      if (!isOver(model.jobs.get(job.id)) && !jobs.some(({ id }) => id === job.id))
        model.jobs.set(job.id, { ...job, state: "cancelled" });
    }
    listed = true;
    model.redraw();
  }

  const toMotion = { text: "Go to 3 Motion", act: () => model.update({ view: "motion" }), isRead: true };

  function ended(job) {
    if (job.state === "failed") model.notify(job.text || "The work failed.", KEPT);
    if (job.state === "cancelled")
      model.notify("Cancelled. What was finished is kept; starting again goes on from there.");
    if (job.state !== "done") return;
    if (job.kind === "run" && model.notice?.offer === toMotion) model.notify(null); // it was made
    const news = job.text?.split("\n") ?? [];
    const read = news.every((line) => GOOD_NEWS.test(line)) ? LASTING : KEPT;
    if (job.text) model.notify(job.text, /make the motion anew/.test(job.text) ? toMotion : read);
    takeIn(job, model.ui.view);
  }

  // Until what a job made was read it is still at work; whoever went to another page meanwhile stays there.
  async function takeIn(job, view) {
    settling.add(job.id);
    try {
      await model.readProject();
      if (RESULTS[job.kind] && model.ui.view === view) go(RESULTS[job.kind]);
    } catch (fault) {
      model.disconnected(fault);
    } finally {
      settling.delete(job.id);
      model.redraw();
    }
  }

  // Ends that happened before the page was opened are no news; what ends at once is never seen to run.
  function noteEnds() {
    if (!listed) return;
    for (const job of model.jobs.values()) {
      const before = states.get(job.id) ?? "running";
      if (before === "running" && job.state !== "running") ended(job);
      states.set(job.id, job.state);
    }
  }

  const runningJob = () =>
    [...model.jobs.values()].find(({ id, state }) => state === "running" || settling.has(id));

  // Has the keyframes chosen, as many as a field for the share of the frames says.
  function chooseKeyframes(field) {
    const percent = numberIn(field) ?? NaN;
    if (!(percent > 0))
      model.notify("The share of frames to mark is a number of per cent, such as 1.5.");
    else if (!runningJob()) startJob("keyframes", { budget: budgetIn(percent, model.project) });
  }

  return { startJob, refreshJobs, noteEnds, runningJob, chooseKeyframes };
}
