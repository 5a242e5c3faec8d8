"""The motion on the court refined: what camera and ground tell changes the pose.

A lifted pose has the picture right and guesses much of its depth. On the court more is known: the
true perspective, metres, the vertical, the ground. One least squares over the motion, in the
unknowns of `motion_solver`, holds together

- the joints' places in the picture, in perspective;
- the lifted directions of the bones, whose errors are large in depth, small across it, and last a
  while: it is the slowly changing correction that is sought, so strokes keep their speed;
- feet that stand: they stay where they are, and their ankles are at one height. Both are let go
  where the evidence is against them (weights of Geman and McClure 1987, and of Cauchy with a scale
  that shrinks from round to round: what slides is found before it is held);
- the centre of mass: free fall while no foot is on the ground, else no acceleration that players do
  not have, and over the feet along the line of sight, where the picture does not show a lean;
- the breadths of hips and shoulders, and one size of the body for all frames.

First every foot that may stand is held in its place but not at its height, which tells heels that
are up from feet that stand; then those that stand are held on the ground too.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion
from keyrecon.world import world_terms as terms
from keyrecon.world.motion_solver import DirectionPrior, Figure, Term, WorldState, solve
from keyrecon.world.records import CourtCamera
from keyrecon.world.sight import sight_axes

DEPTH_ERROR = {"hip": 0.13, "shoulder": 0.165, "head": 0.155, "knee": 0.16, "ankle": 0.23}
DEPTH_ERROR |= {"elbow": 0.23, "wrist": 0.285}
"""Error of the depth of lifted bones by their outer joint, in shares of their lengths: standard
deviations over eight rendered sequences."""
FLAT_ERROR = 0.07
"""The same across the line of sight: .03 (trunk) to .13 (forearms)."""
MEMORY = 0.12
"""Seconds that an error of depth lasts: its autocorrelation is .82 after .1 s, .54 after .2."""
PIXEL_ERROR = 0.0085
"""Error of joints in the picture per axis, statures (median distance .006 to .015)."""
PIXEL_MEMORY = 0.08
"""Seconds that it lasts: its autocorrelation is .64 after .1 s, .32 after .2."""
SIZE_ERROR = 0.03
"""Error of the body's size as standing feet tell it, logarithm."""
SLIPS = (1.0, 0.2, 0.03)
"""Metres per second that a foot may move while it stands, from round to round."""
HEIGHT_ERROR = 0.012
"""Metres by which an ankle is above or below its height while the foot stands."""
HEEL_UP = 0.025
"""Metres above that from which on the height is let go."""
BREADTH_ERROR = 0.02
"""Metres."""
ACCELERATION = 8.0
"""Metres per second squared: of the centre of mass while a foot is on the ground."""
FALL_ERROR = 2.0
"""The same by which free fall is missed."""
SHORTEST_FLIGHT = 0.08
"""Seconds."""
GRAVITY = 9.81
BALANCE_ERROR = 0.07
"""Metres along the line of sight from above the feet to the centre of mass: .05 to .11 in captured
tennis."""
COMMON_LEAN = 0.67
"""Part of the lean along the line of sight common to all frames that is an error: over eight
rendered sequences lifted bodies leaned by a slope of .07 too much, and the true ones by .05."""
MIN_STANCE = 0.75
"""Height of the trunk's middle over the ankles, in its median, from which a lean is read."""
BALANCE_MEMORY = 0.1
"""Seconds that it lasts."""
STEPS = 8
"""Steps of the solver at most, for each of `SLIPS`."""
WINDOW_FRAMES, OVERLAP_FRAMES = 1500, 100
"""Frames solved together, and shared by neighbours."""


OF_FRAMES = (
    "points3d", "points2d", "points2d_propagated", "confidence", "source", "scale", "time"
)  # fmt: skip
"""What a `Motion` has of every frame."""


@dataclass(frozen=True, eq=False)
class Standing:
    """What feet, the right and the left, do; frames without a court have neither."""

    still: Bool[np.ndarray, "T 2"]
    """The foot stays in its place, perhaps with its heel up."""
    flat: Bool[np.ndarray, "T 2"]
    """The whole foot is on the ground."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A motion that has its place on the court, but the pose of the lifting."""

    motion: Motion
    camera: CourtCamera
    seen: Bool[np.ndarray, "T"]
    """Frames of which both are known; in others both hold what they hold nearby."""
    root: Float[np.ndarray, "T 3"]
    """Middle of the hips, metres."""
    scale: float
    """Metres per unit of the motion."""
    stature: float
    """Metres."""
    ankle: float
    """Height of the ankles of standing feet, metres."""

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "Placed":
        """Some of its frames."""
        motion = replace(
            self.motion,
            **{name: getattr(self.motion, name)[frames] for name in OF_FRAMES},
            expected_error=None,
        )
        camera = CourtCamera(
            *(
                getattr(self.camera, name)[frames]
                for name in ("K", "R", "t", "found", "sd_centre", "sd_focal")
            )
        )
        return replace(
            self, motion=motion, camera=camera, seen=self.seen[frames], root=self.root[frames]
        )


