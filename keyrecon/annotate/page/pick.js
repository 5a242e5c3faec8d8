// The page where colours are picked: click a part on any frame, and see on a strip of other frames
// whether head and feet are found.
import { addPick, newId, removePick } from "./edits.js";
import { byId, make, setText, toggle } from "./dom.js";
import { placeUnder } from "./geometry.js";
import { createStrip } from "./strip.js";
import { NEEDED, partsOf, stillNeeded } from "./parts.js";
import { drawCross, drawLabel } from "./skeleton.js";
import { createViewer } from "./viewer.js";

const COLORS = ["#56b4e9", "#e69f00", "#f0e442", "#cc79a7", "#009e73", "#d55e00", "#0072b2", "#ffffff"];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export function createPick(model, { stills, jobs, frame: surround }) {
  const { project } = model, last = project.n_frames - 1;
  const viewer = createViewer({ root: byId("pick-picture"), project, stills, changed: model.changed });
  const strip = createStrip(model, (number) => show(number));
  const doing = { frame: Math.round(last / 2), part: "head", named: [], cross: null, pointer: null, map: false };
  let map = null;

  const picks = () => model.state.picks;
  const parts = () => partsOf(picks(), doing.named);
  const colorOf = (part) => COLORS[Math.max(0, parts().findIndex((one) => one.part === part)) % COLORS.length];

  function show(number) {
    doing.frame = Math.max(0, Math.min(last, number));
    map = null;
    askMap();
    model.changed();
  }

  function add([x, y]) {
    if (x < 0 || y < 0 || x > project.width - 1 || y > project.height - 1) return;
    const rounded = [x, y].map((value) => Math.round(value * 10) / 10);
    model.edit(addPick({ id: newId(), frame: doing.frame, part: doing.part, x: rounded[0], y: rounded[1] }));
    const next = stillNeeded(parts())[0], now = parts().find(({ part }) => part === doing.part);
    if (next && now.picked >= now.count) choose(next.part);
  }

  function choose(part) {
    doing.part = part;
    map = null;
    askMap();
    model.changed();
  }

  // The server answers from the picks that it has.
  model.onSettled(() => {
    if (model.doing.view !== "pick") return;
    strip.ask();
    askMap();
  });

  async function askMap() {
    if (!doing.map) return;
    const { frame, part } = doing;
    const response = await fetch(`/api/backprojection/${frame}?${new URLSearchParams({ part, revision: model.state.revision })}`);
    if (!response.ok || frame !== doing.frame || part !== doing.part) return;
    map = await createImageBitmap(await response.blob());
    model.changed();
  }

  // What was clicked wrong is to be clicked again.
  function remove(pick) {
    model.edit(removePick(pick));
    choose(pick.part);
  }
  const here = () => picks().filter(({ frame }) => frame === doing.frame);

  viewer.listen({
    grab: () => null, drag() {}, drop() {},
    click(at) {
      const places = Object.fromEntries(here().map((pick) => [pick.id, viewer.toScreen([pick.x, pick.y])]));
      const id = placeUnder(at, places, 8);
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
  byId("show-map").addEventListener("change", (event) => {
    doing.map = event.target.checked;
    map = null;
    askMap();
    model.changed();
  });
  byId("new-part").addEventListener("submit", (event) => {
    event.preventDefault();
    const name = byId("part-name").value.trim().toLowerCase();
    if (!name) return;
    doing.named.push(name);
    byId("part-name").value = "";
    choose(name);
  });

  function primary() {
    const next = stillNeeded(parts())[0];
    if (next) choose(next.part);
    else if (!surround.runningJob()) jobs.start("keyframes");
  }

  function drawParts() {
    const label = JSON.stringify([parts(), doing.part]);
    if (byId("parts").dataset.label === label) return;
    byId("parts").dataset.label = label;
    byId("parts").replaceChildren(...parts().map(({ part, text, picked, count }, n) => {
      const swatch = make("i");
      swatch.style.background = colorOf(part);
      const needed = NEEDED.some((one) => one.part === part) && picked < count;
      const button = make("button", { data: { part } }, swatch, text,
        make("small", {}, picked ? `${picked}` : needed ? "needed" : ""), make("kbd", {}, n < 9 ? String(n + 1) : ""));
      button.setAttribute("aria-pressed", part === doing.part);
      button.addEventListener("click", () => choose(part));
      return button;
    }));
  }

  function drawList() {
    const label = JSON.stringify(picks());
    if (byId("pick-list").dataset.label === label) return;
    byId("pick-list").dataset.label = label;
    byId("pick-list").replaceChildren(...[...picks()].reverse().map((pick) => {
      const go = make("button", { className: "plain" }, `${pick.part}, frame ${pick.frame}`);
      go.addEventListener("click", () => show(pick.frame));
      const gone = make("button", { className: "plain", "aria-label": `Remove ${pick.part} of frame ${pick.frame}` }, "✕");
      gone.addEventListener("click", () => remove(pick));
      return make("div", {}, go, gone);
    }));
  }

  function drawPicture() {
    viewer.drawPicture(doing.frame, [undefined, 960]);
    const [pen] = viewer.overlay();
    if (map) {
      const [x, y] = viewer.toScreen([0, 0]);
      pen.drawImage(map, x, y, viewer.scale() * project.width, viewer.scale() * project.height);
    }
    for (const pick of here()) {
      const at = viewer.toScreen([pick.x, pick.y]);
      drawCross(pen, at, colorOf(pick.part));
      drawLabel(pen, [at[0] + 10, at[1] - 14], pick.part);
    }
    if (doing.cross) drawCross(pen, viewer.toScreen(doing.cross), "#fff");
    if (doing.pointer) drawLabel(pen, [doing.pointer[0] + 14, doing.pointer[1] + 18], doing.part, true);
    viewer.cursor("crosshair");
  }

  function drawWords() {
    const needed = stillNeeded(parts()), now = parts().find(({ part }) => part === doing.part), job = surround.runningJob();
    setText(byId("pick-text"), job ? "The keyframes are being chosen" : needed.length ? `Click ${now?.hint ?? doing.part}`
      : "The colours are known");
    setText(byId("pick-more"), job ? "This may be cancelled; it goes on from there later."
      : needed.length ? "On any frame where it is well seen. A click on a pick removes it."
        : "Look at the strip: are head and feet on the player? More clicks on other frames make it surer.");
    byId("pick-primary").hidden = needed.length > 0 || Boolean(job);
    setText(byId("pick-primary"), model.project.has?.keyframes ? "Choose the keyframes again" : "Choose the keyframes");
  }

  function draw() {
    slider.value = doing.frame;
    setText(byId("pick-where"), `frame ${doing.frame} of ${project.n_frames}`);
    drawWords();
    drawParts();
    drawList();
    drawPicture();
    strip.draw(doing.frame);
    toggle(byId("pick"), "busy", surround.runningJob());
  }

  const commands = {
    primary, clear: () => here().length && remove(here().at(-1)),
    step: ({ place, shift }) => show(doing.frame + (place ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
    part: ({ place }) => parts()[place] && choose(parts()[place].part),
    nudge({ key, shift }) {
      const [dx, dy] = ARROWS[key].map((step) => step * (shift ? 10 : 1)), [x, y] = doing.cross ?? viewer.middle();
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
