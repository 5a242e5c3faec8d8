"""The camera over level ground where there is no court: maximum likelihood over all evidence.

The evidence is clicked marks, the player's height and stances, and a prior on cameras (`USUAL_*`);
`ground_posterior` combines it. A mark that contradicts the rest is named in the error that is
raised. The camera of the reference frame is carried to the others by the camera's motion.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.errors import KeyreconError
from keyrecon.numerics.geometry import warp_points
from keyrecon.records import CameraPath, Motion
from keyrecon.world.clicked_points import CLICK_NOISE
from keyrecon.world.court_tracking import carry_camera, homography_between
from keyrecon.world.ground_evidence import (
    LEANING,
    GroundState,
    MarkedEnds,
    Stances,
    mark_residuals,
    on_plane,
)
from keyrecon.world.ground_posterior import (
    GroundEvidence,
    GroundPosterior,
    explore_cameras,
)
from keyrecon.world.pinhole import Pinhole
from keyrecon.world.placement import ANKLE_SHARE
from keyrecon.world.records import GROUND, GroundMark, WorldCamera
from keyrecon.world.stances import STATURE, find_stances

USUAL_FOCAL, FOCAL_SPREAD = 1.0, 0.7
"""Focal length of cameras at sports, in the picture's longer side, and the spread of its logarithm:
phones have .7 to .85, their second lens 1.5 to 2.2, cameras on tripods up to 4."""
USUAL_TILT, TILT_SPREAD = np.radians(5.0), np.radians(12.0)
"""How far cameras look down, and the spread."""
ROLL_SPREAD = np.radians(2.5)
"""How far cameras are turned about their axis."""
USUAL_HEIGHT, HEIGHT_SPREAD = 1.8, 0.8
"""Metres that cameras stand high, and the spread of the logarithm: .35 to 9 m."""
SIZE_SPREAD = 0.04
"""Share by which the size of a lifted motion is off for a whole clip: 0 to .06 too large in eight
rendered sequences."""
STATURE_SPREAD = 0.06
"""The same for a player whose height is not known."""
CONTRADICTION = 4.0
"""Standard deviations by which a mark may contradict the rest."""
ALIKE = 9.0
"""Sum of squares by which the rest fits better without one mark than without another, from which on
it is told which of them is wrong: three standard deviations."""


@dataclass(frozen=True)
class FieldOfView:
    """A focal length that is known from elsewhere."""

    focal: float
    """px"""
    spread: float
    """Of its logarithm."""
    source: str


@dataclass(frozen=True, eq=False)
class GroundCalibration:
    """The camera, with its parameters in the reference frame and what they were estimated from."""

    camera: WorldCamera
    state: GroundState
    """In the reference frame."""
    sd: GroundState
    """Standard deviations of the same numbers."""
    reference: int
    """The frame in which the player first stands; clicks and stances are in its pixels."""
    stances: Stances
    distances: tuple[float, float]
    """Least and most distance at which the player stands, metres."""


class ContradictoryMarks(KeyreconError):
    """No camera sees the marks where they were clicked."""


def calibrate_ground(
    motion: Motion,
    path: CameraPath,
    size: tuple[int, int],
    marks: Sequence[GroundMark] = (),
    known: FieldOfView | None = None,
) -> GroundCalibration:
    """The camera of every frame of a shot in which a player stands on level ground.

    `size` is the picture's, px. Metres come from the motion's, or from lengths among the `marks`.
    Raises KeyreconError where the player never stands, nothing is in metres, or marks contradict
    one another.
    """
    usable = _frames_of_longest_shot(motion, path)
    if motion.units != "m" and not any(mark.metres for mark in marks):
        raise KeyreconError(
            "Nothing is in metres yet: give the player's height (keyrecon run --height), or mark "
            "a thing of known length."
        )
    principal = (np.array(size) - 1) / 2
    first = np.flatnonzero(usable)[:1]
    zoom = (
        _relative_focal(path, usable, int(first[0]), principal, max(size))
        if len(first)
        else np.ones(0)
    )
    reference = _first_stance(motion, usable, path, zoom)
    to_reference = _homographies(path, reference)
    stances = find_stances(motion, usable, to_reference, zoom / zoom[reference])
    ends = _marks_in_reference(marks, usable, to_reference)
    click = CLICK_NOISE * max(size) / 1280
    evidence = GroundEvidence(ends, stances, _prior(motion, max(size), known), principal, click)
    posterior, evidence = explore_cameras(evidence, max(size))
    if blame := _contradiction(evidence, posterior, marks, max(size)):
        raise ContradictoryMarks(blame)
    best, spread = posterior.best, _camera_spread(posterior, evidence)
    state = GroundState(*best)
    at_reference = replace(state.pinhole(principal), centre=_camera_centre(best, evidence))
    camera = _camera_of_frames(at_reference, spread, path, reference, usable)
    return GroundCalibration(
        replace(camera, stature=_stature_of_scale(evidence)),
        state,
        GroundState(*spread.state),
        reference,
        stances,
        _distances(state, evidence),
    )


def _frames_of_longest_shot(motion: Motion, path: CameraPath) -> Bool[np.ndarray, "T"]:
    """Frames with a motion in the shot that has most of them: the path ends at a cut."""
    number = np.searchsorted(path.cuts, np.arange(len(motion.time)), side="right")
    longest = np.bincount(number, weights=motion.known).argmax()
    return motion.known & (number == longest)


def _relative_focal(
    path: CameraPath,
    usable: Bool[np.ndarray, "T"],
    start: int,
    principal: Float[np.ndarray, "2"],
    longer: int,
) -> Float[np.ndarray, "T"]:
    """Focal length of every frame relative to the frame `start`; insensitive to the latter's."""
    camera = Pinhole(USUAL_FOCAL * longer, principal, np.eye(3), np.zeros(3))
    zoom = np.ones(len(usable))
    for frames, view in _camera_in_frames(camera, path, start, usable):
        zoom[frames] = view.focal / camera.focal
    return zoom


