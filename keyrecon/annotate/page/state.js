// What a person has said, as plain values; an edit makes a new state and leaves the old one.

const empty = {
  revision: 0,
  marks: {},
  nearer: {},
  picks: [],
  own: {},
  locked: {},
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
  lock: (state, { frame, to }) => ({ locked: withValues(state.locked, { [frame]: to || null }) }),
};

// An edit of several parts is applied part by part; kinds of a newer server are left alone.
export function apply(state, edit) {
  if (edit.kind === "group") return edit.edits.reduce(apply, state);
  const applier = appliers[edit.kind];
  return applier ? { ...state, ...applier(state, edit) } : state;
}

export const marksOf = (state, frame) => state.marks[frame] ?? {};
export const nearerOf = (state, frame) => state.nearer[frame] ?? {};

// The places that an edit touches, such as "marks/12/neck".
export function slots(edit) {
  const { kind, frame, joint } = edit;
  if (kind === "group") return edit.edits.flatMap(slots);
  if (kind === "mark") return [`marks/${frame}/${joint}`];
  if (kind === "marks" || kind === "nearer")
    return Object.keys(edit.to).map((name) => `${kind}/${frame}/${name}`);
  if (kind === "pick") return [`pick/${(edit.to ?? edit.from)?.id}`];
  return [`${kind}/${frame}`];
}

// A cell that the server tells of, as an edit.
export function fromCell({ kind, frame, joint, limb, id, to, from }) {
  if (kind === "nearer") return { kind, frame, to: { [limb]: to } };
  if (kind === "pick") return { kind, to: to && { ...to, id }, from: from && { ...from, id } };
  return { kind, frame, joint, to };
}
