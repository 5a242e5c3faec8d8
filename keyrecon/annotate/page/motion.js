// The motion played over the picture, with the skeleton in space beside it.
import { byId, color, numberIn, setText } from "./dom.js";
import { createPlayer } from "./player.js";
import { drawJoint, drawLimb } from "./skeleton.js";
import { createSpace } from "./space.js";
import { createStretches } from "./stretches.js";
import { createViewer } from "./viewer.js";

const AHEAD = 24; // stills fetched ahead while playing
const WIDTH = 960; // px of the stills

export function createMotion(model, { stills, jobs, frame: surround, actions }) {
  const { project, sides } = model,
    last = project.n_frames - 1,
    root = byId("motion-picture");
  const viewer = createViewer({ root, project, stills, changed: model.changed });
  const space = createSpace(byId("motion-space"), project.limbs, sides);
  const stretches = createStretches(project, model.changed);
  const colors = Object.fromEntries(
    ["left", "right", "middle"].map((side) => [side, color(`mark-${side}`)]),
  );
  const slider = byId("motion-frame");
  let frame = 0;

  const player = createPlayer({
    fps: project.fps,
    last,
    show,
    ready: (number) => stills.has(number, WIDTH),
    load: (number) => stills.get(Math.min(last, number), WIDTH),
    wanted: () => model.doing.view === "motion",
  });

  const made = () => model.project.has.motion;
  const points = (kind) => (made() ? stretches.points(frame, kind) : null);
  model.onProject(stretches.forget); // a new run makes new motion

  function show(number) {
    const next = Math.max(0, Math.min(last, number));
    if (next !== frame) stills.wish(Array.from({ length: AHEAD }, (_, n) => [next + n, WIDTH]));
    frame = next;
    model.changed();
  }

  function play() {
    if (player.playing()) player.stop();
    else player.start(frame);
    model.changed();
  }

  function go(number) {
    player.stop();
    show(number);
  }

  function primary() {
    const height = numberIn(byId("height"));
    if (Number.isNaN(height)) model.tell("The height is a number of metres, such as 1.80.");
    else if (!surround.runningJob()) jobs.start("run", height === null ? {} : { height });
  }

  byId("height").value = project.settings.height ?? "";
  slider.max = last;
  slider.addEventListener("input", () => go(Number(slider.value)));
  byId("play").addEventListener("click", play);
  byId("motion-primary").addEventListener("click", primary);
  viewer.listen({ grab: () => null, drag() {}, drop() {}, click() {}, hover() {} });

  function drawSkeleton() {
    const [pen] = viewer.overlay(),
      places = Object.entries(points("points2d") ?? {});
    const at = Object.fromEntries(places.map(([name, place]) => [name, viewer.toScreen(place)]));
    for (const { name, parent } of project.limbs) {
      const look = { color: colors[sides[name]], sign: 0, alpha: 0.8 };
      if (at[name] && at[parent]) drawLimb(pen, at[parent], at[name], look);
    }
    for (const [name, place] of Object.entries(at)) {
      drawJoint(pen, place, { side: sides[name], color: colors[sides[name]], size: 3.5 });
    }
  }

  function words() {
    const keyframes = model.keyframes(),
      open = keyframes.filter((keyframe) => !model.done(keyframe)).length;
    if (surround.runningJob())
      return ["The motion is being made", "You may go on marking meanwhile."];
    const left = open
      ? `${open} of ${keyframes.length} keyframes are still open; what is marked is used.`
      : "All keyframes are marked.";
    if (made()) return ["The motion", left];
    if (open < keyframes.length) return ["Make the motion", left];
    return [
      "No marks yet",
      keyframes.length ? "Mark some keyframes first." : "The colours come first.",
    ];
  }

  function draw() {
    const [text, more] = words(),
      { fps, time } = project,
      seconds = time?.[frame] ?? frame / fps;
    const idle = !surround.runningJob() && model.keyframes().some(model.done);
    setText(byId("motion-text"), text);
    setText(byId("motion-more"), more);
    byId("motion-primary").hidden = byId("height-row").hidden = !idle;
    setText(byId("motion-primary"), made() ? "Make it anew" : "Make the motion");
    setText(
      byId("motion-note"),
      made()
        ? "Where the skeleton leaves the body, press K: that frame becomes a keyframe of yours."
        : "",
    );
    slider.value = frame;
    setText(byId("motion-where"), `frame ${frame} of ${project.n_frames}, ${seconds.toFixed(2)} s`);
    setText(byId("play"), player.playing() ? "❚❚" : "▶");
    viewer.drawPicture(frame, [WIDTH]);
    drawSkeleton();
    const body = points("points3d");
    byId("motion-empty").hidden = body !== null;
    space.show(body);
  }

  const commands = {
    primary,
    play,
    add() {
      player.stop();
      actions.addKeyframe(frame, "both");
    },
    step: ({ place, shift }) =>
      go(frame + (place ? 1 : -1) * (shift ? Math.round(project.fps) : 1)),
  };
  return { draw, commands };
}
