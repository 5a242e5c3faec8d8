"""Where in a film the swing is, searched over all of it.

The motion model is placed where the clicked joints tell, and its silhouette and club are drawn at
every phase, in some styles. How well each phase explains each frame is one table, and a swing is a
path through it (`swing_path`). The best paths that differ are the hypotheses about the swing; a
practice swing is one too.

What a frame is compared by are differences that tell phases apart: pixels are weighted by how
much the drawn phases differ there, so that legs and scenery say little and arms much. In frames
that a person marked, joints and shaft say more than any mask.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.golf.fit.initial_pose import Placement, estimate_initial_pose, repeat_pose
from keyrecon.golf.fit.residuals import build_capsules, project
from keyrecon.golf.fit.swing_path import (
    SearchLimits,
    SwingPath,
    best_paths,
    distinct_paths,
)
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import (
    NO_MARKS,
    Body,
    Camera,
    Capsules,
    InitialJoints,
    MotionModel,
    RootPose,
    SwingMarks,
)


@dataclass(frozen=True, eq=False)
class SwingEvidence:
    """What is compared with the motion model."""

    players: Bool[np.ndarray, "T h w"]
    """The player's masks, reduced."""
    shrink: float
    """Pixels of the masks per pixel of the video."""
    height: float
    """Of the player, px of the video."""
    shafts: tuple[ShaftHypotheses, ...]
    """What may be the club."""
    fps: float

    @cached_property
    def soft_masks(self) -> Float[np.ndarray, "T y x"]:
        """The masks as they are compared: reduced further and smoothed."""
        factor = PLAYER_PIXELS / (self.height * self.shrink)
        h, w = self.players.shape[1:]
        size = max(8, round(w * factor)), max(8, round(h * factor))
        small = (
            cv2.resize(m.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            for m in self.players
        )
        return np.stack([_soften(mask, SOFT * PLAYER_PIXELS) for mask in small])


@dataclass(frozen=True, eq=False)
class SwingHypothesis:
    """A swing that may be in the film."""

    keys: Float[np.ndarray, "4"]
    """Frames of start, top, hit and finish."""
    cost: float
    """How badly it explains the film; lower is better."""
    club: Float[np.ndarray, "T 2 2"]
    """Where it expects the club, px."""
    earlier: SwingMarks = NO_MARKS
    """Shafts that an earlier fit found, which may be the club too, px and frames of the file."""


PLAYER_PIXELS = 48.0
"""Height of the player in the pictures that are compared, px."""
PHASES = (36, 28, 28)
"""Phases drawn between the key postures: in a downswing of .5 s at 60 frames per second every one
counts."""
STYLES = 1.3
"""Standard deviations by which the largest styles are tried."""
STYLED = 2
"""Styles that are tried, either way."""
SOFT = 0.02
"""Standard deviation by which silhouettes are smoothed, player heights."""
SWAY, SWAYS, SWAY_COST = 0.12, 3, 0.1
"""How far a player may sway aside from where the mean motion has him, player heights, in how many
steps, and what it costs: the captures sway by .1 where tour players turn on the spot."""
SHAFT_TURN, SHAFT_OFFSET = np.radians(25.0), 0.1
"""By how much the expected club is usually turned (rad) and off its hands (player heights)."""
SURE_SHAFT = 0.3
"""A shaft detected over so many player heights is a sure one."""
SHAFT_WORTH = 1.0
"""What a sure shaft where it is expected is worth, against a silhouette that is as far off as two
postures of a swing usually are."""
WORST = 1.5
"""Cost of a frame at most, in the same unit: someone walks by."""


MARKED_SECONDS, MARK_OFF = 0.5, 0.15
"""What a person marked in one frame counts as much as so many seconds of film; marked joints so far
off (player heights), or a shaft turned by more than `SHAFT_TURN`, are of another posture."""


def search_swing(
    evidence: SwingEvidence,
    clicked: InitialJoints,
    camera: Camera,
    model: MotionModel,
    body: Body,
    limits: SearchLimits = SearchLimits(),
    marks: SwingMarks = NO_MARKS,
    styled: int = STYLED,
) -> list[SwingHypothesis]:
    """Swings that may be in a film, the likeliest first; none where it is too short for any.

    All of them pass the key postures that a person marked. `styled` of the largest styles are tried
    besides the mean motion.
    """
    placement = estimate_initial_pose(clicked, 0.0, camera, model, body)
    phases = _phases(model)
    hypotheses: list[tuple[SwingPath, SwingHypothesis]] = []
    for style in _styles(model, styled):
        drawn = draw_swing(model, body, style, phases, placement, camera)
        costs = frame_costs(evidence, drawn)
        for row, t in enumerate(marks.frames):
            costs[t] += MARKED_SECONDS * evidence.fps * _mark_costs(marks, row, drawn, evidence)
        for path in best_paths(costs, model.keys, phases, evidence.fps, limits, marks.keys):
            club = drawn.club[_phase_rows(path.keys, phases, model.keys, len(costs))]
            hypotheses.append((path, SwingHypothesis(path.keys, path.cost, club)))
    return [hypothesis for _, hypothesis in distinct_paths(hypotheses, limits.most)]


def _phases(model: MotionModel) -> Float[np.ndarray, "P"]:
    """Normalised times that are drawn: evenly between the key postures."""
    parts = [
        np.linspace(a, b, n, endpoint=False)
        for a, b, n in zip(model.keys, model.keys[1:], PHASES, strict=False)
    ]
    return np.append(np.concatenate(parts), model.keys[-1])


def _styles(model: MotionModel, styled: int) -> list[Float[np.ndarray, "m"]]:
    """The mean motion and the largest styles."""
    several = [np.zeros(styled)]
    for component in range(min(styled, len(model.components))):
        several += [sign * STYLES * np.eye(styled)[component] for sign in (-1, 1)]
    return several


@dataclass(frozen=True, eq=False)
class DrawnSwing:
    """A style of the motion model at all phases."""

    capsules: Float[np.ndarray, "P Q 2 2"]
    """Ends of the capsules' axes, px."""
    radii: Float[np.ndarray, "P Q 2"]
    """px"""
    club: Float[np.ndarray, "P 2 2"]
    """px"""
    joints: Float[np.ndarray, "P 14 2"]
    """px"""


def draw_swing(
    model: MotionModel,
    body: Body,
    style: Float[np.ndarray, "m"],
    phases: Float[np.ndarray, "P"],
    placement: Placement,
    camera: Camera,
) -> DrawnSwing:
    """A style of the motion model at some phases, as a camera sees it."""
    state = replace(repeat_pose(placement, phases), coefficients=style)
    pose = place_body(body, posture_at(model, phases, style), state)
    capsules = build_capsules(body)
    ends, scale = _project_axes(pose, capsules, camera)
    club, joints = (
        project(points.reshape(-1, 3), camera)[0].reshape(len(phases), -1, 2)
        for points in (find_club(body, pose), find_joints(body, pose))
    )
    return DrawnSwing(ends, capsules.radii * scale, club, joints)


def _project_axes(
    pose: RootPose, capsules: Capsules, camera: Camera
) -> tuple[Float[np.ndarray, "P Q 2 2"], Float[np.ndarray, "P Q 2"]]:
    """Axes of the capsules in the picture, and px per metre at their ends."""
    origin, turn = pose.origins[:, capsules.segment], pose.rotations[:, capsules.segment]
    ends = np.stack(
        [origin + (turn @ at[..., None])[..., 0] for at in (capsules.start, capsules.end)], axis=2
    )
    pixels = project(ends.reshape(-1, 3), camera)[0].reshape(*ends.shape[:3], 2)
    return pixels, camera.focal / np.maximum(ends[..., 2], 0.1)


def frame_costs(evidence: SwingEvidence, drawn: DrawnSwing) -> Float[np.ndarray, "T P"]:
    """How badly each phase explains each frame."""
    silhouettes = _silhouette_costs(evidence, drawn)
    clubs = np.stack([_club_gains(s, drawn.club, evidence.height) for s in evidence.shafts])
    costs = silhouettes - SHAFT_WORTH * clubs
    least = np.median(costs.min(axis=1))
    return np.minimum(costs, least + WORST)


def _mark_costs(
    marks: SwingMarks, row: int, drawn: DrawnSwing, evidence: SwingEvidence
) -> Float[np.ndarray, "P"]:
    """How far each phase is from what was marked in a frame, 0-1; 0 where nothing was."""
    ends = marks.shafts[row]
    away = np.linalg.norm(drawn.joints - marks.joints[row], axis=2) / evidence.height
    turn = _turns(drawn.club, ends[None])[:, 0]
    off = np.hstack([away / MARK_OFF, turn[:, None] / SHAFT_TURN])
    known = np.isfinite(off[0])
    if not known.any():
        return np.zeros(len(off))
    share: Float[np.ndarray, "P"] = np.minimum(off[:, known] ** 2, 1.0).mean(axis=1)
    return share


def _silhouette_costs(evidence: SwingEvidence, drawn: DrawnSwing) -> Float[np.ndarray, "T P"]:
    """Weighted squared difference of masks and drawn silhouettes, per usual one of two phases."""
    masks = evidence.soft_masks
    (h, w), size = evidence.players.shape[1:], masks.shape[:0:-1]
    scale = np.array(size) / (w / evidence.shrink, h / evidence.shrink)
    shapes = np.stack([
        _soften(silhouette(ends, radii, scale, size), SOFT * PLAYER_PIXELS)
        for ends, radii in zip(drawn.capsules, drawn.radii, strict=True)
    ])  # fmt: skip
    weight = shapes.std(axis=0)
    between = _apart(shapes, shapes, weight)
    steps = np.rint(PLAYER_PIXELS * np.linspace(-SWAY, SWAY, 2 * SWAYS + 1)).astype(int)
    apart = np.stack([
        _apart(np.roll(masks, step, axis=2), shapes, weight) for step in steps
    ])  # fmt: skip
    paid = SWAY_COST * (steps / (SWAY * PLAYER_PIXELS)) ** 2
    least: Float[np.ndarray, "T P"] = (
        apart / max(float(np.median(between)), 1e-9) + paid[:, None, None]
    ).min(axis=0)
    return least


def _apart(
    one: Float[np.ndarray, "n h w"], other: Float[np.ndarray, "m h w"], weight: np.ndarray
) -> Float[np.ndarray, "n m"]:
    """Weighted squared differences of pictures."""
    a, b, w = one.reshape(len(one), -1), other.reshape(len(other), -1), weight.ravel()
    return ((a**2) @ w)[:, None] + ((b**2) @ w)[None] - 2 * (a * w) @ b.T


def _soften(picture: np.ndarray, spread: float) -> Float[np.ndarray, "h w"]:
    return cv2.GaussianBlur(picture, (0, 0), spread)


def silhouette(
    ends: Float[np.ndarray, "Q 2 2"],
    radii: Float[np.ndarray, "Q 2"],
    scale: Float[np.ndarray, "2"],
    size: tuple[int, int],
) -> Float[np.ndarray, "h w"]:
    """Capsules filled in a reduced picture."""
    picture = np.zeros(size[::-1], np.uint8)
    for (a, b), (r, s) in zip((ends + 0.5) * scale - 0.5, radii * scale.mean(), strict=True):
        _fill_capsule(picture, a, b, r, s)
    return picture.astype(np.float32)


def _fill_capsule(picture: np.ndarray, a: np.ndarray, b: np.ndarray, r: float, s: float) -> None:
    """A tapered capsule: two disks and the quadrilateral between them, to an eighth of a pixel."""
    way = b - a
    length = float(np.linalg.norm(way))
    for place, radius in ((a, r), (b, s)):
        centre = tuple(np.rint(8 * place).astype(int).tolist())
        cv2.circle(picture, centre, max(1, round(8 * float(radius))), 1, -1, cv2.LINE_8, 3)
    if length > 1e-6:
        side = np.array([-way[1], way[0]]) / length
        corners = np.array([a + r * side, b + s * side, b - s * side, a - r * side])
        cv2.fillConvexPoly(picture, np.rint(8 * corners).astype(np.int32), 1, cv2.LINE_8, 3)


def _club_gains(
    shafts: ShaftHypotheses, club: Float[np.ndarray, "P 2 2"], height: float
) -> Float[np.ndarray, "P"]:
    """How well the best shaft of a frame agrees with the club of each phase, 0-1."""
    if not len(shafts.weight):
        return np.zeros(len(club))
    turn = _turns(club, shafts.ends)
    length = np.linalg.norm(club[:, 1] - club[:, 0], axis=1)
    # A club that seems short points at the camera: its angle is known the less.
    spread = SHAFT_TURN * np.maximum(1.0, 0.25 * height / np.maximum(length, 1e-6))
    off = np.linalg.norm(club[:, None, 0] - shafts.ends[:, 0], axis=2) / (SHAFT_OFFSET * height)
    sure = np.minimum(shafts.weight / SURE_SHAFT, 1.0)
    agreed = sure * np.exp(-0.5 * ((turn / spread[:, None]) ** 2 + off**2))
    return agreed.max(axis=1)


def _turns(
    clubs: Float[np.ndarray, "P 2 2"], ends: Float[np.ndarray, "n 2 2"]
) -> Float[np.ndarray, "P n"]:
    """Angles between drawn clubs and shafts, rad."""
    expected, observed = clubs[:, 1] - clubs[:, 0], ends[:, 1] - ends[:, 0]
    cross = expected[:, None, 0] * observed[:, 1] - expected[:, None, 1] * observed[:, 0]
    return np.abs(np.arctan2(cross, expected @ observed.T))


def _phase_rows(
    keys: Float[np.ndarray, "4"],
    phases: Float[np.ndarray, "P"],
    key_times: Float[np.ndarray, "4"],
    frames: int,
) -> Int[np.ndarray, "T"]:
    """The row of the table that a path takes in every frame."""
    phase = np.interp(np.arange(frames), keys, key_times)
    return np.rint(np.interp(phase, phases, np.arange(len(phases)))).astype(int)
