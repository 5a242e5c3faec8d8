// The picture of a keyframe with the skeleton over it, and what the pointer does there: a click places
// the joint that is asked for, dragging a joint moves it, dragging anything else moves the picture.
import { drawCross, drawLabel } from "../draw/canvas.js";
import { nearestLimb, nearestPlace } from "../draw/geometry.js";
import { drawJoint, drawLimb } from "../draw/skeleton.js";
import { label, suggestedJoints } from "../state/workflow.js";

const JOINT_RADIUS = 11; // px around a joint in which the pointer means it
const LIMB_RADIUS = 7;
export const SMALL_WIDTH = 960; // of the frames to scrub through, px

export function createKeyframePicture(model, { actions, viewer, colors }) {
  const { ui } = model;
  let pointer = null;

  const suggestion = () =>
    suggestedJoints(actions.joints(), model.marks(), model.poses.suggestion());

  const onScreen = (places) =>
    Object.fromEntries(
      Object.entries(places)
        .filter(([, place]) => place[2] !== 0)
        .map(([name, place]) => [name, viewer.toScreen(place)]),
    );

  // {joint} or {limb} under a place of the canvas, or null.
  function hit(at) {
    if (!at || actions.offKeyframe() || viewer.shown() !== ui.frame) return null;
    const marks = onScreen(model.placed());
    const joint = nearestPlace(at, { ...marks, ...suggestionOnScreen() }, JOINT_RADIUS);
    if (joint) return { joint };
    const limb = nearestLimb(at, model.project.limbs, marks, LIMB_RADIUS);
    return limb ? { limb } : null;
  }
  const suggestionOnScreen = () =>
    Object.fromEntries(
      Object.entries(suggestion()).map(([name, [x, y]]) => [name, viewer.toScreen([x, y])]),
    );

  // A joint keeps its distance from the pointer that took it.
  function grab(at) {
    const joint = hit(at)?.joint;
    if (!joint) return null;
    const mark = model.placed()[joint];
    const [x, y] = mark?.[2] ? mark : suggestion()[joint];
    const [px, py] = viewer.toPicture(at);
    return { joint, placeFor: ([nx, ny]) => [nx + x - px, ny + y - py] };
  }

  const isAsked = (joint) => Boolean(joint && !model.marks()[joint]);

  viewer.listen({
    grab,
    drag: ({ joint, placeFor }, at) => actions.drag(joint, placeFor(at)),
    drop: ({ joint, placeFor }, at) => actions.drop(joint, placeFor(at)),
    click: (at, event) => {
      const target = hit(at);
      if (actions.offKeyframe()) actions.scrub(0);
      else if (viewer.shown() !== ui.frame) return; // its picture is still to come
      else if (isAsked(ui.joint))
        actions.place(ui.joint, viewer.toPicture(at), event.shiftKey ? 1 : 2);
      else if (target?.joint) actions.select(target.joint);
      else if (target?.limb) actions.flip(target.limb);
      else actions.select(null);
    },
    cancelled: () => actions.dropDragged(),
    hover: (at) => {
      pointer = at;
      model.update({ hovered: hit(at) });
    },
  });

  function drawMarks(pen) {
    const marks = model.placed(),
      screen = onScreen(marks),
      nearer = model.nearer(),
      pose = model.poses.current();
    for (const { name, parent } of model.project.limbs) {
      if (!screen[name] || !screen[parent]) continue;
      const limb = pose?.limbs?.[name],
        given = nearer[name];
      drawLimb(pen, screen[parent], screen[name], {
        color: colors[model.sides[name]],
        sign: given ?? limb?.sign ?? 0,
        alpha: given ? 0.95 : 0.35 + 0.45 * (limb?.certainty ?? 0),
        hovered: ui.hovered?.limb === name,
        tooLong: pose?.stretched?.[name] !== undefined,
      });
    }
    for (const [name, at] of Object.entries(screen)) {
      drawJoint(pen, at, {
        side: model.sides[name],
        color: colors[model.sides[name]],
        hollow: marks[name][2] === 1,
        ring: ui.joint === name,
        size: ui.hovered?.joint === name ? 6.5 : 5,
      });
    }
  }

  function drawSuggestion(pen) {
    const suggested = suggestion(),
      all = { ...model.placed(), ...suggested };
    for (const { name, parent } of model.project.limbs) {
      if (!(name in suggested || parent in suggested) || !all[name] || !all[parent]) continue;
      const ends = [all[parent], all[name]].map((place) => viewer.toScreen(place));
      drawLimb(pen, ...ends, { color: colors[model.sides[name]], dashed: true, alpha: 0.8 });
    }
    for (const [name, [x, y, confidence]] of Object.entries(suggested)) {
      if (ui.dragged?.joint === name) continue;
      drawJoint(pen, viewer.toScreen([x, y]), {
        side: model.sides[name],
        color: colors[model.sides[name]],
        hollow: true,
        size: 4,
        alpha: 0.5 + 0.5 * (confidence ?? 1),
        ring: ui.joint === name,
      });
    }
  }

  function drawHints(pen) {
    const { hovered, joint, dragged } = ui,
      asked = isAsked(joint);
    if (dragged?.floating) {
      const at = viewer.toScreen(dragged.at);
      drawCross(pen, at, "#fff");
      drawLabel(pen, [at[0] + 16, at[1] + 16], `${label(dragged.joint)}, Space puts it here`, true);
    }
    if (!pointer || dragged) return;
    const name = asked && !hovered?.joint ? joint : (hovered?.joint ?? hovered?.limb);
    if (!name) return;
    const text = hovered?.limb && !asked ? limbText(hovered.limb) : label(name);
    drawLabel(pen, [pointer[0] + 14, pointer[1] + 18], text, asked && !hovered?.joint);
  }

  function limbText(name) {
    const given = model.nearer()[name],
      limb = model.poses.current()?.limbs?.[name],
      sign = given ?? limb?.sign;
    if (!sign) return label(name);
    const end = `${label(name)} is ${sign > 0 ? "nearer" : "farther"}`;
    return given
      ? `${end}, click to turn`
      : `${end}? ${Math.round(100 * (limb.certainty ?? 0))} % sure, click to turn`;
  }

  // True when the frame itself could be drawn.
  function draw() {
    const frame = ui.frame + ui.offset;
    const drawn = viewer.drawPicture(frame, ui.offset ? [SMALL_WIDTH] : [undefined, SMALL_WIDTH]);
    const [pen] = viewer.overlay();
    viewer.cursor(cursor());
    if (ui.offset === 0 && !ui.hidden && viewer.shown() === frame) {
      drawMarks(pen);
      drawSuggestion(pen);
      drawHints(pen);
    }
    return drawn;
  }

  function cursor() {
    if (ui.dragged || actions.offKeyframe()) return "grabbing";
    if (isAsked(ui.joint)) return ui.hovered?.joint ? "move" : "crosshair";
    return ui.hovered ? "pointer" : "grab";
  }

  return { draw };
}
