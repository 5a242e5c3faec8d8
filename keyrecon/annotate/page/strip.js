// Small pictures of frames spread over the video, with the head and the feet that the picks find there.
import * as api from "./api.js";
import { byId, make, penOf, setText } from "./dom.js";
import { fit, toScreen } from "./geometry.js";
import { spread } from "./parts.js";

const FRAMES = 7;
const WIDTH = 320; // px of the stills

export function createStrip(model, stills, choose) {
  const { project } = model,
    frames = spread(project.n_frames, FRAMES);
  const found = new Map(); // frame -> {head, feet, box}
  let confidence = null;

  const cells = frames.map((frame) => {
    const canvas = make("canvas"),
      number = make("small", {}, String(frame));
    const cell = make("button", { title: `Frame ${frame}` }, canvas, number);
    cell.addEventListener("click", () => choose(frame));
    return { frame, cell, canvas };
  });
  byId("strip").append(...cells.map(({ cell }) => cell));

  const ask = api.latestOnly(
    async () => {
      const answer = await api.send("picks/preview", { frames });
      found.clear();
      for (const row of answer.frames ?? []) found.set(row.frame, row);
      confidence = answer.confidence ?? null;
      model.changed();
    },
    () => found.clear(),
  ); // too few picks so far

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
      const [pen, width, height] = penOf(canvas),
        row = found.get(frame),
        view = fit([0, 0, project.width, project.height], [width, height]);
      const picture = stills.get(frame, WIDTH),
        extent = [project.width * view.scale, project.height * view.scale];
      if (picture) pen.drawImage(picture, view.x, view.y, ...extent);
      cell.setAttribute("aria-current", frame === current);
      if (row?.head) mark(pen, toScreen(view, row.head), "#56b4e9", 5);
      for (const foot of row?.feet ?? []) mark(pen, toScreen(view, foot), "#e69f00", 3.5);
    }
    const seen =
      typeof confidence === "number"
        ? `Head and feet agree on ${Math.round(100 * confidence)} % of the strip.`
        : "";
    setText(byId("strip-note"), seen);
  }

  return { ask, draw };
}
