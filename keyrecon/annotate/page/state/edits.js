// What a person has decided, as plain values, and edits of it. An edit is a record of what is to be
// there and what was believed to be there before; it makes a new state and leaves the old one.
import { label } from "./workflow.js";

// `golf`, `clicks` (of the address, by joint), `shafts` (by frame) and `keys` (frames by key posture) are
// those of a golf swing. `own` are keyframes that the person added, by frame the half of the body; the journal calls them so.
const empty = {
  revision: 0,
  marks: {},
  nearer: {},
  picks: [],
  own: {},
  locked: {},
  golf: {},
  clicks: {},
  shafts: {},
  keys: {},
  undo: 0,
  redo: 0,
};

export const emptyState = () => structuredClone(empty);

export const same = (a, b) => JSON.stringify(a ?? null) === JSON.stringify(b ?? null);

// A table with some of its values replaced; null takes a value away.
function withValues(table, values) {
  const changed = { ...table };
  for (const [name, value] of Object.entries(values)) {
    if (value === null || value === undefined) delete changed[name];
    else changed[name] = value;
  }
  return changed;
}

const withRow = (table, frame, values) => ({ ...table, [frame]: withValues(table[frame], values) });

const appliers = {
  mark: (state, { frame, joint, to }) => ({ marks: withRow(state.marks, frame, { [joint]: to }) }),
  marks: (state, { frame, to }) => ({ marks: withRow(state.marks, frame, to) }),
  nearer: (state, { frame, to }) => ({ nearer: withRow(state.nearer, frame, to) }),
  pick: (state, { to, from }) => {
    const id = (to ?? from)?.id;
    const others = state.picks.filter((pick) => pick.id !== id);
    return { picks: to ? [...others, to] : others };
  },
  own: (state, { frame, to }) => ({ own: withValues(state.own, { [frame]: to }) }),
  click: (state, { joint, to }) => ({ clicks: withValues(state.clicks, { [joint]: to }) }),
  shaft: (state, { frame, to }) => ({ shafts: withValues(state.shafts, { [frame]: to }) }),
  key: (state, { name, to }) => ({ keys: withValues(state.keys, { [name]: to }) }),
  golf: (state, { name, to }) => ({ golf: withValues(state.golf, { [name]: to === false ? null : to }) }),
  lock: (state, { frame, to }) => ({ locked: withValues(state.locked, { [frame]: to || null }) }),
};

// The edits that one consists of.
export const partsOf = (edit) => (edit.kind === "group" ? edit.edits.flatMap(partsOf) : [edit]);

// An edit of several parts is applied part by part; kinds of a newer server are left alone.
export function apply(state, edit) {
  if (edit.kind === "group") return edit.edits.reduce(apply, state);
  const applier = appliers[edit.kind];
  return applier ? { ...state, ...applier(state, edit) } : state;
}

export const marksOf = (state, frame) => state.marks[frame] ?? {};
export const nearerOf = (state, frame) => state.nearer[frame] ?? {};

// The cells that an edit touches, such as "marks/12/neck".
export function cellsOf(edit) {
  const { kind, frame, joint, name } = edit;
  if (kind === "group") return edit.edits.flatMap(cellsOf);
  if (kind === "mark") return [`marks/${frame}/${joint}`];
  if (kind === "marks" || kind === "nearer")
    return Object.keys(edit.to).map((cell) => `${kind}/${frame}/${cell}`);
  if (kind === "pick") return [`pick/${(edit.to ?? edit.from)?.id}`];
  return [`${kind}/${joint ?? name ?? frame}`];
}

// A change of a cell that the server reports, as an edit.
export function editFromChange({ kind, frame, joint, name, limb, id, to, from }) {
  if (kind === "nearer") return { kind, frame, to: { [limb]: to } };
  if (kind === "pick") return { kind, to: to && { ...to, id }, from: from && { ...from, id } };
  return { kind, frame, joint, name, to };
}

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

export function setOwnKeyframe(state, frame, half) {
  return { id: newId(), kind: "own", frame, to: half, from: state.own[frame] ?? null };
}

export function setLock(state, frame, locked) {
  return { id: newId(), kind: "lock", frame, to: locked, from: Boolean(state.locked[frame]) };
}

const golfEdit = (kind, where, to, from) => ({ id: newId(), kind, ...where, to, from: from ?? null });

