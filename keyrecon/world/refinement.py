"""The pose refined by the camera and the ground that the player stands on.

A lifted pose has the picture right and guesses much of its depth. On the court more is known: the
true perspective, metres, the vertical, the ground. One least squares over the motion, in the
unknowns of `motion_solver`, holds together

- the joints' places in the picture, in perspective;
- the lifted directions of the bones, whose errors are large in depth, small across it, and last a
  while: it is the slowly changing correction that is sought, so strokes keep their speed;
- feet that stand: they stay where they are, and their ankles are at one height. Both are let go
  where the evidence is against them (weights of Geman and McClure 1987, and of Cauchy with a scale
  that shrinks from round to round: what slides is found before it is held);
- the centre of mass: free fall while both feet were seen and neither is on the ground, else no
  acceleration that players do not have, and over the feet along the line of sight, where the
  picture does not show a lean;
- the breadths of hips and shoulders, and one length of each bone for all frames, near the lifted
  one: legs are as long as standing feet and hips show them, a trunk that is put upright as its
  picture.

First every foot that may stand is held in its place but not at its height, which tells heels that
are up from feet that stand; then those that stand are held on the ground too.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion
from keyrecon.timeline import PER_FRAME
from keyrecon.world import world_terms as terms
from keyrecon.world.lean import facing, remove_lean, sight_on_ground
from keyrecon.world.motion_solver import DirectionPrior, Figure, Term, WorldState, solve
from keyrecon.world.records import WorldCamera
from keyrecon.world.sight import sight_axes, unseen_joints

DEPTH_ERROR = {"hip": 0.05, "shoulder": 0.165, "head": 0.155, "knee": 0.16, "ankle": 0.23}
DEPTH_ERROR |= {"elbow": 0.23, "wrist": 0.285}
"""Error of the depth of lifted bones by their outer joint, in shares of their lengths: standard
deviations over eight rendered sequences. Those of the trunk's two bones are .13, but opposite to
one another; with that, errors of the trunk's length became a lean (5.4 degrees for 4.5)."""
OTHER_DEPTH_ERROR = 0.2
"""The same of bones with other names, near the mean of all."""
FLAT_ERROR = 0.07
"""The same across the line of sight: .03 (trunk) to .13 (forearms)."""
MEMORY = 0.12
"""Seconds that an error of depth lasts: its autocorrelation is .82 after .1 s, .54 after .2."""
PIXEL_ERROR = 0.0085
"""Error of joints in the picture per axis, statures: median distances are .006 to .015. Tried: .012
gave the same pose, and took more heels that were up for standing feet (F1 .82 for .83)."""
PIXEL_MEMORY = 0.08
"""Seconds that it lasts: its autocorrelation is .64 after .1 s, .32 after .2."""
SIZE_ERROR = 0.03
"""Error of the body's size as standing feet tell it, logarithm."""
LENGTH_ERROR = {"hip": 0.015, "shoulder": 0.05, "head": 0.03, "knee": 0.025, "ankle": 0.025}
LENGTH_ERROR |= {"elbow": 0.035, "wrist": 0.065}
"""Error of lifted bone lengths beside that of the body's size, logarithms, by their outer joint:
root mean squares over eight rendered sequences. Lengths that may not change gave the root at
contact 7.0 cm off in place of 6.2, joints in the world 87 mm in place of 83; twice as much changed
nothing more from above, where lifted lengths are furthest off. Where they are exact, the freedom
costs pose from above: a trunk put upright wrongly passes for a shorter one (benchmarks/results.md).
"""
OTHER_LENGTH_ERROR = 0.04
"""The same of bones with other names, near the mean of all."""
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
tennis. Tried: .04 gave the root at its ninetieth percentile 2 cm better, knees 1 degree worse."""
FOOT_AHEAD = 0.075
"""Metres from the ankle to the middle of the foot, over which a body stands: a foot is .15 statures
long (Winter), its ankle a quarter of that from the heel. Feet are taken to point where the trunk
faces."""
BALANCE_MEMORY = 0.1
"""Seconds that an error of balance lasts."""
STEPS = 8
"""Steps of the solver at most, for each of `SLIPS`."""
HELD_SHARE = 1e-3
"""Of these errors, where lengths are known from all windows: they may go nowhere."""
WINDOW_FRAMES, OVERLAP_FRAMES = 1500, 100
"""Frames solved together, and shared by neighbours, whose joints are blended there."""


Shots = tuple[slice, ...]


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
    camera: WorldCamera
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
    shots: Shots
    """Frames that follow one another; those outside have no place."""

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "Placed":
        """Some of its frames, as one shot."""
        motion = replace(
            self.motion,
            **{name: getattr(self.motion, name)[frames] for name in PER_FRAME},
            expected_error=None,
            cuts=None,
        )
        return replace(
            self,
            shots=(slice(0, len(motion.time)),),
            motion=motion,
            camera=self.camera.part(frames),
            seen=self.seen[frames],
            root=self.root[frames],
        )


def refine_placed(
    placed: Placed, standing: Standing, log_size: float = 0.0
) -> tuple[Float[np.ndarray, "T J 3"], float]:
    """Joints on the court, metres, and the logarithm of how much longer all bones together became.

    `log_size` is where that logarithm starts.
    """
    body, windows = _lifted_body(placed), [*_windows(placed.shots)]
    lifted, spread = body.figure.reach, _size_spread(placed.motion.skeleton)
    sizes = SizePrior(np.append(log_size, np.zeros(len(spread) - 1)), spread)
    refined = _refine_windows(placed, body, standing, sizes)
    if len(windows) > 1:  # one player: what the windows tell of their lengths goes for all
        usual = np.median([state.log_sizes for state in refined], axis=0)
        body = replace(body, figure=body.figure.grown(usual))
        held = SizePrior(np.zeros(len(spread)), HELD_SHARE * spread)
        refined = _refine_windows(placed, body, standing, held)
    points = np.zeros((len(placed.seen), len(placed.motion.skeleton.names), 3))
    for (frames, weight), state in zip(windows, refined, strict=True):
        points[frames] += weight[:, None, None] * state.points(body.part(frames).figure)
    tall = np.median([state.reach(body.figure).max(axis=0).sum() for state in refined])
    return points, float(np.log(tall / lifted.max(axis=0).sum()))


def _windows(shots: Shots) -> Iterator[tuple[slice, Float[np.ndarray, "n"]]]:
    """Overlapping windows of each shot, with weights that add up to 1."""
    for shot in shots:
        yield from _windows_of_shot(shot.start, shot.stop)


def _windows_of_shot(start: int, count: int) -> Iterator[tuple[slice, Float[np.ndarray, "n"]]]:
    first = start
    while True:
        last = count
        if count - first > WINDOW_FRAMES + OVERLAP_FRAMES:
            last = first + WINDOW_FRAMES
        weight = np.ones(last - first)
        ramp = (np.arange(OVERLAP_FRAMES) + 0.5) / OVERLAP_FRAMES
        if first > start:
            weight[:OVERLAP_FRAMES] = ramp
        if last < count:
            weight[-OVERLAP_FRAMES:] = 1 - ramp
        yield slice(first, last), weight
        if last == count:
            return
        first = last - OVERLAP_FRAMES


@dataclass(frozen=True, eq=False)
class _LiftedBody:
    """The lifted pose, upright, in the axes about the line of sight."""

    figure: Figure
    directions: Float[np.ndarray, "T B 3"]
    breadths: Float[np.ndarray, "n"]
    """Of the pairs of `Skeleton.breadths`, metres."""

    def part(self, frames: slice) -> "_LiftedBody":
        """Some of its frames."""
        figure = replace(self.figure, axes=self.figure.axes[frames])
        return replace(self, figure=figure, directions=self.directions[frames])


def _lifted_body(placed: Placed) -> _LiftedBody:
    motion, skeleton = placed.motion, placed.motion.skeleton
    points = placed.scale * motion.points3d
    bones = points[:, skeleton.bones[:, 1]] - points[:, skeleton.bones[:, 0]]
    lengths = np.median(np.linalg.norm(bones, axis=2), axis=0)
    hips = [skeleton.index(f"{side}_hip") for side in ("right", "left")]
    axes = sight_axes(placed.camera, motion.points2d[:, hips].mean(axis=1))
    figure = Figure(skeleton, skeleton.ancestry * lengths, axes)
    apart = [points[:, pair.left] - points[:, pair.right] for pair in skeleton.breadths]
    breadths = np.array([np.median(np.linalg.norm(pair, axis=1)) for pair in apart])
    return _LiftedBody(figure, remove_lean(unit_vectors(bones), figure), breadths)


@dataclass(frozen=True, eq=False)
class SizePrior:
    """What is known of `WorldState.log_sizes`."""

    start: Float[np.ndarray, "P"]
    """Where the search for them starts."""
    spread: Float[np.ndarray, "P"]
    """Their standard deviations, about 0."""


def _refine_windows(
    placed: Placed, body: _LiftedBody, standing: Standing, sizes: SizePrior
) -> list[WorldState]:
    """What came out for each of the windows."""
    return [
        _refine_window(
            placed.part(frames),
            body.part(frames),
            Standing(standing.still[frames], standing.flat[frames]),
            sizes,
        )
        for frames, _ in _windows(placed.shots)
    ]


def _refine_window(
    placed: Placed, body: _LiftedBody, standing: Standing, sizes: SizePrior
) -> WorldState:
    motion, skeleton, figure = placed.motion, placed.motion.skeleton, body.figure
    ankles = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    hips = [skeleton.index(f"{side}_hip") for side in ("right", "left")]
    prior = _direction_prior(body.directions, motion)
    state = WorldState(np.zeros_like(placed.root), body.directions, sizes.start)
    state = replace(state, root=placed.root - state.points(figure)[:, hips].mean(axis=1))
    steady = _steady_terms(placed, body, standing)
    for slip in SLIPS:
        feet = state.points(figure)[:, ankles]
        recipe = [*steady, *_foot_terms(placed, standing, feet, slip)]
        state = solve(state, figure, recipe, prior, sizes.spread, STEPS)
    return state


def _size_spread(skeleton: Skeleton) -> Float[np.ndarray, "P"]:
    """Standard deviations of `WorldState.log_sizes`."""
    _, bones = np.unique(skeleton.length_group, return_index=True)
    ends = [skeleton.names[child] for child in skeleton.bones[bones, 1]]
    return np.array([SIZE_ERROR, *_by_joint(LENGTH_ERROR, ends, OTHER_LENGTH_ERROR)])


def _by_joint(values: Mapping[str, float], names: Sequence[str], other: float) -> list[float]:
    """The value of each joint, whose key is a part of its name; `other` where none is."""
    return [next((values[key] for key in values if key in name), other) for name in names]


def _correlated_frames(seconds: float, fps: float) -> float:
    """Frames over which an error counts once.

    An error c whose cost is that of `DirectionPrior` has the autocorrelation of white noise behind
    1 / (1 + (frequency x memory)^4), and its variance is 1 / (2 sqrt 2 memory) of that noise's.
    """
    return max(2 * np.sqrt(2) * seconds * fps, 1.0)


def _direction_prior(before: Float[np.ndarray, "T B 3"], motion: Motion) -> DirectionPrior:
    ends = [motion.skeleton.names[child] for child in motion.skeleton.bones[:, 1]]
    depths = _by_joint(DEPTH_ERROR, ends, OTHER_DEPTH_ERROR)
    spread = np.array([[FLAT_ERROR, FLAT_ERROR, depth] for depth in depths])
    weight = 1 / (spread**2 * _correlated_frames(MEMORY, motion.fps))
    return DirectionPrior(before, weight, MEMORY * motion.fps)


def _steady_terms(placed: Placed, body: _LiftedBody, standing: Standing) -> list[Term]:
    """Terms that do not depend on where the feet are."""
    motion, camera, skeleton = placed.motion, placed.camera, placed.motion.skeleton
    joints, fps = len(skeleton.names), motion.fps
    far = np.linalg.norm(placed.root - camera.centre, axis=1)
    off = PIXEL_ERROR * placed.stature * camera.focal / far
    off = np.where(placed.seen, off * np.sqrt(_correlated_frames(PIXEL_MEMORY, fps)), np.inf)
    made = [terms.reprojection(camera, motion.points2d, np.repeat(off[:, None], joints, axis=1))]
    spread = BREADTH_ERROR * np.sqrt(_correlated_frames(MEMORY, fps))
    for pair, length in zip(skeleton.breadths, body.breadths, strict=True):
        made.append(terms.breadth(pair.left, pair.right, float(length), spread, joints))
    masses = terms.joint_masses(skeleton.names)
    grounded = standing.still[:, 0] | standing.still[:, 1]
    feet = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    feet_seen = placed.seen & ~unseen_joints(motion)[:, feet].any(axis=1)
    flying = without_short_runs(
        (feet_seen & ~grounded)[:, None], max(3, round(SHORTEST_FLIGHT * fps))
    )
    expected = np.where(flying, [0.0, 0.0, -GRAVITY], np.zeros(3))
    weight = np.where(flying, 1 / FALL_ERROR, np.full(3, 1 / ACCELERATION))
    made.append(terms.body_acceleration(masses, expected, weight, fps))
    along, _ = sight_on_ground(body.figure.axes)
    ahead = FOOT_AHEAD * facing(body.directions, body.figure)
    support = np.zeros((len(along), joints))
    support[:, feet] = 0.5
    spread = BALANCE_ERROR * np.sqrt(_correlated_frames(BALANCE_MEMORY, fps))
    made.append(terms.balance(masses, support, along, ahead, grounded / spread))
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
    held = held / (HEIGHT_ERROR * np.sqrt(_correlated_frames(MEMORY, fps)))
    return [
        terms.slip(ankles, stay, joints),
        terms.foot_height(ankles, placed.ankle, held, joints),
    ]


def without_short_runs(standing: Bool[np.ndarray, "T n"], shortest: int) -> Bool[np.ndarray, "T n"]:
    """Without spells shorter than so many frames."""
    kept = standing.copy()
    for foot in range(standing.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], standing[:, foot].astype(int), [0]])))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            if end - first < shortest:
                kept[first:end, foot] = False
    return kept
