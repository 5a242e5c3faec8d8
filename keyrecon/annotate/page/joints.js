// The table of joints: how each is marked, and which end of the limb that leads to it is nearer.
import { byId, make, setText, toggle } from "./dom.js";
import { spoken } from "./guide.js";

const SEEN = { 2: "visible", 1: "hidden", 0: "absent" };
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
      { title: `${spoken(joint)} is ${meaning}`, data: { sign: String(sign) } },
      text,
    );
    button.addEventListener("click", () => actions.setDepth(joint, sign));
    return button;
  }

  function makeRow(joint) {
    const shape = make("i", { className: `shape ${model.sides[joint]}` });
    const name = make("button", { className: "name" }, shape, spoken(joint));
    name.addEventListener("click", () => actions.select(joint));
    const seen = make("button", {
      className: "seen",
      title: "visible, hidden, cannot be seen (V)",
    });
    seen.addEventListener("click", () => {
      actions.select(joint);
      actions.visibility(joint);
    });
    const depth = make("span", { className: "depth" });
    if (limbs.has(joint)) depth.append(...DEPTHS.map((choice) => depthButton(joint, choice)));
    const row = make("div", { className: "joint", data: { joint } }, name, seen, depth);
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
      limb = model.pose()?.limbs?.[joint];
    for (const button of row.querySelectorAll(".depth button")) {
      const sign = button.dataset.sign === "null" ? null : Number(button.dataset.sign);
      toggle(button, "on", sign === given);
      toggle(button, "guess", sign !== null && given === null && limb?.sign === sign);
      button.style.setProperty(
        "--sure",
        given === null && limb?.sign === sign ? (limb.sure ?? 0) : 0,
      );
    }
    row.querySelector(".depth").hidden = !limb;
  }

  function draw() {
    const marks = model.marks(),
      wanted = new Set(actions.joints()),
      { joint: selected, under } = model.doing;
    for (const [joint, row] of rows) {
      const mark = marks[joint];
      row.hidden = !wanted.has(joint) && !mark;
      toggle(row, "selected", joint === selected);
      toggle(row, "under", joint === (under?.joint ?? under?.limb));
      toggle(row, "marked", mark);
      setText(row.querySelector(".seen"), mark ? SEEN[mark[2]] : "");
      if (limbs.has(joint)) drawDepth(row, joint);
    }
  }

  return { draw };
}
