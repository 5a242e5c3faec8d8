// A body in space on a plain canvas, turned with the pointer, the arrow keys or buttons. The report
// has this file inlined, the annotator serves it. Axes of the camera: x right, y down, z away from it.
import { cssColor } from "./colors.js";

const FREE_EYE = 25; // of an eye that has no name, over lines on the ground, their lengths
const EYE_DISTANCE = 6; // of the eye that sees the figure in perspective, body heights
const NEAREST = 0.1; // of the eye's distance: nothing is drawn nearer to it
const ZOOM_RANGE = [0.4, 4];
const ZOOM_PER_PIXEL = 0.002; // of the wheel, as an exponent
const TURN_PER_PIXEL = 0.01; // radians
const TURN_PER_KEY = 0.1; // radians
const SEAM = { width: 5, trim: 0.2 }; // beside a bone, px; share of its length left out at both ends

// The context of a canvas that is as sharp as the screen, cleared; also its size in CSS pixels.
export function prepareCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1,
    { clientWidth: width, clientHeight: height } = canvas;
  const size = { width: Math.round(width * ratio), height: Math.round(height * ratio) };
  if (canvas.width !== size.width || canvas.height !== size.height) Object.assign(canvas, size);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}

// Maps a point to [x, y, depth, magnification] on a canvas: turned about `center`, in perspective.
// `view` has yaw and pitch (radians), `scale` is in pixels per unit of length at the center, `eye` is
// how far away the eye is.
export function createProjection(view, { center, unit, scale, size, eye = EYE_DISTANCE * unit }) {
  const [cy, sy] = [Math.cos(view.yaw), Math.sin(view.yaw)];
  const [cp, sp] = [Math.cos(view.pitch), Math.sin(view.pitch)];
  return (point) => {
    const [x, y, z] = [0, 1, 2].map((axis) => point[axis] - center[axis]);
    const across = x * cy + z * sy,
      away = z * cy - x * sy;
    const depth = y * sp + away * cp,
      near = 1 / Math.max(NEAREST, 1 + depth / eye);
    return [
      size[0] / 2 + across * scale * near,
      size[1] / 2 + (y * cp - away * sp) * scale * near,
      depth,
      near,
    ];
  };
}

// The view after a turn: the figure is never upside down.
export const turned = (view, yaw, pitch) => ({
  ...view,
  yaw: view.yaw + yaw,
  pitch: Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + pitch)),
});

export const zoomed = (view, factor) => ({
  ...view,
  zoom: Math.max(ZOOM_RANGE[0], Math.min(ZOOM_RANGE[1], view.zoom * factor)),
});

// Bones whose ends are both known, as places on the canvas, far to near.
export function sortBones(scene, project) {
  const known = (key) => scene.points[key] && Number.isFinite(scene.points[key][0]);
  return scene.bones
    .filter(({ from, to }) => known(from) && known(to))
    .map((bone) => ({ ...bone, ends: [bone.from, bone.to].map((key) => project(scene.points[key])) }))
    .sort((p, q) => q.ends[0][2] + q.ends[1][2] - p.ends[0][2] - p.ends[1][2]);
}

