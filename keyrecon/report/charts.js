// Plotly charts over the frames, in the colours of the present scheme, with the page's cursor.
import { painted } from "./colors.js";
import { byId, read, data, count, cuts, frame, show, followers, restyled } from "./cursor.js";
import { unpack } from "./packed.js";

const config = { displaylogo: false, responsive: true, displayModeBar: false };
const charts = new Map(); // element -> figure whose colours are still names
const curves = ["raw", "refined", "truth2d"].map((name) => unpack(data[name], cuts)).filter(Boolean);
const marks = unpack(data.marked.points),
  joints = marks.shape[1];

// All frames, and between two shots a place without a value, where lines end.
const places = Array.from({ length: count }, (_, t) => (cuts.has(t) ? [t - 0.5, t] : [t])).flat();

function fillJoint(figure, joint) {
  const marked = data.marked.frames;
  const pick = (points, rows, axis) =>
    rows.map((t) => (Number.isInteger(t) ? points.values[(t * joints + joint) * 2 + axis] : NaN));
  const traces = [0, 1].flatMap((axis) => [
    ...curves.map((points) => [places, pick(points, places, axis)]),
    [marked, pick(marks, marked.map((_, k) => k), axis)],
  ]);
  figure.data.forEach((trace, n) => { [trace.x, trace.y] = traces[n]; });
}

function draw(element) {
  const figure = charts.get(element);
  if (element.dataset.chart === "joint") fillJoint(figure, Number(byId("joint").value));
  const { data: traces, layout } = painted(figure);
  Plotly.react(element, traces, layout, config);
}

function addCursor(element) {
  const line = document.createElement("div");
  line.className = "cursor";
  element.append(line);
  const place = () => {
    const { xaxis, _size: size } = element._fullLayout;
    const x = xaxis.l2p(frame());
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

// One chart per task, so that the page answers while they are drawn.
const waiting = [...document.querySelectorAll(".chart")];
function drawNext() {
  const element = waiting.shift();
  if (!element) return;
  charts.set(element, read(`chart-${element.dataset.chart}`));
  draw(element);
  if (element.dataset.chart !== "sources") addCursor(element);
  setTimeout(drawNext);
}
addEventListener("DOMContentLoaded", () => setTimeout(drawNext));
restyled.push(() => charts.forEach((_, element) => draw(element)));
byId("joint").addEventListener("change", () => {
  const element = document.querySelector('[data-chart="joint"]');
  if (charts.has(element)) draw(element);
});
