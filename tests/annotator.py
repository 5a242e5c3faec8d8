"""A project open for annotation, and edits as a page sends them."""

import itertools
import json

from keyrecon import project
from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.desk import open_desk
from keyrecon.annotate.edits import parse_edits
from keyrecon.workspace import Workspace

_numbers = itertools.count()


def new_project(folder, video_file):
    """A project without picks or keyframes."""
    project.start(video_file, folder)
    return Workspace(folder)


def open_project(folder, assistant=Assistant(), commands=None):
    return open_desk(Workspace(folder), assistant, commands or {})


def edit(kind, **parts):
    """An edit with an id of its own; `was` stands for `from`."""
    parts = {"from" if name == "was" else name: value for name, value in parts.items()}
    return {"id": f"edit-{next(_numbers)}", "kind": kind, "from": None, **parts}


def mark(frame, joint, to, was=None):
    return edit("mark", frame=frame, joint=joint, to=to, was=was)


def submit(store, *edits):
    return store.submit(parse_edits(json.dumps({"edits": edits}).encode()))
