// The lists beside the picture: keyframes, checks by suspicion, and what would help next.
import * as api from "../state/api.js";
import { byId, counted, make, setText, toggle } from "./dom.js";
import { label, requiredJoints, whyNoAssistant } from "../state/workflow.js";

const HALF = { upper: "upper body", lower: "lower body", both: "whole body" };
const TABS = { frames: "frame-list", checks: "check-list", next: "next-list" };
const NOT_YET = "The marks were not looked through yet.";

// A small body whose asked half is filled.
function halfIcon(half) {
  const icon = make("span", { className: `half ${half}`, title: HALF[half] });
  icon.append(make("i"), make("i"));
  return icon;
}

function fillRow(element, content, parts) {
  if (element.dataset.content === content) return;
  element.dataset.content = content;
  element.replaceChildren(...parts());
}

// What a keyframe is for: {lines} to show and the whole as `title`; `brings` is what it adds to the share of
// the video that lies within reach of a keyframe.
export function purposeOf({ stands_for: count, brings, own }) {
  if (!count) return { lines: own ? ["added by you"] : [], title: "" };
  const share = brings >= 0.0005 ? (100 * brings).toFixed(1) : null,
    gain = share && `Marked, it brings ${share} % more of the video within reach of a keyframe.`;
  return {
    lines: [`stands for ${counted(count, "frame")}`, ...(share ? [`covers +${share} %`] : [])],
    title: [`Stands for ${counted(count, "frame")} of a similar pose.`, gain].filter(Boolean).join(" "),
  };
}

function keyframeRow(model, element, keyframe) {
  const marks = model.marks(keyframe.frame),
    joints = requiredJoints(model.project, keyframe.half);
  const count = joints.filter((joint) => marks[joint]).length,
    done = count === joints.length;
  const { lines, title } = purposeOf(keyframe),
    tick = model.isMarked(keyframe) ? "✓" : "";
  const content = [keyframe.frame, keyframe.half, ...lines, count, tick, keyframe.locked].join();
  toggle(element, "done", done);
  fillRow(element, content, () => [
    halfIcon(keyframe.half),
    make(
      "span",
      { className: "text", title },
      make("b", {}, `Frame ${keyframe.frame}`),
      ...lines.map((line) => make("small", { className: "line" }, line)),
    ),
    make(
      "span",
      { className: "state" },
      keyframe.locked ? "🔒︎ " : "",
      done ? tick : count ? `${count}/${joints.length} ${tick}` : "",
    ),
  ]);
}

function checkRow(element, check) {
  const name = check.joint ?? check.limb;
  fillRow(element, JSON.stringify(check), () => [
    make("span", { className: "suspicion" }, suspicionMeter(check.suspicion)),
    make(
      "span",
      { className: "text", title: check.text },
      make("b", {}, `Frame ${check.frame}${name ? `, ${label(name)}` : ""}`),
      make("small", {}, check.text),
    ),
  ]);
}

function suggestionRow(element, suggestion) {
  fillRow(element, JSON.stringify(suggestion), () => [
    halfIcon(suggestion.half),
    make(
      "span",
      { className: "text", title: suggestion.why },
      make("b", {}, `Frame ${suggestion.frame}`),
      make("small", {}, suggestion.why),
    ),
    make("span", { className: "state" }, "add"),
  ]);
}

function stretchRow(element, stretch) {
  const place = stretch.first === stretch.last ? `${stretch.first}` : `${stretch.first}-${stretch.last}`,
    text = stretch.text.replace(/^Frames? [^:]*: /, "");
  fillRow(element, JSON.stringify(stretch), () => [
    make("span", { className: "warns" }, "!"),
    make(
      "span",
      { className: "text", title: stretch.text },
      make("b", {}, `Frames ${place}`),
      make("small", {}, text),
    ),
  ]);
}

const nextRow = (element, item) =>
  item.text ? stretchRow(element, item) : suggestionRow(element, item);

function suspicionMeter(share) {
  const bar = make("meter", { min: 0, max: 1, value: Math.max(0, Math.min(1, share)) });
  bar.title = `suspicion ${Math.round(100 * share)} %`;
  return bar;
}

