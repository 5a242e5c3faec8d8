// The motion as a figure in space, at the frame of the page's cursor.
import { cssColor } from "./colors.js";
import { byId, data, count, cuts, frame, followers, restyled } from "./cursor.js";
import { unpack } from "./packed.js";
import { createFigure3d } from "./figure3d.js";
import { groundLevel } from "./ground_level.js";

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

const points3d = unpack(data.points3d, cuts),
  truth3d = unpack(data.truth3d, cuts);
const joints = points3d.shape[1],
  truthShown = byId("show-truth");
const bones = data.bones.map(([from, to], n) => ({ from, to, side: SIDES[data.sides[n]] }));

// Joints of the present frame.
function pose({ values }) {
  const start = frame() * joints * 3;
  return Array.from({ length: joints }, (_, j) => values.slice(start + j * 3, start + j * 3 + 3));
}

// Height of the ground in every frame.
function smoothGround() {
  const lowest = new Float32Array(count);
  for (let t = 0; t < count; t++) {
    let low = -Infinity;
    for (let j = 0; j < joints; j++) low = Math.max(low, points3d.values[(t * joints + j) * 3 + 1]);
    lowest[t] = low;
  }
  const radius = Math.max(1, Math.round(data.fps / 4));
  return lowest.map((_, t) => groundLevel(lowest, t, radius, cuts) || 0);
}
const ground = smoothGround();

// On the court: axes of the figure are x along the net, y down, z up the court.
const court = data.court,
  LINE_PIECE = 1, // metres: short pieces, so that those behind the eye are left out one by one
  WAY = 2, // seconds of the way that lie on the ground
  REACH = 2.2, // how many times more than the body is shown
  ABOVE = 30, // metres of the eye above the player
  onCourt = byId("on-court");
const inFigure = ([x, y, z = 0]) => [x, -z, y];
const places = court && {
  points: unpack(court.points, cuts),
  root: unpack(court.root, cuts).values,
  contact: unpack(court.contact, cuts).values,
  camera: unpack(court.camera, cuts).values,
  lines: court.lines.flatMap(cutLine),
};

function cutLine([from, to]) {
  const pieces = Math.ceil(Math.hypot(...from.map((value, n) => to[n] - value)) / LINE_PIECE);
  const at = (share) => inFigure(from.map((value, n) => value + (to[n] - value) * share));
  const color = from[2] || to[2] ? "muted" : "ink";
  return Array.from({ length: pieces }, (_, n) => ({
    from: at(n / pieces),
    to: at((n + 1) / pieces),
    color,
    width: 2,
  }));
}

// The way around the present frame.
function wayOnGround() {
  const reach = Math.round(WAY * data.fps),
    at = (t) => inFigure([places.root[2 * t], places.root[2 * t + 1]]),
    pieces = [];
  for (let t = Math.max(1, frame() - reach); t <= Math.min(count - 1, frame() + reach); t++)
    if (!cuts.has(t)) pieces.push({ from: at(t - 1), to: at(t), color: cssColor("accent"), width: 2 });
  return pieces.filter(({ from, to }) => Number.isFinite(from[0] + to[0]));
}

function sceneOnCourt() {
  const t = frame(),
    [x, y] = [places.root[2 * t], places.root[2 * t + 1]];
  if (!Number.isFinite(x)) return null;
  const points = pose(places.points).map((point) => inFigure(point));
  const center = [x, -0.45 * data.stature, y];
  const eye = (place) => inFigure([...place]);
  return {
    points,
    bones,
    center,
    level: 0,
    unit: data.stature,
    ground: "",
    trunk: data.trunk,
    head: data.head,
    lines: [
      ...places.lines.map((line) => ({ ...line, color: cssColor(line.color) })),
      ...wayOnGround(),
    ],
    stances: court.feet
      .filter((_, foot) => places.contact[2 * t + foot] > 0.5)
      .map((joint) => [points[joint][0], 0, points[joint][2]]),
    eyes: {
      camera: { eye: eye(places.camera.slice(3 * t, 3 * t + 3)), words: "from the camera" },
      ...(court.umpire && {
        umpire: { eye: eye(court.umpire), words: "from the umpire's chair" },
        opponent: { eye: eye(court.opponent), words: "from behind the opponent" },
      }),
      above: { eye: [x, -ABOVE, y - 1e-3], words: "from above", zoom: 0.5 },
    },
    reach: REACH,
  };
}

function scene() {
  if (court && onCourt.checked) return sceneOnCourt();
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
  style: court ? { ...STYLE, start: { ...STYLE.start, from: "camera" } } : STYLE,
  buttons: document.querySelectorAll("[data-yaw]"),
});
followers.push(figure.redraw);
restyled.push(figure.redraw);
truthShown?.addEventListener("change", figure.redraw);
for (const button of document.querySelectorAll("[data-eye]"))
  button.addEventListener("click", () => figure.lookFrom(button.dataset.eye));
const showViews = () => {
  document.querySelector(".on-court").hidden = !onCourt.checked;
  document.querySelector(".off-court").hidden = onCourt.checked;
  figure.redraw();
};
onCourt?.addEventListener("change", showViews);
if (onCourt) showViews();
