// The motion as a figure in space that can be turned, drawn on a plain canvas.
"use strict";
(() => {
  const { byId, data, unpack, color, count } = report;
  const points3d = unpack(data.points3d), truth3d = unpack(data.truth3d);
  const joints = points3d.shape[1], unit = data.stature;
  const canvas = byId("figure-canvas"), ghost = byId("ghost");
  const view = { yaw: 0.6, pitch: 0.3, zoom: 1 };
  let palette = null;

  const joint = (points, j) => {
    const at = (report.frame() * joints + j) * 3;
    return points.values.subarray(at, at + 3);
  };

  // Height of the lower foot over the frames around, so that the ground does not follow each step.
  const ground = (() => {
    const lowest = new Float32Array(count);
    for (let t = 0; t < count; t++) {
      let low = -Infinity;
      for (let j = 0; j < joints; j++) low = Math.max(low, points3d.values[(t * joints + j) * 3 + 1] || 0);
      lowest[t] = low;
    }
    const reach = Math.max(1, Math.round(data.fps / 4));
    return lowest.map((_, t) => {
      const around = lowest.subarray(Math.max(0, t - reach), t + reach + 1);
      return around.reduce((sum, value) => sum + value, 0) / around.length;
    });
  })();

  // Maps a point to [x, y, depth, size] on the canvas.
  function projector(width, height, level) {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const scale = (Math.min(width, height * 1.1) / (1.55 * unit)) * view.zoom;
    const middle = level - 0.5 * unit;
    return (x, y, z) => {
      const side = x * cy + z * sy, away = z * cy - x * sy, up = y - middle;
      const depth = up * sp + away * cp;
      const near = 1 / (1 + depth / (6 * unit)); // a little perspective, as the eye expects
      return [width / 2 + side * scale * near, height / 2 + (up * cp - away * sp) * scale * near, depth, near];
    };
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    palette ??= Object.fromEntries(["left", "right", "trunk", "truth", "rule", "ink", "card"]
      .map((name) => [name, color(`--${name}`)]));
    const pen = canvas.getContext("2d"), level = ground[report.frame()];
    const project = projector(width, height, level);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineCap = pen.lineJoin = "round";
    drawGrid(pen, project, level);
    drawFlat(pen, points3d, (x, y, z) => project(x, level, z), [palette.ink, 0.14, 9]);
    if (truth3d && ghost.checked) drawFlat(pen, truth3d, project, [palette.truth, 0.6, 4]);
    drawTrunk(pen, project);
    drawBones(pen, project);
  }

  function drawGrid(pen, project, level) {
    const end = (4 * unit) / 6;
    pen.strokeStyle = palette.rule;
    pen.lineWidth = 1;
    pen.beginPath();
    for (let n = -4; n <= 4; n++) {
      const at = (n * unit) / 6;
      pen.moveTo(...project(at, level, -end).slice(0, 2));
      pen.lineTo(...project(at, level, end).slice(0, 2));
      pen.moveTo(...project(-end, level, at).slice(0, 2));
      pen.lineTo(...project(end, level, at).slice(0, 2));
    }
    pen.stroke();
  }

  // All bones in one stroke: the shadow on the ground, and the truth.
  function drawFlat(pen, points, place, [style, alpha, thickness]) {
    pen.strokeStyle = style;
    pen.globalAlpha = alpha;
    pen.lineWidth = thickness;
    pen.beginPath();
    for (const pair of data.bones) {
      const [a, b] = pair.map((j) => place(...joint(points, j)));
      if (!Number.isFinite(a[0] + b[0])) continue;
      pen.moveTo(a[0], a[1]);
      pen.lineTo(b[0], b[1]);
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  // The trunk as a tinted plane and the head as a ball, so that the eye sees which way it faces.
  function drawTrunk(pen, project) {
    pen.fillStyle = palette.trunk;
    pen.globalAlpha = 0.18;
    pen.beginPath();
    for (const j of data.trunk) pen.lineTo(...project(...joint(points3d, j)).slice(0, 2));
    pen.fill();
    if (data.head.length) {
      const [low, high] = data.head.map((j) => joint(points3d, j));
      const length = Math.hypot(...low.map((value, n) => high[n] - value));
      const [x, y] = project(...low.map((value, n) => value + 0.62 * (high[n] - value)));
      const [x1, y1] = project(...low), [x2, y2] = project(low[0], low[1] - length, low[2]);
      pen.beginPath();
      pen.arc(x, y, Math.max(0.38 * Math.hypot(x1 - x2, y1 - y2), 14 * view.zoom) || 0, 0, 2 * Math.PI);
      pen.fill();
    }
    pen.globalAlpha = 1;
  }

  // Bones far to near; a seam lets the nearer one pass visibly over the farther one.
  function drawBones(pen, project) {
    const places = Array.from({ length: joints }, (_, j) => project(...joint(points3d, j)));
    const styles = [palette.left, palette.right, palette.trunk];
    const lines = data.bones.map(([a, b], bone) => [places[a], places[b], styles[data.sides[bone]]]);
    lines.sort((p, q) => q[0][2] + q[1][2] - p[0][2] - p[1][2]);
    for (const [a, b, style] of lines) {
      if (!Number.isFinite(a[0] + b[0])) continue;
      const wide = 7 * ((a[3] + b[3]) / 2) ** 2 * Math.sqrt(view.zoom);
      line(pen, [a, b], 0.2, palette.card, wide + 5);
      line(pen, [a, b], 0, style, wide);
    }
  }

  // A line less a share of its length at both ends.
  function line(pen, [a, b], less, style, width) {
    const at = (share) => [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.lineCap = less ? "butt" : "round";
    pen.beginPath();
    pen.moveTo(...at(less));
    pen.lineTo(...at(1 - less));
    pen.stroke();
  }

  let waiting = false;
  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }
  report.followers.push(redraw);
  report.restyled.push(() => {
    palette = null;
    redraw();
  });
  new ResizeObserver(redraw).observe(canvas);
  if (ghost) ghost.addEventListener("change", redraw);

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + pitch));
    redraw();
  }
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) turn(event.movementX * -0.01, event.movementY * 0.01);
  });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return; // a plain wheel scrolls the page
    event.preventDefault();
    view.zoom = Math.max(0.4, Math.min(4, view.zoom * Math.exp(-event.deltaY * 0.002)));
    redraw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (!(event.key in turns)) return;
    turn(...turns[event.key]);
    event.preventDefault();
    event.stopPropagation();
  });
  document.querySelectorAll("[data-yaw]").forEach((button) => button.addEventListener("click", () => {
    view.yaw = (button.dataset.yaw * Math.PI) / 180;
    view.pitch = (button.dataset.pitch * Math.PI) / 180;
    view.zoom = 1;
    redraw();
  }));
})();
