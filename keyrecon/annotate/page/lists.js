// The lists beside the picture: keyframes, checks by suspicion, and what would help next.
import * as api from "./api.js";
import { byId, make, setText, toggle } from "./dom.js";
import { asked, spoken, whyNoHelp } from "./guide.js";
import { createList } from "./list.js";

const HALF = { upper: "upper body", lower: "lower body", both: "whole body" };
const TABS = { frames: "frame-list", checks: "check-list", next: "next-list" };

// A small body whose asked half is filled.
function bodySign(half) {
  const sign = make("span", { className: `half ${half}`, title: HALF[half] });
  sign.append(make("i"), make("i"));
  return sign;
}

function fillRow(element, label, parts) {
  if (element.dataset.label === label) return;
  element.dataset.label = label;
  element.replaceChildren(...parts());
}

function keyframeRow(model, element, keyframe) {
  const marks = model.marks(keyframe.frame),
    joints = asked(model.project, keyframe.half);
  const count = joints.filter((joint) => marks[joint]).length,
    done = count === joints.length;
  const stands = keyframe.stands_for
    ? `stands for ${keyframe.stands_for}`
    : keyframe.own
      ? "added by you"
      : "";
  const label = [keyframe.frame, keyframe.half, stands, count, keyframe.locked].join();
  toggle(element, "done", done);
  fillRow(element, label, () => [
    bodySign(keyframe.half),
    make(
      "span",
      { className: "text" },
      make("b", {}, `Frame ${keyframe.frame}`),
      make("small", {}, stands),
    ),
    make(
      "span",
      { className: "state" },
      keyframe.locked ? "🔒︎ " : "",
      done ? "✓" : count ? `${count}/${joints.length}` : "",
    ),
  ]);
}

function checkRow(element, check) {
  const name = check.joint ?? check.limb;
  fillRow(element, JSON.stringify(check), () => [
    make("span", { className: "suspicion" }, meter(check.suspicion)),
    make(
      "span",
      { className: "text", title: check.text },
      make("b", {}, `Frame ${check.frame}${name ? `, ${spoken(name)}` : ""}`),
      make("small", {}, check.text),
    ),
  ]);
}

function suggestionRow(element, suggestion) {
  fillRow(element, JSON.stringify(suggestion), () => [
    bodySign(suggestion.half),
    make(
      "span",
      { className: "text", title: suggestion.why },
      make("b", {}, `Frame ${suggestion.frame}`),
      make("small", {}, suggestion.why),
    ),
    make("span", { className: "state" }, "add"),
  ]);
}

function meter(share) {
  const bar = make("meter", { min: 0, max: 1, value: Math.max(0, Math.min(1, share)) });
  bar.title = `suspicion ${Math.round(100 * share)} %`;
  return bar;
}

export function createLists(model, actions) {
  let tab = "frames",
    checks = [],
    suggestions = [];
  const frames = createList(byId("frame-list"), {
    height: 44,
    fill: (element, item) => keyframeRow(model, element, item),
    choose: ({ frame }) => actions.open(frame),
  });
  const checkList = createList(byId("check-list"), { height: 58, fill: checkRow, choose: goTo });
  const nextList = createList(byId("next-list"), { height: 58, fill: suggestionRow, choose: add });

  function goTo(check) {
    if (check) actions.open(check.frame, { joint: check.joint ?? check.limb ?? null });
  }
  // Number of the check whose place is open, -1 if none is.
  function openCheck() {
    const { frame, joint } = model.doing;
    return checks.findIndex((check) => {
      return check.frame === frame && (check.joint ?? check.limb ?? null) === joint;
    });
  }
  function add(suggestion) {
    if (suggestion) actions.addKeyframe(suggestion.frame, suggestion.half);
  }

  // The server takes a while over these: one question at a time, or edits would wait for it.
  const ask = api.latestOnly(
    async () => {
      checks = await api.read("checks");
      suggestions = await api.read("next");
      model.changed();
    },
    (fault) => model.tell(fault.message),
  );
  model.onSettled(ask);

  document.querySelectorAll("[data-tab]").forEach((button) =>
    button.addEventListener("click", () => {
      tab = button.dataset.tab;
      model.changed();
    }),
  );

  function explain() {
    const keyframe = model.keyframe(),
      silent = whyNoHelp(model.project);
    if (tab !== "frames" && silent) return silent;
    if (tab === "checks")
      return checks.length
        ? checks[openCheck()]?.text ?? "Most suspicious first. G goes from one to the next."
        : "Nothing looks wrong.";
    if (tab === "next") {
      if (suggestions.length)
        return "Frames where one more keyframe would help most. Y adds the first.";
      return "After the motion was made, frames where one more keyframe would help are listed here.";
    }
    return keyframe?.why ? `Frame ${keyframe.frame}: ${keyframe.why}.`.replace("..", ".") : "";
  }

  function draw() {
    const keyframes = model.keyframes();
    for (const [name, id] of Object.entries(TABS)) byId(id).hidden = name !== tab;
    document.querySelectorAll("[data-tab]").forEach((button) => {
      button.setAttribute("aria-selected", button.dataset.tab === tab);
    });
    setText(byId("check-count"), checks.length ? String(checks.length) : "");
    setText(byId("why"), explain());
    if (tab === "frames")
      frames.show(
        keyframes,
        keyframes.findIndex(({ frame }) => frame === model.doing.frame),
      );
    if (tab === "checks") checkList.show(checks, openCheck());
    if (tab === "next") nextList.show(suggestions, -1);
  }

  return {
    draw,
    ask,
    nextCheck: () => goTo(checks[(openCheck() + 1) % checks.length]),
    firstSuggestion: () => add(suggestions[0]),
  };
}
