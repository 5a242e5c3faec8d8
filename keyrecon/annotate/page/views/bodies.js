// The page where everything begins: a clear frame is found and its whole body marked, then more bodies
// where the program is least sure; from them it knows the player, and chooses the keyframes.
import { intersection, pictureBox } from "../draw/geometry.js";
import { drawJoint, drawLimb } from "../draw/skeleton.js";
import { createViewer } from "../draw/viewer.js";
import { jointWords } from "../state/joint_words.js";
import { budgetText, label, nextBeginning } from "../state/workflow.js";
import { byId, followProject, make, setText } from "./dom.js";
import { createGuide } from "./guide.js";
import { createShots } from "./shots.js";

const SMALL_WIDTH = 960; // of a frame until the sharp one is here, px
const GENERAL =
  "The program looks for centres of joints, not for what is seen of them. Left and right are the player's own. Point at a joint for words.";

export function createBodies(model, { frames, shell, actions, colors }) {
  const { project } = model,
    last = project.n_frames - 1,
    root = byId("bodies-picture");
  const viewer = createViewer({ root, project, frames, redraw: model.redraw });
  const guide = createGuide(byId("guide"), model);
  const shots = createShots(model, {
    address: frames.address,
    show,
    isBusy: () => Boolean(shell.runningJob()),
  });
  const boxes = new Map(); // frame -> what was in sight when it was chosen
  let frame = Math.round(last / 2);

  const bodies = () => model.keyframes().filter(({ half }) => half === "both");
  const next = () => nextBeginning(model.project, model.keyframes(), model.isDone);

  function show(number) {
    frame = Math.max(0, Math.min(last, number));
    model.redraw();
  }

  // The part of the picture that is in sight, so that a body is marked at the zoom it was found at.
  function inSight() {
    const [x0, y0] = viewer.toPicture([0, 0]),
      [x1, y1] = viewer.toPicture([root.clientWidth, root.clientHeight]);
    const box = intersection([x0, y0, x1, y1], pictureBox([project.width, project.height]));
    return box[2] - box[0] < 0.9 * project.width && box[3] > box[1] ? box : null;
  }

  function markHere() {
    boxes.set(frame, inSight());
    actions.addKeyframe(frame, "both");
  }

  const steps = {
    frame: markHere,
    mark: ({ frame: open }) => actions.open(open),
    follow: () => shell.runningJob() || shell.startJob("follow"),
    choose: () => shell.chooseKeyframes(byId("bodies-budget")),
  };
  function primary() {
    const step = next();
    steps[step.do](step);
  }

  followProject(model, byId("bodies-budget"), budgetText);
  const slider = byId("bodies-frame");
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  byId("bodies-back").addEventListener("click", () => show(frame - 1));
  byId("bodies-ahead").addEventListener("click", () => show(frame + 1));
  byId("bodies-primary").addEventListener("click", primary);
  byId("bodies-skip").addEventListener("click", steps.choose);
  byId("guide").addEventListener("pointerover", ({ target }) => {
    const joint = target.dataset?.joint;
    setText(byId("guide-words"), joint ? `${label(joint)}: ${jointWords(joint)}.` : GENERAL);
  });
  setText(byId("guide-words"), GENERAL);
  viewer.listen({ grab: () => null, drag() {}, drop() {}, click() {}, hover() {} });

  const WORDS = {
    frame: () => ({
      text: "Find a frame that shows the player clearly",
      more: "Arms and legs apart, nothing before them, no blur. The wheel zooms.",
      button: "Mark the body in this frame",
    }),
    mark: ({ frame: open, left }) => ({
      text: left > 1 ? `${left} bodies are to be marked` : "One body is to be marked",
      more: model.project.bodies
        ? "In these frames the program is least sure where the player is."
        : "All joints of the player in one frame.",
      button: `Mark frame ${open}`,
    }),
    follow: () => ({
      text: "The body is marked",
      more: "The program now follows the player, and asks where it is unsure.",
      button: "Follow the player",
    }),
    choose: () =>
      model.project.has.keyframes
        ? {
            text: "The keyframes are chosen",
            more: "K marks one more body here.",
            button: "Choose the keyframes again",
          }
        : {
            text: "The player is known",
            more: "The program now chooses the frames to mark.",
            button: "Choose the keyframes",
          },
  };

  function drawList() {
    const rows = bodies().filter(({ own, frame: t }) => own || model.project.bodies?.includes(t) || !model.project.has.keyframes);
    const content = JSON.stringify(rows.map((row) => [row.frame, model.isDone(row)]));
    const list = byId("body-list");
    if (list.dataset.content === content) return;
    list.dataset.content = content;
    list.replaceChildren(
      ...(rows.length ? rows.map(bodyRow) : [make("p", { className: "note" }, "None yet.")]),
    );
  }

  function bodyRow(keyframe) {
    const go = make("button", { className: "plain" }, `Frame ${keyframe.frame}`);
    go.addEventListener("click", () => actions.open(keyframe.frame));
    return make("div", {}, go, make("small", {}, model.isDone(keyframe) ? "✓" : "to be marked"));
  }

  // What is marked on the frame that is shown.
  function drawMarks() {
    const [pen] = viewer.overlay(),
      marks = Object.entries(model.marks(viewer.shown() ?? frame)).filter(([, place]) => place[2]);
    const at = Object.fromEntries(marks.map(([name, place]) => [name, viewer.toScreen(place)]));
    const color = (name) => colors[model.sides[name]];
    for (const { name, parent } of project.limbs)
      if (at[name] && at[parent])
        drawLimb(pen, at[parent], at[name], { color: color(name), sign: 0, alpha: 0.7 });
    for (const [name, place] of Object.entries(at))
      drawJoint(pen, place, { side: model.sides[name], color: color(name), size: 3.5 });
  }

  function draw() {
    const step = next(),
      busy = Boolean(shell.runningJob());
    const { text, more, button } = busy
      ? { text: "The program is at work", more: "When cancelled, it goes on from there later." }
      : WORDS[step.do](step);
    setText(byId("bodies-text"), text);
    setText(byId("bodies-more"), more);
    byId("bodies-primary").hidden = !button;
    setText(byId("bodies-primary"), button ?? "");
    byId("bodies-budget-row").hidden = busy || step.do !== "choose";
    byId("bodies-skip").hidden =
      busy || step.do === "choose" || step.do === "frame" || !bodies().some(model.isDone);
    slider.value = frame;
    setText(byId("bodies-where"), `frame ${frame} of ${project.n_frames}`);
    drawList();
    shots.draw();
    guide.show(null);
    viewer.drawPicture(frame, [undefined, SMALL_WIDTH]);
    drawMarks();
  }

  const commands = {
    primary,
    add: markHere,
    zoom: viewer.toggleZoom,
    zoomBy: ({ index }) => viewer.zoom(viewer.toScreen(viewer.middle()), index ? 0.8 : 1.25),
    step: ({ index, shift }) =>
      show(frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
  };
  return {
    draw,
    commands,
    box: (number) => boxes.get(number) ?? null,
    // Whether something is to be done here before there is anything to mark.
    isWaiting: () => !model.project.has.keyframes && next().do !== "mark",
  };
}
