// Asks the server for the pose in space of what is marked, after every change and while a joint is
// dragged, and for the suggestion of a keyframe when it is opened.
import * as api from "./api.js";
import { byId, make, setText, toggle } from "./dom.js";
import { whyNoHelp } from "./guide.js";
import { createSpace } from "./space.js";

const EMPTY = "The body in space appears here as joints are placed.";

export function createDepth(model, placed) {
  const space = createSpace(byId("space"), model.project.limbs, model.sides);
  const poses = new Map(),
    ghosts = new Map();
  let last = "",
    hovered = null,
    inSpace = {},
    settled = Promise.resolve();

  model.pose = () => poses.get(model.doing.frame) ?? null;
  model.ghost = () =>
    model.done(model.keyframe() ?? { half: "both", frame: -1 })
      ? null
      : (ghosts.get(model.doing.frame) ?? null);

  async function askPose(frame, marks, nearer) {
    const began = performance.now();
    poses.set(frame, await api.send("pose", { frame, marks, nearer }));
    model.changed();
    performance.measure("pose", { start: began, end: performance.now() });
  }
  const ask = api.latestOnly(askPose, (fault, frame) => {
    poses.set(frame, { trouble: fault.message });
    model.changed();
  });

  const askGhost = api.latestOnly(
    async (frame) => {
      const answer = await api.read(`ghost/${frame}`);
      ghosts.set(frame, answer.joints ? answer : null);
      model.changed();
    },
    (fault, frame) => ghosts.delete(frame), // nothing is known yet that could be suggested
  );

  function follow() {
    const { frame } = model.doing,
      marks = placed(),
      nearer = model.nearer();
    const now = JSON.stringify([frame, marks, nearer]);
    if (frame === null || now === last) return;
    last = now;
    const asked = ask(frame, marks, nearer);
    settled = asked;
    byId("space").setAttribute("aria-busy", true);
    asked.then(() => byId("space").setAttribute("aria-busy", settled !== asked));
  }

  // The pose of what is marked at this moment.
  model.settledPose = async () => {
    follow();
    await settled;
    return model.pose();
  };

  const readings = [0, 1, 2].map((n) => {
    const button = make("button", {}, make("kbd", {}, String(n + 1)), make("span"));
    button.addEventListener("pointerenter", () => hover(n));
    button.addEventListener("pointerleave", () => hover(null));
    return button;
  });
  byId("readings").append(...readings);
  function hover(n) {
    hovered = n;
    model.changed();
  }

  function drawReadings() {
    const pose = model.pose(),
      alternatives = pose?.alternatives ?? [],
      best = alternatives[0];
    readings.forEach((button, n) => {
      const reading = alternatives[n];
      button.hidden = !reading;
      if (!reading) return;
      const turned = Object.keys(reading.nearer).filter(
        (limb) => reading.nearer[limb] !== best.nearer[limb],
      );
      setText(button.lastChild, n === 0 ? "most likely" : `${turned.length} turned`);
      button.title =
        n === 0
          ? "Take the most likely reading"
          : `Turned: ${turned.join(", ").replaceAll("_", " ")}`;
      const shown = Object.entries(reading.nearer).every(
        ([limb, sign]) => pose.limbs[limb]?.sign === sign,
      );
      toggle(button, "on", shown);
    });
  }

  // Drawn when it changes, not with every move of the pointer.
  function showInSpace(points, faint) {
    if (inSpace.points === points && inSpace.faint === faint) return;
    inSpace = { points, faint };
    space.show(points, faint);
  }

  function draw() {
    follow();
    const pose = model.pose(),
      other = pose?.alternatives?.[hovered]?.points3d;
    showInSpace(other ?? pose?.points3d, other ? pose?.points3d : null);
    byId("space-empty").hidden = Object.keys(pose?.points3d ?? {}).length > 1;
    setText(byId("space-empty"), pose?.trouble ?? whyNoHelp(model.project) ?? EMPTY);
    drawReadings();
  }

  return { draw, askGhost };
}
