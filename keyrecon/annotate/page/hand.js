// The joint in hand: dragged by the pointer, walked by the arrow keys, or hovering over its first place.
import { placeJoint } from "./edits.js";
import { asked, following } from "./guide.js";

const PAUSE = 350; // ms after the last step of the arrows until it is taken as meant

export function createHand(model) {
  const { doing } = model;
  let resting = null;

  const joints = () => asked(model.project, model.keyframe()?.half);

  // Context only: off the keyframe nothing is changed.
  const away = () => doing.look !== 0 || doing.frame === null;

  // What is in hand is put down before anything else is changed.
  function ready() {
    keepHeld();
    return !away();
  }

  // After a joint is settled the next unmarked one is asked for.
  const goOn = (joint) => model.do({ joint: following(joints(), model.marks(), joint) });

  function place(joint, at, v = 2) {
    if (away() || !joint) return;
    const fresh = !model.marks()[joint];
    model.edit(placeJoint(model.state, doing.frame, joint, [...at, v]));
    if (fresh) goOn(joint);
    else model.do({ joint });
  }

  // A joint on its way is held until the arrows rest, so that one undo takes the whole walk back.
  function nudge(dx, dy) {
    const joint = doing.joint,
      mark = model.marks()[joint];
    if (away() || !joint) return;
    const start =
      doing.held?.joint === joint
        ? doing.held.at
        : (mark ?? model.ghost()?.joints?.[joint] ?? model.middle());
    model.do({ held: { joint, at: [start[0] + dx, start[1] + dy], floating: !mark } });
    clearTimeout(resting);
    if (mark) resting = setTimeout(keepHeld, PAUSE);
  }

  const placeAgain = (joint, at) => place(joint, at, model.marks()[joint]?.[2] || 2);

  function keepHeld() {
    clearTimeout(resting);
    const { held } = doing;
    doing.held = null;
    if (held && !held.floating) placeAgain(held.joint, held.at);
  }

  function carry(joint, at) {
    if (doing.held?.joint !== joint) keepHeld();
    clearTimeout(resting);
    model.do({ joint, held: { joint, at } });
  }

  function drop(joint, at) {
    doing.held = null;
    placeAgain(joint, at);
  }

  // Takes the hovering joint's place as meant.
  function putDown() {
    const { held } = doing;
    if (!held?.floating) return;
    doing.held = null;
    place(held.joint, held.at);
  }

  function select(joint) {
    keepHeld();
    model.do({ joint });
  }

  return { joints, away, ready, goOn, place, nudge, keepHeld, carry, drop, putDown, select };
}
