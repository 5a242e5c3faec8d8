// The page of the court: the model's lines over every frame, and points of the court to click where
// the lines do not tell; dragging a point mends a wrong court.
import { CASING, cssColor, drawCross, drawLabel, prepareCanvas } from "../draw/canvas.js";
import { nearestPlace, placeIn } from "../draw/geometry.js";
import { createViewer } from "../draw/viewer.js";
import * as api from "../state/api.js";
import { ASKED, namedInWords, nextPoint } from "../state/court_points.js";
import { byId, counted, make, setText } from "./dom.js";

const GRAB_RADIUS = 12; // px around a point in which it is taken
const SMALL_WIDTH = 960; // of a frame until the sharp one is here, px
const LINE = "#ff2878",
  PREVIEW = "#ffdc00",
  CLICKED = "#56b4e9",
  CHOSEN = "#e69f00";
const MAP_MARGIN = 14; // px

export function createCourt(model, { frames, shell }) {
  const { project } = model,
    last = project.n_frames - 1;
  const viewer = createViewer({ root: byId("court-picture"), project, frames, redraw: model.redraw });
  const selection = { frame: Math.round(last / 2), point: null, dragged: null, pointer: null };
  let court = null, // the map, the clicks and how far the camera is; see server/court.py
    view = null, // the court over the frame that is shown: {frame, source, lines, points, fault}
    searched = false, // whether the court was looked for since the page was opened
    working = false;

  const on = (number) => court.clicks.filter(({ frame }) => frame === number),
    here = () => on(selection.frame);
  const failed = (fault) => model.notify(fault.message || "The server does not answer.");

  const loadView = api.latestOnly(async (frame) => {
    const fresh = await api.read(`court/${frame}`);
    view = { frame, ...fresh };
    model.redraw();
  }, failed);

  // A click shows at once; what the server says of it comes later.
  const requests = api.oneByOne(take, failed);
  function take(answer) {
    court = answer.clicks ? { ...court, ...answer } : null;
    if (!court) return;
    loadView(selection.frame);
    model.redraw();
  }
  function opened() {
    requests.ask(() => api.read("court")).then(() => {
      if (!court) return;
      selection.point = isFound() ? null : (selection.point ?? nextPoint(court.clicks));
      model.redraw();
    });
  }
  const isFound = () => court.found !== null && !court.changed;

  function show(frame) {
    selection.frame = Math.max(0, Math.min(last, frame));
    selection.dragged = null;
    loadView(selection.frame);
    model.redraw();
  }

  function choose(name) {
    selection.point = name;
    model.redraw();
  }

  // Keeps a click of a point in a frame; takes it away where there is no place.
  function keep({ name, frame, place }) {
    const others = court.clicks.filter((click) => click.name !== name || click.frame !== frame),
      clicks = place ? [...others, { name, frame, x: place[0], y: place[1] }] : others;
    court = { ...court, clicks };
    requests.keep(() => api.send("court", { name, frame, place }).catch(refused));
    model.redraw();
  }
  function refused(fault) {
    failed(fault);
    return api.read("court");
  }

  function put(name, at) {
    if (viewer.shown() !== selection.frame || name === null) return;
    const place = placeIn([project.width, project.height], at);
    if (!place) return;
    keep({ name, frame: selection.frame, place });
    choose(nextPoint(court.clicks));
  }

  // What can be taken hold of: clicks of this frame, and where the model has its points.
  function places() {
    const known = view?.frame === selection.frame ? view.points : {},
      clicks = Object.fromEntries(here().map(({ name, x, y }) => [name, [x, y]])),
      all = { ...known, ...clicks };
    return Object.fromEntries(
      Object.entries(all).map(([name, place]) => [name, viewer.toScreen(place)]),
    );
  }

  viewer.listen({
    grab: (at) => (court && viewer.shown() === selection.frame ? nearestPlace(at, places(), GRAB_RADIUS) : null),
    drag(name, place) {
      selection.dragged = { name, place };
      model.redraw();
    },
    drop(name, place) {
      selection.dragged = null;
      put(name, place);
      model.redraw();
    },
    cancelled() {
      selection.dragged = null;
    },
    click(at) {
      if (!court) return;
      const name = nearestPlace(at, places(), GRAB_RADIUS);
      if (name && here().some((click) => click.name === name)) choose(name);
      else put(selection.point, viewer.toPicture(at));
    },
    hover(at) {
      selection.pointer = at;
      model.redraw();
    },
  });

  const map = createMap(byId("court-map"), choose);
  const slider = byId("court-frame");
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  byId("court-back").addEventListener("click", () => show(selection.frame - 1));
  byId("court-ahead").addEventListener("click", () => show(selection.frame + 1));
  byId("court-primary").addEventListener("click", primary);

  // A page that has just opened, and a point that was clicked last, are waited for.
  async function primary() {
    await requests.rest();
    if (shell.runningJob() || !court || isFound()) return;
    searched = true;
    shell.startJob("court");
  }

  function words() {
    const count = court.clicks.length,
      point = selection.point && namedInWords(selection.point);
    if (shell.runningJob()?.kind === "court") return ["The court is being looked for", ""];
    if (view?.fault) return ["These points do not tell the camera", view.fault];
    if (court.changed)
      return [
        count < court.fewest || view?.source !== "clicks"
          ? `Click ${point}`
          : "Do the yellow lines lie on the painted ones?",
        `${counted(count, "point")} clicked. Four tell the camera, five tell which one is wrong; choose another on the map.`,
      ];
    if (court.found !== null)
      return [
        "Do the pink lines lie on the painted ones?",
        `The court was found in ${Math.round(100 * court.found)} % of the frames. If a frame is wrong, drag four of its points to their places.`,
      ];
    if (searched || count)
      return [`Click ${point}`, "Four points of the court tell the camera; choose on the map which one to click."];
    return [
      "Is this a tennis court?",
      "Its lines tell where the camera and the player are. No click is needed where they are seen well.",
    ];
  }

  function drawPicture() {
    viewer.drawPicture(selection.frame, [undefined, SMALL_WIDTH]);
    const [pen] = viewer.overlay(),
      shown = viewer.shown(); // a picture may come later than it is asked for
    byId("court-picture").dataset.lines = (view?.frame === shown && view.source) || "";
    if (view?.frame === shown) {
      pen.lineCap = "round";
      for (const [color, width] of [[CASING, 3.5], [view.source === "clicks" ? PREVIEW : LINE, 1.5]]) {
        pen.strokeStyle = color;
        pen.lineWidth = width;
        pen.beginPath();
        for (const [from, to] of view.lines) {
          pen.moveTo(...viewer.toScreen(from));
          pen.lineTo(...viewer.toScreen(to));
        }
        pen.stroke();
      }
      for (const place of Object.values(view.points)) drawDot(pen, viewer.toScreen(place), LINE, 4);
    }
    for (const { name, x, y } of on(shown)) {
      const moved = selection.dragged?.name === name ? selection.dragged.place : [x, y],
        at = viewer.toScreen(moved);
      drawCross(pen, at, name === selection.point ? CHOSEN : CLICKED);
      drawLabel(pen, [at[0] + 10, at[1] - 14], namedInWords(name));
    }
    if (selection.dragged) drawCross(pen, viewer.toScreen(selection.dragged.place), CHOSEN);
    if (selection.pointer && selection.point && !selection.dragged) {
      const [x, y] = selection.pointer;
      drawLabel(pen, [x + 14, y + 18], namedInWords(selection.point), true);
    }
    viewer.cursor("crosshair");
  }

  function clickRow({ name, frame }) {
    const go = make("button", { className: "plain" }, `${namedInWords(name)}, frame ${frame}`),
      label = `Remove ${namedInWords(name)} of frame ${frame}`,
      removal = make("button", { className: "plain", "aria-label": label }, "✕");
    go.addEventListener("click", () => show(frame));
    removal.addEventListener("click", () => keep({ name, frame }));
    return make("div", {}, go, removal);
  }

  function drawClicks() {
    const list = byId("court-points"),
      content = JSON.stringify(court.clicks);
    if (list.dataset.content === content) return;
    list.dataset.content = content;
    list.replaceChildren(...court.clicks.map(clickRow));
  }

  // When the work has ended, what it found is shown.
  function watchWork() {
    const running = shell.runningJob()?.kind === "court";
    if (working && !running) opened();
    working = running;
  }

  function draw() {
    watchWork();
    if (!court) return;
    const [text, more] = words(),
      button = byId("court-primary");
    slider.value = selection.frame;
    setText(byId("court-where"), `frame ${selection.frame} of ${project.n_frames}`);
    setText(byId("court-text"), text);
    setText(byId("court-more"), more);
    button.hidden = Boolean(shell.runningJob()) || isFound();
    setText(button, court.clicks.length ? "Find the court with these points" : "Find the court");
    setText(byId("court-chosen"), selection.point ? `To click: ${namedInWords(selection.point)}` : "");
    drawClicks();
    map(court, selection);
    drawPicture();
  }

  const commands = {
    primary,
    clear: () => court && here().length && keep({ name: here().at(-1).name, frame: selection.frame }),
    step: ({ index, shift }) =>
      show(selection.frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
    zoom: viewer.toggleZoom,
    zoomBy: ({ index }) => viewer.zoom(viewer.toScreen(viewer.middle()), index ? 0.8 : 1.25),
  };
  return { draw, commands, opened };
}

function drawDot(pen, [x, y], color, radius) {
  pen.fillStyle = color;
  pen.strokeStyle = CASING;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
  pen.stroke();
}

// The court from above with its points; a press chooses the nearest one. Posts of the net stand for
// their tops: their feet are chosen beside them.
function createMap(canvas, choose) {
  let spots = {};

  canvas.addEventListener("click", (event) => {
    const name = nearestPlace([event.offsetX, event.offsetY], spots, 40);
    if (name) choose(name);
  });

  return function draw({ lines, points, clicks }, { point }) {
    const [pen, width, height] = prepareCanvas(canvas);
    const [wide, long] = [7.4, 12.6],
      scale = Math.min((width - 2 * MAP_MARGIN) / wide, (height - 2 * MAP_MARGIN) / long) / 2;
    const at = ([x, y]) => [width / 2 + x * scale, height / 2 - y * scale];
    pen.strokeStyle = cssColor("muted");
    pen.lineWidth = 1.2;
    pen.beginPath();
    for (const [from, to] of lines) {
      pen.moveTo(...at(from));
      pen.lineTo(...at(to));
    }
    pen.stroke();
    spots = Object.fromEntries(
      Object.entries(points).map(([name, [x, y]]) => [
        name,
        at(name.endsWith("foot") ? [x, y - 1] : [x, y]),
      ]),
    );
    const done = new Set(clicks.map(({ name }) => name));
    for (const [name, spot] of Object.entries(spots)) {
      const color = name === point ? CHOSEN : done.has(name) ? CLICKED : cssColor("card"),
        asked = ASKED.includes(name);
      drawDot(pen, spot, color, name === point ? 7 : asked ? 5 : 4);
    }
    pen.fillStyle = cssColor("muted");
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText("far", width / 2, 11);
    pen.fillText("the camera's end", width / 2, height - 3);
  };
}
