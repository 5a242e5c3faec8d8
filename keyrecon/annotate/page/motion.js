// The motion played over the picture, with the skeleton in space beside it.
import * as api from "./api.js";
import { setOwn } from "./edits.js";
import { byId, color, setText } from "./dom.js";
import { drawJoint, drawLimb } from "./skeleton.js";
import { createSpace } from "./space.js";
import { createViewer } from "./viewer.js";

const CHUNK = 250; // frames asked for at a time
const AHEAD = 24; // stills fetched ahead while playing
const WIDTH = 960; // px of the stills

export function createMotion(model, { stills, jobs, frame: surround, actions }) {
  const { project } = model, last = project.n_frames - 1;
  const viewer = createViewer({ root: byId("motion-picture"), project, stills, changed: model.changed });
  const space = createSpace(byId("motion-space"), project.limbs, model.sides);
  const colors = Object.fromEntries(["left", "right", "middle"].map((side) => [side, color(`mark-${side}`)]));
  const slider = byId("motion-frame");
  let frame = 0, playing = null, chunks = new Map(), made = null;

  const askChunk = async (number) => {
    if (chunks.has(number)) return;
    chunks.set(number, null);
    const from = number * CHUNK, to = Math.min(project.n_frames, from + CHUNK);
    const answer = await api.read(`motion?from=${from}&to=${to}`).catch(() => null);
    if (answer?.points3d) chunks.set(number, answer);
    else chunks.delete(number);
    model.changed();
  };

  // A new run makes new motion: what was fetched of the old one is forgotten.
  function forgetOld() {
    const now = model.project.has?.motion ? `${model.motionVersion ?? 0}` : null;
    if (now === made) return;
    made = now;
    chunks = new Map();
  }

  function points(kind) {
    const number = Math.floor(frame / CHUNK);
    if (made !== null) askChunk(number);
    const row = chunks.get(number)?.[kind]?.[frame - number * CHUNK];
    const named = row?.map((point, j) => [project.joints[j], point]).filter(([, point]) => point && point[0] !== null);
    return named ? Object.fromEntries(named) : null;
  }

  function show(number) {
    frame = Math.max(0, Math.min(last, Math.round(number)));
    stills.wish(Array.from({ length: AHEAD }, (_, n) => [frame + n, WIDTH]));
    model.changed();
  }

  function play() {
    if (playing) {
      playing = null;
      model.changed();
      return;
    }
    playing = { frame: frame >= last ? 0 : frame, since: performance.now() };
    show(playing.frame);
    requestAnimationFrame(step);
  }

  // Each frame waits for its picture, so that picture and skeleton always belong together.
  function step(now) {
    if (!playing || model.doing.view !== "motion") {
      playing = null;
      return;
    }
    const due = Math.min(last, playing.frame + Math.floor(((now - playing.since) * project.fps) / 1000));
    const ready = stills.has(due, WIDTH);
    if (ready && due !== frame) show(due);
    else if (!ready) {
      if (due > frame) stills.get(frame + 1, WIDTH);
      playing = { frame: stills.has(frame + 1, WIDTH) ? frame + 1 : frame, since: now };
      if (playing.frame !== frame) show(playing.frame);
    }
    if (frame >= last) playing = null;
    model.changed();
    requestAnimationFrame(step);
  }

  slider.max = last;
  slider.addEventListener("input", () => {
    playing = null;
    show(Number(slider.value));
  });
  byId("play").addEventListener("click", play);
  byId("motion-primary").addEventListener("click", primary);
  document.querySelectorAll("#motion [data-yaw]").forEach((button) => {
    button.addEventListener("click", () => space.look(Number(button.dataset.yaw), Number(button.dataset.pitch)));
  });
  viewer.listen({ grab: () => null, drag() {}, drop() {}, click() {}, hover() {} });

  function primary() {
    const text = byId("height").value.trim().replace(",", ".");
    const height = text ? Number(text) : null;
    if (Number.isNaN(height)) model.tell(`The height is a number of metres, such as 1.80; "${text}" is not.`);
    else if (!surround.runningJob()) jobs.start("run", { height });
  }

  function drawSkeleton() {
    const [pen] = viewer.overlay(), places = points("points2d") ?? {};
    const at = Object.fromEntries(Object.entries(places).map(([name, place]) => [name, viewer.toScreen(place)]));
    for (const { name, parent } of project.limbs) {
      if (at[name] && at[parent]) drawLimb(pen, at[parent], at[name], { color: colors[model.sides[name]], sign: 0, alpha: 0.8 });
    }
    for (const [name, place] of Object.entries(at)) {
      drawJoint(pen, place, { side: model.sides[name], color: colors[model.sides[name]], size: 3.5 });
    }
  }

  function drawWords() {
    const keyframes = model.keyframes(), open = keyframes.filter((keyframe) => !model.done(keyframe)).length;
    const job = surround.runningJob(), marked = keyframes.length - open;
    const text = job ? "The motion is being made" : made !== null ? "The motion" : marked ? "Make the motion" : "No marks yet";
    const left = open ? `${open} of ${keyframes.length} keyframes are still open; what is marked is used.` : "All keyframes are marked.";
    setText(byId("motion-text"), text);
    setText(byId("motion-more"), job ? "You may go on marking meanwhile." : keyframes.length ? left : "The colours come first.");
    byId("motion-primary").hidden = byId("height-row").hidden = Boolean(job) || !marked;
    setText(byId("motion-primary"), made !== null ? "Make it anew" : "Make the motion");
    setText(byId("motion-note"), made !== null ? "Where the skeleton leaves the body, press K: the frame becomes a keyframe of yours." : "");
  }

  function draw() {
    forgetOld();
    const { fps, time } = project;
    slider.value = frame;
    setText(byId("motion-where"), `frame ${frame} of ${project.n_frames}, ${(time?.[frame] ?? frame / fps).toFixed(2)} s`);
    setText(byId("play"), playing ? "❚❚" : "▶");
    drawWords();
    viewer.drawPicture(frame, [WIDTH]);
    drawSkeleton();
    const body = points("points3d");
    byId("motion-empty").hidden = body !== null;
    space.show(body);
  }

  function add() {
    playing = null;
    if (model.keyframes().some((keyframe) => keyframe.frame === frame)) actions.open(frame);
    else {
      model.edit(setOwn(model.state, frame, "both"));
      actions.open(frame);
    }
  }

  const commands = {
    primary, play, add,
    step: ({ place, shift }) => show(frame + (place ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
  };
  return { draw, commands };
}
