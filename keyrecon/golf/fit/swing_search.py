"""Where in a film the swing is, searched over all of it.

The motion model is placed where the clicked joints tell, and its silhouette and club are drawn at
every phase, in some styles. How well each phase explains each frame is one table. A swing is a path
through it: the player stands at address, swings up, down and through, and rests. Between its key
postures the phase runs evenly, which leaves four numbers: when the top is, and how long downswing,
upswing and follow-through last. All their values within what golfers do are tried: sums along
the table's straight lines make that as exact as dynamic programming, and pace and tempo bound
it. The best paths that differ are the hypotheses about the swing; a practice swing is one too.

What a frame is compared by are differences that tell phases apart: pixels are weighted by how
much the drawn phases differ there, so that legs and scenery say little and arms much.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.golf.fit.initial_pose import Placement, estimate_initial_pose, repeat_pose
from keyrecon.golf.fit.residuals import build_capsules, project
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.prior.kinematics import find_club, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, Camera, Capsules, InitialJoints, MotionModel, RootPose

Segment = Callable[[int, int], np.ndarray]
"""(part of the swing, its length in frames) -> cost where it begins at each frame."""
Of = TypeVar("Of")


@dataclass(frozen=True)
class SearchLimits:
    """Which swings are tried; times in seconds of the world."""

    downswing: tuple[float, float] = (0.15, 0.5)
    """Shortest and longest from the top to the hit (Cochran and Stobbs, 1968; Novosel and Garrity,
    2004: .23 to .28 for tour players)."""
    tempo: tuple[float, float] = (1.5, 6.0)
    """Upswing to downswing."""
    follow: tuple[float, float] = (1.0, 5.0)
    """From the hit to the finish, in downswings."""
    fastest_camera: float = 1000.0
    """Frames per second up to which slow motion that nobody told of is tried; 0 for none."""
    most: int = 4
    """Hypotheses."""


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


@dataclass(frozen=True, eq=False)
class SwingHypothesis:
    """A swing that may be in the film."""

    keys: Float[np.ndarray, "4"]
    """Frames of start, top, hit and finish."""
    cost: float
    """How badly it explains the film; lower is better."""
    placement: Placement
    club: Float[np.ndarray, "T 2 2"]
    """Where it expects the club, px."""


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
SLOWEST_CAMERA = 24.0
"""No camera takes fewer pictures per second, however slowly they are shown: a downswing has at
least 3 of them."""
SHAFT_TURN, SHAFT_OFFSET = np.radians(25.0), 0.1
"""By how much the expected club is usually turned (rad) and off its hands (player heights)."""
SURE_SHAFT = 0.3
"""A shaft detected over so many player heights is a sure one."""
SHAFT_WORTH = 1.0
"""What a sure shaft where it is expected is worth, against a silhouette that is as far off as two
postures of a swing usually are."""
WORST = 1.5
"""Cost of a frame at most, in the same unit: someone walks by."""
RATIOS = 1.12
"""Step between durations that are tried."""
SAME = 0.5
"""Hypotheses are the same where top and hit differ by less, downswings."""


def search_swing(
    evidence: SwingEvidence,
    clicked: InitialJoints,
    camera: Camera,
    model: MotionModel,
    body: Body,
    limits: SearchLimits = SearchLimits(),
) -> list[SwingHypothesis]:
    """Swings that may be in a film, the likeliest first; none where it is too short for any."""
    placement = estimate_initial_pose(clicked, 0.0, camera, model, body)
    phases = _phases(model)
    found: list[tuple[SwingPath, SwingHypothesis]] = []
    for style in _styles(model):
        drawn = draw_swing(model, body, style, phases, placement, camera)
        costs = frame_costs(evidence, drawn)
        for path in best_paths(costs, model.keys, phases, evidence.fps, limits):
            club = drawn.club[_phase_rows(path.keys, phases, model.keys, len(costs))]
            found.append((path, SwingHypothesis(path.keys, path.cost, placement, club)))
    return [hypothesis for _, hypothesis in _distinct(found, limits.most)]


def _phases(model: MotionModel) -> Float[np.ndarray, "P"]:
    """Normalised times that are drawn: evenly between the key postures."""
    parts = [
        np.linspace(a, b, n, endpoint=False)
        for a, b, n in zip(model.keys, model.keys[1:], PHASES, strict=False)
    ]
    return np.append(np.concatenate(parts), model.keys[-1])


def _styles(model: MotionModel) -> list[Float[np.ndarray, "m"]]:
    """The mean motion and the largest styles."""
    several = [np.zeros(STYLED)]
    for component in range(min(STYLED, len(model.components))):
        several += [sign * STYLES * np.eye(STYLED)[component] for sign in (-1, 1)]
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
    club = project(find_club(body, pose).reshape(-1, 3), camera)[0].reshape(-1, 2, 2)
    return DrawnSwing(ends, capsules.radii * scale, club)


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


def _silhouette_costs(evidence: SwingEvidence, drawn: DrawnSwing) -> Float[np.ndarray, "T P"]:
    """Weighted squared difference of masks and drawn silhouettes, per usual one of two phases."""
    factor = PLAYER_PIXELS / (evidence.height * evidence.shrink)
    h, w = evidence.players.shape[1:]
    size = max(8, round(w * factor)), max(8, round(h * factor))
    scale = np.array(size) / (w / evidence.shrink, h / evidence.shrink)
    soft = SOFT * PLAYER_PIXELS
    masks = np.stack([_soften(cv2.resize(m.astype(np.float32), size, interpolation=cv2.INTER_AREA),
                              soft) for m in evidence.players])  # fmt: skip
    shapes = np.stack([
        _soften(silhouette(ends, radii, scale, size), soft)
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
    expected, found = club[:, 1] - club[:, 0], shafts.ends[:, 1] - shafts.ends[:, 0]
    length = np.linalg.norm(expected, axis=1)
    cross = expected[:, None, 0] * found[:, 1] - expected[:, None, 1] * found[:, 0]
    turn = np.abs(np.arctan2(cross, expected @ found.T))
    # A club that seems short points at the camera: its angle is known the less.
    spread = SHAFT_TURN * np.maximum(1.0, 0.25 * height / np.maximum(length, 1e-6))
    off = np.linalg.norm(club[:, None, 0] - shafts.ends[:, 0], axis=2) / (SHAFT_OFFSET * height)
    sure = np.minimum(shafts.weight / SURE_SHAFT, 1.0)
    agreed = sure * np.exp(-0.5 * ((turn / spread[:, None]) ** 2 + off**2))
    return agreed.max(axis=1)


@dataclass(frozen=True, eq=False)
class SwingPath:
    """A way through the table of costs."""

    keys: Float[np.ndarray, "4"]
    cost: float


def best_paths(
    costs: Float[np.ndarray, "T P"],
    key_times: Float[np.ndarray, "4"],
    phases: Float[np.ndarray, "P"],
    fps: float,
    limits: SearchLimits = SearchLimits(),
) -> list[SwingPath]:
    """The likeliest swings through a table of costs, of different tops and hits, best first.

    Before the start the player is at address, after the finish at the finish; what a film ends
    before is not counted.
    """
    frames = len(costs)
    rows = np.interp(key_times, phases, np.arange(len(phases)))
    address, finish = (np.append(0.0, np.cumsum(costs[:, k])) for k in (0, -1))
    shortest, longest = limits.downswing
    fewest = shortest * max(fps, SLOWEST_CAMERA)
    downs = _durations(fewest, longest * max(fps, limits.fastest_camera), frames / 2)
    lengths: dict[tuple[int, int], np.ndarray] = {}

    def segment(part: int, length: int) -> Float[np.ndarray, "T"]:
        """Cost of a part of the swing that begins at each frame; frames beyond the film free."""
        if (part, length) not in lengths:
            lengths[part, length] = _line_sums(costs, rows[part], rows[part + 1], length)
        return lengths[part, length]

    found: list[SwingPath] = []
    for down in downs:
        ups = _durations(limits.tempo[0] * down, limits.tempo[1] * down, frames)
        throughs = _durations(limits.follow[0] * down, limits.follow[1] * down, 10 * frames)
        tops = np.arange(1, frames - down)
        before, up_of = _best_before(address, segment, ups, tops)
        after, through_of = _best_after(finish, segment, throughs, tops + down)
        total = (before + segment(1, down)[tops] + after) / frames
        for top in _local_minima(total, max(1, down // 2)):
            hit = tops[top] + down
            keys = np.array([tops[top] - up_of[top], tops[top], hit, hit + through_of[top]], float)
            found.append(SwingPath(keys, float(total[top])))
    return [path for path, _ in _distinct([(p, None) for p in found], limits.most)]


def _durations(shortest: float, longest: float, most: float | int) -> list[int]:
    """Numbers of frames from a shortest to a longest duration."""
    low, high = max(1.0, shortest), min(longest, most)
    if high < low:
        return []
    number = max(2, int(np.ceil(np.log(high / low) / np.log(RATIOS))) + 1)
    return np.unique(np.rint(np.geomspace(low, high, number)).astype(int)).tolist()


def _line_sums(
    costs: Float[np.ndarray, "T P"], low: float, high: float, length: int
) -> Float[np.ndarray, "T"]:
    """Sums along a straight line from one row to another that begins at each frame."""
    frames = len(costs)
    row = np.rint(low + (high - low) * np.arange(length) / length).astype(int)
    padded = np.concatenate([costs, np.zeros((length, costs.shape[1]))])
    total = np.zeros(frames)
    for step in range(length):
        total += padded[step : step + frames, row[step]]
    return total


def _best_before(
    address: Float[np.ndarray, "n"], segment: Segment, ups: list[int], tops: Int[np.ndarray, "m"]
) -> tuple[Float[np.ndarray, "m"], Int[np.ndarray, "m"]]:
    """Least cost of all frames before each top, and how long the upswing is then."""
    total = np.full(len(tops), np.inf)
    chosen = np.zeros(len(tops), int)
    for up in ups:
        starts = tops - up
        inside = starts >= 0
        cost = np.where(inside, address[np.maximum(starts, 0)], np.inf)
        cost = cost + segment(0, up)[np.maximum(starts, 0)]
        better = cost < total
        total, chosen = np.where(better, cost, total), np.where(better, up, chosen)
    return total, chosen


def _best_after(
    finish: Float[np.ndarray, "n"], segment: Segment, throughs: list[int],
    hits: Int[np.ndarray, "m"],
) -> tuple[Float[np.ndarray, "m"], Int[np.ndarray, "m"]]:  # fmt: skip
    """Least cost of all frames from each hit on, and how long the follow-through is then."""
    total = np.full(len(hits), np.inf)
    chosen = np.zeros(len(hits), int)
    last = len(finish) - 1
    for through in throughs:
        ends = np.minimum(hits + through, last)
        cost = segment(2, through)[np.minimum(hits, last - 1)] + finish[-1] - finish[ends]
        better = cost < total
        total, chosen = np.where(better, cost, total), np.where(better, through, chosen)
    return total, chosen


def _local_minima(total: Float[np.ndarray, "n"], reach: int) -> Int[np.ndarray, "m"]:
    """Places of values that none within reach is below."""
    if not np.isfinite(total).any():
        return np.zeros(0, int)
    padded = np.pad(np.where(np.isfinite(total), total, np.inf), reach, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.flatnonzero(np.isfinite(total) & (total <= windows.min(axis=1)))


def _phase_rows(
    keys: Float[np.ndarray, "4"],
    phases: Float[np.ndarray, "P"],
    key_times: Float[np.ndarray, "4"],
    frames: int,
) -> Int[np.ndarray, "T"]:
    """The row of the table that a path takes in every frame."""
    phase = np.interp(np.arange(frames), keys, key_times)
    return np.rint(np.interp(phase, phases, np.arange(len(phases)))).astype(int)


def _distinct(found: list[tuple[SwingPath, Of]], most: int) -> list[tuple[SwingPath, Of]]:
    """The best ones of which no two have about the same top and hit."""
    kept: list[tuple[SwingPath, Of]] = []
    for path, more in sorted(found, key=lambda f: f[0].cost):
        down = path.keys[2] - path.keys[1]
        if all(np.abs(path.keys[1:3] - p.keys[1:3]).max() > SAME * down for p, _ in kept):
            kept.append((path, more))
        if len(kept) == most:
            break
    return kept
