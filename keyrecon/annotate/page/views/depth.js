// The pose in space of what is marked, after every change and while a joint is dragged, and the other
// poses that fit the picture as well.
import { createFigure3d } from "../../../report/figure3d.js";
import { cssColor } from "../draw/canvas.js";
import { label, whyNoAssistant } from "../state/workflow.js";
import { byId, make, setText, toggle } from "./dom.js";
import { createGuide } from "./guide.js";

const EMPTY = "The body in space appears here as joints are placed.";
const STYLE = {
  start: { yaw: 0.6, pitch: 0.25 },
  fit: (width, height) => Math.min(width, height) / 1.45,
  grid: { lines: 3, step: 1 / 4 },
  shadowWidth: 6,
  boneWidth: 6,
  marksEnds: true,
  wheelScrolls: false,
};

// Bones to draw: the limbs, and the line between both hips that closes the trunk.
function bonesOf({ limbs, mirror, halves }, sides) {
  const parent = Object.fromEntries(limbs.map((limb) => [limb.name, limb.parent]));
  const closing = mirror.filter(
    ([left, right]) => halves.lower.includes(left) && parent[left] && parent[left] === parent[right],
  );
  return [
    ...limbs.map((limb) => ({
      from: limb.parent,
      to: limb.name,
      side: { left: "left", right: "right", middle: "trunk" }[sides[limb.name]],
    })),
    ...closing.map(([from, to]) => ({ from, to, side: "trunk" })),
  ];
}

// The joints around the trunk, left shoulder first; none where a skeleton has no such joints.
export const trunkOf = ({ joints }) => {
  const names = ["left_shoulder", "right_shoulder", "right_hip", "left_hip"];
  return names.every((name) => joints.includes(name)) ? names : [];
};
const headOf = ({ joints }) =>
  ["neck", "head_top"].every((name) => joints.includes(name)) ? ["neck", "head_top"] : [];

// Ground and size of a single pose: the lowest joint stands on the ground.
function placeOf(points) {
  const all = Object.values(points);
  const ranges = [0, 1, 2].map((axis) => {
    const values = all.map((point) => point[axis]);
    return [Math.min(...values), Math.max(...values)];
  });
  const [top, level] = ranges[1];
  return {
    center: ranges.map(([low, high]) => (low + high) / 2),
    level,
    unit: Math.max(level - top, 1e-6),
    ground: "ground",
  };
}

// A body in space on a canvas of the page; `show(points, other, place)` takes places by joint, and
// where the ground is when more is known of it than this pose shows.
export function createPoseFigure(canvas, model) {
  const bones = bonesOf(model.project, model.sides),
    [trunk, head] = [trunkOf(model.project), headOf(model.project)];
  let points = null,
    other = null,
    place = null;

  function scene() {
    if (Object.keys(points ?? {}).length < 2) return null;
    return {
      ...(place ?? placeOf(points)),
      points,
      bones,
      trunk,
      head,
      other: other && { points: other, color: cssColor("rule"), width: 3 },
    };
  }
  const figure = createFigure3d(canvas, {
    scene,
    style: STYLE,
    buttons: canvas.parentElement.querySelectorAll("[data-yaw]"),
  });

  return {
    // Drawn when it changes, not with every move of the pointer.
    show(next = null, faint = null, ground = null) {
      if (next === points && faint === other) return;
      points = next;
      other = faint;
      place = ground;
      figure.redraw();
    },
  };
}

export function createDepth(model) {
  const figure = createPoseFigure(byId("pose-canvas"), model),
    guide = createGuide(byId("pose-guide"), model);
  const turning = byId("pose-canvas").parentElement.querySelectorAll("[data-yaw]");
  let hovered = null;

  function request() {
    const pending = model.poses.refresh();
    if (!pending) return;
    byId("pose-canvas").setAttribute("aria-busy", true);
    pending.then(() => byId("pose-canvas").setAttribute("aria-busy", !model.poses.isLatest(pending)));
  }

  const buttons = [0, 1, 2].map((n) => {
    const button = make("button", {}, make("kbd", {}, String(n + 1)), make("span"));
    button.addEventListener("pointerenter", () => hover(n));
    button.addEventListener("pointerleave", () => hover(null));
    return button;
  });
  byId("alternatives").append(...buttons);
  function hover(n) {
    hovered = n;
    model.redraw();
  }

  function drawAlternatives(pose) {
    const alternatives = pose?.alternatives ?? [],
      best = alternatives[0];
    buttons.forEach((button, n) => {
      const one = alternatives[n];
      button.hidden = !one;
      if (!one) return;
      const turned = Object.keys(one.nearer).filter(
        (limb) => one.nearer[limb] !== best.nearer[limb],
      );
      setText(button.lastChild, n === 0 ? "most likely" : `${turned.length} turned`);
      button.title =
        n === 0 ? "Take the most likely reading" : `Turned: ${turned.map(label).join(", ")}`;
      const current = Object.entries(one.nearer).every(
        ([limb, sign]) => pose.limbs[limb]?.sign === sign,
      );
      toggle(button, "on", current);
    });
  }

  function draw() {
    request();
    const pose = model.poses.current(),
      other = pose?.alternatives?.[hovered]?.points3d;
    figure.show(other ?? pose?.points3d, other ? pose?.points3d : null);
    const empty = Object.keys(pose?.points3d ?? {}).length < 2,
      trouble = pose?.trouble ?? whyNoAssistant(model.project);
    const guided = empty && trouble === null && guide.exists;
    byId("pose-guide").hidden = !guided;
    byId("pose-empty").hidden = !empty || guided;
    setText(byId("pose-empty"), trouble ?? EMPTY);
    for (const button of turning) button.hidden = guided;
    guide.show(model.ui.hovered?.joint ?? model.ui.joint);
    drawAlternatives(pose);
  }

  return { draw };
}
