"""Join clips of motion capture into one long motion of one person.

Every clip is brought to the same rate, body and floor, and turned so that the player faces the
net on average. Clips follow one another where pose and velocity agree best: for all pairs of
frames near the end of one and the start of the next, distance of all joints after the best
shift along the floor, in the manner of motion graphs (Kovar, Gleicher and Pighin, SIGGRAPH
2002), with a short blend that keeps the bones' lengths. Captured toes go with their ankles, and
have no say in where clips are cut.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.mocap import Capture
from keyrecon.ranges import within
from keyrecon.synthetic.figure import ANKLE_HEIGHT, STATURE, estimate_stature, joint

SHORTEST = 18
"""Frames that a clip has at least."""
SIDES = ("right", "left")
SPELL = 3.0
"""Seconds that every clip gets at least, as long as there is time for all."""
JOINTS = len(LSP14.names)
BONES = np.array(
    [*LSP14.bones, *((LSP14.index(f"{side}_ankle"), JOINTS + k) for k, side in enumerate(SIDES))]
)
"""Those of the skeleton, and the feet from ankle to toes."""
Footed = Float[np.ndarray, "_ 16 3"]
"""Joints, then right and left toes; NaN where no toes were captured."""


@dataclass(frozen=True)
class JoinOptions:
    """How clips become one motion."""

    seconds: Annotated[float, within(0.1, 3600)] = 36.0
    """Length of the result; clips are repeated when they are too short."""
    fps: Annotated[float, within(5, 1000)] = 50.0
    """Frames per second of the result."""
    blend: Annotated[float, within(0.04, 5)] = 0.4
    """Seconds over which one clip turns into the next."""
    search: Annotated[float, within(0, 60)] = 2.5
    """Seconds before a clip's planned end, and after the next one's start, that are searched."""


def join_with_toes(captures: Sequence[Capture], options: JoinOptions = JoinOptions()) -> Footed:
    """One motion in the world, with the toes that were captured: metres, y up, floor at 0, the net
    at negative z.

    Short clips are searched and blended over a third and a sixth of their length. Raises
    KeyreconError when a clip is too short even for that.
    """
    clips = [_prepare(capture, options) for capture in captures]
    lengths = bone_lengths(clips[0])
    clips = [clips[0]] + [_fit_body(clip, lengths) for clip in clips[1:]]
    wanted = round(options.seconds * options.fps)
    turn = wanted // min(len(clips), max(1, round(options.seconds / SPELL))) + 1
    shortest = min(len(clip) for clip in clips)
    blend = min(shortest // 6, max(2, round(options.blend * options.fps)))
    reach = min(shortest // 3, max(blend + 1, round(options.search * options.fps)))
    motion = clips[0][: turn + reach]
    starts = [len(motion)] + [0] * (len(clips) - 1)
    index = 0
    while len(motion) < wanted + reach:
        index = (index + 1) % len(clips)
        clip = clips[index]
        first = starts[index] if len(clip) - starts[index] > 3 * reach else 0
        piece = clip[first : first + turn + 2 * reach]
        starts[index] = first + len(piece)
        motion = _append(motion, piece, blend, reach)
    motion = motion[:wanted].copy()
    motion[..., [0, 2]] -= motion[:, :JOINTS, [0, 2]].mean(axis=(0, 1))
    return motion


def bone_lengths(points: Float[np.ndarray, "_ n 3"]) -> Float[np.ndarray, "B"]:
    """Median bone lengths, metres, with those of the feet where the points have toes."""
    bones = BONES[(points.shape[1] > BONES).all(axis=1)]
    return np.median(np.linalg.norm(points[:, bones[:, 1]] - points[:, bones[:, 0]], axis=-1), 0)


def _prepare(capture: Capture, options: JoinOptions) -> Footed:
    """Resample a clip, stand it on the floor and turn it to the net."""
    seconds = (len(capture.joints) - 1) / capture.fps
    if seconds * options.fps < SHORTEST or len(capture.joints) < 4:
        raise KeyreconError(
            f"A clip lasts {seconds:.2f} s; it needs {SHORTEST / options.fps:.2f} s to be joined."
        )
    times = np.arange(int(seconds * options.fps) + 1) / options.fps
    captured = np.arange(len(capture.joints)) / capture.fps
    points = CubicSpline(captured, capture.joints)(times)
    toes = np.full((len(times), 2, 3), np.nan)
    if capture.toes is not None:
        toes = CubicSpline(captured, capture.toes)(times)
    ankles = np.stack([joint(points, f"{s}_ankle")[:, 1] for s in ("right", "left")])
    rest = ANKLE_HEIGHT * estimate_stature(points) / STATURE
    floor = np.percentile(ankles, 5) - rest
    points[..., 1] -= floor
    toes[..., 1] -= floor
    across = joint(points, "left_shoulder") - joint(points, "right_shoulder")
    trunk = joint(points, "neck") - (joint(points, "left_hip") + joint(points, "right_hip")) / 2
    front = np.cross(across, trunk).mean(axis=0)
    footed = np.concatenate([points, toes], axis=1)
    return _turn(footed, np.arctan2(-front[0], -front[2]))


def _turn(points: Footed, angle: float) -> Footed:
    """Turn about the vertical so that the heading `angle` (from -z towards -x) becomes -z."""
    c, s = np.cos(-angle), np.sin(-angle)
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T


def _fit_body(points: Footed, lengths: Float[np.ndarray, "B"]) -> Footed:
    """The same motion by a person with other bones; steps scale with the legs."""
    ratio = lengths / bone_lengths(points)
    legs = [b for b, (_, child) in enumerate(LSP14.bones) if "knee" in LSP14.names[child]
            or "ankle" in LSP14.names[child]]  # fmt: skip
    scaled = _stretch(points, ratio[None, :])
    pelvis = _pelvis(points) * ratio[legs].mean()
    return scaled + (pelvis - _pelvis(scaled))[:, None]


def _pelvis(points: Footed) -> Float[np.ndarray, "T 3"]:
    return (joint(points, "left_hip") + joint(points, "right_hip")) / 2


def _stretch(points: Footed, ratio: Float[np.ndarray, "t B"]) -> Footed:
    """Multiply every bone's length, from the root outwards."""
    result = points.copy()
    for bone, (parent, child) in enumerate(BONES):
        step = points[:, child] - points[:, parent]
        result[:, child] = result[:, parent] + step * ratio[:, bone, None]
    return result


