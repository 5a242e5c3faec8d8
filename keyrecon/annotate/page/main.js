// Wires the page together: one model, what a person can do, the views, and the keys.
import { cssColor } from "./draw/canvas.js";
import { enclosing } from "./draw/geometry.js";
import { createViewer } from "./draw/viewer.js";
import { createActions } from "./state/actions.js";
import { createFrameCache } from "./state/caches.js";
import { describeFault } from "./state/faults.js";
import { createModel } from "./state/model.js";
import { createBodies } from "./views/bodies.js";
import { createCourt } from "./views/court.js";
import { createGround } from "./views/ground.js";
import { createDepth } from "./views/depth.js";
import { byId } from "./views/dom.js";
import { createExports } from "./views/exports.js";
import { createFiles } from "./views/files.js";
import { createJoints } from "./views/joints.js";
import { belongsTo, goesOn, interpret, keyframeCommands } from "./views/keyboard.js";
import { SMALL_WIDTH, createKeyframePicture } from "./views/keyframe.js";
import { createLists } from "./views/lists.js";
import { createMotion } from "./views/motion.js";
import { createPick } from "./views/pick.js";
import { createPrompt, createScrub } from "./views/prompt.js";
import { createShell } from "./views/shell.js";
import { createAddress } from "./views/address.js";
import { createSwing } from "./views/swing.js";
import { nextClick } from "./state/swing.js";
import { nextOpen, stepsOf } from "./state/workflow.js";

const model = await createModel();
const { ui } = model;
const frames = createFrameCache(model.project, model.redraw, model.notify);
const viewer = createViewer({
  root: byId("picture"),
  project: model.project,
  frames,
  redraw: model.redraw,
});
const actions = createActions(model, {
  middle: viewer.middle,
  opened,
  showInSwing: (frame) => Number.isFinite(frame) && swing.goTo(frame),
});
const colors = Object.fromEntries(
  ["left", "right", "middle"].map((side) => [side, cssColor(`mark-${side}`)]),
);
const picture = createKeyframePicture(model, { actions, viewer, colors });
const lists = createLists(model, actions);
const shell = createShell(model, go);
const panels = [
  createDepth(model),
  createPrompt(model, actions),
  createScrub(model, actions),
  lists,
  createJoints(model, actions),
];
const bodies = createBodies(model, { frames, shell, actions, colors });
const pick = createPick(model, { frames, shell });
const court = createCourt(model, { frames, shell });
const motion = createMotion(model, { frames, shell, actions, colors });
const ground = createGround(model, { frames, shell, go, heightWaits: motion.heightWaits });
const address = createAddress(model, { frames, shell, colors });
const swing = createSwing(model, { frames, shell, actions, colors, go, heightIsWrong: address.heightIsWrong });
createFiles(model);
const exports = createExports(model, shell);

let opening = null; // {frame, at}: a keyframe that is not drawn yet, to measure how long it takes

function opened(frame) {
  opening = { frame, at: performance.now() };
  const places = Object.values(model.marks(frame)).filter(([, , v]) => v);
  viewer.frameBox(enclosing(model.box(frame) ?? bodies.box(frame), places));
  history.replaceState(null, "", `#frame=${frame}`);
  model.poses.requestSuggestion(frame);
  prefetchAround();
}

// The next and previous keyframes first, then a second around this one.
function prefetchAround() {
  const numbers = model.keyframes().map(({ frame }) => frame),
    at = numbers.indexOf(ui.frame);
  const near = [1, -1, 2].map((by) => numbers[at + by]).filter((number) => number !== undefined);
  const second = Math.round(model.project.fps),
    beside = [];
  for (let by = 1; by <= second; by++)
    beside.push([ui.frame + by, SMALL_WIDTH], [ui.frame - by, SMALL_WIDTH]);
  frames.prefetch([...near.map((number) => [number]), ...beside]);
}

