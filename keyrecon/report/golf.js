// The page of one swing or of two: player, figure and paths on the video, bodies in space, charts.
// The cursor is a frame of the first swing; the second is shown where it stands in the same posture.
import { cssColor, painted } from "./colors.js";
import { createFigure3d, prepareCanvas } from "./figure3d.js";

const byId = (id) => document.getElementById(id);
const read = (id) => JSON.parse(byId(id).textContent);
const { swings: told, names } = read("golf-data");
const SIDES = ["left", "right", "trunk", "club"];
const STYLE = {
  start: { yaw: 0.6, pitch: 0.25 },
  fit: (width, height) => Math.min(width, height) / 1.9,
  grid: { lines: 4, step: 1 / 4 },
  shadowWidth: 7,
  boneWidth: 6,
  marksEnds: false,
  wheelScrolls: true,
};
const PATH_WIDTH = 2.5; // px
const HANDS = "hands";

function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const whole = new Int16Array(bytes.buffer);
  const values = Float32Array.from(whole, (n) => (n === -32768 ? NaN : n * packed.step));
  return { values, shape: packed.shape };
}

// Linear between the given places, and beyond them at the pace of `beyond`.
function interpolate(x, from, to, beyond) {
  const last = from.length - 1;
  if (x <= from[0]) return to[0] + (x - from[0]) * beyond;
  if (x >= from[last]) return to[last] + (x - from[last]) * beyond;
  let n = 0;
  while (x > from[n + 1]) n++;
  const share = (x - from[n]) / (from[n + 1] - from[n] || 1);
  return to[n] + share * (to[n + 1] - to[n]);
}

const swings = told.map((swing, number) => {
  const time = unpack(swing.time).values;
  const flat = unpack(swing.flat),
    solid = unpack(swing.solid);
  const points = (packed, frame) => {
    const [, joints, axes] = packed.shape,
      start = frame * joints * axes;
    return Array.from({ length: joints }, (_, j) =>
      packed.values.subarray(start + j * axes, start + (j + 1) * axes));
  };
  return {
    ...swing,
    time,
    count: time.length,
    joints: flat.shape[1],
    flatAt: (frame) => points(flat, frame),
    solidAt: (frame) => points(solid, frame),
    limbs: swing.bones.map(([from, to], n) => ({ from, to, side: SIDES[swing.sides[n]] })),
    frame: 0,
    video: document.querySelector(`[data-swing="${number}"]`),
    drawn: document.querySelector(`[data-drawn="${number}"]`),
    space: document.querySelector(`[data-space="${number}"]`),
    output: document.querySelector(`[data-now="${number}"]`),
  };
});
const lead = swings[0];
const slider = byId("frame"),
  play = byId("play"),
  speed = byId("speed"),
  figureShown = byId("show-figure"),
  pathsShown = byId("show-paths");
slider.max = lead.count - 1;
const followers = [];
let now = 0,
  playing = false;

function frameOf(swing) {
  if (swing === lead) return Math.round(now);
  const there = interpolate(now, lead.keys, swing.keys, swing.fps / lead.fps);
  return Math.max(0, Math.min(swing.count - 1, Math.round(there)));
}

// A seek that comes while another is under way waits for it.
function seek(swing) {
  const due = (swing.frame + 0.5) / swing.fps;
  if (!swing.video.readyState || swing.video.seeking) return;
  if (Math.abs(swing.video.currentTime - due) > 0.3 / swing.fps) swing.video.currentTime = due;
}

function posture(swing) {
  const near = swing.keys.findIndex((key) => Math.abs(key - swing.frame) < 1);
  return near < 0 ? "" : `, ${names[near].toLowerCase()}`;
}

function drawPath(pen, swing, joint, color, last) {
  pen.strokeStyle = color;
  pen.lineWidth = PATH_WIDTH;
  pen.lineJoin = "round";
  pen.beginPath();
  for (let frame = Math.round(swing.keys[0]); frame <= last; frame++)
    pen.lineTo(...swing.flatAt(frame)[joint]);
  pen.stroke();
}