def _append(motion: Footed, piece: Footed, blend: int, reach: int) -> Footed:
    """Continue a motion with another piece where they agree best."""
    out, into = _find_cut(motion, piece, blend, reach)
    before, after = motion[out : out + blend], piece[into : into + blend]
    shift = (before - after)[:, :JOINTS].mean(axis=(0, 1)) * [1, 0, 1]
    share = np.linspace(0, 1, blend + 2)[1:-1]
    share = (share**2 * (3 - 2 * share))[:, None, None]
    mixed = before * (1 - share) + (after + shift) * share

    def lengths(points: Footed) -> np.ndarray:
        return np.linalg.norm(points[:, BONES[:, 1]] - points[:, BONES[:, 0]], axis=-1)

    wanted = lengths(before) * (1 - share[..., 0]) + lengths(after) * share[..., 0]
    mixed = _stretch(mixed, wanted / lengths(mixed))
    return np.concatenate([motion[:out], mixed, piece[into + blend :] + shift])


def _find_cut(motion: Footed, piece: Footed, blend: int, reach: int) -> tuple[int, int]:
    """Frames at which to leave a motion and to enter a piece."""
    outs = np.arange(max(0, len(motion) - reach), len(motion) - blend, 2)
    intos = np.arange(0, min(reach, len(piece) - blend), 2)
    leave = _features(motion, outs, blend)
    enter = _features(piece, intos, blend)
    cost = ((leave[:, None] - enter[None]) ** 2).sum(axis=-1)
    best = np.unravel_index(cost.argmin(), cost.shape)
    return int(outs[best[0]]), int(intos[best[1]])


def _features(points: Footed, frames: np.ndarray, blend: int) -> Float[np.ndarray, "n F"]:
    """Poses at the start, middle and end of a blend, without their place on the floor."""
    window = points[frames[:, None] + np.array([0, blend // 2, blend - 1]), :JOINTS]
    place = window.mean(axis=(1, 2), keepdims=True) * [1, 0, 1]
    return (window - place).reshape(len(frames), -1)
