// A picture of where the joints are: a figure that faces the reader, with the joint that is asked for
// marked on it and told of in words. Joints of other skeletons have no picture.
import { FIGURE, jointWords } from "../state/joint_words.js";
import { label } from "../state/workflow.js";
import { toggle } from "./dom.js";

const SVG = "http://www.w3.org/2000/svg";
// Flesh around the joints: [from, to, width].
const LIMBS = [
  ["neck", "head_top", 7],
  ["right_shoulder", "right_elbow", 6],
  ["right_elbow", "right_wrist", 5],
  ["left_shoulder", "left_elbow", 6],
  ["left_elbow", "left_wrist", 5],
  ["right_hip", "right_knee", 9],
  ["right_knee", "right_ankle", 6.5],
  ["left_hip", "left_knee", 9],
  ["left_knee", "left_ankle", 6.5],
];
const OUTLINES = [
  "M36 22 Q37 18 46 18 L54 18 Q63 18 64 22 L60 40 L61 53 L39 53 L40 40 Z", // trunk
  "M42.5 10 a7.5 8.5 0 1 0 15 0 a7.5 8.5 0 1 0 -15 0", // head
  "M36.5 94 L43.5 94 L43 98 L32 98 Q32 95 36.5 94 Z M63.5 94 L56.5 94 L57 98 L68 98 Q68 95 63.5 94 Z", // shoes
  "M22.5 52 a3.2 4 15 1 0 6 1.5 a3.2 4 15 1 0 -6 -1.5 M71.5 53.5 a3.2 4 -15 1 0 6 -1.5 a3.2 4 -15 1 0 -6 1.5", // hands
];
const BELT = "M39.6 44 L60.4 44";

function draw(tag, properties) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(properties)) element.setAttribute(name, value);
  return element;
}

// `show(joint)` marks one joint, null marks none; `exists` is false for joints that have no picture.
export function createGuide(root, model, joints = model.project.joints) {
  const picture = draw("svg", { viewBox: "14 -1 72 101", role: "img" });
  picture.setAttribute("aria-label", "Where the joints are on a body that faces you");
  for (const path of OUTLINES) picture.append(draw("path", { d: path, class: "flesh" }));
  for (const [from, to, width] of LIMBS) {
    const [[x1, y1], [x2, y2]] = [FIGURE[from], FIGURE[to]];
    picture.append(draw("line", { x1, y1, x2, y2, class: "limb", "stroke-width": width }));
  }
  picture.append(draw("path", { d: BELT, class: "belt" }));
  const dots = new Map();
  for (const joint of joints.filter((name) => FIGURE[name])) {
    const [cx, cy] = FIGURE[joint],
      dot = draw("circle", { cx, cy, r: 1.7, class: `place ${model.sides[joint] ?? "middle"}` }),
      title = draw("title", {});
    title.textContent = `${label(joint)}: ${jointWords(joint)}`;
    dot.append(title);
    dot.dataset.joint = joint;
    dots.set(joint, dot);
    picture.append(dot);
  }
  for (const [x, text] of [[18, "right"], [82, "left"]]) {
    const word = draw("text", { x, y: 12, class: "side-word", "text-anchor": x < 50 ? "start" : "end" });
    word.textContent = text;
    picture.append(word);
  }
  if (dots.size) root.append(picture);

  return {
    exists: dots.size > 0,
    show(joint) {
      for (const [name, dot] of dots) {
        toggle(dot, "asked", name === joint);
        dot.setAttribute("r", name === joint ? 2.8 : 1.7);
      }
    },
  };
}
