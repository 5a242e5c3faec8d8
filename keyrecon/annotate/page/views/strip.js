// Small pictures of frames spread over the video, with the head and the feet that the picks find there.
import * as api from "../state/api.js";
import { prepareCanvas } from "../draw/canvas.js";
import { fit, pictureBox, pictureOnScreen, toScreen } from "../draw/geometry.js";
import { spreadFrames } from "../state/workflow.js";
import { byId, make, setText } from "./dom.js";

const COUNT = 7; // frames
const WIDTH = 320; // of the small pictures, px

export function createStrip(model, frames, choose) {
  const { project } = model,
    extent = [project.width, project.height],
    numbers = spreadFrames(project.n_frames, COUNT);
  const detections = new Map(); // frame -> {head, feet, box}
  let confidence = null;

  const cells = numbers.map((frame) => {
    const canvas = make("canvas"),
      number = make("small", {}, String(frame));
    const cell = make("button", { title: `Frame ${frame}` }, canvas, number);
    cell.addEventListener("click", () => choose(frame));
    return { frame, cell, canvas };
  });
  byId("strip").append(...cells.map(({ cell }) => cell));

  const refresh = api.latestOnly(
    async () => {
      const answer = await api.send("picks/preview", { frames: numbers });
      detections.clear();
      for (const row of answer.frames ?? []) detections.set(row.frame, row);
      confidence = answer.confidence ?? null;
      model.redraw();
    },
    () => {
      detections.clear(); // too few picks so far
      confidence = null;
      model.redraw();
    },
  );

  function mark(pen, [x, y], style, size) {
    pen.beginPath();
    pen.arc(x, y, size, 0, 2 * Math.PI);
    pen.lineWidth = 4;
    pen.strokeStyle = "rgba(0, 0, 0, .7)";
    pen.stroke();
    pen.lineWidth = 2;
    pen.strokeStyle = style;
    pen.stroke();
  }

  function draw(current) {
    for (const { frame, cell, canvas } of cells) {
      const [pen, width, height] = prepareCanvas(canvas),
        row = detections.get(frame),
        view = fit(pictureBox(extent), [width, height]);
      const picture = frames.get(frame, WIDTH);
      if (picture) pen.drawImage(picture, ...pictureOnScreen(view, extent));
      cell.setAttribute("aria-current", frame === current);
      if (row?.head) mark(pen, toScreen(view, row.head), "#56b4e9", 5);
      for (const foot of row?.feet ?? []) mark(pen, toScreen(view, foot), "#e69f00", 3.5);
    }
    const agreement =
      typeof confidence === "number"
        ? `Head and feet agree on ${Math.round(100 * confidence)} % of the strip.`
        : "";
    setText(byId("strip-note"), agreement);
  }

  return { refresh, draw };
}
