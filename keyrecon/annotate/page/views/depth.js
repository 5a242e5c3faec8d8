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
  fit: (width, height) => Math.min(width, height) / 1.35,
  grid: { lines: 3, step: 1 / 4 },
  shadowWidth: 6,
  boneWidth: 6,
  marksEnds: true,
  wheelScrolls: false,
};

// A body in space on a canvas of the page; `show(points, other)` takes places by joint.
export function createPoseFigure(canvas, model) {
  const bones = model.project.limbs.map(({ name, parent }) => ({
    from: parent,
    to: name,
    side: { left: "left", right: "right", middle: "trunk" }[model.sides[name]],
  }));
  let points = null,
    other = null;

  function scene() {
    const all = Object.values(points ?? {});
    if (all.length < 2) return null;
    const ranges = [0, 1, 2].map((axis) => {
      const values = all.map((point) => point[axis]);
      return [Math.min(...values), Math.max(...values)];
    });
    const [top, level] = ranges[1];
    return {
      points,
      bones,
      center: ranges.map(([low, high]) => (low + high) / 2),
      level,
      unit: Math.max(level - top, 1e-6),
      trunk: [],
      head: [],
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
    show(next = null, faint = null) {
      if (next === points && faint === other) return;
      points = next;
      other = faint;
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
