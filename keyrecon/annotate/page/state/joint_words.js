// Where each joint is, in words and on a figure that faces the reader: the places that the program's
// limb lengths mean, and that people put elsewhere when they are only named.

// By the joint's name without its side: where it is, and what is taken for it by mistake.
const WORDS = {
  head_top: "the top of the skull, under hair or cap",
  neck: "between the collarbones, where the neck meets the trunk; not the chin",
  shoulder: "the middle of the joint, three fingers below the top of the shoulder",
  elbow: "the middle of the joint, not its bony tip",
  wrist: "where hand and forearm meet, not the fist",
  root: "the middle between both hip joints, a hand below the belt",
  hip: "the centre of the joint, where the thigh turns: in the fold of the groin, a hand below the belt",
  knee: "the middle of the joint, behind the kneecap",
  ankle: "between the ankle bones, above the shoe; not on the shoe",
};

// On a figure of height 100 seen from the front; the player's right is on the reader's left.
export const FIGURE = {
  head_top: [50, 3],
  neck: [50, 20],
  right_shoulder: [40, 22],
  right_elbow: [33, 37],
  right_wrist: [26, 51],
  root: [50, 50],
  right_hip: [45, 50],
  right_knee: [42, 72],
  right_ankle: [40, 93],
  left_shoulder: [60, 22],
  left_elbow: [67, 37],
  left_wrist: [74, 51],
  left_hip: [55, 50],
  left_knee: [58, 72],
  left_ankle: [60, 93],
};

const withoutSide = (joint) => joint.replace(/^(left|right)_/, "");

// Where a joint is, in words; an empty text for a joint of another skeleton.
export const jointWords = (joint) => WORDS[withoutSide(joint)] ?? "";
