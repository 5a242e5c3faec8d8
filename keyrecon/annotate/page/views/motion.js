// The motion played over the picture, with the skeleton in space beside it.
import { drawHalo, drawJoint, drawLimb } from "../draw/skeleton.js";
import { createViewer } from "../draw/viewer.js";
import { createMotionCache } from "../state/caches.js";
import { createPoseFigure } from "./depth.js";
import { fieldOfViewIn, heightIn, label } from "../state/workflow.js";
import { byId, counted, make, setText, toggle } from "./dom.js";
import { createPlayer } from "./player.js";

const PREFETCHED = 24; // frames fetched ahead while playing
const WIDTH = 960; // of the pictures, px

// Where the figure stands: the ground does not follow each step, nor its size each bend.
export function groundBelow(ground, body) {
  const around = ["left_hip", "right_hip"].map((name) => body[name]).filter(Boolean);
  if (!ground || !around.length) return null;
  const { level, unit, units } = ground,
    mean = (axis) => around.reduce((sum, point) => sum + point[axis], 0) / around.length,
    square = units === "m" ? `${Math.round(unit * 25)} cm` : "¼ body height";
  return { center: [mean(0), level - unit / 2, mean(2)], level, unit, ground: `ground, squares of ${square}` };
}

// What stands where there is no body in space.
export function whyEmpty({ exists, isHere }) {
  if (!exists) return "The motion in space appears here when it is made.";
  return isHere ? "Nothing is known in this frame." : "The motion is on its way.";
}

