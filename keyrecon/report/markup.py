"""What the report is made from.

Small pieces of HTML; every text that comes from outside passes through `text`.
"""

import base64
import html
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Float

from keyrecon.io.video import Video
from keyrecon.records import Annotations, Keyframes, Motion, PoseDistances, Track
from keyrecon.report.summary import Truth, arrange_truth
from keyrecon.world.records import WorldCamera, WorldMotion

OPTION = re.compile(r"(?<![\w-])--[a-z][\w.-]*\w")
"""A name of an option in a text."""


@dataclass(frozen=True, eq=False)
class ReportMaterial:
    """Everything that one run knows; the truth only where there is one."""

    video: Video
    track: Track
    pose_distances: PoseDistances
    keyframes: Keyframes
    annotations: Annotations
    motion: Motion
    seconds: Mapping[str, float] = field(default_factory=dict)
    """How long each stage took that was run, seconds."""
    truth: Mapping[str, np.ndarray] | None = None
    """Joints as they really were, frame for frame, as `metrics.read_truth` gives them."""
    options: object = None
    """The options record of the run, to be listed."""
    court: tuple[WorldMotion, WorldCamera] | None = None
    """The motion on the court, where that is known, and the camera."""
    warnings: Sequence[str] = ()
    """What of the video and of what a person told does not fit the rest, a line each."""
    shots: Sequence[str] = ()
    """Which shots the motion is of, and where nobody is seen in them, a line each; none where the
    whole video shows the player."""
    lens: str | None = None
    """What an unknown lens costs the depths, where the player may have been near it."""

    @cached_property
    def true_joints(self) -> Truth | None:
        """The truth in the order of the skeleton."""
        return None if self.truth is None else arrange_truth(self.truth, self.motion.skeleton)


def text(value: object) -> str:
    """A value as text that HTML cannot mistake for markup."""
    return html.escape(str(value), quote=True)


def sentence(line: str) -> str:
    """A line of a command's output as text, names of options set as code so that none is broken."""
    return OPTION.sub(r"<code>\g<0></code>", text(line))


def number(value: float, form: str) -> str:
    """A number, or a dash where it is unknown."""
    return format(value, form) if np.isfinite(value) else "\u2013"


def section(name: str, title: str, *parts: str) -> str:
    """A section with an anchor."""
    return f'<section id="{name}"><h2>{text(title)}</h2>{"".join(parts)}</section>'


def note(caption: str) -> str:
    """A caption; it may hold markup and must be safe."""
    return f'<p class="note">{caption}</p>'


def table(
    head: Sequence[str], rows: Iterable[Sequence[object]], label: str, kind: str = "numbers"
) -> str:
    """A table whose first column names its rows; `kind` is its style; all cells are escaped."""
    top = "".join(f'<th scope="col">{text(cell)}</th>' for cell in head)
    body = "".join(
        f'<tr><th scope="row">{text(first)}</th>'
        + "".join(f"<td>{text(cell)}</td>" for cell in rest)
        + "</tr>"
        for first, *rest in rows
    )
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{text(label)}">'
        f'<table class="{kind}">'
        f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
    )


MOST_FRAMES = 48_000
"""Of a video that a report holds one by one, 32 minutes of 25 frames per second: each takes 270
bytes of numbers and 350 of the small video at its least, script, charts and pictures of 195
keyframes take 17 MB, and a report shall stay below 50 MB."""


def data_block(name: str, data: str) -> str:
    """JSON that the page's script reads; it cannot end the element it stands in."""
    safe = data.replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{safe}</script>'


def to_json(data: object) -> str:
    """Compact JSON."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False)


def pack(values: Float[np.ndarray, "*n"], every: int = 1) -> dict[str, object]:
    """An array as 16-bit steps in base64, -32768 where unknown; a step is 1/32000 of the range.

    Only every so-many-th row is held; the page's script puts those between on a straight line.
    """
    held = values[::every]
    known = np.isfinite(held)
    step = float(np.abs(held[known]).max(initial=1e-9)) / 32000
    whole = np.where(known, np.round(np.where(known, held, 0) / step), -32768).astype("<i2")
    data = base64.b64encode(whole.tobytes()).decode()
    return {"step": step, "every": every, "shape": list(values.shape), "data": data}


def thinning(frames: int) -> int:
    """Of how many frames a report shows one, so that its file stays small for hours of video."""
    return -(-frames // MOST_FRAMES)