// A line less a share of its length at both ends.
function drawLine(pen, [a, b], { color, width, trim = 0 }) {
  const at = (share) => [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
  pen.strokeStyle = color;
  pen.lineWidth = width;
  pen.lineCap = trim ? "butt" : "round";
  pen.beginPath();
  pen.moveTo(...at(trim));
  pen.lineTo(...at(1 - trim));
  pen.stroke();
}

// The ground at `level`: squares of `step` about the center.
function drawGrid(pen, project, { center, level }, { lines, step }) {
  const end = lines * step;
  const line = (...ends) =>
    ends.forEach(([x, z], n) => {
      const at = project([center[0] + x, level, center[2] + z]);
      pen[n ? "lineTo" : "moveTo"](at[0], at[1]);
    });
  pen.strokeStyle = cssColor("rule");
  pen.lineWidth = 1;
  pen.beginPath();
  for (let n = -lines; n <= lines; n++) {
    line([n * step, -end], [n * step, end]);
    line([-end, n * step], [end, n * step]);
  }
  pen.stroke();
}

// Lines on the ground in place of squares: [{from, to, color, width}]; those too near the eye are left out.
function drawGroundLines(pen, project, lines) {
  for (const { from, to, color, width } of lines) {
    const [a, b] = [project(from), project(to)];
    if (Math.max(a[3], b[3]) >= 0.99 / NEAREST || !Number.isFinite(a[0] + b[0])) continue;
    drawLine(pen, [a, b], { color, width: Math.max(1, (width * (a[3] + b[3])) / 2) });
  }
}

// Where a foot stands: a disc on the ground under it.
function drawStances(pen, project, places) {
  pen.fillStyle = cssColor("accent");
  for (const place of places) {
    const [x, y, , near] = project(place);
    pen.beginPath();
    pen.ellipse(x, y, 6 * near, 4 * near, 0, 0, 2 * Math.PI);
    pen.fill();
  }
}

// The direction in which an eye sees a point, and how far away it is.
export function seenFrom(eye, center) {
  const [x, y, z] = [0, 1, 2].map((axis) => center[axis] - eye[axis]),
    flat = Math.hypot(x, z);
  return { yaw: Math.atan2(-x, z), pitch: Math.atan2(y, flat), distance: Math.hypot(flat, y) };
}

// All bones in one stroke: the shadow on the ground, and a second pose.
function drawFlat(pen, bones, place, { color, width, alpha = 1 }) {
  pen.strokeStyle = color;
  pen.lineWidth = width;
  pen.globalAlpha = alpha;
  pen.lineCap = "round";
  pen.beginPath();
  for (const { from, to } of bones) {
    const [a, b] = [place(from), place(to)];
    if (!a || !b || !Number.isFinite(a[0] + b[0])) continue;
    pen.moveTo(a[0], a[1]);
    pen.lineTo(b[0], b[1]);
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

const CAMERA = { away: 0.62, size: 0.05 }; // from the center and half its width, body heights
const LABEL_FONT = "12px system-ui, sans-serif";
const LINE_HEIGHT = 16; // px
const LONGEST = "180° to the right of the camera, 75° from above"; // that is said of a view
const footHeight = (lines) => (lines.length ? LINE_HEIGHT * lines.length + 6 : 0);

function drawText(pen, text, [x, y], align) {
  pen.font = LABEL_FONT;
  pen.textAlign = align;
  pen.textBaseline = "middle";
  pen.strokeStyle = cssColor("card"); // what lies below does not strike the letters through
  pen.lineWidth = 4;
  pen.lineJoin = "round";
  pen.strokeText(text, x, y);
  pen.fillStyle = cssColor("muted");
  pen.fillText(text, x, y);
}

// On the ground, in front of the body: which way the camera looks. z points away from it.
function drawCamera(pen, project, { center, level, unit }) {
  const [x, z] = [center[0], center[2] - CAMERA.away * unit],
    half = CAMERA.size * unit;
  const at = (dx, dy, dz) => project([x + dx * half, level + dy * half, z + dz * half]);
  const lens = [at(-1, 0, 2), at(1, 0, 2), at(1, -1.6, 2), at(-1, -1.6, 2)],
    eye = at(0, -0.8, -0.5);
  pen.strokeStyle = pen.fillStyle = cssColor("accent");
  pen.lineWidth = 1.5;
  pen.beginPath();
  for (const [n, corner] of lens.entries()) {
    pen.moveTo(eye[0], eye[1]);
    pen.lineTo(corner[0], corner[1]);
    pen.lineTo(...lens[(n + 1) % 4].slice(0, 2));
  }
  pen.stroke();
  pen.beginPath();
  pen.arc(eye[0], eye[1], 2.5, 0, 2 * Math.PI);
  pen.fill();
  const top = Math.min(eye[1], ...lens.map(([, y]) => y));
  drawText(pen, "camera", [eye[0], top - 10], "center");
}

// From where the body is seen, in words.
export function viewInWords({ yaw, pitch }) {
  const [across, up] = [yaw, pitch].map((angle) => Math.round((angle * 180) / Math.PI)),
    turn = ((((across + 180) % 360) + 360) % 360) - 180;
  if (up > 75) return "from above";
  const parts = [
    Math.abs(turn) < 3 ? "from the camera" : `${Math.abs(turn)}° to the ${turn > 0 ? "right" : "left"} of the camera`,
    Math.abs(up) < 3 ? "" : `${Math.abs(up)}° ${up > 0 ? "from above" : "from below"}`,
  ];
  return parts.filter(Boolean).join(", ");
}

// Words in lines that have room: broken after a comma where they are too long.
export function wrapWords(words, room, breadthOf) {
  const lines = [];
  for (const part of words.split(/(?<=,) /)) {
    const longer = lines.length ? `${lines.at(-1)} ${part}` : part;
    if (lines.length && breadthOf(longer) <= room) lines[lines.length - 1] = longer;
    else lines.push(part);
  }
  return lines;
}

// What is said at the foot of a figure: what the squares mean, and from where the body is seen.
function footOf(pen, width, { words, ground }) {
  pen.font = LABEL_FONT;
  const breadthOf = (text) => pen.measureText(text).width;
  return [ground, words].filter(Boolean).flatMap((text) => wrapWords(text, width - 20, breadthOf));
}

// The foot, and what the colours mean. In two corners: the left of the upper edge belongs to the page's
// buttons. What was moved over the foot shows through no word.
function drawLegend(pen, [width, height], lines) {
  pen.fillStyle = cssColor("card");
  pen.globalAlpha = 0.85;
  pen.fillRect(0, height - footHeight(lines), width, footHeight(lines));
  pen.globalAlpha = 1;
  for (const [n, line] of lines.entries())
    drawText(pen, line, [10, height - 12 - LINE_HEIGHT * (lines.length - 1 - n)], "left");
  for (const [n, side] of ["right", "left"].entries()) {
    const y = 14 + 16 * n;
    drawText(pen, side, [width - 10, y], "right");
    pen.fillStyle = cssColor(side);
    drawEnd(pen, [width - 46, y], side, 4);
  }
}

// Where the chest points: without it nobody tells front from back.
function drawFront(pen, project, { points, trunk, unit }) {
  const [leftShoulder, rightShoulder, rightHip, leftHip] = trunk.map((key) => points[key]);
  if (![leftShoulder, rightShoulder, rightHip, leftHip].every((point) => point && Number.isFinite(point[0])))
    return;
  const middle = (a, b) => [0, 1, 2].map((axis) => (a[axis] + b[axis]) / 2),
    [chest, hips] = [middle(leftShoulder, rightShoulder), middle(leftHip, rightHip)];
  const front = chestDirection(points, trunk),
    start = [0, 1, 2].map((axis) => chest[axis] + 0.25 * (hips[axis] - chest[axis])),
    end = start.map((value, axis) => value + 0.16 * unit * front[axis]);
  const [a, b] = [project(start), project(end)],
    along = Math.hypot(b[0] - a[0], b[1] - a[1]);
  pen.strokeStyle = pen.fillStyle = cssColor("trunk");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(a[0], a[1]);
  pen.lineTo(b[0], b[1]);
  pen.stroke();
  if (along < 4) return;
  const [ux, uy] = [(b[0] - a[0]) / along, (b[1] - a[1]) / along];
  pen.beginPath();
  pen.moveTo(b[0] + 6 * ux, b[1] + 6 * uy);
  pen.lineTo(b[0] - 4 * uy, b[1] + 4 * ux);
  pen.lineTo(b[0] + 4 * uy, b[1] - 4 * ux);
  pen.fill();
}

// The way the chest points, a unit vector: down the trunk crossed with right to left.
export function chestDirection(points, [leftShoulder, rightShoulder, rightHip, leftHip]) {
  const [ls, rs, rh, lh] = [leftShoulder, rightShoulder, rightHip, leftHip].map((key) => points[key]);
  const across = [0, 1, 2].map((axis) => ls[axis] - rs[axis] + lh[axis] - rh[axis]),
    down = [0, 1, 2].map((axis) => lh[axis] + rh[axis] - ls[axis] - rs[axis]);
  const front = [0, 1, 2].map((n) => {
    const [i, j] = [(n + 1) % 3, (n + 2) % 3];
    return down[i] * across[j] - down[j] * across[i];
  });
  const length = Math.hypot(...front) || 1;
  return front.map((part) => part / length);
}

// The trunk as a tinted plane and the head as a ball, so that the eye sees which way it faces.
function drawVolumes(pen, project, { points, trunk, head }, zoom) {
  pen.fillStyle = cssColor("trunk");
  pen.globalAlpha = 0.18;
  pen.beginPath();
  const known = (key) => points[key] && Number.isFinite(points[key][0]);
  if (trunk.every(known)) {
    for (const key of trunk) pen.lineTo(...project(points[key]).slice(0, 2));
    pen.fill();
  }
  if (head.length && head.every(known)) {
    const [low, high] = head.map((key) => points[key]);
    const along = [0, 1, 2].map((axis) => high[axis] - low[axis]),
      length = Math.hypot(...along);
    const [x, y] = project(along.map((part, axis) => low[axis] + 0.62 * part));
    const [x1, y1] = project(low),
      [x2, y2] = project([low[0], low[1] - length, low[2]]);
    const radius = Math.max(0.38 * Math.hypot(x1 - x2, y1 - y2), 14 * zoom) || 0;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fill();
  }
  pen.globalAlpha = 1;
}

// Left and right differ by shape too.
function drawEnd(pen, [x, y], side, size) {
  pen.beginPath();
  if (side === "right") pen.rect(x - size, y - size, 2 * size, 2 * size);
  else pen.arc(x, y, size, 0, 2 * Math.PI);
  pen.fill();
}

// A seam lets the nearer bone pass visibly over the farther one.
function drawBones(pen, bones, { boneWidth, marksEnds }, zoom) {
  const colors = Object.fromEntries(["left", "right", "trunk"].map((name) => [name, cssColor(name)]));
  const card = cssColor("card");
  for (const { ends, side } of bones) {
    const width = boneWidth * ((ends[0][3] + ends[1][3]) / 2) ** 2 * Math.sqrt(zoom);
    drawLine(pen, ends, { color: card, width: width + SEAM.width, trim: SEAM.trim });
    drawLine(pen, ends, { color: colors[side], width });
    pen.fillStyle = colors[side];
    if (marksEnds) drawEnd(pen, ends[1], side, width * 0.75);
  }
}

// `scene()` tells what is to be drawn, or null for nothing:
//   points   by key, [x, y, z] or nothing; bones [{from, to, side: "left" | "right" | "trunk"}]
//   center   the point that stays in the middle; level: y of the ground; unit: the body's height
//   ground   what is said of the ground, such as the size of its squares
//   trunk    keys around the trunk (left shoulder, right shoulder, right hip, left hip), head: its lower and upper key; both may be empty
//   lines    what is painted on the ground, in place of squares and the camera: [{from, to, color, width}]
//   stances  points of the ground on which a foot stands; eyes: by name, places from which it is seen,
//            {eye, zoom, words}; reach: how many times more than the body is shown
//   other    a second pose to compare with: {points, color, width, alpha}, or null
// `style` is what differs between pages: start (yaw, pitch), fit(width, height) in body heights, grid
// {lines, step} in body heights, boneWidth (px), marksEnds, and whether a plain wheel scrolls the page.
export function createFigure3d(canvas, { scene, style, buttons }) {
  let view = { ...style.start, zoom: 1 },
    waiting = false;

  // From a named eye the view follows the body.
  const followed = (now) => {
    const named = view.from && now.eyes?.[view.from];
    return named ? { ...view, ...seenFrom(named.eye, now.center), words: named.words } : view;
  };

  function draw() {
    const [pen, width, height] = prepareCanvas(canvas),
      now = scene();
    if (!now) return;
    const seen = followed(now);
    const words = seen.words || (now.lines ? "" : viewInWords(seen)),
      foot = footOf(pen, width, { words, ground: now.ground }),
      longest = now.lines ? foot : footOf(pen, width, { words: LONGEST, ground: now.ground }),
      size = [width, height - footHeight(longest)]; // of the body and its ground, above all words there may be
    const project = createProjection(seen, {
      ...now,
      scale: (style.fit(...size) / now.unit / (now.reach || 1)) * seen.zoom,
      size,
      eye: now.lines && (seen.distance || FREE_EYE),
    });
    const onGround = (key) => {
      const point = now.points[key];
      return point && project([point[0], now.level, point[2]]);
    };
    pen.lineCap = pen.lineJoin = "round";
    if (now.lines) drawGroundLines(pen, project, now.lines);
    else drawGrid(pen, project, now, { ...style.grid, step: style.grid.step * now.unit });
    drawStances(pen, project, now.stances || []);
    drawFlat(pen, now.bones, onGround, { color: cssColor("shadow"), width: style.shadowWidth });
    if (now.other) {
      const there = (key) => now.other.points[key] && project(now.other.points[key]);
      drawFlat(pen, now.bones, there, now.other);
    }
    if (!now.lines) drawCamera(pen, project, now);
    if (now.trunk.length) drawVolumes(pen, project, now, view.zoom);
    drawBones(pen, sortBones(now, project), style, view.zoom);
    if (now.trunk.length) drawFront(pen, project, now);
    drawLegend(pen, [width, height], foot);
  }

  // At most once for every picture on the screen.
  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }

  function change(next) {
    view = next;
    redraw();
  }

  // The present view, no longer tied to an eye: what is turned stays where it is turned to.
  function free() {
    const now = scene(),
      { yaw, pitch, zoom, distance } = now ? followed(now) : view;
    return { yaw, pitch, zoom, distance };
  }

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    change(turned(free(), event.movementX * -TURN_PER_PIXEL, event.movementY * TURN_PER_PIXEL));
  });
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (style.wheelScrolls && !event.ctrlKey) return;
      event.preventDefault();
      change(zoomed(view, Math.exp(-event.deltaY * ZOOM_PER_PIXEL)));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (!(event.key in turns)) return;
    event.preventDefault();
    event.stopPropagation();
    change(turned(free(), ...turns[event.key].map((sign) => sign * TURN_PER_KEY)));
  });
  for (const button of buttons) {
    button.addEventListener("click", () => {
      const [yaw, pitch] = [button.dataset.yaw, button.dataset.pitch].map(
        (angle) => (angle * Math.PI) / 180,
      );
      change({ yaw, pitch, zoom: 1 });
    });
  }
  const lookFrom = (name) => change({ ...view, from: name, zoom: scene()?.eyes?.[name]?.zoom || 1 });
  new ResizeObserver(redraw).observe(canvas);
  return { redraw, lookFrom };
}
