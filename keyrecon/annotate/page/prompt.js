// The bar over the picture: the one next thing in words, and the button that Enter presses.
import { byId, setText } from "./dom.js";
import { asked, spoken, unmarked } from "./guide.js";

const person = { left: "the player's left", right: "the player's right", middle: "the" };

function named(model, joint) {
  const side = model.sides[joint];
  return `${person[side]} ${spoken(joint).replace(/^(left|right) /, "")}`;
}

function counted(n, word) {
  return `${n} ${word}${n === 1 ? "" : "s"}`;
}

function sureness(model, limbs) {
  const unsure = limbs
    .filter((limb) => (model.pose()?.limbs?.[limb]?.sure ?? 1) < 0.75)
    .map(spoken);
  if (!unsure.length) return "The program is fairly sure of all of them.";
  const listed =
    unsure.slice(0, 3).join(", ") + (unsure.length > 3 ? ` and ${unsure.length - 3} more` : "");
  return `Least sure: ${listed}. Click a limb to turn it, or try 1, 2, 3.`;
}

const prompts = {
  accept(model, { joints, joint }) {
    const from = model.ghost().from?.slice(0, 3).join(", ");
    return {
      text: `Take the suggestion for ${counted(joints.length, "joint")}?`,
      more: `${from ? `From frame ${from}. ` : ""}Drag what is wrong, or click ${named(model, joint)}.`,
      button: "Take it",
    };
  },
  place: (model, { joint, left }) => ({
    text: `Click ${named(model, joint)}`,
    more: `${counted(left, "joint")} to go. Shift-click if it is hidden, V if it cannot be placed.`,
  }),
  depth: (model, { limbs }) => ({
    text: "Which ends are nearer the camera?",
    more: sureness(model, limbs),
    button: "Right as shown",
  }),
  next(model) {
    const open = model.keyframes().filter((keyframe) => !model.done(keyframe)).length;
    return open
      ? {
          text: "This keyframe is done",
          more: `${counted(open, "keyframe")} to go.`,
          button: "Next keyframe",
        }
      : {
          text: "All keyframes are done",
          more: "The motion can be made.",
          button: "Go to the motion",
        };
  },
};

function stretched(model) {
  const found = Object.entries(model.pose()?.stretched ?? {});
  if (!found.length) return null;
  const [limb, ratio] = found.sort((a, b) => b[1] - a[1])[0];
  const joints = asked(model.project, model.keyframe()?.half);
  if (unmarked(joints, model.marks()).length) return null;
  const share = Math.round(100 * (ratio - 1));
  return `The limb to ${named(model, limb)} is ${share} % longer than it can be: check its ends.`;
}

export function createPrompt(model, actions) {
  byId("primary").addEventListener("click", actions.primary);

  function words() {
    if (!model.keyframe())
      return {
        text: "No keyframes yet",
        more: "Pick the colours first; the program then chooses the keyframes.",
      };
    if (model.doing.look)
      return {
        text: "Looking around the keyframe",
        more: "Nothing is marked here.",
        button: "Back to the keyframe",
      };
    const thing = actions.thing(),
      found = prompts[thing.do](model, thing);
    return { ...found, more: stretched(model) ?? found.more };
  }

  return {
    draw() {
      const { text, more, button } = words();
      setText(byId("guide-text"), text);
      setText(byId("guide-more"), more);
      byId("primary").hidden = !button;
      setText(byId("primary"), button ?? "");
    },
  };
}