def _homographies(path: CameraPath, frame: int) -> Float[np.ndarray, "T 3 3"]:
    """From the pixels of every frame to those of one of them."""
    to_frame = np.linalg.solve(path.to_reference[frame], path.to_reference)
    return to_frame / to_frame[:, 2:, 2:]


def _camera_in_frames(
    camera: Pinhole, path: CameraPath, frame: int, usable: Bool[np.ndarray, "T"]
) -> Iterator[tuple[slice, Pinhole]]:
    """The camera of one frame carried to the others: runs of frames with the same camera."""
    moves = np.ones(len(usable), dtype=bool)
    moves[1:] = (path.to_reference[1:] != path.to_reference[:-1]).any(axis=(1, 2))
    moves[1:] |= usable[1:] != usable[:-1]
    first = np.flatnonzero(moves)
    for start, end in zip(first, np.append(first[1:], len(usable)), strict=True):
        if usable[start]:
            view = carry_camera(camera, homography_between(path, frame, int(start)))
            yield slice(int(start), int(end)), view


def _first_stance(
    motion: Motion,
    usable: Bool[np.ndarray, "T"],
    path: CameraPath,
    zoom: Float[np.ndarray, "T"],
) -> int:
    """The first frame in which the player stands."""
    frames = np.zeros(0)
    if usable.any():
        start = int(np.flatnonzero(usable)[0])
        frames = find_stances(motion, usable, _homographies(path, start), zoom).frame
    if not len(frames):
        raise KeyreconError(
            "The player is never seen to stand, so that nothing tells where the ground is; look "
            "at the overlay, and mark the ankles of a frame in which he stands."
        )
    return int(frames[0])


def _marks_in_reference(
    marks: Sequence[GroundMark],
    usable: Bool[np.ndarray, "T"],
    to_reference: Float[np.ndarray, "T 3 3"],
) -> MarkedEnds:
    """Marks in the reference picture."""
    for mark in marks:
        if not usable[mark.frame]:
            raise KeyreconError(
                f"The {mark.kind} marked in frame {mark.frame} is in no frame with the motion of "
                "the shot that is used; mark one in another frame."
            )
    ends = [warp_points(to_reference[m.frame], np.array([m.start, m.end])) for m in marks]
    metres = [np.nan if mark.metres is None else mark.metres for mark in marks]
    return MarkedEnds(
        tuple(mark.kind for mark in marks),
        np.array(ends).reshape(-1, 2, 2),
        np.array(metres, float),
    )


def _prior(
    motion: Motion, longer: int, known: FieldOfView | None
) -> tuple[GroundState, GroundState]:
    """What is known of cameras and players beforehand: mean and spread."""
    focal, spread = np.log(USUAL_FOCAL * longer), FOCAL_SPREAD
    if known is not None:
        focal, spread = np.log(known.focal), known.spread
    size = 0.0 if motion.units == "m" else float(np.log(STATURE))
    sizes = SIZE_SPREAD if motion.units == "m" else STATURE_SPREAD
    return (
        GroundState(focal, USUAL_TILT, 0.0, np.log(USUAL_HEIGHT), size, 0.0),
        GroundState(spread, TILT_SPREAD, ROLL_SPREAD, HEIGHT_SPREAD, sizes, LEANING),
    )


