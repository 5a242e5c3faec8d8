// A body in space on a plain canvas, turned with the pointer, the arrow keys or buttons. The report
// has this file inlined, the annotator serves it. Axes of the camera: x right, y down, z away from it.
import { cssColor } from "./colors.js";

const EYE_DISTANCE = 6; // of the eye that sees the figure in perspective, body heights
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
// `view` has yaw and pitch (radians), `scale` is in pixels per unit of length at the center.
export function createProjection(view, { center, unit, scale, size }) {
  const [cy, sy] = [Math.cos(view.yaw), Math.sin(view.yaw)];
  const [cp, sp] = [Math.cos(view.pitch), Math.sin(view.pitch)];
  return (point) => {
    const [x, y, z] = [0, 1, 2].map((axis) => point[axis] - center[axis]);
    const across = x * cy + z * sy,
      away = z * cy - x * sy;
    const depth = y * sp + away * cp,
      near = 1 / (1 + depth / (EYE_DISTANCE * unit));
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

// The trunk as a tinted plane and the head as a ball, so that the eye sees which way it faces.
function drawVolumes(pen, project, { points, trunk, head }, zoom) {
  pen.fillStyle = cssColor("trunk");
  pen.globalAlpha = 0.18;
  pen.beginPath();
  for (const key of trunk) pen.lineTo(...project(points[key]).slice(0, 2));
  pen.fill();
  if (head.length) {
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
//   trunk    keys around the trunk, head: its lower and upper key; both may be empty
//   other    a second pose to compare with: {points, color, width, alpha}, or null
// `style` is what differs between pages: start (yaw, pitch), fit(width, height) in body heights, grid
// {lines, step} in body heights, boneWidth (px), marksEnds, and whether a plain wheel scrolls the page.
export function createFigure3d(canvas, { scene, style, buttons }) {
  let view = { ...style.start, zoom: 1 },
    waiting = false;

  function draw() {
    const [pen, width, height] = prepareCanvas(canvas),
      now = scene();
    if (!now) return;
    const project = createProjection(view, {
      ...now,
      scale: (style.fit(width, height) / now.unit) * view.zoom,
      size: [width, height],
    });
    const onGround = (key) => {
      const point = now.points[key];
      return point && project([point[0], now.level, point[2]]);
    };
    pen.lineCap = pen.lineJoin = "round";
    drawGrid(pen, project, now, { ...style.grid, step: style.grid.step * now.unit });
    drawFlat(pen, now.bones, onGround, { color: cssColor("shadow"), width: style.shadowWidth });
    if (now.other) {
      const there = (key) => now.other.points[key] && project(now.other.points[key]);
      drawFlat(pen, now.bones, there, now.other);
    }
    if (now.trunk.length) drawVolumes(pen, project, now, view.zoom);
    drawBones(pen, sortBones(now, project), style, view.zoom);
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

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    change(turned(view, event.movementX * -TURN_PER_PIXEL, event.movementY * TURN_PER_PIXEL));
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
    change(turned(view, ...turns[event.key].map((sign) => sign * TURN_PER_KEY)));
  });
  for (const button of buttons) {
    button.addEventListener("click", () => {
      const [yaw, pitch] = [button.dataset.yaw, button.dataset.pitch].map(
        (angle) => (angle * Math.PI) / 180,
      );
      change({ yaw, pitch, zoom: 1 });
    });
  }
  new ResizeObserver(redraw).observe(canvas);
  return { redraw };
}
