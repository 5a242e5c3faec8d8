// Plotly charts over the frames, in the colours of the present scheme, with the page's cursor.
"use strict";
(() => {
  const { byId, read, data, unpack, color, count } = report;
  const config = { displaylogo: false, responsive: true, displayModeBar: false };
  const charts = new Map(); // element -> figure whose colours are still names
  const curves = ["raw", "refined", "truth2d"].map((name) => unpack(data[name])).filter(Boolean);
  const marks = unpack(data.marked.points), joints = marks.shape[1];

  // Replaces "var(--name)" by the colour of the present scheme, anywhere in a figure.
  function paint(value) {
    if (typeof value === "string") return value.replace(/^var\((--\w+)\)$/, (_, name) => color(name));
    if (Array.isArray(value)) return value.map(paint);
    if (value && value.constructor === Object) {
      return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, paint(part)]));
    }
    return value;
  }

  function fillJoint(figure, joint) {
    const frames = Array.from({ length: count }, (_, t) => t), marked = data.marked.frames;
    const pick = (points, rows, axis) => rows.map((t) => points.values[(t * joints + joint) * 2 + axis]);
    const traces = [0, 1].flatMap((axis) => [
      ...curves.map((points) => [frames, pick(points, frames, axis)]),
      [marked, pick(marks, marked.map((_, k) => k), axis)],
    ]);
    figure.data.forEach((trace, n) => { [trace.x, trace.y] = traces[n]; });
  }

  function draw(element) {
    const figure = charts.get(element);
    if (element.dataset.chart === "joint") fillJoint(figure, Number(byId("joint").value));
    const painted = paint(figure);
    Plotly.react(element, painted.data, painted.layout, config);
  }

  function addCursor(element) {
    const line = document.createElement("div");
    line.className = "cursor";
    element.append(line);
    const place = () => {
      const { xaxis, _size: size } = element._fullLayout;
      const x = xaxis.l2p(report.frame());
      line.hidden = x < 0 || x > xaxis._length;
      Object.assign(line.style, {
        left: `${xaxis._offset + x}px`, top: `${size.t}px`, height: `${size.h}px`,
      });
    };
    report.followers.push(place);
    element.on("plotly_afterplot", place);
    element.on("plotly_click", (event) => report.show(event.points[0].x));
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
  report.restyled.push(() => charts.forEach((_, element) => draw(element)));
  byId("joint").addEventListener("change", () => {
    const element = document.querySelector('[data-chart="joint"]');
    if (charts.has(element)) draw(element);
  });
})();
