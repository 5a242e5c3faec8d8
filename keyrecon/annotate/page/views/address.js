// The page where a golf swing begins: six joints clicked in the frame of the address, the player's
// height and hand; then the swing is fitted.
import { drawJoint, drawLimb } from "../draw/skeleton.js";
import { createViewer } from "../draw/viewer.js";
import { drawCross, drawLabel } from "../draw/canvas.js";
import { enclosing, nearestPlace, placeIn } from "../draw/geometry.js";
import { placeClick, setGolf } from "../state/edits.js";
import { jointWords } from "../state/joint_words.js";
import { CLICKS, WRONG_HEIGHT, beginIn, clickIn, clickWords, nextAddress } from "../state/swing.js";
import { heightIn, label } from "../state/workflow.js";
import { byId, counted, make, setText, toggle } from "./dom.js";
import { createGuide } from "./guide.js";
import { arrowStep } from "./keyboard.js";

const CLICK_RADIUS = 11; // px around a click in which the pointer means it
const SMALL_WIDTH = 960; // of a frame until the sharp one is here, px
const MARGIN = 0.35; // around the clicks that is shown, in their height
const LINES = [
  ["head_top", "root"],
  ["root", "right_knee"],
  ["right_knee", "right_ankle"],
  ["root", "left_knee"],
  ["left_knee", "left_ankle"],
];

const sentence = (words) => `${words[0].toUpperCase()}${words.slice(1)}. `;