// The keyframe that the address names, so that a place can be returned to.
function addressed() {
  const frame = Number(location.hash.match(/^#frame=(\d+)$/)?.[1] ?? NaN);
  return model.keyframes().some((keyframe) => keyframe.frame === frame) ? frame : null;
}

function drawKeyframes() {
  if (ui.frame === null && model.keyframes().length) {
    const all = model.keyframes();
    actions.open(addressed() ?? nextOpen(all, -1, model.isMarked) ?? all[0].frame);
    return;
  }
  for (const panel of panels) panel.draw();
  if (ui.frame === null) return;
  const drawn = picture.draw();
  if (drawn && opening?.frame === ui.frame) {
    performance.measure("keyframe", { start: opening.at, end: performance.now() });
    opening = null;
  }
}

model.onDraw(() => {
  if (ui.view === null) return;
  shell.draw();
  if (ui.view === "keyframes") drawKeyframes();
  if (ui.view === "address") address.draw();
  if (ui.view === "swing") swing.draw();
  if (ui.view === "bodies") bodies.draw();
  if (ui.view === "pick") pick.draw();
  if (ui.view === "motion") motion.draw();
  if (ui.view === "files") exports.draw();
  if (ui.view === "court") court.draw();
  if (ui.view === "ground") ground.draw();
});

function go(view) {
  actions.dropDragged();
  model.update({ view });
  if (view === "address") address.opened();
  if (view === "pick") pick.opened();
  if (view === "files") exports.opened();
  if (view === "court") court.opened();
  if (view === "ground") ground.opened();
}

const commands = {
  any: {
    undo: actions.undo,
    redo: actions.redo,
    help: shell.help,
    page: ({ index }) => stepsOf(model.project)[index] && go(stepsOf(model.project)[index]),
    stage: toggleStage,
  },
  keyframes: keyframeCommands(model, { actions, viewer, lists }),
  address: address.commands,
  swing: swing.commands,
  bodies: bodies.commands,
  pick: pick.commands,
  motion: motion.commands,
  files: exports.commands,
  court: court.commands,
  ground: ground.commands,
};

// Told once: a view that fails is drawn again with the notice.
function tell(fault) {
  const text = describeFault(fault);
  if (model.notice?.text !== text) model.notify(text);
}

async function execute(command, key) {
  try {
    await command(key);
  } catch (fault) {
    tell(fault);
  }
}

addEventListener("error", ({ error }) => error && tell(error));
addEventListener("unhandledrejection", ({ reason }) => tell(reason));


document.addEventListener("keydown", (event) => {
  if (document.body.inert || (document.querySelector("dialog[open]") && event.key !== "?")) return;
  const key = interpret(event, ui.view);
  // Other pages can be gone to out of a field, too.
  if (!key || (key.action !== "page" && belongsTo(event.target, event.key))) return;
  event.preventDefault();
  if (event.repeat && !goesOn(key)) return;
  if (event.target.matches("input[type=text]")) event.target.blur(); // takes what was typed
  execute(commands[ui.view][key.action] ?? commands.any[key.action], key);
});
document.addEventListener(
  "keyup",
  ({ key }) => ["h", "x"].includes(key.toLowerCase()) && ui.hidden && model.update({ hidden: false }),
);
// A button pressed with the mouse does not keep the keys to itself.
document.addEventListener(
  "click",
  ({ detail, target }) => detail && target.closest("button")?.blur(),
);

function onPress(selector, command) {
  document.querySelectorAll(selector).forEach((button, n) => {
    button.addEventListener("click", () => execute(() => command(button, n)));
  });
}
onPress("[data-swap]", (button) => commands.keyframes[button.dataset.swap]());
onPress("#alternatives button", (_, n) => actions.confirmAlternative(n));
// The body in space on the whole stage, or beside the picture.
function toggleStage() {
  const page = byId(ui.view);
  if (page.dataset.stage) delete page.dataset.stage;
  else page.dataset.stage = "figure";
}
onPress("[data-stage]", toggleStage);
onPress("#bodies-colours", () => go("pick"));
onPress("#pick-bodies", () => go("bodies"));
onPress("#undo", actions.undo);
onPress("#redo", actions.redo);
addEventListener("hashchange", () => addressed() !== null && actions.open(addressed()));
addEventListener("pagehide", actions.dropDragged);

await model.readState();
model.listen(shell.refreshJobs);
lists.refresh();
if (model.project.golf) {
  await model.readSwing();
  go(model.swing?.keys && !nextClick(model.state) ? "swing" : "address");
} else go(bodies.isWaiting() ? "bodies" : "keyframes");
