// The motion as a figure in space, at the frame of the page's cursor.
import { cssColor } from "./colors.js";
import { byId, data, unpack, count, frame, followers, restyled } from "./cursor.js";
import { createFigure3d } from "./figure3d.js";

const SIDES = ["left", "right", "trunk"];
const STYLE = {
  start: { yaw: 0.6, pitch: 0.3 },
  fit: (width, height) => Math.min(width, height * 1.1) / 1.55,
  grid: { lines: 4, step: 1 / 6 },
  shadowWidth: 9,
  boneWidth: 7,
  marksEnds: false,
  wheelScrolls: true,
};

const points3d = unpack(data.points3d),
  truth3d = unpack(data.truth3d);
const joints = points3d.shape[1],
  truthShown = byId("show-truth");
const bones = data.bones.map(([from, to], n) => ({ from, to, side: SIDES[data.sides[n]] }));

// Joints of the present frame.
function pose({ values }) {
  const start = frame() * joints * 3;
  return Array.from({ length: joints }, (_, j) => values.slice(start + j * 3, start + j * 3 + 3));
}

// Height of the lower foot over the frames around, so that the ground does not follow each step.
function smoothGround() {
  const lowest = new Float32Array(count);
  for (let t = 0; t < count; t++) {
    let low = -Infinity;
    for (let j = 0; j < joints; j++)
      low = Math.max(low, points3d.values[(t * joints + j) * 3 + 1] || 0);
    lowest[t] = low;
  }
  const radius = Math.max(1, Math.round(data.fps / 4));
  return lowest.map((_, t) => {
    const around = lowest.subarray(Math.max(0, t - radius), t + radius + 1);
    return around.reduce((sum, value) => sum + value, 0) / around.length;
  });
}
const ground = smoothGround();

function scene() {
  const level = ground[frame()],
    truth = truth3d && truthShown.checked;
  return {
    points: pose(points3d),
    bones,
    center: [0, level - 0.5 * data.stature, 0],
    level,
    unit: data.stature,
    ground: `ground, squares of ${(data.stature / 6).toFixed(2)} ${data.units}`,
    trunk: data.trunk,
    head: data.head,
    other: truth ? { points: pose(truth3d), color: cssColor("truth"), width: 4, alpha: 0.6 } : null,
  };
}

const figure = createFigure3d(byId("figure-canvas"), {
  scene,
  style: STYLE,
  buttons: document.querySelectorAll("[data-yaw]"),
});
followers.push(figure.redraw);
restyled.push(figure.redraw);
truthShown?.addEventListener("change", figure.redraw);
