// Edits as records: what is to be there, and what was believed to be there before.
import { marksOf, nearerOf } from "./state.js";

export function newId() {
  const bytes = crypto.getRandomValues(new Uint8Array(12));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

const pickedFrom = (values, names) =>
  Object.fromEntries(names.map((name) => [name, values[name] ?? null]));

// A tenth of a pixel is finer than anyone clicks.
const rounded = (place) =>
  place && [Math.round(place[0] * 10) / 10, Math.round(place[1] * 10) / 10, place[2]];

export function placeJoint(state, frame, joint, to) {
  return {
    id: newId(),
    kind: "mark",
    frame,
    joint,
    to: rounded(to),
    from: marksOf(state, frame)[joint] ?? null,
  };
}

export function placeJoints(state, frame, places) {
  const names = Object.keys(places);
  const to = Object.fromEntries(names.map((name) => [name, rounded(places[name])]));
  return { id: newId(), kind: "marks", frame, to, from: pickedFrom(marksOf(state, frame), names) };
}

export function setNearer(state, frame, to) {
  return {
    id: newId(),
    kind: "nearer",
    frame,
    to,
    from: pickedFrom(nearerOf(state, frame), Object.keys(to)),
  };
}

export const addPick = (pick) => ({ id: newId(), kind: "pick", to: pick, from: null });
export const removePick = (pick) => ({ id: newId(), kind: "pick", to: null, from: pick });

export function setOwn(state, frame, half) {
  return { id: newId(), kind: "own", frame, to: half, from: state.own[frame] ?? null };
}

export function setLock(state, frame, locked) {
  return { id: newId(), kind: "lock", frame, to: locked, from: Boolean(state.locked[frame]) };
}

function exchanged(values, pairs) {
  const to = {};
  for (const [left, right] of pairs) {
    if (values[left] || values[right]) {
      to[left] = values[right] ?? null;
      to[right] = values[left] ?? null;
    }
  }
  return to;
}

// Left and right exchanged in some mirrored pairs, with the depth of their limbs; null if none is marked.
export function swapSides(state, frame, pairs) {
  const places = exchanged(marksOf(state, frame), pairs);
  const depths = exchanged(nearerOf(state, frame), pairs);
  const parts = [];
  if (Object.keys(places).length) parts.push(placeJoints(state, frame, places));
  if (Object.keys(depths).length) parts.push(setNearer(state, frame, depths));
  if (parts.length < 2) return parts[0] ?? null;
  return { id: newId(), kind: "group", edits: parts };
}

// visible -> placed though hidden -> cannot be seen -> visible; an unplaced joint goes to "cannot be seen".
export function nextVisibility(mark) {
  if (!mark) return [0, 0, 0];
  const [x, y, v] = mark;
  if (v === 2) return [x, y, 1];
  if (v === 1) return [x, y, 0];
  return x || y ? [x, y, 2] : null;
}

// The edit that takes another back.
export function inverse(edit) {
  if (edit.kind === "group")
    return { id: newId(), kind: "group", edits: edit.edits.map(inverse).reverse() };
  return { ...edit, id: newId(), to: edit.from, from: edit.to };
}

// The same wish, made anew on what stands there now.
export function rebased(state, edit) {
  const { frame } = edit;
  switch (edit.kind) {
    case "group":
      return { ...edit, id: newId(), edits: edit.edits.map((part) => rebased(state, part)) };
    case "mark":
      return placeJoint(state, frame, edit.joint, edit.to);
    case "marks":
      return placeJoints(state, frame, edit.to);
    case "nearer":
      return setNearer(state, frame, edit.to);
    case "own":
      return setOwn(state, frame, edit.to);
    case "lock":
      return setLock(state, frame, edit.to);
    default:
      return {
        ...edit,
        id: newId(),
        from: state.picks.find(({ id }) => id === (edit.to ?? edit.from).id) ?? null,
      };
  }
}
