// The table of joints: how each is marked, and which end of the limb that leads to it is nearer.
import { byId, make, setText, toggle } from "./dom.js";
import { label } from "../state/workflow.js";

const VISIBILITY = { 2: "visible", 1: "hidden", 0: "absent" };
const DEPTHS = [
  [1, "▲", "nearer the camera"],
  [null, "auto", "left to the program"],
  [-1, "▽", "farther from the camera"],
];

export function createJoints(model, actions) {
  const rows = new Map(),
    limbs = new Map(model.project.limbs.map((limb) => [limb.name, limb]));

  function depthButton(joint, [sign, text, meaning]) {
    const button = make(
      "button",
      { title: `${label(joint)} is ${meaning}`, data: { sign: String(sign) } },
      text,
    );
    button.addEventListener("click", () => actions.setDepth(joint, sign));
    return button;
  }

  function makeRow(joint) {
    const shape = make("i", { className: `shape ${model.sides[joint]}` });
    const name = make("button", { className: "name" }, shape, label(joint));
    name.addEventListener("click", () => actions.select(joint));
    const visibility = make("button", {
      className: "visibility",
      title: "visible, hidden, cannot be seen (V)",
    });
    visibility.addEventListener("click", () => {
      actions.select(joint);
      actions.visibility(joint);
    });
    const depth = make("span", { className: "depth" });
    if (limbs.has(joint)) depth.append(...DEPTHS.map((choice) => depthButton(joint, choice)));
    const row = make("div", { className: "joint", data: { joint } }, name, visibility, depth);
    rows.set(joint, row);
    return row;
  }

  byId("joints").append(
    make(
      "div",
      { className: "joint head" },
      make("span", {}, "Joint"),
      make("span", {}, "Seen"),
      make("span", {}, "Outer end"),
    ),
    ...model.project.order.map(makeRow),
  );

  function drawDepth(row, joint) {
    const given = model.nearer()[joint] ?? null,
      limb = model.poses.current()?.limbs?.[joint];
    for (const button of row.querySelectorAll(".depth button")) {
      const sign = button.dataset.sign === "null" ? null : Number(button.dataset.sign);
      toggle(button, "on", sign === given);
      toggle(button, "guess", sign !== null && given === null && limb?.sign === sign);
      button.style.setProperty(
        "--certainty",
        given === null && limb?.sign === sign ? (limb.certainty ?? 0) : 0,
      );
    }
    row.querySelector(".depth").hidden = !limb;
  }

  function draw() {
    const marks = model.marks(),
      wanted = new Set(actions.joints()),
      { joint: selected, hovered } = model.ui;
    for (const [joint, row] of rows) {
      const mark = marks[joint];
      row.hidden = !wanted.has(joint) && !mark;
      toggle(row, "selected", joint === selected);
      toggle(row, "hovered", joint === (hovered?.joint ?? hovered?.limb));
      toggle(row, "marked", mark);
      setText(row.querySelector(".visibility"), mark ? VISIBILITY[mark[2]] : "");
      if (limbs.has(joint)) drawDepth(row, joint);
    }
  }

  return { draw };
}
