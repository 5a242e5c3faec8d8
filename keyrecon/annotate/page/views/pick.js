// The page where colours are picked: click a part on any frame, and see on a strip of other frames
// whether head and feet are found.
import { drawCross, drawLabel } from "../draw/canvas.js";
import { nearestPlace, placeIn } from "../draw/geometry.js";
import { createViewer } from "../draw/viewer.js";
import { addPick, newId, removePick } from "../state/edits.js";
import { REQUIRED_PARTS, budgetText, missingParts, nextPart, partsOf } from "../state/workflow.js";
import { byId, followProject, make, setText } from "./dom.js";
import { arrowStep } from "./keyboard.js";
import { createStrip } from "./strip.js";

const PICK_RADIUS = 8; // px around a pick in which a click means it
const SMALL_WIDTH = 960; // of a frame until the sharp one is here, px

export function createPick(model, { frames, shell }) {
  const { project } = model,
    last = project.n_frames - 1,
    root = byId("pick-picture");
  const viewer = createViewer({ root, project, frames, redraw: model.redraw });
  const strip = createStrip(model, frames, show);
  const palette = createPalette({ choose, show, remove, name });
  const selection = {
    frame: Math.round(last / 2),
    part: "head", // what a click is taken for; null when everything was clicked once
    last: null, // what the last click was taken for
    named: [],
    cross: null,
    pointer: null,
  };
  let map = null; // where the part's colour is, to be laid over the picture

  const picks = () => model.state.picks;
  const on = (number) => picks().filter(({ frame }) => frame === number);
  const here = () => on(selection.frame);
  const parts = () => partsOf(picks(), selection.named);

  function show(frame) {
    selection.frame = Math.max(0, Math.min(last, frame));
    loadMap();
    model.redraw();
  }

  function choose(part) {
    selection.part = part;
    loadMap();
    model.redraw();
  }

  function name(part) {
    selection.named.push(part);
    choose(part);
  }

  function add(at) {
    if (viewer.shown() !== selection.frame) return; // its picture is still to come
    if (selection.part === null) return model.notify("Choose on the right what the click is to show.");
    const place = placeIn([project.width, project.height], at);
    if (!place) return;
    const [x, y] = place;
    model.edit(addPick({ id: newId(), frame: selection.frame, part: selection.part, x, y }));
    const now = parts().find(({ part }) => part === selection.part);
    selection.last = now.text;
    if (now.picked >= now.count) choose(nextPart(parts())?.part ?? null);
  }

  // What was clicked wrong is to be clicked again.
  function remove(pick) {
    model.edit(removePick(pick));
    choose(pick.part);
  }

  let mapOf = 0; // number of the map that was asked for last
  async function loadMap() {
    const number = ++mapOf;
    map = null;
    model.redraw();
    const { frame, part } = selection;
    if (!byId("show-map").checked || part === null) return;
    const query = new URLSearchParams({ part, revision: model.state.revision });
    const response = await fetch(`/api/backprojection/${frame}?${query}`).catch(() => null);
    const picture = response?.status === 200 && (await createImageBitmap(await response.blob()));
    if (picture && number === mapOf) map = picture;
    model.redraw();
  }

  // The server answers from the picks that it has.
  model.onIdle(() => {
    if (model.ui.view !== "pick") return;
    strip.refresh();
    loadMap();
  });

  viewer.listen({
    grab: () => null,
    drag() {},
    drop() {},
    click(at) {
      const places = here().map((pick) => [pick.id, viewer.toScreen([pick.x, pick.y])]);
      const id = nearestPlace(at, Object.fromEntries(places), PICK_RADIUS);
      if (id) remove(picks().find((pick) => pick.id === id));
      else add(viewer.toPicture(at));
    },
    hover(at) {
      selection.pointer = at;
      model.redraw();
    },
  });

  const slider = byId("pick-frame");
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  byId("pick-back").addEventListener("click", () => show(selection.frame - 1));
  byId("pick-ahead").addEventListener("click", () => show(selection.frame + 1));
  byId("pick-primary").addEventListener("click", primary);
  byId("show-map").addEventListener("change", loadMap);

  followProject(model, byId("budget"), budgetText);

  function primary() {
    const [next] = missingParts(parts());
    if (next) choose(next.part);
    else shell.chooseKeyframes(byId("budget"));
  }

  function drawPicture() {
    viewer.drawPicture(selection.frame, [undefined, SMALL_WIDTH]);
    const [pen] = viewer.overlay();
    if (map) pen.drawImage(map, ...viewer.onScreen());
    for (const pick of on(viewer.shown() ?? selection.frame)) {
      const at = viewer.toScreen([pick.x, pick.y]);
      drawCross(pen, at, palette.colorOf(pick.part));
      drawLabel(pen, [at[0] + 10, at[1] - 14], pick.part);
    }
    if (selection.cross) drawCross(pen, viewer.toScreen(selection.cross), "#fff");
    if (selection.pointer)
      drawLabel(
        pen,
        [selection.pointer[0] + 14, selection.pointer[1] + 18],
        selection.part ?? "nothing chosen",
        true,
      );
    viewer.cursor("crosshair");
  }

  function words() {
    const now = parts().find(({ part }) => part === selection.part);
    if (shell.runningJob())
      return ["The keyframes are being chosen", "When cancelled, it goes on from there later."];
    const taken = selection.last ? `The last click was taken for the ${selection.last}. ` : "";
    if (missingParts(parts()).length)
      return [`Click ${now.hint}`, `${taken}On any frame where it is well seen; a click on a cross takes it away.`];
    if (now) return [`Click ${now.hint}, or go on`, `${taken}What the player does not wear is left out.`];
    return [
      "The colours are known",
      `${taken}Are head and feet on the player in the strip? To add clicks, choose a part first.`,
    ];
  }

  function draw() {
    const [text, more] = words();
    slider.value = selection.frame;
    setText(byId("pick-where"), `frame ${selection.frame} of ${project.n_frames}`);
    setText(byId("pick-text"), text);
    setText(byId("pick-more"), more);
    byId("pick-primary").hidden = byId("budget-row").hidden =
      missingParts(parts()).length > 0 || Boolean(shell.runningJob());
    setText(
      byId("pick-primary"),
      model.project.has.keyframes ? "Choose the keyframes again" : "Choose the keyframes",
    );
    palette.draw(parts(), picks(), selection.part);
    strip.draw(selection.frame);
    drawPicture(); // last, so that its frame is fetched first
  }

  const commands = {
    primary,
    clear: () => here().length && remove(here().at(-1)),
    step: ({ index, shift }) =>
      show(selection.frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
    part: ({ index }) => parts()[index] && choose(parts()[index].part),
    nudge(key) {
      const [dx, dy] = arrowStep(key),
        [x, y] = selection.cross ?? viewer.middle();
      selection.cross = [x + dx, y + dy];
      model.redraw();
    },
    put: () => selection.cross && add(selection.cross),
    map: () => byId("show-map").click(),
    zoom: viewer.toggleZoom,
    zoomBy: ({ index }) => viewer.zoom(viewer.toScreen(viewer.middle()), index ? 0.8 : 1.25),
  };
  return { draw, commands, opened: strip.refresh };
}

const COLORS = [
  "#56b4e9",
  "#e69f00",
  "#f0e442",
  "#cc79a7",
  "#009e73",
  "#d55e00",
  "#0072b2",
  "#ffffff",
];

// Replaces the children of an element when what they show has changed.
function refill(element, content, children) {
  const text = JSON.stringify(content);
  if (element.dataset.content === text) return;
  element.dataset.content = text;
  element.replaceChildren(...children());
}

// Beside the picture: what can be clicked, and what was clicked. Callbacks: choose(part), show(frame),
// remove(pick), name(part).
function createPalette({ choose, show, remove, name }) {
  const colors = new Map(); // part -> colour, kept while the page is open

  function colorOf(part) {
    if (!colors.has(part)) colors.set(part, COLORS[colors.size % COLORS.length]);
    return colors.get(part);
  }

  function partButton({ part, text, picked, count }, n, current) {
    const swatch = make("i"),
      required = REQUIRED_PARTS.some((one) => one.part === part) && picked < count;
    swatch.style.background = colorOf(part);
    const button = make(
      "button",
      { data: { part } },
      swatch,
      text,
      make("small", required ? { className: "needed", title: "needed" } : {}, picked ? String(picked) : ""),
      make("kbd", {}, n < 9 ? String(n + 1) : ""),
    );
    button.setAttribute("aria-pressed", part === current);
    button.addEventListener("click", () => choose(part));
    return button;
  }

  function pickRow(pick) {
    const go = make("button", { className: "plain" }, `${pick.part}, frame ${pick.frame}`);
    const label = `Remove ${pick.part} of frame ${pick.frame}`;
    const removal = make("button", { className: "plain", "aria-label": label }, "✕");
    go.addEventListener("click", () => show(pick.frame));
    removal.addEventListener("click", () => remove(pick));
    return make("div", {}, go, removal);
  }

  byId("new-part").addEventListener("submit", (event) => {
    event.preventDefault();
    const part = byId("part-name").value.trim().toLowerCase();
    byId("part-name").value = "";
    if (part) name(part);
  });

  function draw(parts, picks, current) {
    refill(byId("parts"), [parts, current], () =>
      parts.map((part, n) => partButton(part, n, current)),
    );
    refill(byId("pick-list"), picks, () => [...picks].reverse().map(pickRow));
  }

  return { draw, colorOf };
}