export function createLists(model, actions) {
  let tab = "frames",
    suggestions = [],
    looked = NOT_YET; // what there is to say where no check is listed
  const frames = createVirtualList(byId("frame-list"), {
    height: 54,
    fill: (element, item) => keyframeRow(model, element, item),
    choose: ({ frame }) => actions.open(frame),
  });
  const checkList = createVirtualList(byId("check-list"), { height: 58, fill: checkRow, choose: goTo });
  const nextList = createVirtualList(byId("next-list"), { height: 58, fill: nextRow, choose: add });

  function goTo(check) {
    if (check) actions.open(check.frame, { joint: check.joint ?? check.limb ?? null });
  }
  // Number of the check whose place is open, -1 if none is.
  function openCheck() {
    const { frame, joint } = model.ui;
    return model.checks.findIndex((check) => {
      return check.frame === frame && (check.joint ?? check.limb ?? null) === joint;
    });
  }
  function add(suggestion) {
    if (suggestion) actions.addKeyframe(suggestion.frame, suggestion.half);
  }

  const answers = {
    stretches: (found) => (model.stretches = found),
    next_frames: (found) => (suggestions = found),
    // Null where nothing could be checked yet.
    checks(found) {
      model.checks = found ?? [];
      looked = found ? "Nothing looks wrong." : NOT_YET;
    },
  };
  // What was said of older marks no longer stands.
  const lost = {
    checks() {
      model.checks = [];
      looked = "The marks could not be looked through.";
    },
  };
  // The server takes a while over these: one request at a time, or edits would wait for it. Where it has no
  // answer to one, the others are still asked for.
  const refresh = api.latestOnly(
    async () => {
      let failed = null;
      for (const [name, take] of Object.entries(answers)) {
        await api.read(name).then(take, (fault) => {
          lost[name]?.();
          failed ??= fault;
        });
        model.redraw();
      }
      if (failed) throw failed;
    },
    (fault) => model.notify(fault.message),
  );
  model.onIdle(refresh);
  model.onProject(refresh); // after a run there is more to say

  document.querySelectorAll("[data-tab]").forEach((button) =>
    button.addEventListener("click", () => {
      tab = button.dataset.tab;
      model.redraw();
    }),
  );

  function explanation() {
    const keyframe = model.keyframe(),
      unavailable = whyNoAssistant(model.project);
    if (tab !== "frames" && unavailable) return unavailable;
    if (tab === "checks")
      return model.checks.length
        ? model.checks[openCheck()]?.text ?? "Most suspicious first. G goes from one to the next."
        : looked;
    if (tab === "next") {
      if (model.stretches.length && !suggestions.length)
        return "Where the program is least sure. Choose a line to mark its frame.";
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
    setText(byId("check-count"), model.checks.length ? String(model.checks.length) : "");
    setText(byId("explanation"), explanation());
    if (tab === "frames")
      frames.show(
        keyframes,
        keyframes.findIndex(({ frame }) => frame === model.ui.frame),
      );
    if (tab === "checks") checkList.show(model.checks, openCheck());
    if (tab === "next") nextList.show([...model.stretches, ...suggestions], -1);
  }

  return {
    draw,
    refresh,
    nextCheck: () => goTo(model.checks[(openCheck() + 1) % model.checks.length]),
    firstSuggestion: () => add(model.stretches[0] ?? suggestions[0]),
  };
}

// Makes elements only for the rows in sight, so that hundreds of rows scroll smoothly.
export function createVirtualList(root, { height, fill, choose }) {
  const tall = make("div", { className: "tall" });
  root.append(tall);
  const rows = new Map(); // number -> element
  let items = [],
    current = -1;

  function row(n) {
    if (!rows.has(n)) {
      const element = make("div", { className: "row", role: "option" });
      element.style.transform = `translateY(${n * height}px)`;
      element.addEventListener("click", () => choose(items[n]));
      rows.set(n, element);
      tall.append(element);
    }
    return rows.get(n);
  }

  function draw() {
    const first = Math.max(0, Math.floor(root.scrollTop / height) - 4);
    const last = Math.min(
      items.length,
      Math.ceil((root.scrollTop + root.clientHeight) / height) + 4,
    );
    for (const [n, element] of rows) {
      if (n < first || n >= last) {
        element.remove();
        rows.delete(n);
      }
    }
    for (let n = first; n < last; n++) {
      const element = row(n);
      element.setAttribute("aria-selected", n === current);
      element.setAttribute("aria-posinset", n + 1);
      element.setAttribute("aria-setsize", items.length);
      fill(element, items[n]);
    }
  }

  function reveal(n) {
    const top = n * height,
      bottom = top + height;
    if (top < root.scrollTop) root.scrollTop = Math.max(0, top - height);
    else if (bottom > root.scrollTop + root.clientHeight)
      root.scrollTop = bottom + height - root.clientHeight;
  }

  root.addEventListener("scroll", draw, { passive: true });
  root.addEventListener("keydown", (event) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key],
      next = items[current + by];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    if (next) choose(next);
  });
  new ResizeObserver(draw).observe(root);

  return {
    show(next, chosen) {
      items = next;
      tall.style.height = `${items.length * height}px`;
      if (chosen !== current && chosen >= 0) reveal(chosen);
      current = chosen;
      draw();
    },
  };
}