def _contradiction(
    evidence: GroundEvidence, posterior: GroundPosterior, marks: Sequence[GroundMark], longer: int
) -> str:
    """Which mark contradicts the others; empty where none does.

    That is one without which all the rest, player and usual cameras included, fits far better. A
    camera that is turned about its axis by all accounts is so.
    """
    best = posterior.best
    strain = float((evidence.residuals(best)[: 6 + 2 * len(marks)] ** 2).sum())
    if strain <= CONTRADICTION**2:
        return ""
    gain, misfit = [], []
    for k in range(len(marks)):
        kept = [i for i in range(len(marks)) if i != k]
        ends = evidence.marks
        ends = MarkedEnds(tuple(ends.kinds[i] for i in kept), ends.ends[kept], ends.metres[kept])
        found, without = explore_cameras(replace(evidence, marks=ends), longer)
        without = replace(without, noise=evidence.noise)
        gain.append(_cost(evidence, best) - _cost(without, found.best))
        misfit.append(_misfit(evidence, found.best, k))
    if not gain or max(gain) <= CONTRADICTION**2:
        return ""
    suspects = [k for k in range(len(marks)) if gain[k] > max(gain) - ALIKE]
    if len(suspects) > 1:
        names = " and ".join(describe_mark(marks[k]) for k in suspects)
        return (
            f"{names.capitalize()} contradict one another; mark them again, or a third thing to "
            "tell which."
        )
    return (
        f"{describe_mark(marks[suspects[0]]).capitalize()} contradicts the rest: it is off by "
        f"{misfit[suspects[0]]:.0f} times what a careful click is. Mark it again, or leave it out."
    )


def _cost(evidence: GroundEvidence, x: Float[np.ndarray, "6"]) -> float:
    return float((evidence.residuals(x) ** 2).sum())


def _misfit(evidence: GroundEvidence, x: Float[np.ndarray, "6"], number: int) -> float:
    """How far a mark is off, standard deviations."""
    camera = GroundState(*x).pinhole(evidence.principal)
    return float(np.abs(mark_residuals(camera, evidence.marks, evidence.click)[number]).max())


def describe_mark(mark: GroundMark) -> str:
    """A mark by its place."""
    (x0, y0), (x1, y1) = mark.start, mark.end
    return f"the {mark.kind} at {x0:g},{y0:g} to {x1:g},{y1:g} in frame {mark.frame}"


@dataclass(frozen=True, eq=False)
class _CameraSpread:
    """Standard deviations of the posterior."""

    state: Float[np.ndarray, "6"]
    centre: Float[np.ndarray, "3"]
    """Metres."""
    vertical: float
    """Angle, radians."""


def _camera_spread(posterior: GroundPosterior, evidence: GroundEvidence) -> _CameraSpread:
    """Of the camera in the reference frame, from draws of the posterior."""
    draws = posterior.draws()
    centres = np.array([_camera_centre(x, evidence) for x in draws])
    off = np.array([_vertical(x) for x in draws]) - _vertical(posterior.best)
    return _CameraSpread(
        draws.std(axis=0), centres.std(axis=0), float(np.sqrt((off**2).sum(axis=1).mean()))
    )


def _camera_of_frames(
    camera: Pinhole,
    spread: _CameraSpread,
    path: CameraPath,
    reference: int,
    usable: Bool[np.ndarray, "T"],
) -> WorldCamera:
    """The `camera` of the reference frame carried to the usable ones; NaN in the others."""
    count = len(usable)
    inner, rotation = np.full((2, count, 3, 3), np.nan)
    shift = np.full((count, 3), np.nan)
    for t, view in _camera_in_frames(camera, path, reference, usable):
        inner[t] = [
            [view.focal, 0, view.principal[0]],
            [0, view.focal, view.principal[1]],
            [0, 0, 1],
        ]
        rotation[t], shift[t] = view.rotation, -view.rotation @ view.centre
    return WorldCamera(
        inner,
        rotation,
        shift,
        usable,
        np.where(usable[:, None], spread.centre, np.nan),
        inner[:, 0, 0] * spread.state[0],
        np.where(usable, spread.vertical, np.nan),
        GROUND,
    )


def _stature_of_scale(evidence: GroundEvidence) -> float | None:
    """The player's height where it alone sets the scale; None where a mark has a length."""
    return None if np.isfinite(evidence.marks.metres).any() else evidence.stances.given_height


def _camera_centre(x: Float[np.ndarray, "6"], evidence: GroundEvidence) -> Float[np.ndarray, "3"]:
    """With the origin under the foot on which the player first stands, metres."""
    state = GroundState(*x)
    foot = _standing_ankles(state, evidence)[0]
    return state.pinhole(evidence.principal).centre - foot * [1, 1, 0]


def _standing_ankles(state: GroundState, evidence: GroundEvidence) -> Float[np.ndarray, "N 3"]:
    """Of all stances, with the camera above the origin, metres."""
    height = ANKLE_SHARE * np.exp(state.log_size) * evidence.stances.stature
    camera = state.pinhole(evidence.principal)
    return on_plane(camera, evidence.stances.foot, float(height))


def _vertical(x: Float[np.ndarray, "6"]) -> Float[np.ndarray, "3"]:
    """The vertical in camera axes."""
    return GroundState(*x).pinhole(np.zeros(2)).rotation[:, 2]


def _distances(state: GroundState, evidence: GroundEvidence) -> tuple[float, float]:
    """Least and most distance at which the player stands, metres."""
    camera = state.pinhole(evidence.principal)
    far = np.linalg.norm(_standing_ankles(state, evidence) - camera.centre, axis=1)
    return float(np.percentile(far, 2)), float(np.percentile(far, 98))
