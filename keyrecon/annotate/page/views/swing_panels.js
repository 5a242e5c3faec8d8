// Below and beside the picture of a golf swing: its key postures on a strip, what is doubtful, what can be
// marked in the frame that is shown, and what was.
import { KEYS, markedFrames, spreadLabels } from "../state/swing.js";
import { label } from "../state/workflow.js";
import { byId, make, setText, toggle } from "./dom.js";

const LABEL = 96; // breadth of a key posture on the strip, px

// goTo(frame), mark(key posture), askFor(joint or end of the club), clearIn(frame), keys() of the swing.
export function createSwingPanels(model, { goTo, mark, askFor, clearIn, keys }) {
  const { project } = model,
    last = project.n_frames - 1;

  const postures = new Map(
    KEYS.map((name) => {
      const button = make("button", { className: "posture" }, make("b", {}, name), make("small"));
      button.addEventListener("click", () => goTo(keys()[name].frame));
      return [name, { button, tick: make("i") }];
    }),
  );
  byId("swing-strip").append(...[...postures.values()].flatMap(({ button, tick }) => [tick, button]));
  const namers = KEYS.map((name) => {
    const button = make("button", {}, name, " ", make("kbd", {}, name[0].toUpperCase()));
    button.addEventListener("click", () => mark(name));
    return [name, button];
  });
  byId("swing-keys").append(...namers.map(([, button]) => button));
  const targets = ["hands", ...project.order].map((name) => {
    const club = name === "hands",
      button = make("button", { className: "plain" }, club ? "the club " : label(name), club ? make("kbd", {}, "C") : null);
    button.addEventListener("click", () => askFor(name));
    return [name, button];
  });
  byId("swing-targets").append(...targets.map(([, button]) => button));

  function drawStrip(frame) {
    const strip = byId("swing-strip"),
      known = keys(),
      names = KEYS.filter((name) => known[name]),
      places = names.map((name) => (known[name].frame / Math.max(1, last)) * strip.clientWidth),
      breadth = Math.min(LABEL, strip.clientWidth / KEYS.length),
      lefts = spreadLabels(places, breadth, strip.clientWidth);
    for (const [name, { button, tick }] of postures) {
      const n = names.indexOf(name);
      button.hidden = tick.hidden = n < 0;
      if (n < 0) continue;
      button.style.left = `${lefts[n]}px`;
      button.style.width = `${breadth - 4}px`;
      tick.style.left = `${places[n]}px`;
      toggle(button, "marked", known[name].marked);
      setText(button.lastChild, `${Math.round(known[name].frame)}`);
      button.title = known[name].marked ? `The ${name}, as you marked it` : `The ${name}, as it was found`;
      button.setAttribute("aria-current", Math.round(known[name].frame) === frame);
    }
  }

  // Replaces the children of an element when what they show has changed.
  function refill(element, content, children) {
    const text = JSON.stringify(content);
    if (element.dataset.content === text) return;
    element.dataset.content = text;
    element.replaceChildren(...children());
  }

  function lineTo(number, text) {
    const button = make("button", { className: "plain" }, text);
    button.addEventListener("click", () => number === null || goTo(number));
    return button;
  }

  function drawSide(frame, asked) {
    const doubts = model.swing?.doubts ?? [],
      rows = markedFrames(model.state);
    byId("doubts-title").hidden = !doubts.length;
    refill(byId("doubts"), doubts, () =>
      doubts.map(({ text, frame: at }) => lineTo(at, at === null ? text : `Frame ${at}: ${text}`)),
    );
    byId("swing-marked").hidden = !rows.length;
    refill(byId("swing-marks"), rows, () =>
      rows.map(({ frame: at, marks: names }) => {
        const removal = make("button", { className: "plain", "aria-label": `Take the marks of frame ${at} away` }, "✕");
        removal.addEventListener("click", () => clearIn(at));
        return make("div", {}, lineTo(at, `Frame ${at}: ${names.join(", ")}`), removal);
      }),
    );
    for (const [name, button] of namers) button.setAttribute("aria-pressed", model.state.keys[name] === frame);
    for (const [name, button] of targets) {
      const placed = name === "hands" ? model.state.shafts[frame] : model.marks(frame)[name];
      toggle(button, "placed", placed);
      button.setAttribute("aria-pressed", name === asked || (name === "hands" && asked === "head"));
    }
  }

  return {
    draw(frame, asked) {
      drawStrip(frame);
      drawSide(frame, asked);
    },
  };
}
