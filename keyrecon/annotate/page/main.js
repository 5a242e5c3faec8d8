// Wires the page together: one model, the parts that draw it, and the keys.
import { createActions } from "./actions.js";
import { keyframeCommands } from "./commands.js";
import { byId, color } from "./dom.js";
import { createDepth } from "./depth.js";
import { createFiles } from "./files.js";
import { createFrame } from "./frame.js";
import { around } from "./geometry.js";
import { createJobs } from "./jobs.js";
import { createJoints } from "./joints.js";
import { belongsTo, meaning } from "./keys.js";
import { createLists } from "./lists.js";
import { createModel } from "./model.js";
import { createMotion } from "./motion.js";
import { createPick } from "./pick.js";
import { createPrompt } from "./prompt.js";
import { createScrub } from "./scrub.js";
import { createStage, SMALL } from "./stage.js";
import { marksOf } from "./state.js";
import { createStills } from "./stills.js";
import { createViewer } from "./viewer.js";

const VIEWS = ["pick", "keyframes", "motion"];

const model = await createModel();
const { doing } = model;
const stills = createStills(model.project, model.changed, model.tell);
const viewer = createViewer({
  root: byId("picture"),
  project: model.project,
  stills,
  changed: model.changed,
});
const actions = createActions(model);
const marks = Object.fromEntries(
  ["left", "right", "middle"].map((side) => [side, color(`mark-${side}`)]),
);
const stage = createStage(model, actions, viewer, marks);
const depth = createDepth(model, stage.placed);
const lists = createLists(model, actions);
const jobs = createJobs(model);
const frame = createFrame(model, go);
const parts = [
  depth,
  createPrompt(model, actions),
  createScrub(model, actions),
  lists,
  createJoints(model, actions),
];
const pick = createPick(model, { stills, jobs, frame });
const motion = createMotion(model, { stills, jobs, frame, actions });
createFiles(model);
model.middle = viewer.middle;

let opening = null;
model.opened = (number) => {
  opening = { frame: number, at: performance.now() };
  const places = Object.values(marksOf(model.state, number)).filter(([, , seen]) => seen);
  viewer.frameBox(around(model.keyframe()?.box, places));
  history.replaceState(null, "", `#frame=${number}`);
  depth.askGhost(number);
  lookAhead();
};

// The next and previous keyframes first, then a second around this one.
function lookAhead() {
  const frames = model.keyframes().map((keyframe) => keyframe.frame),
    at = frames.indexOf(doing.frame);
  const near = [1, -1, 2].map((by) => frames[at + by]).filter((number) => number !== undefined);
  const reach = Math.round(model.project.fps),
    beside = [];
  for (let by = 1; by <= reach; by++)
    beside.push([doing.frame + by, SMALL], [doing.frame - by, SMALL]);
  stills.wish([...near.map((number) => [number]), ...beside]);
}

// The keyframe that the address names, so that a place can be returned to.
function addressed() {
  const frame = Number(location.hash.match(/^#frame=(\d+)$/)?.[1] ?? NaN);
  return model.keyframes().some((keyframe) => keyframe.frame === frame) ? frame : null;
}

function drawKeyframes() {
  if (doing.frame === null && model.keyframes().length) {
    const all = model.keyframes();
    actions.open(addressed() ?? (all.find((keyframe) => !model.done(keyframe)) ?? all[0]).frame);
    return;
  }
  for (const part of parts) part.draw();
  if (doing.frame === null) return;
  const sharp = stage.draw();
  if (sharp && opening?.frame === doing.frame) {
    performance.measure("keyframe", { start: opening.at, end: performance.now() });
    opening = null;
  }
}

model.onDraw(() => {
  if (doing.view === null) return;
  frame.draw();
  jobs.draw();
  if (doing.view === "keyframes") drawKeyframes();
  if (doing.view === "pick") pick.draw();
  if (doing.view === "motion") motion.draw();
});

function go(view) {
  actions.keepHeld();
  model.do({ view });
  if (view === "pick") pick.opened();
}

const commands = {
  any: {
    undo: actions.undo,
    redo: actions.redo,
    help: frame.help,
    page: ({ place }) => go(VIEWS[place]),
  },
  keyframes: keyframeCommands(model, { actions, viewer, lists }),
  pick: pick.commands,
  motion: motion.commands,
};

function obey(act, key) {
  Promise.resolve(act(key)).catch((fault) =>
    model.tell(fault.message || "The server does not answer."),
  );
}

document.addEventListener("keydown", (event) => {
  if (document.querySelector("dialog[open]") && event.key !== "?") return;
  const key = meaning(event, doing.view);
  if (!key || belongsTo(event.target, event.key)) return;
  event.preventDefault();
  obey(commands[doing.view][key.action] ?? commands.any[key.action], key);
});
document.addEventListener(
  "keyup",
  ({ key }) => key.toLowerCase() === "h" && model.do({ hidden: false }),
);
// A button pressed with the mouse does not keep the keys to itself.
document.addEventListener(
  "click",
  ({ detail, target }) => detail && target.closest("button")?.blur(),
);

function pressing(selector, act) {
  document.querySelectorAll(selector).forEach((button, n) => {
    button.addEventListener("click", () => obey(() => act(button, n)));
  });
}
pressing("[data-swap]", (button) => commands.keyframes[button.dataset.swap]());
pressing("#readings button", (_, n) => actions.reading(n));
pressing("#undo", actions.undo);
pressing("#redo", actions.redo);
addEventListener("hashchange", () => addressed() !== null && actions.open(addressed()));
addEventListener("pagehide", actions.keepHeld);

await model.readState();
model.listen();
jobs.refresh();
lists.ask();
go(model.keyframes().length ? "keyframes" : "pick");
