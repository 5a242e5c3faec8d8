// A fitted golf swing over the video: played, looked at in its key postures, and put right: a joint or
// an end of the club is dragged to where it is, a frame is called the start, top, hit or finish.
import { CASING, cssColor, drawCross, drawLabel } from "../draw/canvas.js";
import { BESIDE, nearestPlace, placeSeen } from "../draw/geometry.js";
import { drawJoint, drawLimb } from "../draw/skeleton.js";
import { createViewer } from "../draw/viewer.js";
import { createMotionCache } from "../state/caches.js";
import { placeJoint, setKey, setShaft, together } from "../state/edits.js";
import { ENDS, KEYS, WRONG_HEIGHT, clubAt, keysOf, markedFrames, nextSwing } from "../state/swing.js";
import { label } from "../state/workflow.js";
import { createPoseFigure } from "./depth.js";
import { byId, counted, setText, toggle } from "./dom.js";
import { arrowStep } from "./keyboard.js";
import { groundBelow } from "./motion.js";
import { createPlayer } from "./player.js";
import { createSwingPanels } from "./swing_panels.js";

const RADIUS = 11; // px around a joint or an end of the club in which the pointer means it
const PREFETCHED = 24; // frames fetched ahead while playing
const WIDTH = 960; // of the pictures while they play, px
const ENDS_NAMED = { hands: "the club between the hands", head: "the club's head" };

const BEFORE_FIT = "The body in space appears here when the swing is fitted.";
const OUTSIDE = "Nothing is fitted to this frame: it lies before or after the swing that was found.";

const COMING = "The swing is on its way.";

const sentence = (words) => `${words[0].toUpperCase()}${words.slice(1)}`;