export const placeClick = (state, joint, to) =>
  golfEdit("click", { joint }, rounded(to), state.clicks[joint]);
export const setShaft = (state, frame, ends) =>
  golfEdit("shaft", { frame }, ends && ends.map((n) => Math.round(n * 10) / 10), state.shafts[frame]);
export const setKey = (state, name, frame) => golfEdit("key", { name }, frame, state.keys[name]);
export const setGolf = (state, name, to) => golfEdit("golf", { name }, to, state.golf[name]);

// Edits that stand together or not at all, and are undone as one.
export const together = (edits) => ({ id: newId(), kind: "group", edits });

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
  return together(parts);
}

// visible -> placed though hidden -> absent -> visible; an unplaced joint becomes absent.
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

// The same edit, made anew on what stands there now.
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
      return setOwnKeyframe(state, frame, edit.to);
    case "lock":
      return setLock(state, frame, edit.to);
    case "click":
      return placeClick(state, edit.joint, edit.to);
    case "shaft":
      return setShaft(state, frame, edit.to);
    case "key":
      return setKey(state, edit.name, edit.to);
    case "golf":
      return setGolf(state, edit.name, edit.to);
    default:
      return {
        ...edit,
        id: newId(),
        from: state.picks.find(({ id }) => id === (edit.to ?? edit.from).id) ?? null,
      };
  }
}

// Edits that wait, of which `state` knows already, as if they had been made after others that were done
// before them: what they take to stand there is what those left.
export function madeAfter(state, waiting, earlier) {
  const touched = new Set(earlier.flatMap(cellsOf));
  if (!waiting.some((edit) => cellsOf(edit).some((cell) => touched.has(cell)))) return [];
  const without = waiting.toReversed().map(inverse).reduce(apply, state);
  let now = earlier.reduce(apply, without);
  return waiting.map((edit) => {
    const made = { ...rebased(now, edit), id: edit.id };
    now = apply(now, made);
    return made;
  });
}

// What a person is told of edits that the server did not take, {edit, error}, and those of them that can be
// made anew because another page was faster; `earlier` are some that are still offered.
export function describeRefused(failed, earlier = []) {
  const wrong = new Set(failed.map(({ error }) => error).filter(Boolean)),
    overruled = [...earlier, ...failed.filter(({ error }) => !error).map(({ edit }) => edit)],
    parts = [...wrong].map((error) => `Not taken: ${error}`);
  if (overruled.length === 1) parts.push("Another page changed the same place; its version was kept.");
  if (overruled.length > 1)
    parts.push(`Another page changed the same ${overruled.length} places; its versions were kept.`);
  return { text: parts.join(" "), overruled };
}

const MOST_NAMED = 3; // joints or limbs; of more their number is told
const listed = (names, plural) =>
  names.length > MOST_NAMED ? `${names.length} ${plural}` : names.map(label).join(", ");
const limbsListed = (names) => (names.length > MOST_NAMED ? "" : "the ") + listed(names, "limbs");

const WHAT = {
  own: () => "keyframe of yours",
  lock: () => "lock",
  pick: ({ to, from }) => `colour of the ${(to ?? from)?.part}`,
  click: ({ joint }) => `${label(joint)} at the address`,
  shaft: () => "club",
  key: ({ name }) => `${name} of the swing`,
  golf: ({ name }) => label(name),
};

// What an edit changed, for a person who does not see it: "left knee, frame 13".
export function describeEdit(edit) {
  const parts = partsOf(edit),
    named = (...kinds) =>
      parts.filter(({ kind }) => kinds.includes(kind)).flatMap(({ joint, to }) => joint ?? Object.keys(to)),
    [joints, limbs] = [named("mark", "marks"), named("nearer")];
  const whats = [
    ...(joints.length ? [listed(joints, "joints")] : []),
    ...(limbs.length ? [`depth of ${limbsListed(limbs)}`] : []),
    ...parts.filter(({ kind }) => kind in WHAT).map((part) => WHAT[part.kind](part)),
  ];
  const what = [...new Set(whats)].join(" and ") || edit.kind,
    frames = [...new Set(parts.map(({ frame, to, from }) => frame ?? (to ?? from)?.frame))].filter(Number.isFinite);
  if (frames.length > 1) return `${what} in ${frames.length} frames`;
  return frames.length ? `${what}, frame ${frames[0]}` : what;
}
