"""Edits as a page sends them; a module of its own, because programs that are killed start often."""

import itertools
import json

import msgspec

from keyrecon.annotate.store.edits import EditList

_numbers = itertools.count()


def edit(kind, **parts):
    """An edit with an id of its own; `was` stands for `from`."""
    parts = {"from" if name == "was" else name: value for name, value in parts.items()}
    expected = {} if kind == "group" else {"from": None}
    return {"id": f"edit-{next(_numbers)}", "kind": kind, **expected, **parts}


def mark(frame, joint, to, was=None):
    return edit("mark", frame=frame, joint=joint, to=to, was=was)


def read_edits(text):
    """Edits from the body of a request, as the server reads it."""
    return msgspec.json.decode(text, type=EditList).edits


def submit(store, *edits):
    return store.submit(read_edits(json.dumps({"edits": edits})))


def golf(name, to, was=None):
    return edit("golf", name=name, to=to, was=was)


def golf_click(joint, to, was=None):
    return edit("click", joint=joint, to=to, was=was)


def shaft(frame, to, was=None):
    return edit("shaft", frame=frame, to=to, was=was)


def key_posture(name, to, was=None):
    return edit("key", name=name, to=to, was=was)
