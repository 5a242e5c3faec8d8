// What each action of the table of keys does.
import { byId } from "./dom.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const SWAPS = { swapBody: null, swapUpper: "upper", swapLower: "lower" };

// One way or the other, by which of two keys it was.
const way = ({ place }) => (place ? 1 : -1);

// The step of an arrow key, px.
export function arrowStep({ key, shift }) {
  return ARROWS[key].map((step) => step * (shift ? 10 : 1));
}

function swapCommands(model, actions) {
  const pairs = (half) =>
    model.project.mirror.filter(([left]) => !half || model.project.halves[half].includes(left));
  return Object.fromEntries(
    Object.entries(SWAPS).map(([name, half]) => [name, () => actions.swap(pairs(half))]),
  );
}

export function keyframeCommands(model, { actions, viewer, lists }) {
  const { doing } = model;
  const middle = () => [byId("picture").clientWidth / 2, byId("picture").clientHeight / 2];
  return {
    primary: () => actions.primary(),
    put: () => actions.putDown(),
    visibility: () => actions.visibility(),
    clear: () => actions.clear(),
    flip: () => actions.flip(),
    automatic: () => actions.automaticDepth(),
    automaticAll: () => actions.automaticDepths(),
    open: () => actions.nextKeyframe(),
    lock: () => actions.lock(),
    check: () => lists.nextCheck(),
    suggestion: () => lists.firstSuggestion(),
    keyframe: (key) => actions.stepKeyframe(way(key)),
    joint: (key) => actions.stepJoint(way(key)),
    look: (key) => actions.look(doing.look + way(key)),
    reading: ({ place }) => actions.reading(place),
    nudge: (key) => actions.nudge(...arrowStep(key)),
    back: () => (doing.held ? model.do({ held: null }) : actions.look(0)),
    zoom: () => viewer.toggleZoom(),
    zoomBy: ({ place }) => viewer.zoom(middle(), place ? 0.8 : 1.25),
    hide: () => model.do({ hidden: true }),
    ...swapCommands(model, actions),
  };
}
