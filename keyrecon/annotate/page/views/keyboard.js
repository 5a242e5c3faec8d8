// Every key, once: the panel that explains the keys and the page read this table; and what the actions
// of the page of keyframes do.
import { byId } from "./dom.js";

// [keys, what it does, action]; "any" works on every page, the others on the page they are named for.
export const KEYS = {
  any: [
    [["Ctrl+z"], "undo", "undo"],
    [["Ctrl+Shift+z", "Ctrl+y"], "redo", "redo"],
    [["1", "2", "3", "4", "5", "6"].map((n) => `Alt+${n}`), "the pages, as they are numbered above", "page"],
    [["?"], "show or hide the keys", "help"],
  ],
  keyframes: [
    [["Enter"], "do what the bar over the picture offers", "primary"],
    [["o"], "the other answer, where the bar asks one of two", "secondary"],
    [["a", "d"], "previous, next keyframe", "keyframe"],
    [["n"], "next keyframe that is not done", "open"],
    [["w", "s"], "previous, next joint", "joint"],
    [
      ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"],
      "move the joint by a pixel (with Shift by ten)",
      "nudge",
    ],
    [[" "], "put the joint down where the cross is", "put"],
    [["v"], "visible, placed though hidden, cannot be seen", "visibility"],
    [["Backspace", "Delete"], "take the joint's mark away", "clear"],
    [["x"], "swap left and right of the body", "swapBody"],
    [["c"], "swap left and right of the arms", "swapUpper"],
    [["b"], "swap left and right of the legs", "swapLower"],
    [["f"], "turn the limb: its other end is nearer", "flip"],
    [["r"], "leave the limb's depth to the program", "automatic"],
    [["1", "2", "3"], "take the first, second, third reading of the depth", "alternative"],
    [["0"], "leave all depths of this keyframe to the program", "automaticAll"],
    [["q", "e"], "look a frame back, ahead", "scrub"],
    [["Escape"], "back to the keyframe", "back"],
    [["z"], "the player or the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["h"], "hide the skeleton while held", "hide"],
    [["m"], "the body in space large or small", "stage"],
    [["g"], "go to the most suspicious place, then to the next", "check"],
    [["y"], "mark the frame that would help most", "suggestion"],
    [["l"], "lock or unlock the keyframe", "lock"],
  ],
  address: [
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [["Enter"], "do what the bar over the picture offers", "primary"],
    [["o"], "begin the clicks anew in this frame", "secondary"],
    [
      ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"],
      "move the cross (with Shift by ten)",
      "nudge",
    ],
    [[" "], "click where the cross is", "put"],
    [["Backspace", "Delete"], "take the last click away", "clear"],
    [["z"], "the player or the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
  ],
  swing: [
    [["Enter"], "do what the bar over the picture offers", "primary"],
    [["r"], "fit again", "again"],
    [[" "], "play, stop; put down what is asked for", "play"],
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [
      ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"],
      "move what is asked for (with Shift by ten)",
      "nudge",
    ],
    [["1", "2", "3", "4"], "go to start, top, hit, finish", "posture"],
    [["s", "t", "h", "f"], "this frame is the start, top, hit, finish; or not", "name"],
    [["c"], "mark the club: click between the hands, then its head", "club"],
    [["Backspace", "Delete"], "take what is marked under the pointer away, or all of this frame", "clear"],
    [["Escape"], "place nothing", "back"],
    [["k"], "mark the whole body in this frame", "add"],
    [["z"], "the player or the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["x"], "hide body and club while held", "hide"],
    [["m"], "the body in space large or small", "stage"],
  ],
  bodies: [
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [["z"], "the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["Enter"], "do what the bar over the picture offers", "primary"],
    [["k"], "mark the whole body in this frame", "add"],
  ],
  pick: [
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [[..."123456789"], "choose what to click", "part"],
    [
      ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"],
      "move the cross (with Shift by ten)",
      "nudge",
    ],
    [[" "], "pick the colour under the cross", "put"],
    [["Backspace", "Delete"], "take the last pick of this frame away", "clear"],
    [["m"], "show where the colour is found", "map"],
    [["z"], "the player or the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["Enter"], "choose the keyframes", "primary"],
  ],
  motion: [
    [[" "], "play, stop", "play"],
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [["Enter"], "make the motion from what is marked", "primary"],
    [["k"], "add this frame to the keyframes", "add"],
    [["m"], "the body in space large or small", "stage"],
  ],
  files: [[["Enter"], "write the chosen files", "primary"]],
  court: [
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [["Backspace", "Delete"], "take the last point of this frame away", "clear"],
    [["z"], "the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["Enter"], "find the court", "primary"],
  ],
  ground: [
    [["q", "e"], "a frame back, ahead (with Shift a second)", "step"],
    [["1", "2", "3"], "mark an upright thing, a length on the ground, the horizon", "kind"],
    [["Backspace", "Delete"], "take the last mark of this frame away", "clear"],
    [["Escape"], "forget the first end", "back"],
    [["z"], "the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["Enter"], "find the ground", "primary"],
  ],
};

const shiftMatters = (key) => key.startsWith("Arrow") || key.length > 1;

// "Ctrl+Shift+z" of an event; Shift counts only where it does not change the character itself.
function named(event) {
  const digit = event.altKey && event.code?.match(/^Digit(\d)$/)?.[1], // on a Mac, Alt and 1 write "¡"
    letter = digit || (event.key.length === 1 ? event.key.toLowerCase() : event.key);
  const parts = [];
  if (event.ctrlKey || event.metaKey) parts.push("Ctrl");
  if (event.altKey) parts.push("Alt");
  if (event.shiftKey && parts.length && !shiftMatters(event.key)) parts.push("Shift");
  return [...parts, letter].join("+");
}

const REPEATED = new Set(["undo", "redo", "keyframe", "joint", "scrub", "step", "nudge", "zoomBy"]);

// Whether an action goes on while its key is held down; all others are done once.
export const goesOn = ({ action }) => REPEATED.has(action);

// {action, key, index, shift} of a key on a page, or null; the index is that of the key in its row.
export function interpret(event, page) {
  const name = named(event);
  for (const [keys, , action] of [...KEYS[page], ...KEYS.any]) {
    if (keys.includes(name))
      return { action, key: name, index: keys.indexOf(name), shift: event.shiftKey };
  }
  return null;
}

// Keys that belong to the element that has the focus: text, lists, sliders, checkboxes, buttons.
export function belongsTo(element, key) {
  if (element.closest("input[type=text]:not(form *)") && key === "Enter") return false;
  if (element.closest("input[type=text], textarea, select")) return true;
  if (element.closest("button, a, summary") && [" ", "Enter"].includes(key)) return true;
  if (element.closest("input[type=range], [role=listbox], [data-turns]"))
    return key.startsWith("Arrow");
  return Boolean(element.closest("input[type=checkbox]")) && key === " ";
}

const keyNames = {
  ArrowLeft: "←",
  ArrowRight: "→",
  ArrowUp: "↑",
  ArrowDown: "↓",
  " ": "Space",
  Escape: "Esc",
  Delete: "Del",
};

const partText = (part) => keyNames[part] ?? (part.length === 1 ? part.toUpperCase() : part);

export const keyText = (key) => (key === "+" ? key : key.split("+").map(partText).join(" "));

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const SWAPS = { swapBody: null, swapUpper: "upper", swapLower: "lower" };

// One way or the other, by which of two keys it was.
const direction = ({ index }) => (index ? 1 : -1);

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
  const { ui } = model;
  const middle = () => [byId("picture").clientWidth / 2, byId("picture").clientHeight / 2];
  return {
    primary: () => actions.primary(),
    secondary: () => actions.secondary(),
    put: () => actions.placeFloating(),
    visibility: () => actions.visibility(),
    clear: () => actions.clear(),
    flip: () => actions.flip(),
    automatic: () => actions.automaticDepth(),
    automaticAll: () => actions.automaticDepths(),
    open: () => actions.nextKeyframe(),
    lock: () => actions.lock(),
    check: () => lists.nextCheck(),
    suggestion: () => lists.firstSuggestion(),
    keyframe: (key) => actions.stepKeyframe(direction(key)),
    joint: (key) => actions.stepJoint(direction(key)),
    scrub: (key) => actions.scrub(ui.offset + direction(key)),
    alternative: ({ index }) => actions.confirmAlternative(index),
    nudge: (key) => actions.nudge(...arrowStep(key)),
    back: () => (ui.dragged ? model.update({ dragged: null }) : actions.scrub(0)),
    zoom: () => viewer.toggleZoom(),
    zoomBy: ({ index }) => viewer.zoom(middle(), index ? 0.8 : 1.25),
    hide: () => model.update({ hidden: true }),
    ...swapCommands(model, actions),
  };
}