export function createAddress(model, { frames, shell, colors }) {
  const { project } = model,
    last = project.n_frames - 1,
    root = byId("address-picture");
  const viewer = createViewer({ root, project, frames, redraw: model.redraw });
  const guide = createGuide(byId("address-guide"), model, CLICKS);
  let frame = 0,
    dragged = null, // {joint, at}
    cross = null, // moved by the arrow keys
    pointer = null;

  const clicks = () => model.state.clicks;
  const own = () => model.state.golf.frame; // the frame that was clicked
  const step = () => nextAddress(model.state, frame, model.swing?.wrong);
  const sideOf = (joint) => model.sides[joint] ?? "middle";

  function show(number) {
    frame = Math.max(0, Math.min(last, number));
    model.redraw();
  }

  function put(joint, at, v) {
    const place = viewer.shown() === frame ? placeIn([project.width, project.height], at) : null;
    if (place) model.edit(clickIn(model.state, frame, joint, [...place, v]));
  }

  function removeLast() {
    const placed = CLICKS.filter((joint) => clicks()[joint]);
    if (frame === own() && placed.length) model.edit(placeClick(model.state, placed.at(-1), null));
  }

  // Only the player, once it is known where that is.
  function closer() {
    const places = Object.values(clicks());
    if (places.length < CLICKS.length) return viewer.frameBox(null);
    const [x0, y0, x1, y1] = enclosing([...places[0].slice(0, 2), ...places[0].slice(0, 2)], places),
      room = MARGIN * (y1 - y0);
    viewer.frameBox([x0 - 2 * room, y0 - room, x1 + 2 * room, y1 + room]);
  }

  const steps = {
    click() {},
    elsewhere: ({ frame: other }) => show(other),
    wrong: () => model.notify("Drag a click to its place, or take the last one away with Del."),
    fit: () => shell.runningJob() || heightIsWrong() || shell.startJob("golf"),
  };
  function primary() {
    const next = step();
    steps[next.do](next);
  }
  // Clicks of another frame give way to those of this one.
  function secondary() {
    if (step().do === "elsewhere") model.edit(beginIn(model.state, frame));
  }

  const under = (at) => {
    if (!at || frame !== own() || viewer.shown() !== frame) return null;
    const places = Object.entries(clicks()).map(([name, place]) => [name, viewer.toScreen(place)]);
    return nearestPlace(at, Object.fromEntries(places), CLICK_RADIUS);
  };
  viewer.listen({
    grab(at) {
      const joint = under(at);
      return joint && { joint };
    },
    drag({ joint }, at) {
      dragged = { joint, at };
      model.redraw();
    },
    drop({ joint }, at) {
      dragged = null;
      put(joint, at, clicks()[joint]?.[2] ?? 2);
    },
    cancelled() {
      dragged = null;
    },
    click(at, event) {
      const next = step();
      if (under(at)) return;
      if (next.do === "click") put(next.joint, viewer.toPicture(at), event.shiftKey ? 1 : 2);
      else if (next.do === "elsewhere") model.notify(`The other clicks are in frame ${next.frame}.`);
    },
    hover(at) {
      pointer = at;
      model.redraw();
    },
  });

  const slider = byId("address-frame");
  slider.max = last;
  slider.addEventListener("input", () => show(Number(slider.value)));
  byId("address-back").addEventListener("click", () => show(frame - 1));
  byId("address-ahead").addEventListener("click", () => show(frame + 1));
  byId("address-primary").addEventListener("click", primary);
  byId("address-secondary").addEventListener("click", secondary);
  byId("left-handed").addEventListener("change", ({ target }) =>
    model.edit(setGolf(model.state, "left_handed", target.checked)),
  );
  const height = byId("stature"),
    heightIsWrong = () => heightIn(height.value).wrong;
  height.addEventListener("input", model.redraw);
  height.addEventListener("change", () => {
    const { metres, wrong } = heightIn(height.value);
    if (!wrong && metres !== (model.state.golf.stature ?? null))
      model.edit(setGolf(model.state, "stature", metres));
  });

  const rows = new Map(
    CLICKS.map((joint) => [joint, make("div", {}, make("span", {}, clickWords(joint)), make("small"))]),
  );
  byId("address-list").append(...rows.values());

  const WORDS = {
    click: ({ joint }) => {
      const left = CLICKS.filter((name) => !clicks()[name]).length;
      return left === CLICKS.length
        ? {
            text: "Find the address, and click the top of the player's head",
            more: "The player stands ready, the club still at the ball. Q and E step, with Shift a second; the wheel zooms.",
          }
        : {
            text: `Click ${clickWords(joint)}`,
            more: `${sentence(jointWords(joint))}${counted(left, "joint")} to go. Left and right are the player's own. Shift-click if it is hidden.`,
          };
    },
    elsewhere: ({ frame: other }) => ({
      text: `The clicks are in frame ${other}`,
      more: "All six belong into one frame.",
      button: `Back to frame ${other}`,
      other: "Begin anew here",
    }),
    wrong: () => ({ text: "Nobody stands as it was clicked", more: model.swing.wrong, warns: true }),
    fit: () => ({
      text: model.swing?.keys ? "The address is clicked" : "All six joints are clicked",
      more: heightIsWrong() ? WRONG_HEIGHT : "Height and hand are on the right. Drag what is not in its place.",
      warns: heightIsWrong(),
      button: model.swing?.keys ? "Fit again" : "Fit the swing",
    }),
  };

  function words() {
    if (shell.runningJob())
      return { text: "The swing is being fitted", more: "It takes a minute or more; when cancelled, it goes on from there later." };
    const next = step();
    return WORDS[next.do](next);
  }

  function drawClicks() {
    const [pen] = viewer.overlay(),
      next = step();
    viewer.cursor(under(pointer) ? "move" : next.do === "click" ? "crosshair" : "grab");
    const places = viewer.shown() === own() && frame === own() ? { ...clicks() } : {};
    if (dragged && places[dragged.joint]) places[dragged.joint] = [...dragged.at, places[dragged.joint][2]];
    const at = Object.fromEntries(Object.entries(places).map(([name, place]) => [name, viewer.toScreen(place)]));
    for (const [from, to] of LINES)
      if (at[from] && at[to]) drawLimb(pen, at[from], at[to], { color: colors[sideOf(to)], sign: 0, alpha: 0.6 });
    for (const [name, place] of Object.entries(at))
      drawJoint(pen, place, {
        side: sideOf(name),
        color: colors[sideOf(name)],
        hollow: places[name][2] === 1,
        size: 5,
      });
    if (cross && next.do === "click") drawCross(pen, viewer.toScreen(cross), "#fff");
    const named = under(pointer) ?? (next.do === "click" ? next.joint : null);
    if (pointer && named && !dragged)
      drawLabel(pen, [pointer[0] + 14, pointer[1] + 18], named === "root" ? "between the hips" : label(named), true);
  }

  function drawSide(asked) {
    for (const [joint, row] of rows) {
      toggle(row, "asked", joint === asked);
      setText(row.lastChild, clicks()[joint] ? "✓" : "");
    }
    guide.show(under(pointer) ?? asked ?? null);
    byId("left-handed").checked = Boolean(model.state.golf.left_handed);
    const { stature } = model.state.golf;
    if (document.activeElement !== height && !heightIsWrong()) height.value = stature ?? "";
    const { said, wrong } = heightIn(height.value);
    setText(byId("stature-said"), height.value.trim() ? said : "metres; left empty, 1.75");
    toggle(byId("stature-said"), "wrong", wrong);
  }

  function draw() {
    const { text, more, button, other, warns } = words();
    setText(byId("address-text"), text);
    setText(byId("address-more"), more);
    toggle(byId("address-more"), "wrong", warns);
    byId("address-primary").hidden = !button;
    setText(byId("address-primary"), button ?? "");
    byId("address-primary").disabled = step().do === "fit" && heightIsWrong();
    byId("address-secondary").hidden = !other;
    setText(byId("address-other"), other ?? "");
    slider.value = frame;
    const seconds = project.time?.[frame] ?? frame / project.fps;
    setText(byId("address-where"), `frame ${frame} of ${project.n_frames}, ${seconds.toFixed(2)} s`);
    drawSide(step().joint);
    viewer.drawPicture(frame, [undefined, SMALL_WIDTH]);
    drawClicks();
  }

  const commands = {
    primary,
    secondary,
    clear: removeLast,
    nudge(key) {
      const [dx, dy] = arrowStep(key),
        [x, y] = cross ?? viewer.middle();
      cross = [x + dx, y + dy];
      model.redraw();
    },
    put: () => cross && step().do === "click" && put(step().joint, cross, 2),
    zoom: viewer.toggleZoom,
    zoomBy: ({ index }) => viewer.zoom(viewer.toScreen(viewer.middle()), index ? 0.8 : 1.25),
    step: ({ index, shift }) => show(frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
  };
  return {
    draw,
    commands,
    heightIsWrong,
    opened() {
      if (own() !== undefined) frame = own();
      closer();
      model.redraw();
    },
  };
}
