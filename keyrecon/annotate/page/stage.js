// The picture of a keyframe with the skeleton over it, and what the pointer does there: a click places
// the joint that is asked for, dragging a joint moves it, dragging anything else moves the picture.
import { limbUnder, placeUnder } from "./geometry.js";
import { suggested, spoken } from "./guide.js";
import { drawCross, drawJoint, drawLabel, drawLimb } from "./skeleton.js";

const REACH = 11; // px around a joint
const LIMB_REACH = 7;
export const SMALL = 960; // width of the stills to scrub through, px

export function createStage(model, actions, viewer, colors) {
  const { doing } = model;
  let pointer = null;

  // Everything placed, the joint in hand where the hand is: name -> [x, y, v] on the picture.
  function placed() {
    const marks = { ...model.marks() },
      { held } = doing;
    if (held) marks[held.joint] = [...held.at, marks[held.joint]?.[2] || 2];
    return marks;
  }
  const offered = () => suggested(actions.joints(), model.marks(), model.ghost());

  const onScreen = (places) =>
    Object.fromEntries(
      Object.entries(places)
        .filter(([, place]) => place[2] !== 0)
        .map(([name, place]) => [name, viewer.toScreen(place)]),
    );

  function find(at) {
    if (!at || actions.away()) return null;
    const marks = onScreen(placed());
    const joint = placeUnder(at, { ...marks, ...onScreen(bare(offered())) }, REACH);
    if (joint) return { joint };
    const limb = limbUnder(at, model.project.limbs, marks, LIMB_REACH);
    return limb ? { limb } : null;
  }
  // Without the confidence.
  const bare = (ghost) =>
    Object.fromEntries(Object.entries(ghost).map(([name, [x, y]]) => [name, [x, y]]));

  // A joint keeps its distance from the pointer that took it.
  function grab(at) {
    const joint = find(at)?.joint;
    if (!joint) return null;
    const [x, y] = placed()[joint]?.[2] ? placed()[joint] : offered()[joint];
    const [px, py] = viewer.toPicture(at);
    return { joint, follow: ([nx, ny]) => [nx + x - px, ny + y - py] };
  }

  viewer.listen({
    grab,
    drag: ({ joint, follow }, at) => actions.carry(joint, follow(at)),
    drop: ({ joint, follow }, at) => actions.drop(joint, follow(at)),
    click: (at, event) => {
      const waits = doing.joint && !model.marks()[doing.joint],
        found = find(at);
      if (actions.away()) actions.look(0);
      else if (waits) actions.place(doing.joint, viewer.toPicture(at), event.shiftKey ? 1 : 2);
      else if (found?.joint) actions.select(found.joint);
      else if (found?.limb) actions.flip(found.limb);
      else actions.select(null);
    },
    hover: (at) => {
      pointer = at;
      model.do({ under: find(at) });
    },
  });

  function drawSkeleton(pen) {
    const marks = placed(),
      screen = onScreen(marks),
      nearer = model.nearer(),
      pose = model.pose();
    for (const { name, parent } of model.project.limbs) {
      if (!screen[name] || !screen[parent]) continue;
      const limb = pose?.limbs?.[name],
        given = nearer[name];
      drawLimb(pen, screen[parent], screen[name], {
        color: colors[model.sides[name]],
        sign: given ?? limb?.sign ?? 0,
        alpha: given ? 0.95 : 0.35 + 0.45 * (limb?.sure ?? 0),
        under: doing.under?.limb === name,
        warned: pose?.stretched?.[name] !== undefined,
      });
    }
    for (const [name, at] of Object.entries(screen)) {
      drawJoint(pen, at, {
        side: model.sides[name],
        color: colors[model.sides[name]],
        hollow: marks[name][2] === 1,
        ring: doing.joint === name,
        size: doing.under?.joint === name ? 6.5 : 5,
      });
    }
  }

  function drawOffer(pen) {
    const ghost = offered(),
      all = { ...placed(), ...ghost };
    for (const { name, parent } of model.project.limbs) {
      if (!(name in ghost || parent in ghost) || !all[name] || !all[parent]) continue;
      const ends = [all[parent], all[name]].map((place) => viewer.toScreen(place));
      drawLimb(pen, ...ends, { color: colors[model.sides[name]], dashed: true, alpha: 0.8 });
    }
    for (const [name, [x, y, confidence]] of Object.entries(ghost)) {
      if (doing.held?.joint === name) continue;
      drawJoint(pen, viewer.toScreen([x, y]), {
        side: model.sides[name],
        color: colors[model.sides[name]],
        hollow: true,
        size: 4,
        alpha: 0.5 + 0.5 * (confidence ?? 1),
        ring: doing.joint === name,
      });
    }
  }

  function drawHints(pen) {
    const { under, joint, held } = doing,
      waits = joint && !model.marks()[joint];
    if (held?.floating) {
      const at = viewer.toScreen(held.at);
      drawCross(pen, at, "#fff");
      drawLabel(pen, [at[0] + 16, at[1] + 16], `${spoken(joint)}, Space puts it here`, true);
    }
    if (!pointer || held) return;
    const name = waits && !under?.joint ? joint : (under?.joint ?? under?.limb);
    if (!name) return;
    const text = under?.limb && !waits ? limbText(under.limb) : spoken(name);
    drawLabel(pen, [pointer[0] + 14, pointer[1] + 18], text, waits && !under?.joint);
  }

  function limbText(name) {
    const given = model.nearer()[name],
      limb = model.pose()?.limbs?.[name],
      sign = given ?? limb?.sign;
    if (!sign) return spoken(name);
    const end = `${spoken(name)} is ${sign > 0 ? "nearer" : "farther"}`;
    return given
      ? `${end}, click to turn`
      : `${end}? ${Math.round(100 * (limb.sure ?? 0))} % sure, click to turn`;
  }

  function draw() {
    const frame = doing.frame + doing.look;
    const drawn = viewer.drawPicture(frame, doing.look ? [SMALL] : [undefined, SMALL]);
    const [pen] = viewer.overlay();
    viewer.cursor(cursor());
    if (doing.look === 0 && !doing.hidden) {
      drawSkeleton(pen);
      drawOffer(pen);
      drawHints(pen);
    }
    return drawn;
  }

  function cursor() {
    if (doing.held || actions.away()) return "grabbing";
    if (doing.joint && !model.marks()[doing.joint])
      return doing.under?.joint ? "move" : "crosshair";
    return doing.under ? "pointer" : "grab";
  }

  return { draw, placed };
}