def refine_placed(
    placed: Placed, standing: Standing, log_size: float = 0.0
) -> tuple[Float[np.ndarray, "T J 3"], float]:
    """Joints on the court, metres, and the logarithm of the size by which the body was changed.

    `log_size` is where that logarithm starts.
    """
    count = len(placed.seen)
    points = np.zeros((count, len(placed.motion.skeleton.names), 3))
    sizes = []
    for frames, weight in _windows(count):
        own = Standing(standing.still[frames], standing.flat[frames])
        part, size = _refine_window(placed.part(frames), own, log_size)
        points[frames] += weight[:, None, None] * part
        sizes.append(size)
    return points, float(np.median(sizes))


def _windows(count: int) -> Iterator[tuple[slice, Float[np.ndarray, "n"]]]:
    """Overlapping windows, with weights that add up to 1."""
    first = 0
    while True:
        last = count
        if count - first > WINDOW_FRAMES + OVERLAP_FRAMES:
            last = first + WINDOW_FRAMES
        weight = np.ones(last - first)
        ramp = (np.arange(OVERLAP_FRAMES) + 0.5) / OVERLAP_FRAMES
        if first > 0:
            weight[:OVERLAP_FRAMES] = ramp
        if last < count:
            weight[-OVERLAP_FRAMES:] = 1 - ramp
        yield slice(first, last), weight
        if last == count:
            return
        first = last - OVERLAP_FRAMES


def _refine_window(
    placed: Placed, standing: Standing, log_size: float
) -> tuple[Float[np.ndarray, "T J 3"], float]:
    motion, skeleton = placed.motion, placed.motion.skeleton
    ankles = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    hips = [skeleton.index(f"{side}_hip") for side in ("right", "left")]
    bones = placed.scale * (
        motion.points3d[:, skeleton.bones[:, 1]] - motion.points3d[:, skeleton.bones[:, 0]]
    )
    lengths = np.median(np.linalg.norm(bones, axis=2), axis=0)
    axes = sight_axes(placed.camera, motion.points2d[:, hips].mean(axis=1))
    figure = Figure(skeleton, skeleton.ancestry * lengths, axes)
    before = _upright(unit_vectors(bones), figure)
    prior = _direction_prior(before, motion)
    state = WorldState(np.zeros((len(bones), 3)), before, log_size)
    state = replace(state, root=placed.root - state.points(figure)[:, hips].mean(axis=1))
    steady = _steady_terms(placed, standing, axes)
    for slip in SLIPS:
        feet = state.points(figure)[:, ankles]
        recipe = [*steady, *_foot_terms(placed, standing, feet, slip)]
        state = solve(state, figure, recipe, prior, (0.0, SIZE_ERROR), STEPS)
    return state.points(figure), state.log_size


def _lasting(seconds: float, fps: float) -> float:
    """Frames over which an error counts once.

    An error c whose cost is that of `DirectionPrior` has the autocorrelation of white noise behind
    1 / (1 + (frequency x memory)^4), and its variance is 1 / (2 sqrt 2 memory) of that noise's.
    """
    return max(2 * np.sqrt(2) * seconds * fps, 1.0)


def _direction_prior(before: Float[np.ndarray, "T B 3"], motion: Motion) -> DirectionPrior:
    ends = [motion.skeleton.names[child] for child in motion.skeleton.bones[:, 1]]
    depth = [next((DEPTH_ERROR[k] for k in DEPTH_ERROR if k in end), 0.2) for end in ends]
    spread = np.array([[FLAT_ERROR, FLAT_ERROR, one] for one in depth])
    weight = 1 / (spread**2 * _lasting(MEMORY, motion.fps))
    return DirectionPrior(before, weight, MEMORY * motion.fps)


