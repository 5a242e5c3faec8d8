// Wires the page together: one model, the parts that draw it, and the keys.
import { createActions } from "./actions.js";
import { byId, color } from "./dom.js";
import { createDepth } from "./depth.js";
import { createFiles } from "./files.js";
import { createFrame } from "./frame.js";
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
import { createStills } from "./stills.js";
import { createViewer } from "./viewer.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const VIEWS = ["pick", "keyframes", "motion"];

const model = await createModel();
const { doing } = model;
const stills = createStills(model.project, model.changed);
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
  viewer.frameBox(model.keyframe()?.box);
  history.replaceState(null, "", `#frame=${number}`);
  depth.askGhost(number).catch(() => {}); // without the server there is no suggestion
  lookAhead();
};

// The next and previous keyframes first, then a second around this one.
function lookAhead() {
  const frames = model.keyframes().map((keyframe) => keyframe.frame),
    at = frames.indexOf(doing.frame);
  const near = [1, -1, 2].map((by) => frames[at + by]).filter((number) => number !== undefined);
  const reach = Math.round(model.project.fps),
    around = [];
  for (let by = 1; by <= reach; by++)
    around.push([doing.frame + by, SMALL], [doing.frame - by, SMALL]);
  stills.wish([...near.map((number) => [number]), ...around]);
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

const mirrored = (half) =>
  model.project.mirror.filter(([left]) => !half || model.project.halves[half].includes(left));
const swaps = { swapBody: null, swapUpper: "upper", swapLower: "lower" };

const commands = {
  any: {
    undo: actions.undo,
    redo: actions.redo,
    help: frame.help,
    page: ({ place }) => go(VIEWS[place]),
  },
  keyframes: {
    primary: actions.primary,
    put: actions.putDown,
    visibility: () => actions.visibility(),
    clear: actions.clear,
    flip: () => actions.flip(),
    automatic: actions.automaticDepth,
    automaticAll: actions.automaticDepths,
    open: actions.nextKeyframe,
    lock: actions.lock,
    check: lists.firstCheck,
    suggestion: lists.firstSuggestion,
    keyframe: ({ place }) => actions.stepKeyframe(place ? 1 : -1),
    joint: ({ place }) => actions.stepJoint(place ? 1 : -1),
    look: ({ place }) => actions.look(doing.look + (place ? 1 : -1)),
    reading: ({ place }) => actions.reading(place),
    nudge: ({ key, shift }) => actions.nudge(...ARROWS[key].map((step) => step * (shift ? 10 : 1))),
    back: () => (doing.held ? model.do({ held: null }) : actions.look(0)),
    zoom: viewer.toggleZoom,
    zoomBy: ({ place }) =>
      viewer.zoom(
        [byId("picture").clientWidth / 2, byId("picture").clientHeight / 2],
        place ? 0.8 : 1.25,
      ),
    hide: () => model.do({ hidden: true }),
    ...Object.fromEntries(
      Object.entries(swaps).map(([name, half]) => [name, () => actions.swap(mirrored(half))]),
    ),
  },
  pick: pick.commands,
  motion: motion.commands,
};

document.addEventListener("keydown", (event) => {
  if (document.querySelector("dialog[open]") && event.key !== "?") return;
  const meant = meaning(event, doing.view);
  if (!meant || belongsTo(event.target, event.key)) return;
  event.preventDefault();
  const act = commands[doing.view][meant.action] ?? commands.any[meant.action];
  Promise.resolve(act(meant)).catch((fault) => model.tell(fault.message));
});
document.addEventListener(
  "keyup",
  (event) => event.key.toLowerCase() === "h" && model.do({ hidden: false }),
);
// A button pressed with the mouse does not keep the keys to itself.
document.addEventListener(
  "click",
  (event) => event.detail && event.target.closest("button")?.blur(),
);
document.querySelectorAll("[data-swap]").forEach((button) => {
  button.addEventListener("click", () => commands.keyframes[button.dataset.swap]());
});
go(model.keyframes().length ? "keyframes" : "pick");
