"""Swings that a film may show, and which of its frames each of them takes.

The whole film is searched (`fit.swing_search`); only the frames of a swing that was found are
observed further and fitted, so that a long wait before it costs no more than that it is seen.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.fit.handedness import (
    mirror_evidence,
    mirror_initial,
    mirror_marks,
    mirror_pixels,
)
from keyrecon.golf.fit.swing_path import SearchLimits
from keyrecon.golf.fit.swing_search import STYLED, SwingEvidence, SwingHypothesis, search_swing
from keyrecon.golf.marks import place_marks
from keyrecon.golf.observe.film import Film, frame_step
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import NO_MARKS, Camera, MotionModel, SwingMarks
from keyrecon.golf.scene import SwingScene

SLOW_DOWNSWING = 0.27
"""Seconds that a downswing is thought to take where its length shows slow motion: between those of
tour players and of others."""


def find_slow_motion(keys: Float[np.ndarray, "4"], fps: float) -> float:
    """By how much a film is slowed down in which a swing has these key postures; 1 if it is not."""
    down = float(keys[2] - keys[1]) / fps
    return down / SLOW_DOWNSWING if down > SearchLimits().downswing[1] else 1.0


def find_slowed_keys(
    keys: Float[np.ndarray, "4"], fitted: Film, searched: Film
) -> Float[np.ndarray, "4"] | None:
    """Key postures of a fit, by the film that was searched, where they show slow motion; else None.

    A search may take part of a slow downswing for a pause, and then the fit has the wrong time: of
    two real films in slow motion, in twelve variants, three fits took 0.7 to 1.2 s down.
    """
    frames = np.searchsorted(searched.file_frames, fitted.file_frames)
    slowed = np.interp(keys, np.arange(len(frames)), frames)
    return None if find_slow_motion(slowed, searched.fps) == 1 else slowed


MARGINS = (1.0, 2.0)
"""Seconds before the start and after the finish that are fitted too: a start is found up to 0.2 s
late, and golfers hold their finish until the ball lands."""


def choose_swing_frames(
    keys: Float[np.ndarray, "4"], film: Film, slow_motion: float
) -> Int[np.ndarray, "T"]:
    """The frames of a film in which a swing with these key postures is fitted."""
    fps, last = film.fps * slow_motion, len(film.file_frames) - 1
    begin = max(0, int(keys[0] - MARGINS[0] * fps))
    end = min(last, int(np.ceil(keys[3] + MARGINS[1] * fps)))
    return np.arange(begin, end + 1, frame_step(fps))


def place_in_film(pose: ClickedPose, film: Film) -> ClickedPose:
    """A clicked pose in the picture and by the frame numbers of a film."""
    joints, camera = pose.joints, pose.camera
    frame = round(float(film.film_index[joints.frame]))
    return replace(
        pose,
        joints=replace(joints, frame=frame, places=joints.places + film.corner),
        camera=replace(camera, principal=camera.principal + film.corner),
        size=film.size,
    )


def find_candidates(
    scene: SwingScene, pose: ClickedPose, marks: SwingMarks, model: MotionModel
) -> tuple[SwingHypothesis, ...]:
    """Swings that a film may show, the likeliest first, in the film's own picture.

    `scene` is what the film shows, `pose` and `marks` are those of the file's frames; left-handers
    are mirrored. Raises KeyreconError where no swing is observed.
    """
    evidence, width = gather_evidence(scene), scene.film.size[0]
    marks = place_marks(marks, scene.film)
    if pose.left_handed:
        marks = mirror_marks(marks, width)
    hypotheses = _search(evidence, place_in_film(pose, scene.film), model, marks)
    if not hypotheses and np.isfinite(marks.keys).any():
        raise KeyreconError(
            "No swing of a pace that golfers have passes start, top, hit and finish where they "
            f"were marked (frames {', '.join(f'{k:.0f}' for k in marks.keys if np.isfinite(k))} of "
            "the fitted ones); correct these marks, or take some back."
        )
    if not hypotheses:
        raise KeyreconError(
            f"There is no swing in this video: its {len(evidence.players)} frames are too few for "
            "one. Give a video with a whole swing, from the address to the finish."
        )
    if pose.left_handed:
        hypotheses = [replace(h, club=mirror_pixels(h.club, width)) for h in hypotheses]
    return tuple(hypotheses)


def gather_evidence(scene: SwingScene) -> SwingEvidence:
    """What the swing is searched by."""
    foreground = scene.foreground
    return SwingEvidence(
        scene.players, foreground.shrink, foreground.height, scene.shafts, scene.film.fps
    )


def least_cost(evidence: SwingEvidence, pose: ClickedPose, model: MotionModel) -> float:
    """How badly the mean swing explains a film at best; infinite where none is long enough.

    `pose` is placed in the film.
    """
    hypotheses = _search(evidence, pose, model, styled=0)
    return hypotheses[0].cost if hypotheses else np.inf


def _search(
    evidence: SwingEvidence,
    pose: ClickedPose,
    model: MotionModel,
    marks: SwingMarks = NO_MARKS,
    styled: int = STYLED,
) -> list[SwingHypothesis]:
    """Swings of the clicked player, in mirrored pictures where he is left-handed."""
    joints, camera, width = pose.joints, pose.camera, pose.size[0]
    if pose.left_handed:
        evidence, joints = mirror_evidence(evidence, width), mirror_initial(joints, width)
        camera = Camera(camera.focal, mirror_pixels(camera.principal, width))
    body = size_body(pose.stature)
    return search_swing(evidence, joints, camera, model, body, marks=marks, styled=styled)
