"""Which marks the track of a project is made with.

Following the player anew takes long, and a mark on its way changes nothing. So the marks that the
last track was made with are kept beside it, until one of them is taken back or moved, or another
disagrees.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.io.formats.coco import read_coco
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import frames_off_marks
from keyrecon.records import Annotations, Preparation
from keyrecon.segmentation.marked_bodies import anchors_from_bodies

MOVED = 0.03
"""A marked head or foot that was moved farther than this is told to the track anew, player heights:
two eyes mark the same joint .016 apart in the median, .042 in the worst tenth."""


def teach_more(marks: Annotations, known: Annotations | None, made: Preparation) -> bool:
    """Whether marks disagree with the track, or are in a shot that is left out without the track
    having been made with them: they tell that it shows the player."""
    if len(frames_off_marks(made, marks)):
        return True
    new = anchors_from_bodies(marks).frames
    if known is not None:
        new = np.setdiff1d(new, anchors_from_bodies(known).frames)
    return bool(np.setdiff1d(new, made.shots.usable_frames).size)


def marks_of_last_preparation(
    workspace: Workspace, video: Video, marks: Annotations | None
) -> Annotations | None:
    """The marks that the last preparation was made with; the present ones where a head or feet of
    those was deleted or moved; None without any."""
    file = workspace.prepared_marks_file
    if workspace.stages.force or not file.is_file():
        return None
    last_marks = read_coco(file, workspace.skeleton, len(video), (video.width, video.height))
    still_marked = {} if marks is None else _marked_parts(marks)
    y = last_marks.joints[..., 1]
    tall = np.fmax.reduce(np.fmax.reduce(y, axis=1) - np.fmin.reduce(y, axis=1), initial=0.0)
    in_place = (
        part in still_marked and np.abs(still_marked[part] - place).max() <= MOVED * tall
        for part, place in _marked_parts(last_marks).items()
    )
    return last_marks if all(in_place) else marks


def _marked_parts(marks: Annotations) -> dict[tuple[str, int], Float[np.ndarray, "n"]]:
    """The heads and the pairs of feet that are marked, by part and frame, and where, px."""
    anchors = anchors_from_bodies(marks)
    places = {"head": anchors.head, "feet": anchors.feet.reshape(-1, 4)}
    return {
        (part, frame): place[row]
        for part, place in places.items()
        for row, frame in enumerate(anchors.frames.tolist())
        if np.isfinite(place[row]).all()
    }