export function createSwing(model, { frames, shell, actions, colors, go, heightIsWrong }) {
  const { project, sides } = model,
    last = project.n_frames - 1,
    root = byId("swing-picture");
  const viewer = createViewer({ root, project, frames, redraw: model.redraw });
  const figure = createPoseFigure(byId("swing-canvas"), model);
  const motion = createMotionCache(project, model.redraw);
  model.onProject(motion.forget);
  let frame = 0,
    asked = null, // a joint, "hands" or "head": what the next click places
    dragged = null, // {name, at}
    cross = null, // moved by the arrow keys while something is asked for
    first = null, // where the hands' end of a club was clicked of which the head is still to come
    pointer = null,
    looked = -1; // the doubt that was looked at last

  const player = createPlayer({
    fps: project.fps,
    last,
    show,
    ready: (number) => frames.has(number, WIDTH),
    load: (number) => frames.get(Math.min(last, number), WIDTH),
    active: () => model.ui.view === "swing",
  });

  const found = () => model.swing;
  const exists = () => Boolean(found()?.keys);
  const marks = (number = frame) => model.marks(number);
  const keys = () => keysOf(model.state, found());
  const step = () =>
    nextSwing({ state: model.state, found: found(), fresh: model.swingIsFresh(), running: shell.runningJob() });

  function show(number) {
    const next = Math.max(0, Math.min(last, Math.round(number)));
    if (next !== frame) frames.prefetch(Array.from({ length: PREFETCHED }, (_, n) => [next + n, WIDTH]));
    if (next !== frame) asked = first = null;
    frame = next;
    model.redraw();
  }
  function goTo(number) {
    player.stop();
    show(number);
  }

  // Whether the swing that was found has a body in a frame; before and after it, nothing was fitted.
  const isFitted = (number) => exists() && found().fitted[number];

  // The body as it was found, marked joints where they were marked: {joint: [x, y, v or undefined]}.
  function body(number) {
    const points = isFitted(number) ? (motion.points(number, "points2d") ?? {}) : {},
      placed = Object.entries(marks(number)).filter(([, [, , v]]) => v);
    return { ...points, ...Object.fromEntries(placed) };
  }

  const clubEnds = (number) => {
    const club = clubAt(model.state, found(), number);
    return club && { hands: club.ends.slice(0, 2), head: club.ends.slice(2), kind: club.kind };
  };

  // Everything that can be dragged, by name, as it is drawn at this moment.
  function handles(number) {
    const club = clubEnds(number),
      all = { ...body(number), ...(club ? { hands: club.hands, head: club.head } : {}) };
    if (dragged) all[dragged.name] = dragged.at;
    return all;
  }

  function under(at) {
    if (!at || player.playing() || viewer.shown() !== frame) return null;
    const places = Object.entries(handles(frame)).map(([name, place]) => [name, viewer.toScreen(place)]);
    return nearestPlace(at, Object.fromEntries(places), RADIUS);
  }

  function put(name, [x, y], v = 2) {
    if (viewer.shown() !== frame) return;
    if (!ENDS.includes(name)) return putJoint(name, [x, y], v);
    const ends = { ...clubEnds(frame), ...(first ? { hands: first } : {}), [name]: [x, y] };
    first = null;
    model.edit(setShaft(model.state, frame, [...ends.hands, ...ends.head]));
  }

  function putJoint(name, at, v) {
    const place = v === 2 ? placeSeen([project.width, project.height], at) : at;
    if (place) model.edit(placeJoint(model.state, frame, name, [...place, v]));
    else model.notify(BESIDE);
  }

  // The next click places a joint; of the club two do, first between the hands.
  function askFor(name) {
    player.stop();
    cross = first = null;
    asked = name;
    model.redraw();
  }
  function placeAsked(place, v) {
    const name = asked;
    if (viewer.shown() !== frame) return;
    asked = name === "hands" ? "head" : null;
    if (name === "hands") first = place;
    else put(name, place, v);
    model.redraw();
  }

  // Takes away what is marked in a frame, or of it only what is named.
  function clearIn(number, target = null) {
    player.stop();
    const club = !target || ENDS.includes(target),
      joints = Object.keys(marks(number)).filter((name) => !target || name === target),
      named = KEYS.filter((name) => !target && Math.round(model.state.keys[name]) === number);
    const edits = [
      ...joints.map((name) => placeJoint(model.state, number, name, null)),
      ...(club && model.state.shafts[number] ? [setShaft(model.state, number, null)] : []),
      ...named.map((name) => setKey(model.state, name, null)),
    ];
    if (edits.length) model.edit(edits.length > 1 ? together(edits) : edits[0]);
  }

  // This frame is a key posture; said of the same frame again, it is taken back.
  function mark(name) {
    player.stop();
    const before = model.state.keys[name];
    model.edit(setKey(model.state, name, before === frame ? null : frame));
  }

  const nextDoubt = () => found().doubts[(looked + 1) % found().doubts.length];
  function lookAtDoubt() {
    const { frame: at } = nextDoubt();
    looked = (looked + 1) % found().doubts.length;
    if (at !== null) goTo(at);
  }

  const fit = () => shell.runningJob() || heightIsWrong() || shell.startJob("golf");
  const steps = {
    wait() {},
    address: () => go("address"),
    wrong() {},
    fit,
    again: fit,
    doubt: lookAtDoubt,
    files: () => go("files"),
  };
  const primary = () => steps[step().do]();

  function play() {
    if (player.playing()) player.stop();
    else player.start(frame);
    model.redraw();
  }

  viewer.listen({
    grab(at) {
      const name = under(at);
      return name && { name };
    },
    drag({ name }, at) {
      dragged = { name, at };
      model.redraw();
    },
    drop({ name }, at) {
      dragged = asked = first = null;
      put(name, at, marks()[name]?.[2] || 2);
    },
    cancelled() {
      dragged = null;
    },
    click(at, event) {
      const name = under(at);
      if (asked) placeAsked(viewer.toPicture(at), event.shiftKey ? 1 : 2);
      else if (name) askFor(ENDS.includes(name) ? "hands" : name);
    },
    hover(at) {
      pointer = at;
      model.redraw();
    },
  });

  const slider = byId("swing-frame");
  slider.max = last;
  slider.addEventListener("input", () => goTo(Number(slider.value)));
  byId("swing-play").addEventListener("click", play);
  byId("swing-primary").addEventListener("click", primary);
  byId("swing-again").addEventListener("click", fit);

  const panels = createSwingPanels(model, { goTo, mark, askFor, clearIn, keys });

  const WORDS = {
    wait: () => ({
      text: "The swing is being fitted",
      more: "It takes a minute or more. You may go on marking; when cancelled, it goes on from there later.",
    }),
    address: () => ({ text: "Click the address first", more: "Six joints in one frame begin a fit.", button: "To the address" }),
    wrong: () => ({ text: "These marks cannot be", more: found().wrong, warns: true }),
    fit: () => ({ text: "The swing can be fitted", more: heightIsWrong() ? WRONG_HEIGHT : "The six joints of the address are clicked.", button: "Fit the swing" }),
    again: () => ({
      text: "This fit does not know all your marks yet",
      more: heightIsWrong()
        ? WRONG_HEIGHT
        : `${counted(markedFrames(model.state).length, "frame")} marked. What is marked holds in the next fit.`,
      button: "Fit again",
    }),
    doubt: () => ({
      text: "This fit is doubtful: do not use its numbers",
      more: `${sentence(found().doubts.map(({ text }) => text).join("; "))}. Where body or club is off, drag it right, then fit again.`,
      button: nextDoubt().frame === null ? "Look again" : `Look at frame ${nextDoubt().frame}`,
      warns: true,
    }),
    files: () => ({
      text: "The swing is found",
      more: `${found().tempo ?? ""}. Where body or club is off, drag it right and fit again.`,
      button: "Video and files",
    }),
  };

  function words() {
    const next = step();
    if (!asked) return WORDS[next.do]();
    return {
      text: `Click ${ENDS_NAMED[asked] ?? `the ${label(asked)}`}`,
      more: ENDS.includes(asked) ? "Both ends tell where the shaft is. Esc leaves it." : "Left and right are the player's own. Shift-click if it is hidden. Esc leaves it.",
      button: WORDS[next.do]().button,
    };
  }

  function whyEmpty() {
    if (!exists()) return BEFORE_FIT;
    return isFitted(frame) && !motion.isHere(frame) ? COMING : OUTSIDE;
  }

  function drawClub(pen, club) {
    const [from, to] = ENDS.map((end) => viewer.toScreen(dragged?.name === end ? dragged.at : club[end]));
    pen.save();
    pen.lineCap = "round";
    for (const [style, width] of [
      [CASING, club.kind === "marked" ? 7 : 5],
      [cssColor("mark-club"), club.kind === "marked" ? 4 : 2],
    ]) {
      pen.setLineDash(club.kind === "guess" ? [7, 6] : []);
      pen.beginPath();
      pen.moveTo(...from);
      pen.lineTo(...to);
      pen.strokeStyle = style;
      pen.lineWidth = width;
      pen.stroke();
    }
    pen.restore();
    const size = club.kind === "marked" ? 5 : 3.5;
    for (const place of [from, to]) drawJoint(pen, place, { side: "left", color: cssColor("mark-club"), size });
  }

  function drawFigure() {
    const [pen] = viewer.overlay(),
      shown = viewer.shown() ?? frame,
      hovered = under(pointer),
      placed = body(shown);
    if (dragged && !ENDS.includes(dragged.name)) placed[dragged.name] = dragged.at;
    viewer.cursor(asked ? "crosshair" : hovered ? "move" : "grab");
    if (model.ui.hidden) return;
    const at = Object.fromEntries(Object.entries(placed).map(([name, place]) => [name, viewer.toScreen(place)]));
    for (const { name, parent } of project.limbs)
      if (at[name] && at[parent]) drawLimb(pen, at[parent], at[name], { color: colors[sides[name]], sign: 0, alpha: 0.8 });
    const club = clubEnds(shown);
    if (club) drawClub(pen, club);
    for (const [name, place] of Object.entries(at)) {
      const marked = marks(shown)[name]?.[2];
      drawJoint(pen, place, {
        side: sides[name],
        color: colors[sides[name]],
        hollow: marked === 1,
        size: marked || name === hovered ? 5.5 : 3.5,
        ring: Boolean(marked) || name === asked,
      });
    }
    if (asked && cross) drawCross(pen, viewer.toScreen(cross), "#fff");
    if (first) drawJoint(pen, viewer.toScreen(first), { side: "left", color: cssColor("mark-club"), size: 5 });
    const named = asked ?? hovered;
    if (pointer && named && !dragged)
      drawLabel(pen, [pointer[0] + 14, pointer[1] + 18], ENDS_NAMED[named] ?? label(named), Boolean(asked));
  }

  function draw() {
    const { text, more, button, warns } = words(),
      next = step().do;
    setText(byId("swing-text"), text);
    setText(byId("swing-more"), more);
    byId("swing-more").title = more;
    toggle(byId("swing-text"), "wrong", warns && !asked);
    byId("swing-primary").hidden = !button;
    setText(byId("swing-primary"), button ?? "");
    byId("swing-again").hidden = next !== "doubt";
    byId("swing-again").disabled = heightIsWrong();
    byId("swing-primary").disabled = ["fit", "again"].includes(next) && heightIsWrong();
    byId("swing-report").hidden = !exists() || !model.project.has.report;
    slider.value = frame;
    const seconds = project.time?.[frame] ?? frame / project.fps;
    setText(byId("swing-where"), `frame ${frame} of ${project.n_frames}, ${seconds.toFixed(2)} s`);
    setText(byId("swing-play"), player.playing() ? "❚❚" : "▶");
    panels.draw(frame, asked);
    viewer.drawPicture(frame, player.playing() ? [WIDTH] : [undefined, WIDTH]);
    drawFigure();
    const points = isFitted(frame) ? motion.points(frame, "points3d") : null;
    byId("swing-empty").hidden = points !== null;
    setText(byId("swing-empty"), whyEmpty());
    figure.show(points, null, points && groundBelow(motion.ground(frame), points));
  }

  const posture = (index) => keys()[KEYS[index]] && goTo(keys()[KEYS[index]].frame);
  const commands = {
    primary,
    play: () => (asked && cross ? placeAsked(cross, 2) : play()),
    nudge(key) {
      const [dx, dy] = arrowStep(key),
        [x, y] = cross ?? handles(frame)[asked] ?? viewer.middle();
      if (!asked) return;
      cross = [x + dx, y + dy];
      model.redraw();
    },
    again: () => exists() && step().do !== "wrong" && fit(),
    step: ({ index, shift }) => goTo(frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
    posture: ({ index }) => posture(index),
    name: ({ index }) => mark(KEYS[index]),
    club: () => askFor("hands"),
    clear: () => clearIn(frame, under(pointer)),
    back() {
      asked = first = dragged = null;
      model.redraw();
    },
    add() {
      player.stop();
      actions.addKeyframe(frame, "both");
    },
    hide: () => model.update({ hidden: true }),
    zoom: viewer.toggleZoom,
    zoomBy: ({ index }) => viewer.zoom(viewer.toScreen(viewer.middle()), index ? 0.8 : 1.25),
  };
  return { draw, commands, goTo };
}
