// Every key, once: the panel that explains them and the page that obeys them read this table.
// [keys, what it does, action]; "any" works on every page, the others on the page they are named for.

export const KEYS = {
  any: [
    [["Ctrl+z"], "undo", "undo"],
    [["Ctrl+Shift+z", "Ctrl+y"], "redo", "redo"],
    [["1", "2", "3"].map((n) => `Alt+${n}`), "colours, keyframes, motion", "page"],
    [["?"], "show or hide the keys", "help"],
  ],
  keyframes: [
    [["Enter"], "do what the bar over the picture offers", "primary"],
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
    [["1", "2", "3"], "take the first, second, third reading of the depth", "reading"],
    [["0"], "leave all depths of this keyframe to the program", "automaticAll"],
    [["q", "e"], "look a frame back, ahead", "look"],
    [["Escape"], "back to the keyframe", "back"],
    [["z"], "the player or the whole picture", "zoom"],
    [["+", "-"], "zoom in, out", "zoomBy"],
    [["h"], "hide the skeleton while held", "hide"],
    [["g"], "go to the most suspicious place, then to the next", "check"],
    [["y"], "add the frame that would help most", "suggestion"],
    [["l"], "lock or unlock the keyframe", "lock"],
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
  ],
};

const shiftMatters = (key) => key.startsWith("Arrow") || key.length > 1;

// "Ctrl+Shift+z" of an event; Shift counts only where it does not change the character itself.
function named(event) {
  const letter = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const parts = [];
  if (event.ctrlKey || event.metaKey) parts.push("Ctrl");
  if (event.altKey) parts.push("Alt");
  if (event.shiftKey && parts.length && !shiftMatters(event.key)) parts.push("Shift");
  return [...parts, letter].join("+");
}

// {action, key, shift} of a key on a page, or null.
export function meaning(event, page) {
  const name = named(event);
  for (const [keys, , action] of [...KEYS[page], ...KEYS.any]) {
    if (keys.includes(name))
      return { action, key: name, place: keys.indexOf(name), shift: event.shiftKey };
  }
  return null;
}

// Keys that belong to the element that has the focus: text, lists, sliders, buttons.
export function belongsTo(element, key) {
  if (element.closest("input[type=text], textarea, select")) return true;
  if (element.closest("input[type=range], [role=listbox], [data-turns]"))
    return key.startsWith("Arrow");
  return Boolean(element.closest("button, a, summary")) && [" ", "Enter"].includes(key);
}

const shownNames = {
  ArrowLeft: "←",
  ArrowRight: "→",
  ArrowUp: "↑",
  ArrowDown: "↓",
  " ": "Space",
  Escape: "Esc",
  Delete: "Del",
};

const shownPart = (part) => shownNames[part] ?? (part.length === 1 ? part.toUpperCase() : part);

export const keyText = (key) => (key === "+" ? key : key.split("+").map(shownPart).join(" "));
