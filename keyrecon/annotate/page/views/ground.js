// The page of the ground where there is no court: both ends of upright things, of a known length or two
// points of the horizon are clicked; squares of a metre show what they and the player tell.
import { CASING, drawCross, drawLabel } from "../draw/canvas.js";
import { placeIn } from "../draw/geometry.js";
import { createViewer } from "../draw/viewer.js";
import * as api from "../state/api.js";
import { byId, make, numberIn, setText } from "./dom.js";

const SMALL_WIDTH = 960; // of a frame until the sharp one is here, px
const GRID = "#ff2878",
  POST = "#00dcff",
  MARKED = "#56b4e9",
  CHOSEN = "#e69f00";
const KINDS = {
  vertical: { name: "Upright thing", ends: ["one end of something upright", "its other end"] },
  length: { name: "Length", ends: ["one end of a length on the ground", "its other end"] },
  horizon: { name: "Horizon", ends: ["a point of the horizon", "another point of it, far from the first"] },
};

export function createGround(model, { frames, shell, go, heightWaits }) {
  const { project } = model,
    last = project.n_frames - 1;
  const viewer = createViewer({ root: byId("ground-picture"), project, frames, redraw: model.redraw });
  const selection = { frame: 0, kind: "vertical", start: null, pointer: null };
  let ground = null, // what was marked and what is known; see assist/ground_views.py
    view = null, // the ground over the frame that is shown: {frame, lines, post}
    working = false;
  const metres = byId("ground-metres"),
    field = byId("ground-fov");

  const on = (number) => ground.marks.filter(({ frame }) => frame === number),
    here = () => on(selection.frame);
  const failed = (fault) => model.notify(fault.message || "The server does not answer.");

  const loadView = api.latestOnly(async (frame) => {
    view = { frame, ...(await api.read(`ground/${frame}`)) };
    model.redraw();
  }, failed);

  function take(answer) {
    ground = answer.marks ? answer : null;
    if (ground && document.activeElement !== field) field.value = ground.field_of_view ?? "";
    loadView(selection.frame);
    model.redraw();
  }

  const requests = api.oneByOne(take, failed),
    load = () => api.read("ground"),
    opened = () => requests.ask(load);
  const change = (request) => requests.keep(() => api.send("ground", request).catch(refused));
  function refused(fault) {
    failed(fault);
    return load();
  }

  function show(frame) {
    selection.frame = Math.max(0, Math.min(last, frame));
    selection.start = null;
    loadView(selection.frame);
    model.redraw();
  }

  function choose(kind) {
    Object.assign(selection, { kind, start: null });
    model.redraw();
  }

  // {length} that is typed, null for none; {fault} where one is missing or is none.
  function typedLength() {
    const length = selection.kind === "horizon" ? null : numberIn(metres);
    if (length === null && selection.kind === "length") return { fault: "Type the length in metres first." };
    if (length !== null && !(length > 0 && length < Infinity))
      return { fault: "A length is a number of metres above 0, such as 1.8." };
    return { length };
  }

  function click(at) {
    if (!ground || viewer.shown() !== selection.frame) return;
    const place = placeIn([project.width, project.height], viewer.toPicture(at));
    if (!place) return;
    const { length, fault } = typedLength();
    if (fault) {
      model.notify(fault);
      metres.focus();
      return;
    }
    if (!selection.start) selection.start = place;
    else {
      const { frame, kind, start } = selection;
      selection.start = null;
      metres.value = "";
      change({ mark: { kind, frame, ends: [start, place], metres: length } });
    }
    model.redraw();
  }

  viewer.listen({
    grab: () => null,
    drag() {},
    drop() {},
    click,
    hover(at) {
      selection.pointer = at;
      model.redraw();
    },
  });

  const buttons = Object.entries(KINDS).map(([kind, { name }]) => {
    const button = make("button", { type: "button", data: { kind } }, name);
    button.addEventListener("click", () => choose(kind));
    return button;
  });
  byId("ground-kinds").append(...buttons);
  const slider = byId("ground-frame");
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  byId("ground-back").addEventListener("click", () => show(selection.frame - 1));
  byId("ground-ahead").addEventListener("click", () => show(selection.frame + 1));
  byId("ground-primary").addEventListener("click", primary);
  field.addEventListener("change", () => {
    const degrees = numberIn(field);
    if (Number.isNaN(degrees)) model.notify("The field of view is a number of degrees.");
    else change({ field_of_view: degrees });
  });

  const isFound = () => ground.camera && !ground.changed;

  // Whether nothing is in metres but a height of which the motion does not know.
  const waitsForHeight = () =>
    heightWaits() && model.project.settings.height === null && ground.marks.every((mark) => mark.metres === null);

  // A number that Enter ended in its field is used, too, and a page that has just opened is waited for.
  async function primary() {
    await requests.rest();
    if (shell.runningJob() || !ground?.motion || ground.court || isFound()) return;
    if (!waitsForHeight()) shell.startJob("ground");
    else
      model.notify(
        "Nothing is in metres yet: the height that is typed in 3 Motion counts when the motion is made anew. Or mark a known length.",
        { text: "Go to 3 Motion", act: () => go("motion") },
      );
  }

  function words() {
    const { name, ends } = KINDS[selection.kind];
    if (shell.runningJob()?.kind === "ground") return ["The ground is being looked for", ""];
    if (ground.court) return ["The court has told the camera", "The ground is for videos without one."];
    if (!ground.motion)
      return ["Make the motion first", "The player's own height tells where the ground is, best where he walks about."];
    if (selection.start) return [`Click ${ends[1]}`, `${name}: the first end is marked.`];
    if (isFound())
      return ["Do the squares lie flat, and does the post stand upright?", ground.camera];
    return [
      `Click ${ends[0]}`,
      "Two upright things, far left and far right, tell most; a known length, the horizon or the field of view help.",
    ];
  }

  function drawLines(pen, lines, color, width) {
    for (const [style, wide] of [[CASING, width + 2], [color, width]]) {
      pen.strokeStyle = style;
      pen.lineWidth = wide;
      pen.beginPath();
      for (const [from, to] of lines) {
        pen.moveTo(...viewer.toScreen(from));
        pen.lineTo(...viewer.toScreen(to));
      }
      pen.stroke();
    }
  }

  function drawPicture() {
    viewer.drawPicture(selection.frame, [undefined, SMALL_WIDTH]);
    const [pen] = viewer.overlay();
    pen.lineCap = "round";
    if (view?.frame === viewer.shown() && view.lines) {
      drawLines(pen, view.lines, GRID, 1);
      drawLines(pen, view.post, POST, 2.5);
    }
    // A picture may come later than it is asked for.
    for (const { name, ends } of on(viewer.shown())) {
      drawLines(pen, [ends], MARKED, 1.5);
      for (const end of ends) drawCross(pen, viewer.toScreen(end), MARKED);
      const [x, y] = viewer.toScreen(ends[0]);
      drawLabel(pen, [x + 10, y - 14], name);
    }
    if (selection.start) {
      drawCross(pen, viewer.toScreen(selection.start), CHOSEN);
      if (selection.pointer)
        drawLines(pen, [[selection.start, viewer.toPicture(selection.pointer)]], CHOSEN, 1.5);
    }
    viewer.cursor("crosshair");
  }

  // It is gone at once, so that the next press means the next one.
  function remove(mark) {
    const { kind, frame, ends, metres: length } = mark;
    ground = { ...ground, marks: ground.marks.filter((other) => other !== mark) };
    change({ removed: { kind, frame, ends, metres: length } });
    model.redraw();
  }

  function markRow(mark) {
    const { name, frame, metres: length } = mark,
      known = length === null ? "" : `, ${length} m`,
      there = make("button", { className: "plain" }, `${name}, frame ${frame}${known}`),
      removal = make("button", { className: "plain", "aria-label": `Remove ${name}` }, "✕");
    there.addEventListener("click", () => show(frame));
    // The second click of a double one would meet the row that has moved up.
    removal.addEventListener("click", ({ detail }) => detail < 2 && remove(mark));
    return make("div", {}, there, removal);
  }

  function drawMarks() {
    const list = byId("ground-marks"),
      content = JSON.stringify(ground.marks);
    if (list.dataset.content === content) return;
    list.dataset.content = content;
    list.replaceChildren(...ground.marks.map(markRow));
  }

  // When the work has ended, what it found is shown.
  function watchWork() {
    const running = shell.runningJob()?.kind === "ground";
    if (working && !running) opened();
    working = running;
  }

  function draw() {
    watchWork();
    if (!ground) return;
    const [text, more] = words();
    slider.value = selection.frame;
    setText(byId("ground-where"), `frame ${selection.frame} of ${project.n_frames}`);
    setText(byId("ground-text"), text);
    setText(byId("ground-more"), more);
    byId("ground-primary").hidden = Boolean(shell.runningJob()) || !ground.motion || ground.court || isFound();
    for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.kind === selection.kind);
    drawMarks();
    drawPicture();
  }

  const commands = {
    primary,
    clear: () => ground && here().length && remove(here().at(-1)),
    kind: ({ index }) => choose(Object.keys(KINDS)[index]),
    back: () => choose(selection.kind),
    step: ({ index, shift }) =>
      show(selection.frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
    zoom: viewer.toggleZoom,
    zoomBy: ({ index }) => viewer.zoom(viewer.toScreen(viewer.middle()), index ? 0.8 : 1.25),
  };
  return { draw, commands, opened };
}
