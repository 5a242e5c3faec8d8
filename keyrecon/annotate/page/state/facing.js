// Which way the player faces: what nothing in a picture of joints tells, and a person sees at once.
// Joints seen from the front and their mirror image seen from behind are the same picture, so front and
// back hang on which joints were called left; and a chest turned to the left looks like one turned to
// the right as much.
import { chestDirection } from "../../../report/figure3d.js";

const SIDEWAYS = 0.12; // breadth of the trunk over its length in the picture below which it is seen from the side
const LEAST_TURN = 0.35; // of the chest to one side (sine of the angle): below it nobody would see a difference
const UNDECIDED = 0.15; // share of the likelier side's opposite from which on a person is asked

export const TRUNK = ["left_shoulder", "right_shoulder", "right_hip", "left_hip"];

// 1 where the marks say that the chest points to the camera, -1 away from it, 0 where it is seen from
// the side or not all of the trunk is marked.
export function facingOfMarks(marks) {
  if (!TRUNK.every((joint) => marks[joint]?.[2] > 0)) return 0;
  const [ls, rs, rh, lh] = TRUNK.map((joint) => marks[joint]);
  const across = [0, 1].map((axis) => (ls[axis] - rs[axis] + lh[axis] - rh[axis]) / 2),
    down = [0, 1].map((axis) => (lh[axis] + rh[axis] - ls[axis] - rs[axis]) / 2);
  const breadth = (across[0] * down[1] - across[1] * down[0]) / (down[0] ** 2 + down[1] ** 2 || 1);
  return Math.abs(breadth) < SIDEWAYS ? 0 : Math.sign(breadth);
}

// {frame, facing} of the only frame whose marks tell which way the player faces, `others` where several do;
// null where none does. `marks` are those of all frames, by frame.
export function firstFacing(marks) {
  const told = Object.keys(marks).filter((frame) => facingOfMarks(marks[frame]));
  if (!told.length) return null;
  return { frame: Number(told[0]), facing: facingOfMarks(marks[told[0]]), others: told.length > 1 };
}

// {left, right}: the likeliest readings of the depth whose chest is turned to either side of the picture
// where both are likely; else null. The readings are those of the server, with their costs in nats.
export function undecidedTurn(alternatives) {
  const known = (alternatives ?? []).filter(({ points3d }) => TRUNK.every((joint) => points3d[joint]));
  const turned = known.map((one) => ({ one, x: chestDirection(one.points3d, TRUNK)[0] }));
  const share = (sign) =>
    turned.filter(({ x }) => x * sign > 0).reduce((sum, { one }) => sum + Math.exp(-one.cost), 0);
  const [left, right] = [-1, 1].map((sign) => turned.find(({ x }) => x * sign > LEAST_TURN)?.one);
  const [p, q] = [share(-1), share(1)];
  return left && right && Math.min(p, q) / (p + q) > UNDECIDED ? { left, right } : null;
}