function drawOnVideo(swing) {
  const [pen, width] = prepareCanvas(swing.drawn);
  const ratio = width / swing.size[0];
  pen.scale(ratio, ratio);
  if (pathsShown.checked) {
    const last = Math.min(swing.frame, Math.round(swing.keys[3]));
    drawPath(pen, swing, swing.joints - 1, cssColor("club"), last);
    drawPath(pen, swing, swing.joints - 2, cssColor(HANDS), last);
  }
  if (!figureShown.checked) return;
  const points = swing.flatAt(swing.frame);
  for (const { from, to, side } of swing.limbs) {
    pen.beginPath();
    pen.moveTo(...points[from]);
    pen.lineTo(...points[to]);
    for (const [color, thick] of [["#14141899", 5], [cssColor(`on-${side}`), 2.6]]) {
      pen.strokeStyle = color;
      pen.lineWidth = thick;
      pen.lineCap = "round";
      pen.stroke();
    }
  }
}

for (const swing of swings) {
  const body = swing.limbs.map((limb) => ({ ...limb, side: limb.side === "club" ? "trunk" : limb.side }));
  swing.figure = createFigure3d(swing.space, {
    scene: () => ({
      points: swing.solidAt(swing.frame),
      bones: body,
      center: [0, swing.level - 0.52 * swing.height, 0],
      level: swing.level,
      unit: swing.height,
      ground: `ground, squares of ${(swing.height / 4).toFixed(2)} ${swing.units}`,
      trunk: swing.trunk,
      head: swing.head,
      other: null,
    }),
    style: STYLE,
    buttons: document.querySelectorAll("[data-yaw]"),
  });
  swing.video.addEventListener("seeked", () => seek(swing));
  swing.video.addEventListener("loadedmetadata", () => seek(swing));
  new ResizeObserver(() => drawOnVideo(swing)).observe(swing.drawn);
}

function show(frame) {
  now = Math.max(0, Math.min(lead.count - 1, frame));
  slider.value = Math.round(now);
  for (const swing of swings) {
    swing.frame = frameOf(swing);
    seek(swing);
    drawOnVideo(swing);
    swing.figure.redraw();
    const seconds = swing.time[swing.frame].toFixed(2);
    swing.output.textContent = `frame ${swing.frame}, ${seconds} s${posture(swing)}`;
  }
  followers.forEach((follow) => follow());
}

let last = 0;
function step(at) {
  if (!playing) return;
  const due = now + ((at - last) / 1000) * lead.fps * Number(speed.value);
  last = at;
  show(due);
  if (due >= lead.count - 1) setPlaying(false);
  else requestAnimationFrame(step);
}

function setPlaying(wanted) {
  playing = wanted;
  play.textContent = playing ? "❚❚" : "▶";
  play.setAttribute("aria-label", playing ? "Pause" : "Play");
  if (!playing) return;
  if (now >= lead.count - 1) show(0);
  last = performance.now();
  requestAnimationFrame(step);
}

play.addEventListener("click", () => setPlaying(!playing));
slider.addEventListener("input", () => {
  setPlaying(false);
  show(Number(slider.value));
});
for (const button of document.querySelectorAll("[data-key]"))
  button.addEventListener("click", () => {
    setPlaying(false);
    show(Math.round(lead.keys[Number(button.dataset.key)]));
  });
for (const box of [figureShown, pathsShown]) box.addEventListener("change", () => show(now));
document.addEventListener("keydown", (event) => {
  const busy = event.target.closest("select, input, button, summary, canvas");
  if ((busy && event.target !== slider) || event.ctrlKey || event.metaKey || event.altKey) return;
  const steps = { ArrowLeft: -1, ArrowRight: 1 };
  if (event.key === " ") setPlaying(!playing);
  else if (event.key in steps) show(Math.round(now) + steps[event.key] * (event.shiftKey ? 10 : 1));
  else return;
  event.preventDefault();
});

const drawnCharts = new Map();
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
  element.on("plotly_click", (event) => show(Math.round(event.points[0].x)));
  place();
}

function drawCharts() {
  for (const element of document.querySelectorAll(".chart")) {
    const figure = painted(read(`chart-${element.dataset.chart}`));
    Plotly.react(element, figure.data, figure.layout, { displayModeBar: false, responsive: true });
    if (!drawnCharts.has(element) && "follows" in element.dataset) addCursor(element);
    drawnCharts.set(element, figure);
  }
}

addEventListener("DOMContentLoaded", () => {
  drawCharts();
  show(Math.round(lead.keys[0]));
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  drawCharts();
  show(now);
});