export function createMotion(model, { frames, shell, actions, colors }) {
  const { project, sides } = model,
    last = project.n_frames - 1,
    root = byId("motion-picture");
  const viewer = createViewer({ root, project, frames, redraw: model.redraw });
  const figure = createPoseFigure(byId("motion-canvas"), model);
  const motion = createMotionCache(project, model.redraw);
  const slider = byId("motion-frame");
  let frame = 0;

  const player = createPlayer({
    fps: project.fps,
    last,
    show,
    ready: (number) => frames.has(number, WIDTH),
    load: (number) => frames.get(Math.min(last, number), WIDTH),
    active: () => model.ui.view === "motion",
  });

  const exists = () => model.project.has.motion;
  // The state of the marks which the motion shows.
  const shownMarks = ({ has, run }) => (has.motion && run.is_current ? run.revision : null);
  const points = (kind, at = frame) => (exists() ? motion.points(at, kind) : null);
  model.onProject(motion.forget); // a new run makes new motion

  function show(number) {
    const next = Math.max(0, Math.min(last, number));
    if (next !== frame) frames.prefetch(Array.from({ length: PREFETCHED }, (_, n) => [next + n, WIDTH]));
    frame = next;
    model.redraw();
  }

  function play() {
    if (player.playing()) player.stop();
    else player.start(frame);
    model.redraw();
  }

  function go(number) {
    player.stop();
    show(number);
  }

  const typed = () => ({
    height: heightIn(byId("height").value),
    fov: fieldOfViewIn(byId("fov").value, model.project.settings.lens),
  });

  // By field, what the last motion was made with.
  const used = () => {
    const { height = null, field_of_view: fov = null } = model.project.settings;
    return { height, fov };
  };

  // By field, whether it holds what no motion was made with yet.
  function waiting() {
    const { height, fov } = typed();
    return {
      height: height.wrong || height.metres !== used().height,
      fov: fov.wrong || fov.degrees !== used().fov,
    };
  }

  // What waits for the next motion outlives the page.
  const kept = (name) => `${name} ${project.id}`;
  function keepTyped() {
    for (const [name, waits] of Object.entries(waiting())) {
      if (waits) localStorage.setItem(kept(name), byId(name).value);
      else localStorage.removeItem(kept(name));
    }
    model.redraw();
  }

  // What nobody typed is what the motion was made with, be it elsewhere. While one is made the project has
  // what it is made with, and may take that back.
  function fillFields() {
    for (const [name, value] of Object.entries(used()))
      byId(name).value = localStorage.getItem(kept(name)) ?? value ?? "";
    keepTyped();
  }

  function makeMotion() {
    const { height, fov } = typed();
    if (height.wrong) byId("height").focus();
    else if (fov.wrong) byId("fov").focus();
    if (height.wrong || fov.wrong || shell.runningJob()) return;
    shell.startJob("run", { height: height.metres, field_of_view: fov.degrees });
  }

  // Whether the motion was made from the marks, keyframes and options as they are.
  function showsMarks() {
    const made = shownMarks(model.project);
    return made !== null && model.marksAreOf(made);
  }

  // "court" or "ground", which the report does not know.
  const lacked = () => (exists() && model.project.has.report && model.project.run.report_lacks) || null;

  // Whether there is nothing to make anew: neither camera, marks nor what is typed changed.
  function isMade() {
    return showsMarks() && !lacked() && !Object.values(waiting()).some(Boolean);
  }

  function primary() {
    if (isMade()) byId("motion-files").click();
    else makeMotion();
  }

  fillFields();
  for (const field of ["height", "fov"]) byId(field).addEventListener("input", keepTyped);
  model.onProject(() => shell.runningJob()?.state === "running" || fillFields());
  slider.max = last;
  slider.addEventListener("input", () => go(Number(slider.value)));
  byId("play").addEventListener("click", play);
  byId("motion-primary").addEventListener("click", makeMotion);
  viewer.listen({ grab: () => null, drag() {}, drop() {}, click() {}, hover() {} });

  function drawSkeleton() {
    const [pen] = viewer.overlay(),
      shown = viewer.shown() ?? frame, // a picture may come later than it is asked for
      places = Object.entries(points("points2d", shown) ?? {});
    const at = Object.fromEntries(places.map(([name, place]) => [name, viewer.toScreen(place)]));
    const errors = exists() ? motion.errors(shown) : null;
    for (const [name, place] of Object.entries(at))
      if (errors?.[name]) drawHalo(pen, place, errors[name] * viewer.scale(), colors[sides[name]]);
    for (const { name, parent } of project.limbs) {
      const style = { color: colors[sides[name]], sign: 0, alpha: 0.8 };
      if (at[name] && at[parent]) drawLimb(pen, at[parent], at[name], style);
    }
    for (const [name, place] of Object.entries(at)) {
      drawJoint(pen, place, { side: sides[name], color: colors[sides[name]], size: 3.5 });
    }
  }

  // The joints that are probably farthest off in this frame.
  function leastSure() {
    const errors = exists() ? motion.errors(frame) : null;
    if (!errors) return "";
    const worst = Object.entries(errors).sort((a, b) => b[1] - a[1]),
      mean = worst.reduce((sum, [, px]) => sum + px, 0) / worst.length;
    const named = worst.slice(0, 3).map(([name, px]) => `${label(name)} ±${Math.round(px)}`);
    return `Expected error here: ${mean.toFixed(0)} px; least sure: ${named.join(", ")}. Discs show it.`;
  }

  // What spoke against the track when the motion was made, and what would make it better; both stay
  // true when their notice is closed.
  function drawNotes() {
    const { doubts, advice } = model.project.run;
    fillNotes(byId("motion-doubts"), exists() ? doubts : [], "note wrong");
    fillNotes(byId("motion-advice"), exists() ? advice : [], "note");
  }

  function fillNotes(list, lines, className) {
    list.hidden = !lines.length;
    if (list.dataset.content === lines.join("\n")) return;
    list.dataset.content = lines.join("\n");
    list.replaceChildren(...lines.map((text) => make("p", { className }, text)));
  }

  function drawSettings() {
    for (const [name, { said, wrong }] of Object.entries(typed())) {
      const waits = !wrong && exists() && waiting()[name];
      setText(byId(`${name}-said`), waits ? `${said}; counts when it is made anew` : said);
      toggle(byId(`${name}-said`), "wrong", wrong);
    }
    byId("motion-primary").disabled = Object.values(typed()).some(({ wrong }) => wrong);
  }

  function drawStretches() {
    const list = byId("stretches"),
      content = JSON.stringify(model.stretches);
    byId("stretches-title").hidden = !exists() || !model.stretches.length;
    if (list.dataset.content === content) return;
    list.dataset.content = content;
    list.replaceChildren(...model.stretches.map(stretchButton));
  }

  // Goes to the frame and offers to mark it.
  function stretchButton(stretch) {
    const button = make("button", { className: "plain" }, stretch.text);
    button.addEventListener("click", () => {
      go(stretch.frame);
      model.notify(`Frame ${stretch.frame} would help most here.`, {
        text: `Mark frame ${stretch.frame}`,
        act: () => actions.addKeyframe(stretch.frame, stretch.half),
      });
    });
    return button;
  }

  function words() {
    const { all, marked, lacking } = model.progress(),
      single = lacking ? `, ${counted(lacking, "marked one")} ${lacking > 1 ? "lack" : "lacks"} single joints` : "";
    if (shell.runningJob())
      return ["The motion is being made", "You may go on marking meanwhile."];
    const left =
      marked < all
        ? `${all - marked} of ${all} keyframes are still open${single}; what is marked is used.`
        : `All keyframes are marked${single}.`;
    if (exists() && !showsMarks()) return ["Not yet in the motion", `What it was made from has changed since. ${left}`];
    if (lacked())
      return [`The report does not know the ${lacked()} yet`, `Make the motion anew for a report with it. ${left}`];
    if (exists()) return ["The motion is made", left];
    if (marked) return ["Make the motion", left];
    return [
      "No marks yet",
      all ? "Mark some keyframes first." : "One marked body comes first.",
    ];
  }

  function draw() {
    const [text, more] = words(),
      { fps, time } = project,
      seconds = time?.[frame] ?? frame / fps;
    const idle = !shell.runningJob() && model.keyframes().some(model.isMarked);
    setText(byId("motion-text"), text);
    setText(byId("motion-more"), more);
    byId("motion-primary").hidden = byId("motion-settings").hidden = !idle;
    drawSettings();
    byId("motion-report").hidden = !model.project.has.report;
    setText(byId("motion-report"), lacked() ? "Old report" : "Report");
    byId("motion-report").title = lacked() ? `Made before the ${lacked()} was found` : "";
    byId("motion-files").hidden = !exists();
    toggle(byId("motion-files"), "primary", isMade());
    toggle(byId("motion-primary"), "primary", !isMade());
    setText(byId("motion-primary"), exists() ? "Make it anew" : "Make the motion");
    setText(
      byId("motion-note"),
      exists()
        ? "Where the skeleton leaves the body, press K: that frame becomes a keyframe of yours."
        : "",
    );
    setText(byId("motion-errors"), leastSure());
    drawNotes();
    drawStretches();
    slider.value = frame;
    setText(byId("motion-where"), `frame ${frame} of ${project.n_frames}, ${seconds.toFixed(2)} s`);
    setText(byId("play"), player.playing() ? "❚❚" : "▶");
    viewer.drawPicture(frame, [WIDTH]);
    drawSkeleton();
    const body = points("points3d");
    byId("motion-empty").hidden = body !== null;
    setText(byId("motion-empty"), whyEmpty({ exists: exists(), isHere: motion.isHere(frame) }));
    figure.show(body, null, body && groundBelow(motion.ground(frame), body));
  }

  const commands = {
    primary,
    play,
    add() {
      player.stop();
      actions.addKeyframe(frame, "both");
    },
    step: ({ index, shift }) =>
      go(frame + (index ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
  };
  // Whether a height is typed that the motion does not know.
  const heightWaits = () => waiting().height && typed().height.metres !== null;
  return { draw, commands, heightWaits };
}
