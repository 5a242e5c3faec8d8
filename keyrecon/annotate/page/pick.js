// The page where colours are picked: click a part on any frame, and see on a strip of other frames
// whether head and feet are found.
import { arrowStep } from "./commands.js";
import { addPick, newId, removePick } from "./edits.js";
import { byId, numberIn, setText } from "./dom.js";
import { placeUnder } from "./geometry.js";
import { createPalette } from "./palette.js";
import { partsOf, stillNeeded, usualBudget } from "./parts.js";
import { drawCross, drawLabel } from "./skeleton.js";
import { createStrip } from "./strip.js";
import { createViewer } from "./viewer.js";

const REACH = 8; // px around a pick

export function createPick(model, { stills, jobs, frame: surround }) {
  const { project } = model,
    last = project.n_frames - 1,
    root = byId("pick-picture");
  const viewer = createViewer({ root, project, stills, changed: model.changed });
  const strip = createStrip(model, stills, show);
  const palette = createPalette({ choose, show, remove, name });
  const doing = {
    frame: Math.round(last / 2),
    part: "head",
    named: [],
    cross: null,
    pointer: null,
  };
  let map = null; // where the part's colour is, over the picture

  const picks = () => model.state.picks;
  const here = () => picks().filter(({ frame }) => frame === doing.frame);
  const parts = () => partsOf(picks(), doing.named);

  function show(frame) {
    doing.frame = Math.max(0, Math.min(last, frame));
    askMap();
    model.changed();
  }

  function choose(part) {
    doing.part = part;
    askMap();
    model.changed();
  }

  function name(part) {
    doing.named.push(part);
    choose(part);
  }

  function add([x, y]) {
    if (x < 0 || y < 0 || x > project.width - 1 || y > project.height - 1) return;
    const [px, py] = [x, y].map((value) => Math.round(value * 10) / 10);
    model.edit(addPick({ id: newId(), frame: doing.frame, part: doing.part, x: px, y: py }));
    const next = stillNeeded(parts())[0],
      now = parts().find(({ part }) => part === doing.part);
    if (next && now.picked >= now.count) choose(next.part);
  }

  // What was clicked wrong is to be clicked again.
  function remove(pick) {
    model.edit(removePick(pick));
    choose(pick.part);
  }

  async function askMap() {
    map = null;
    if (!byId("show-map").checked) return;
    const { frame, part } = doing,
      asked = new URLSearchParams({ part, revision: model.state.revision });
    const response = await fetch(`/api/backprojection/${frame}?${asked}`).catch(() => null);
    const picture = response?.status === 200 && (await createImageBitmap(await response.blob()));
    if (picture && frame === doing.frame && part === doing.part) map = picture;
    model.changed();
  }

  // The server answers from the picks that it has.
  model.onSettled(() => {
    if (model.doing.view !== "pick") return;
    strip.ask();
    askMap();
  });

  viewer.listen({
    grab: () => null,
    drag() {},
    drop() {},
    click(at) {
      const places = here().map((pick) => [pick.id, viewer.toScreen([pick.x, pick.y])]);
      const id = placeUnder(at, Object.fromEntries(places), REACH);
      if (id) remove(picks().find((pick) => pick.id === id));
      else add(viewer.toPicture(at));
    },
    hover(at) {
      doing.pointer = at;
      model.changed();
    },
  });

  const slider = byId("pick-frame");
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  byId("pick-back").addEventListener("click", () => show(doing.frame - 1));
  byId("pick-ahead").addEventListener("click", () => show(doing.frame + 1));
  byId("pick-primary").addEventListener("click", primary);
  byId("show-map").addEventListener("change", askMap);

  const budget = project.settings.budget ?? usualBudget(project.n_frames);
  byId("budget").value = String(Math.round(10000 * budget) / 100);

  function primary() {
    const [next] = stillNeeded(parts()),
      wanted = (numberIn(byId("budget")) ?? NaN) / 100;
    if (next) choose(next.part);
    else if (!(wanted > 0))
      model.tell("The share of frames to mark is a number of per cent, such as 1.5.");
    else if (!surround.runningJob()) jobs.start("keyframes", { budget: wanted });
  }

  function drawPicture() {
    viewer.drawPicture(doing.frame, [undefined, 960]);
    const [pen] = viewer.overlay();
    if (map) {
      const scale = viewer.scale();
      pen.drawImage(map, ...viewer.toScreen([0, 0]), scale * project.width, scale * project.height);
    }
    for (const pick of here()) {
      const at = viewer.toScreen([pick.x, pick.y]);
      drawCross(pen, at, palette.colorOf(pick.part));
      drawLabel(pen, [at[0] + 10, at[1] - 14], pick.part);
    }
    if (doing.cross) drawCross(pen, viewer.toScreen(doing.cross), "#fff");
    if (doing.pointer)
      drawLabel(pen, [doing.pointer[0] + 14, doing.pointer[1] + 18], doing.part, true);
    viewer.cursor("crosshair");
  }

  function words() {
    const now = parts().find(({ part }) => part === doing.part);
    if (surround.runningJob())
      return ["The keyframes are being chosen", "When cancelled, it goes on from there later."];
    if (stillNeeded(parts()).length) {
      return [
        `Click ${now.hint}`,
        "On any frame where it is well seen. A click on a pick removes it.",
      ];
    }
    return [
      "The colours are known",
      "Are head and feet on the player in the strip? More clicks make it surer.",
    ];
  }

  function draw() {
    const [text, more] = words();
    slider.value = doing.frame;
    setText(byId("pick-where"), `frame ${doing.frame} of ${project.n_frames}`);
    setText(byId("pick-text"), text);
    setText(byId("pick-more"), more);
    byId("pick-primary").hidden = byId("budget-row").hidden =
      stillNeeded(parts()).length > 0 || Boolean(surround.runningJob());
    setText(
      byId("pick-primary"),
      model.project.has.keyframes ? "Choose the keyframes again" : "Choose the keyframes",
    );
    palette.draw(parts(), picks(), doing.part);
    strip.draw(doing.frame);
    drawPicture(); // asked for last, so that its still comes first
  }

  const commands = {
    primary,
    clear: () => here().length && remove(here().at(-1)),
    step: ({ place, shift }) =>
      show(doing.frame + (place ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
    part: ({ place }) => parts()[place] && choose(parts()[place].part),
    nudge(key) {
      const [dx, dy] = arrowStep(key),
        [x, y] = doing.cross ?? viewer.middle();
      doing.cross = [x + dx, y + dy];
      model.changed();
    },
    put: () => doing.cross && add(doing.cross),
    map: () => byId("show-map").click(),
    zoom: viewer.toggleZoom,
    zoomBy: ({ place }) => viewer.zoom(viewer.toScreen(viewer.middle()), place ? 0.8 : 1.25),
  };
  return { draw, commands, opened: strip.ask };
}
