// The pose in space, drawn on a plain canvas and turned with the mouse or the arrow keys.
// Axes of the camera: x right, y down, z away from it.
import { penOf, color } from "./dom.js";

const START = { yaw: 0.6, pitch: 0.25, zoom: 1 };

export function createSpace(canvas, limbs, sides) {
  const view = { ...START };
  let points = {},
    faint = null;

  function bounds() {
    const all = Object.values(points);
    const range = (axis) => [
      Math.min(...all.map((p) => p[axis])),
      Math.max(...all.map((p) => p[axis])),
    ];
    const [x, y, z] = [0, 1, 2].map(range);
    return {
      middle: [x, y, z].map(([low, high]) => (low + high) / 2),
      ground: y[1],
      height: y[1] - y[0],
    };
  }

  // Maps a point to [x, y, depth, size] on the canvas, with a little perspective as the eye expects.
  function projector(width, height, { middle }, unit) {
    const [cy, sy, cp, sp] = [
      Math.cos(view.yaw),
      Math.sin(view.yaw),
      Math.cos(view.pitch),
      Math.sin(view.pitch),
    ];
    const scale = (Math.min(width, height) / (1.35 * unit)) * view.zoom;
    return ([px, py, pz]) => {
      const [x, y, z] = [px - middle[0], py - middle[1], pz - middle[2]];
      const across = x * cy + z * sy,
        away = z * cy - x * sy;
      const depth = y * sp + away * cp,
        near = 1 / (1 + depth / (6 * unit));
      return [
        width / 2 + across * scale * near,
        height / 2 + (y * cp - away * sp) * scale * near,
        depth,
        near,
      ];
    };
  }

  function drawGround(pen, project, { middle, ground }, unit) {
    pen.strokeStyle = color("rule");
    pen.lineWidth = 1;
    pen.beginPath();
    for (let n = -3; n <= 3; n++) {
      const at = (n * unit) / 4,
        end = (3 * unit) / 4;
      for (const [a, b] of [
        [
          [at, -end],
          [at, end],
        ],
        [
          [-end, at],
          [end, at],
        ],
      ]) {
        pen.moveTo(...project([middle[0] + a[0], ground, middle[2] + a[1]]).slice(0, 2));
        pen.lineTo(...project([middle[0] + b[0], ground, middle[2] + b[1]]).slice(0, 2));
      }
    }
    pen.stroke();
  }

  function stroke(pen, [a, b], style, width) {
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(a[0], a[1]);
    pen.lineTo(b[0], b[1]);
    pen.stroke();
  }

  // Far to near, with a seam, so that the nearer limb passes visibly over the farther one.
  function drawLimbs(pen, project) {
    const styles = { left: color("left"), right: color("right"), middle: color("trunk") };
    const lines = limbs
      .filter(({ name, parent }) => points[name] && points[parent])
      .map(({ name, parent }) => ({
        ends: [project(points[parent]), project(points[name])],
        side: sides[name],
      }));
    const depth = ({ ends: [a, b] }) => a[2] + b[2];
    for (const { ends, side } of lines.sort((p, q) => depth(q) - depth(p))) {
      const wide = 6 * ((ends[0][3] + ends[1][3]) / 2) ** 2;
      stroke(pen, ends, color("card"), wide + 4);
      stroke(pen, ends, styles[side], wide);
      pen.fillStyle = styles[side];
      drawEnd(pen, ends[1], side, wide * 0.75);
    }
  }

  function drawEnd(pen, [x, y], side, size) {
    pen.beginPath();
    if (side === "right") pen.rect(x - size, y - size, 2 * size, 2 * size);
    else pen.arc(x, y, size, 0, 2 * Math.PI);
    pen.fill();
  }

  function draw() {
    const [pen, width, height] = penOf(canvas);
    if (Object.keys(points).length < 2) return;
    const space = bounds(),
      unit = Math.max(space.height, 1e-6),
      project = projector(width, height, space, unit);
    pen.lineCap = pen.lineJoin = "round";
    drawGround(pen, project, space, unit);
    for (const { name, parent } of limbs) {
      // shadow on the ground
      if (!points[name] || !points[parent]) continue;
      const flat = [points[parent], points[name]].map(([x, , z]) => project([x, space.ground, z]));
      stroke(pen, flat, color("shadow"), 6);
    }
    if (faint) drawFaint(pen, project);
    drawLimbs(pen, project);
  }

  function drawFaint(pen, project) {
    for (const { name, parent } of limbs) {
      if (faint[name] && faint[parent])
        stroke(pen, [project(faint[parent]), project(faint[name])], color("rule"), 3);
    }
  }

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + pitch));
    draw();
  }

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) turn(event.movementX * -0.01, event.movementY * 0.01);
  });
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      view.zoom = Math.max(0.5, Math.min(4, view.zoom * Math.exp(-event.deltaY * 0.0015)));
      draw();
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    const turns = {
      ArrowLeft: [0.1, 0],
      ArrowRight: [-0.1, 0],
      ArrowUp: [0, 0.1],
      ArrowDown: [0, -0.1],
    };
    if (!turns[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    turn(...turns[event.key]);
  });
  for (const button of canvas.parentElement.querySelectorAll("[data-yaw]")) {
    button.addEventListener("click", () => {
      const [yaw, pitch] = [button.dataset.yaw, button.dataset.pitch].map(
        (angle) => (angle * Math.PI) / 180,
      );
      Object.assign(view, { yaw, pitch, zoom: 1 });
      draw();
    });
  }
  new ResizeObserver(draw).observe(canvas);

  return {
    show(pose, other = null) {
      points = pose ?? {};
      faint = other;
      draw();
    },
  };
}
