// The bar over the picture: the next step in words, and the button that Enter presses; and the slider
// below it.
import { byId, counted, setText } from "./dom.js";
import { jointWords } from "../state/joint_words.js";
import { label, nextBeginning, requiredJoints, unmarked } from "../state/workflow.js";

const UNCERTAIN = 0.75; // certainty below which a limb is named
const SIDES = { left: "the player's left", right: "the player's right", middle: "the" };

function named(model, joint) {
  const side = model.sides[joint];
  return `${SIDES[side]} ${label(joint).replace(/^(left|right) /, "")}`;
}

const sentence = (words) => (words ? `${words[0].toUpperCase()}${words.slice(1)}. ` : "");

// Before there are keyframes: what a marked body is for.
function afterBody(model) {
  if (model.project.golf)
    return {
      text: "This body is marked",
      more: "What is marked holds in the next fit of the swing.",
      button: "Back to the swing",
    };
  const { left } = nextBeginning(model.project, model.keyframes(), model.isDone);
  if (left)
    return {
      text: "This body is done",
      more: `${counted(left, "more body").replace("bodys", "bodies")}, where the program is least sure.`,
      button: "Next body",
    };
  return {
    text: model.project.bodies ? "All bodies are marked" : "The body is marked",
    more: "The program learns from it where the player is and what the player looks like.",
    button: "Go on",
  };
}

function leastCertain(model, limbs) {
  const uncertain = limbs
    .filter((limb) => (model.poses.current()?.limbs?.[limb]?.certainty ?? 1) < UNCERTAIN)
    .map(label);
  if (!uncertain.length) return "The program is fairly sure of all of them.";
  const listed =
    uncertain.slice(0, 3).join(", ") + (uncertain.length > 3 ? ` and ${uncertain.length - 3} more` : "");
  return `Least sure: ${listed}. Click a limb to turn it, or try 1, 2, 3.`;
}

// Enter alone, pressed to the end, would take what the program itself finds wrong.
function doubted(checks) {
  if (!checks) return "";
  return `${counted(checks, "mark")} ${checks > 1 ? "look" : "looks"} wrong: G goes there. `;
}

const lackingWords = (count) =>
  count ? `${counted(count, "keyframe")} ${count > 1 ? "lack" : "lacks"} single joints. ` : "";

function framesNamed(frames) {
  if (frames.length === 1) return `frame ${frames[0]}`;
  return `frames ${frames.slice(0, -1).join(", ")} and ${frames.at(-1)}`;
}

const PROMPTS = {
  accept(model, { joints, joint }) {
    const from = model.poses.suggestion().from?.slice(0, 3) ?? [];
    return {
      text: `Take the suggestion for ${counted(joints.length, "joint")}?`,
      more: `${from.length ? `From ${framesNamed(from)}. ` : ""}Drag what is wrong, or click ${named(model, joint)}.`,
      button: "Take it",
    };
  },
  place: (model, { joint, left }) => ({
    text: `Click ${named(model, joint)}`,
    more: `${sentence(jointWords(joint))}${counted(left, "joint")} to go. Shift-click if it is hidden, V if it cannot be placed.`,
  }),
  facing: (model, { facing }) => ({
    text: "Does the player face you here?",
    more: `As it is marked, ${facing > 0 ? "yes" : "no: the back is to you"}. Left and right are the player's own, so this tells whether they are exchanged.`,
    button: "Faces me",
    other: "Turned away",
  }),
  turn: () => ({
    text: "To which side of the picture is the chest turned?",
    more: "The joints alone fit both; this is asked once.",
    button: "Left",
    other: "Right",
  }),
  depth: (model, { limbs }) => ({
    text: "Which ends are nearer the camera?",
    more: leastCertain(model, limbs),
    button: "Right as shown",
  }),
  next(model) {
    if (!model.project.has.keyframes) return afterBody(model);
    const { all, marked, lacking } = model.progress();
    return marked < all
      ? {
          text: "This keyframe is done",
          more: `${counted(all - marked, "keyframe")} to go.`,
          button: "Next keyframe",
        }
      : {
          text: lacking ? "All keyframes are marked" : "All keyframes are done",
          more: `${doubted(model.checks.length)}${lackingWords(lacking)}The motion can be made.`,
          button: "Go to the motion",
        };
  },
};

function tooLong(model) {
  const stretched = Object.entries(model.poses.current()?.stretched ?? {});
  if (!stretched.length) return null;
  const [limb, ratio] = stretched.sort((a, b) => b[1] - a[1])[0];
  const joints = requiredJoints(model.project, model.keyframe()?.half);
  if (unmarked(joints, model.marks()).length) return null;
  const share = Math.round(100 * (ratio - 1));
  return `The limb to ${named(model, limb)} is ${share} % longer than it can be: check its ends.`;
}

export function createPrompt(model, actions) {
  byId("primary").addEventListener("click", actions.primary);
  byId("secondary").addEventListener("click", actions.secondary);

  function words() {
    if (!model.keyframe())
      return {
        text: "No keyframes yet",
        more: "Mark one whole body first (1 Body); the program then chooses the keyframes.",
      };
    if (model.ui.offset)
      return {
        text: "Looking around the keyframe",
        more: "Nothing is marked here.",
        button: "Back to the keyframe",
      };
    const step = actions.next(),
      prompt = PROMPTS[step.do](model, step);
    return { ...prompt, more: tooLong(model) ?? prompt.more };
  }

  return {
    draw() {
      const { text, more, button, other } = words();
      byId("secondary").hidden = !other;
      setText(byId("secondary-text"), other ?? "");
      setText(byId("prompt-text"), text);
      setText(byId("prompt-more"), more);
      byId("primary").hidden = !button;
      setText(byId("primary"), button ?? "");
    },
  };
}

// The slider under the picture: a second before and after the keyframe, for context.
export function createScrub(model, actions) {
  const slider = byId("scrub");
  slider.addEventListener("input", () => actions.scrub(Number(slider.value)));
  byId("scrub-back").addEventListener("click", () => actions.scrub(model.ui.offset - 1));
  byId("scrub-ahead").addEventListener("click", () => actions.scrub(model.ui.offset + 1));

  return {
    draw() {
      const { frame, offset } = model.ui,
        { fps, time, n_frames: count } = model.project;
      const second = Math.round(fps);
      slider.min = -Math.min(second, frame);
      slider.max = Math.min(second, count - 1 - frame);
      slider.value = offset;
      const at = frame + offset,
        seconds = time?.[at] ?? at / fps;
      setText(byId("position"), `frame ${at} of ${count}, ${seconds.toFixed(2)} s`);
      byId("offset").hidden = offset === 0;
      setText(byId("offset"), `${offset > 0 ? "+" : "−"}${Math.abs(offset)} frames from the keyframe`);
    },
  };
}
