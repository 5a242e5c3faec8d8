// What a person can do on a keyframe; keys, buttons and the pointer all end here.
import { nextVisibility, placeJoint, placeJoints, setLock, setNearer, swapSides } from "./edits.js";
import { limbsShown, nextThing, suggested } from "./guide.js";
import { createHand } from "./hand.js";
import { createTravel } from "./travel.js";

export function createActions(model) {
  const { doing } = model,
    hand = createHand(model),
    travel = createTravel(model, hand);

  // What a key means: the joint under the pointer, else the selected one.
  const meant = () => doing.under?.joint ?? doing.joint;
  // The limb under the pointer, else the one that ends in that joint.
  const meantLimb = () => doing.under?.limb ?? meant();

  function visibility(joint = meant()) {
    if (!hand.ready() || !joint) return;
    const mark = model.marks()[joint];
    model.edit(placeJoint(model.state, doing.frame, joint, nextVisibility(mark)));
    if (!mark) hand.goOn(joint);
  }

  function clear() {
    const joint = meant();
    if (!hand.ready() || !model.marks()[joint]) return;
    model.edit(placeJoint(model.state, doing.frame, joint, null));
    model.do({ joint });
  }

  function swap(pairs) {
    if (hand.ready()) model.edit(swapSides(model.state, doing.frame, pairs));
  }

  function accept() {
    if (!hand.ready()) return;
    const places = Object.entries(suggested(hand.joints(), model.marks(), model.ghost()));
    if (!places.length) return;
    const to = Object.fromEntries(places.map(([joint, [x, y]]) => [joint, [x, y, 2]]));
    model.edit(placeJoints(model.state, doing.frame, to));
    hand.goOn(null);
  }

  function setDepth(limb, sign) {
    const known = model.project.limbs.some(({ name }) => name === limb);
    if (hand.ready() && known && (model.nearer()[limb] ?? null) !== sign) {
      model.edit(setNearer(model.state, doing.frame, { [limb]: sign }));
    }
  }

  function flip(limb = meantLimb()) {
    const shown = model.nearer()[limb] ?? model.pose()?.limbs?.[limb]?.sign;
    if (shown) setDepth(limb, -shown);
  }

  // The depths of the n-th reading become the person's word; without one, those that are shown. A
  // pose that is still being computed is waited for, so that no limb is left out.
  async function keepDepths(n = null) {
    if (!hand.ready()) return;
    const { frame } = doing,
      pose = await model.settledPose();
    const reading = n === null ? null : pose?.alternatives?.[n]?.nearer;
    if (doing.frame !== frame || (n !== null && !reading)) return;
    const to = {};
    for (const { name } of limbsShown(model.project.limbs, model.marks())) {
      const sign = reading?.[name] ?? pose?.limbs?.[name]?.sign;
      if (sign && model.nearer()[name] !== sign) to[name] = sign;
    }
    if (Object.keys(to).length) model.edit(setNearer(model.state, frame, to));
  }

  function automaticDepths() {
    const given = Object.keys(model.nearer());
    if (!hand.ready() || !given.length) return;
    model.edit(
      setNearer(model.state, doing.frame, Object.fromEntries(given.map((limb) => [limb, null]))),
    );
  }

  function lock() {
    if (model.keyframe())
      model.edit(setLock(model.state, doing.frame, !model.state.locked[doing.frame]));
  }

  const thing = () =>
    nextThing({
      project: model.project,
      half: model.keyframe()?.half,
      marks: model.marks(),
      nearer: model.nearer(),
      ghost: model.ghost(),
      pose: model.pose(),
      joint: doing.joint,
    });

  const primaries = { accept, depth: () => keepDepths(), next: travel.nextKeyframe, place() {} };

  function primary() {
    if (doing.held?.floating) return hand.putDown();
    if (hand.away()) return travel.look(0);
    hand.keepHeld();
    return primaries[thing().do]();
  }

  return {
    ...hand,
    ...travel,
    visibility,
    clear,
    swap,
    accept,
    setDepth,
    flip,
    automaticDepths,
    lock,
    thing,
    primary,
    reading: (n) => keepDepths(n),
    automaticDepth: () => setDepth(meantLimb(), null),
  };
}
