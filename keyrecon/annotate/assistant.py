"""What the page shows that must be computed; filled in by keyrecon.annotate.assist.

The server knows these functions only by their signatures. A field left None means that there is
no such function, and its route answers with nothing. Results are ready for JSON (no NaN). The
server calls them in worker threads, one call of each kind at a time; KeyreconError is shown.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from keyrecon.io.video import Video
from keyrecon.records import Annotations, Pick

Json = dict[str, Any]
Marks = dict[str, list[float]]
"""[x, y, v] of joints by name."""
Signs = dict[str, int]
"""1 or -1 of limbs by name."""


@dataclass(frozen=True)
class Assistant:
    """What can be computed while a person marks."""

    ready: Callable[[float, Callable[[], None]], bool] | None = None
    """Whether the stored results are loaded, after so many seconds at most; where they are not, the
    function is called when they are. Of hours of video they take longer than a page may wait."""
    keyframes: Callable[[dict[int, str]], Json] | None = None
    """Added keyframes -> {"frames": {frame: {"stands_for", "why"}}, "height_px", "boxes"}; the
    boxes tell where the player is in every frame."""
    bodies: Callable[[], list[Json] | None] | None = None
    """Frames in which a whole body, marked before there are keyframes, would teach most, as
    {"frame", "box"}; None before the player was followed."""
    motion_digest: Callable[[Video], str | None] | None = None
    """A digest of what a motion of this video would be made from now; None while a file that tells
    it is damaged."""
    suggestion: Callable[[Annotations, int], Json] | None = None
    """Where the joints of a frame probably are, from the frames annotated so far."""
    pose: Callable[[Annotations, int, Marks, Signs], Json] | None = None
    """A frame's body in space from its marks and signs, and the most plausible alternatives."""
    checks: Callable[[Annotations], list[Json] | None] | None = None
    """Marks that look wrong, most suspicious first; None where nothing can be checked yet."""
    next_frames: Callable[[Annotations, frozenset[int]], list[Json]] | None = None
    """Frames where one more annotation would help most, none of those taken already."""
    stretches: Callable[[Annotations], list[Json]] | None = None
    """Where the motion, or before there is one the track, is least sure of itself, as {"first",
    "last", "text", "frame", "half"}: the frame to mark and which half of the body there."""
    preview: Callable[[tuple[Pick, ...], tuple[int, ...]], Json] | None = None
    """Head and feet found on a few frames with these picks."""
    shots: Callable[[], list[Json]] | None = None
    """Shots as {"number", "first", "last", "shows", "unsure", "used", "wanted"}: what each shows,
    whether a person must tell, whether it is used now, and in the next run; none where there is but
    one."""
    choose_shot: Callable[[int, bool], list[Json]] | None = None
    """Keeps by its number whether a shot is used in the next run; the shots anew."""
    court: Callable[[], Json] | None = None
    """The court's map, what was clicked of it, and how much of the video the camera is known in."""
    court_view: Callable[[tuple[int, int], int], Json] | None = None
    """The court over a frame of pictures of a size."""
    court_point: Callable[[str, int, tuple[float, float] | None], Json] | None = None
    """Keeps a clicked point of the court by name and frame, or drops it without a place."""
    ground: Callable[[], Json] | None = None
    """Marks on upright things, lengths and the horizon, and what is known of the camera."""
    ground_view: Callable[[tuple[int, int], int], Json] | None = None
    """Squares of a metre over a frame of pictures of a size."""
    ground_mark: Callable[..., Json] | None = None
    """Keeps a mark of a kind in a frame by both ends, and its length or None."""
    ground_removal: Callable[..., Json] | None = None
    """Takes one away, told in the same way."""
    field_of_view: Callable[[float | None], Json] | None = None
    """Keeps the angle across the picture, or none."""
    backprojection: Callable[[tuple[Pick, ...], int, str], Any] | None = None
    """How much each pixel of a frame looks like a part: RGBA, (h, w, 4)."""
    swing: Callable[[tuple[int, int], Json, Json, Json], Json] | None = None
    """Of a golf swing, from the pictures' size, what is told of it, joints clicked at the address
    and frames of key postures: {"needed", "wrong"}, and after a fit {"keys", "club", "seen",
    "doubts", "tempo", "fresh"}; `fresh` tells whether it knows all marks."""
