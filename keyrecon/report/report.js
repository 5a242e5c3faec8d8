// The moving parts of the report: one cursor (a frame number) that everything follows.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const read = (id) => JSON.parse(byId(id).textContent);
  const data = read("motion-data");
  const followers = []; // functions of a frame number, called whenever it changes
  let now = 0;

  // An array packed as 16-bit steps; unknown numbers become NaN.
  function unpack(packed) {
    if (!packed) return null;
    const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
    const whole = new Int16Array(bytes.buffer);
    const values = Float32Array.from(whole, (n) => (n === -32768 ? NaN : n * packed.step));
    return { values, shape: packed.shape };
  }
  const points3d = unpack(data.points3d), truth3d = unpack(data.truth3d);
  const refined = unpack(data.refined), raw = unpack(data.raw), truth2d = unpack(data.truth2d);
  const marks = unpack(data.marked.points), time = unpack(data.time).values;
  const [count, joints] = points3d.shape;

  function color(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  // Replaces "var(--name)" by the colour of the present scheme, anywhere in a figure.
  function paint(value) {
    if (typeof value === "string") return value.replace(/^var\((--\w+)\)$/, (_, name) => color(name));
    if (Array.isArray(value)) return value.map(paint);
    if (value && value.constructor === Object) {
      return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, paint(part)]));
    }
    return value;
  }

  // ---- charts ------------------------------------------------------------------------------
  const config = { displaylogo: false, responsive: true, displayModeBar: false };
  const charts = new Map(); // element -> figure whose colours are still names

  function jointFigure(figure, joint) {
    const frames = Array.from({ length: count }, (_, t) => t);
    const curve = (points, axis) =>
      frames.map((t) => points.values[(t * joints + joint) * 2 + axis]);
    const traces = [];
    for (const axis of [0, 1]) {
      traces.push([frames, curve(raw, axis)], [frames, curve(refined, axis)]);
      if (truth2d) traces.push([frames, curve(truth2d, axis)]);
      const marked = data.marked.frames;
      traces.push([marked, marked.map((_, k) => marks.values[(k * joints + joint) * 2 + axis])]);
    }
    figure.data.forEach((trace, n) => { [trace.x, trace.y] = traces[n]; });
  }

  function draw(element) {
    const figure = charts.get(element);
    if (element.dataset.chart === "joint") jointFigure(figure, Number(byId("joint").value));
    const painted = paint(figure);
    Plotly.react(element, painted.data, painted.layout, config);
    if (!element.dataset.drawn) {
      element.dataset.drawn = "yes";
      if (element.dataset.chart !== "sources") addCursor(element);
    }
  }

  function addCursor(element) {
    const line = document.createElement("div");
    line.className = "cursor";
    element.append(line);
    const place = () => {
      const { xaxis, _size: size } = element._fullLayout;
      const x = xaxis.l2p(now);
      line.hidden = x < 0 || x > xaxis._length;
      Object.assign(line.style, {
        left: `${xaxis._offset + x}px`, top: `${size.t}px`, height: `${size.h}px`,
      });
    };
    followers.push(place);
    element.on("plotly_afterplot", place);
    element.on("plotly_click", (event) => show(event.points[0].x));
    place();
  }

  const soon = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      soon.unobserve(target);
      charts.set(target, read(`chart-${target.dataset.chart}`));
      draw(target);
    }
  }, { rootMargin: "600px" });
  document.querySelectorAll(".chart").forEach((element) => soon.observe(element));
  byId("joint").addEventListener("change", () => {
    const element = document.querySelector('[data-chart="joint"]');
    if (charts.has(element)) draw(element);
  });

  // ---- distance matrices -------------------------------------------------------------------
  const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74",
    "#c3b369", "#e1cc55", "#fee838"].map((hex) => [1, 3, 5].map((at) => parseInt(hex.substr(at, 2), 16)));
  function cividis(share) {
    const at = Math.min(share, 0.9999) * (CIVIDIS.length - 1), low = Math.floor(at);
    return CIVIDIS[low].map((value, n) => value + (CIVIDIS[low + 1][n] - value) * (at - low));
  }

  function setUpMatrix(figure) {
    const { top, beta, frames, keyframes } = JSON.parse(figure.dataset.matrix);
    const image = figure.querySelector("img"), plate = figure.querySelector(".plate");
    const readout = figure.querySelector("output");
    const side = image.naturalWidth;
    const base = document.createElement("canvas"), over = document.createElement("canvas");
    base.width = base.height = side;
    over.width = over.height = 720;
    const pen = base.getContext("2d");
    pen.drawImage(image, 0, 0);
    const pixels = pen.getImageData(0, 0, side, side);
    const grey = new Uint8Array(side * side);
    const lookup = Array.from({ length: 256 }, (_, n) => cividis(n / 255));
    for (let n = 0; n < grey.length; n++) {
      grey[n] = pixels.data[4 * n];
      pixels.data.set(lookup[grey[n]], 4 * n);
    }
    pen.putImageData(pixels, 0, 0);
    plate.append(base, over);
    addScale(figure, top, beta);
    let pointed = null;
    const mark = () => {
      const brush = over.getContext("2d"), unit = over.width / frames;
      brush.clearRect(0, 0, over.width, over.width);
      brush.fillStyle = "#ffffff";
      for (const frame of keyframes) {
        const at = (frame + 0.5) * unit;
        brush.beginPath();
        brush.moveTo(at - 6, 0); brush.lineTo(at + 6, 0); brush.lineTo(at, 10);
        brush.moveTo(0, at - 6); brush.lineTo(0, at + 6); brush.lineTo(10, at);
        brush.fill();
      }
      for (const [across, down, style] of [[now, now, "#ffffffcc"], pointed || []]) {
        if (across === undefined) continue;
        brush.strokeStyle = style;
        brush.beginPath();
        brush.moveTo((across + 0.5) * unit, 0); brush.lineTo((across + 0.5) * unit, over.width);
        brush.moveTo(0, (down + 0.5) * unit); brush.lineTo(over.width, (down + 0.5) * unit);
        brush.stroke();
      }
    };
    const pairAt = (event) => {
      const box = over.getBoundingClientRect();
      const at = [event.clientX - box.left, event.clientY - box.top];
      return at.map((p) => Math.max(0, Math.min(frames - 1, Math.floor((p / box.width) * frames))));
    };
    over.addEventListener("pointermove", (event) => {
      const [across, down] = pairAt(event);
      const cell = (frame) => Math.min(side - 1, Math.floor((frame / frames) * side));
      const distance = (grey[cell(down) * side + cell(across)] / 255) * top;
      readout.textContent = `frames ${down} and ${across}: ${distance.toFixed(3)} player heights`
        + (distance < beta ? ", alike" : "");
      pointed = [across, down, "#ff6ec7"];
      mark();
    });
    over.addEventListener("pointerleave", () => { pointed = null; readout.textContent = "\u00a0"; mark(); });
    over.addEventListener("click", (event) => show(pairAt(event)[1]));
    followers.push(mark);
    mark();
  }

  function addScale(figure, top, beta) {
    const bar = document.createElement("div");
    bar.className = "scale";
    const stops = [0, 0.25, 0.5, 0.75, 1].map((share) => `rgb(${cividis(share).map(Math.round)})`);
    bar.style.background = `linear-gradient(to right, ${stops})`;
    const at = Math.min(1, beta / top) * 100;
    for (const [place, label] of [[0, "0"], [at, "β"], [100, top.toFixed(2)]]) {
      const span = document.createElement("span");
      span.textContent = label;
      span.style.left = `${place}%`;
      bar.append(span);
    }
    const tick = document.createElement("i");
    tick.style.left = `${at}%`;
    bar.append(tick);
    figure.append(bar);
  }
  for (const figure of document.querySelectorAll(".matrix")) {
    figure.querySelector("img").decode().then(() => setUpMatrix(figure));
  }

  // ---- the figure in space -----------------------------------------------------------------
  const canvas = byId("figure-canvas"), ghost = byId("ghost");
  const view = { yaw: 0.6, pitch: 0.3, zoom: 1 };
  const unit = data.stature;

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

  function projector(width, height) {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const scale = (Math.min(width, height * 1.1) / (1.55 * unit)) * view.zoom;
    const middle = ground[now] - 0.5 * unit;
    return (x, y, z) => {
      const side = x * cy + z * sy, away = z * cy - x * sy, up = y - middle;
      const depth = up * sp + away * cp;
      const near = 1 / (1 + depth / (6 * unit)); // a little perspective, as the eye expects
      return [width / 2 + side * scale * near, height / 2 + (up * cp - away * sp) * scale * near, depth, near];
    };
  }

  function drawFigure() {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineCap = "round";
    const project = projector(width, height), level = ground[now];
    drawGrid(pen, project, level);
    const joint = (points, j) => Array.from(points.values.subarray((now * joints + j) * 3, (now * joints + j) * 3 + 3));
    pen.globalAlpha = 0.13;
    stroke(pen, points3d, (p) => project(p[0], level, p[2]), () => color("--ink"), 9);
    pen.globalAlpha = 0.5;
    if (truth3d && ghost && ghost.checked) stroke(pen, truth3d, (p) => project(...p), () => color("--truth"), 4);
    pen.globalAlpha = 1;
    const sides = ["--left", "--right", "--trunk"].map(color);
    drawTrunk(pen, joint, project, sides[2]);
    stroke(pen, points3d, (p) => project(...p), (bone) => sides[data.sides[bone]], 7, color("--card"));

    // Bones far to near; a seam lets the nearer one pass visibly over the farther one.
    function stroke(pen, points, place, paintOf, thickness, seam) {
      const lines = data.bones.map(([a, b], bone) => [place(joint(points, a)), place(joint(points, b)), bone]);
      lines.sort((p, q) => q[0][2] + q[1][2] - p[0][2] - p[1][2]);
      for (const [a, b, bone] of lines) {
        if (!Number.isFinite(a[0] + b[0])) continue;
        const wide = thickness * ((a[3] + b[3]) / 2) ** 2 * Math.sqrt(view.zoom);
        if (seam) line(pen, a, b, 0.2, seam, wide + 5);
        line(pen, a, b, 0, paintOf(bone), wide);
      }
    }
  }

  // A line from `a` to `b` without a share of its length at both ends.
  function line(pen, a, b, without, style, width) {
    const at = (share) => [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.lineCap = without ? "butt" : "round";
    pen.beginPath();
    pen.moveTo(...at(without));
    pen.lineTo(...at(1 - without));
    pen.stroke();
  }

  // The trunk as a tinted plane and the head as a ball, so that the eye sees which way it faces.
  function drawTrunk(pen, joint, project, style) {
    pen.fillStyle = style;
    pen.globalAlpha = 0.16;
    if (data.trunk.length) {
      pen.beginPath();
      for (const j of data.trunk) {
        const [x, y] = project(...joint(points3d, j));
        pen.lineTo(x, y);
      }
      pen.fill();
    }
    if (data.head.length) {
      const [low, high] = data.head.map((j) => joint(points3d, j));
      const [x, y, , near] = project(...low.map((value, n) => value + 0.62 * (high[n] - value)));
      const [left, right] = [project(...low), project(...high)];
      const size = 0.38 * Math.max(Math.hypot(left[0] - right[0], left[1] - right[1]), 30 * near);
      pen.beginPath();
      pen.arc(x, y, size || 0, 0, 2 * Math.PI);
      pen.fill();
    }
    pen.globalAlpha = 1;
  }

  function drawGrid(pen, project, level) {
    pen.strokeStyle = color("--rule");
    pen.lineWidth = 1;
    for (let n = -4; n <= 4; n++) {
      const at = (n * unit) / 6, end = (4 * unit) / 6;
      for (const [from, to] of [[[at, -end], [at, end]], [[-end, at], [end, at]]]) {
        pen.beginPath();
        pen.moveTo(...project(from[0], level, from[1]));
        pen.lineTo(...project(to[0], level, to[1]));
        pen.stroke();
      }
    }
  }

  let waiting = false;
  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; drawFigure(); });
  }
  followers.push(redraw);
  new ResizeObserver(redraw).observe(canvas);

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
    if (!event.ctrlKey) return;
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
  if (ghost) ghost.addEventListener("change", redraw);

  // ---- the cursor and the player -----------------------------------------------------------
  const slider = byId("frame"), play = byId("play"), output = byId("now"), speed = byId("speed");
  const clip = byId("clip");
  slider.max = count - 1;
  let playing = false, started = 0, from = 0;

  function show(frame, seek = true) {
    now = Math.max(0, Math.min(count - 1, Math.round(frame)));
    slider.value = now;
    output.textContent = `frame ${now}, ${time[now].toFixed(2)} s`;
    if (seek) {
      if (clip.readyState) clip.currentTime = (now + 0.5) / data.fps;
      from = now;
      started = performance.now();
    }
    followers.forEach((follow) => follow(now));
  }

  // The small video leads where the browser plays it, else a clock does.
  function step() {
    if (!playing) return;
    const led = clip.readyState > 2 && !clip.paused;
    const frame = led ? Math.floor(clip.currentTime * data.fps + 1e-3)
      : from + ((performance.now() - started) / 1000) * data.fps * Number(speed.value);
    if (frame >= count - 1 || clip.ended) { show(count - 1, false); setPlaying(false); return; }
    if (Math.floor(frame) !== now) show(Math.floor(frame), false);
    requestAnimationFrame(step);
  }
  function setPlaying(wanted) {
    playing = wanted;
    play.textContent = playing ? "❚❚" : "▶";
    play.setAttribute("aria-label", playing ? "Pause" : "Play");
    if (!playing) { clip.pause(); show(now); return; }
    if (now >= count - 1) show(0);
    from = now;
    started = performance.now();
    clip.playbackRate = Number(speed.value);
    clip.play().catch(() => {}); // without the video the clock goes on
    requestAnimationFrame(step);
  }
  play.addEventListener("click", () => setPlaying(!playing));
  slider.addEventListener("input", () => { if (playing) setPlaying(false); show(Number(slider.value)); });
  speed.addEventListener("change", () => {
    clip.playbackRate = Number(speed.value);
    from = now;
    started = performance.now();
  });
  clip.addEventListener("loadedmetadata", () => show(now));
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("select, input, button, dialog[open]") && event.target !== slider) return;
    const steps = { ArrowLeft: -1, ArrowRight: 1 };
    if (event.key === " ") setPlaying(!playing);
    else if (event.key in steps) show(now + steps[event.key] * (event.shiftKey ? 10 : 1));
    else return;
    event.preventDefault();
  });

  // ---- stills ------------------------------------------------------------------------------
  const large = byId("large");
  document.querySelectorAll(".still").forEach((still) => still.addEventListener("click", () => {
    show(Number(still.dataset.frame));
    const image = still.querySelector("img");
    if (!image) return;
    large.querySelector("img").src = image.src;
    large.querySelector("img").alt = image.alt;
    large.querySelector("p").textContent = image.alt;
    large.showModal();
  }));
  large.addEventListener("click", () => large.close());
  document.querySelectorAll("[data-copy]").forEach((image) => { image.src = byId(image.dataset.copy).src; });

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    charts.forEach((_, element) => draw(element));
    redraw();
  });
  show(0);
})();