def _upright(directions: Float[np.ndarray, "T B 3"], figure: Figure) -> Float[np.ndarray, "T B 3"]:
    """Directions without the lean along the line of sight that all frames share.

    How far a camera looks down, a lifting has to guess; on the court it is known.
    """
    skeleton, axes = figure.skeleton, figure.axes
    ways = figure.reach
    hips, ankles = (
        ways[[skeleton.index(f"{side}_{part}") for side in ("right", "left")]].mean(axis=0)
        for part in ("hip", "ankle")
    )
    share = 0.5 * (hips + ways[skeleton.root]) - ankles
    stance = np.einsum("tik,b,tbk->ti", axes, share, directions)
    along, level = _along(axes)
    high = stance[:, 2] > MIN_STANCE * np.median(stance[:, 2])
    if not high.any() or np.median(stance[:, 2]) <= 0:
        return directions
    lean = (stance[:, :2] * along).sum(axis=1)[high] / stance[high, 2]
    slope = COMMON_LEAN * float(np.median(lean))
    up = np.einsum("tk,tbk->tb", axes[:, 2], directions)
    moved = directions.copy()
    moved[..., 2] -= slope * up / level[:, None]
    return unit_vectors(moved)


def _along(
    axes: Float[np.ndarray, "T 3 3"],
) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T"]]:
    """The line of sight on the ground, and the cosine of its angle with it."""
    flat = axes[:, :2, 2]
    level = np.maximum(np.linalg.norm(flat, axis=1), 0.1)
    return flat / level[:, None], level


def _steady_terms(
    placed: Placed, standing: Standing, axes: Float[np.ndarray, "T 3 3"]
) -> list[Term]:
    """What does not hang on where the feet are."""
    motion, camera, skeleton = placed.motion, placed.camera, placed.motion.skeleton
    joints, fps = len(skeleton.names), motion.fps
    far = np.linalg.norm(placed.root - camera.centre, axis=1)
    off = PIXEL_ERROR * placed.stature * camera.focal / far
    off = np.where(placed.seen, off * np.sqrt(_lasting(PIXEL_MEMORY, fps)), np.inf)
    made = [terms.reprojection(camera, motion.points2d, np.repeat(off[:, None], joints, axis=1))]
    for pair in skeleton.breadths:
        across = motion.points3d[:, pair.left] - motion.points3d[:, pair.right]
        length = placed.scale * float(np.median(np.linalg.norm(across, axis=1)))
        spread = BREADTH_ERROR * np.sqrt(_lasting(MEMORY, fps))
        made.append(terms.breadth(pair.left, pair.right, length, spread, joints))
    masses = terms.joint_masses(skeleton.names)
    grounded = standing.still[:, 0] | standing.still[:, 1]
    flying = without_moments(~grounded[:, None], max(3, round(SHORTEST_FLIGHT * fps)))
    expected = np.where(flying, [0.0, 0.0, -GRAVITY], np.zeros(3))
    weight = np.where(flying, 1 / FALL_ERROR, np.full(3, 1 / ACCELERATION))
    made.append(terms.body_acceleration(masses, expected, weight, fps))
    along, _ = _along(axes)
    feet = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    support = np.zeros((len(along), joints))
    support[:, feet] = 0.5
    spread = BALANCE_ERROR * np.sqrt(_lasting(BALANCE_MEMORY, fps))
    made.append(terms.balance(masses, support, along, grounded / spread))
    return made


def _foot_terms(
    placed: Placed, standing: Standing, feet: Float[np.ndarray, "T 2 3"], slip: float
) -> list[Term]:
    """Standing feet stay where they are, and on the ground, with weights from where they are."""
    skeleton, fps = placed.motion.skeleton, placed.motion.fps
    joints = len(skeleton.names)
    ankles = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    stay = np.zeros((len(feet), 2, 3))
    speed = np.linalg.norm(np.diff(feet[..., :2], axis=0), axis=2) * fps
    both = standing.still[1:] & standing.still[:-1]
    stay[:-1] = (both / np.hypot(1, speed / (3 * slip)))[..., None] * fps / slip
    stay[..., 2] = 0
    off = feet[..., 2] - placed.ankle
    held = standing.flat / (1 + (np.maximum(off, 0) / HEEL_UP) ** 2)  # no foot sinks in
    held = held / (HEIGHT_ERROR * np.sqrt(_lasting(MEMORY, fps)))
    return [
        terms.slip(ankles, stay, joints),
        terms.foot_height(ankles, placed.ankle, held, joints),
    ]


def without_moments(standing: Bool[np.ndarray, "T n"], shortest: int) -> Bool[np.ndarray, "T n"]:
    """Without spells shorter than so many frames."""
    kept = standing.copy()
    for foot in range(standing.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], standing[:, foot].astype(int), [0]])))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            if end - first < shortest:
                kept[first:end, foot] = False
    return kept
