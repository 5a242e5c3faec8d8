"""The motion on the court: turned into the world, with its standing feet on the ground.

A lifted pose lives in scaled orthography about the line of sight to the player, so it is first
turned from that line into the camera's axes and then into the world. Where it stands is told by the
feet: a foot whose picture does not move against the ground, and which is the lower one of the pose,
stands, and the line of sight through its ankle meets the ground's plane at the ankle's height; of a
foot that nothing in the picture told of that is not known. One least squares over all frames then
places the root: on its own line of sight, standing feet in one place on the ground, at the distance
that the player's size says where no foot stands, and without accelerations that no player has. From
there `refinement` changes root and pose together.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_matrix, csr_matrix, vstack
from scipy.sparse.linalg import spsolve

from keyrecon.body import standing_length
from keyrecon.records import Motion
from keyrecon.world.records import WorldCamera, WorldMotion
from keyrecon.world.refinement import (
    HEEL_UP,
    Placed,
    Shots,
    Standing,
    refine_placed,
    without_short_runs,
)
from keyrecon.world.sight import sight_axes, sight_lines, unseen_joints

ANKLE_SHARE = 0.0486
"""Height of the ankle joint above the sole, in statures (8.5 cm of 1.75 m; Drillis and Contini
1966 have 3.9 % to the malleolus, the joint of LSP's marks lies above it)."""
CONTACT_SPEED = 0.4
"""Metres per second across the line of sight below which an ankle is that of a standing foot, which
may turn about its toes. On eight captured motions with the noise of a lifting, true contact that of
toes or heels, F1 two frames off: .3 gave .944, .35 .952, .4 .956, .5 .954, .6 .944."""
HELD_SPEED = 0.3
"""The same below which it is held in its place, and the body does not fall freely: with .4 jumps
came out 3 cm too low, and the root at contact 6.0 cm off in place of 5.6."""
LOWER_BY = 0.2
"""Metres by which a standing foot may be above the other one in the lifted pose, which leans where
the camera looks down: with .08 the F1 of contact was .66 in place of .85 for a camera 7 m high, and
the same elsewhere; heels are told by the refined height."""
STANDING_SHARE = 25
"""Percentile of the heights of ankles of feet that do not move, from which heels are up by
`HEEL_UP`. Over eight rendered sequences: 10 gave F1 .816, 25 .813, 50 .80; with .015 m less .77."""
HIGHEST_HEEL = 0.12
"""Metres above the same up to which the ankle of a foot on its toes may be: in six captures the
highest fiftieth of such feet have theirs .09 to .12 m up; higher ones are at the top of a jump."""
SPELL = 0.08
"""Seconds that a foot stands at least."""
LEAST_SEEN = 3
"""Frames of a shot with a court and a motion, below which it has no place."""
REACH = 0.04
"""Seconds to both sides over which a foot's speed is taken."""
PIXELS = 2.0
"""px by which a joint's place in the picture is off."""
POSE = 0.04
"""Metres by which a foot is off in the pose (N-MPJPE of 60 mm over all three axes)."""
ACCELERATION = 8.0
"""Metres per second squared: a player's root rarely exceeds it."""
SIZE = 0.12
"""Share by which the distance told by the player's size is off; it errs alike for long. Tried: .05
gave 11.9 cm for 12.2, .4 12.3."""
SAME_STATURE = 0.005
"""Share by which two heights of a player may differ that are taken for one: 1 cm."""
ROUNDS = 3
"""Least squares solved, with residuals of feet weighed anew after each."""


@dataclass(frozen=True, eq=False)
class _StanceFrames:
    """Which frame and foot belongs to which spell of standing."""

    frame: np.ndarray
    foot: np.ndarray
    spell: np.ndarray
    count: int


def place_motion(motion: Motion, camera: WorldCamera) -> WorldMotion | None:
    """The motion in the world of the court; None where no foot was seen to stand on it."""
    skeleton = motion.skeleton
    ankles = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    hips = [skeleton.index(f"{side}_hip") for side in ("right", "left")]
    seen = camera.found & np.isfinite(motion.points2d).all(axis=(1, 2)) & motion.known
    shots = tuple(shot for shot in motion.stretches if seen[shot].sum() >= LEAST_SEEN)
    if not shots:
        return None
    inside = np.zeros(len(seen), dtype=bool)
    inside[np.concatenate([np.r_[shot] for shot in shots])] = True
    seen &= inside
    at_root = motion.points2d[:, hips].mean(axis=1)
    pose = _turned_pose(motion, camera, at_root, hips)
    feet, feet_seen = motion.points2d[:, ankles], seen[:, None] & ~unseen_joints(motion)[:, ankles]
    ratio, still = 1.0 if motion.units == "m" else 1.75, np.zeros((len(seen), 2), dtype=bool)
    for _ in range(2):  # the ankle's height hangs on the player's size
        height = ratio * pose[:, ankles, 2]
        ground = _on_ground(camera, feet, ANKLE_SHARE * ratio * stature_in_units(motion))
        speed = _speed_across(motion, camera, ground, shots)
        still = _slow_and_low(speed, height, HELD_SPEED) & feet_seen
        still = _long_enough(still, motion.fps, shots)
        if not still.any():
            return None
        ratio = _size(camera, ground, _distance_by_size(motion, camera, at_root), still)
    slow = _slow_and_low(speed, height, CONTACT_SPEED) & feet_seen
    slow = _long_enough(slow, motion.fps, shots)
    ankle = ANKLE_SHARE * ratio * stature_in_units(motion)
    evidence = _Evidence(at_root, ratio * pose[:, ankles], ground, seen, ratio, ankle)
    root = _solve(motion, camera, evidence, _number_stances(still, shots), shots)
    stature = ratio * stature_in_units(motion)
    placed = Placed(motion, camera, seen, root, ratio, stature, ankle, shots)
    return _refined(_with_gaps_filled(placed), still, slow)


def _refined(
    placed: Placed, still: Bool[np.ndarray, "T 2"], slow: Bool[np.ndarray, "T 2"]
) -> WorldMotion:
    """Pose and root fitted together; of feet that do not move, or are slow, those that stand."""
    skeleton, seen = placed.motion.skeleton, placed.seen
    ankles = [skeleton.index(f"{side}_ankle") for side in ("right", "left")]
    points, log_size = refine_placed(placed, Standing(still, still))
    height = points[:, ankles, 2]
    rise = height - np.percentile(height[still], STANDING_SHARE)
    fps, shots = placed.motion.fps, placed.shots
    flat = _long_enough(still & (rise < HEEL_UP), fps, shots)
    contact = _long_enough((still | slow) & (rise < HIGHEST_HEEL), fps, shots)
    points, log_size = refine_placed(placed, Standing(still, flat), log_size)
    points[~seen] = np.nan
    ratio = placed.scale * float(np.exp(log_size))
    hips = [skeleton.index(f"{side}_hip") for side in ("right", "left")]
    return WorldMotion(points, points[:, hips].mean(axis=1), contact, ratio)


def _with_gaps_filled(placed: Placed) -> Placed:
    """Frames that are not known have the camera and the pose of the nearest one that is.

    In a shot it is the nearest one of the shot.
    """
    nearest = _nearest(np.flatnonzero(placed.seen), np.arange(len(placed.seen)))
    for shot in placed.shots:
        known = np.flatnonzero(placed.seen[shot]) + shot.start
        nearest[shot] = _nearest(known, np.r_[shot])
    return replace(placed.part(nearest), seen=placed.seen, root=placed.root, shots=placed.shots)


def _nearest(known: Int[np.ndarray, "k"], frames: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    """The nearest of the known frames, ascending, to each."""
    at = np.clip(np.searchsorted(known, frames), 1, len(known) - 1)
    return np.where(frames - known[at - 1] <= known[at] - frames, known[at - 1], known[at])


def stature_in_units(motion: Motion) -> float:
    """Length of the body in the motion's own units."""
    if motion.units != "m":
        return 1.0
    shares = np.array([motion.skeleton.proportions[child] for child in motion.skeleton.bones[:, 1]])
    return float(_bone_lengths(motion).sum() / shares.sum())


def _bone_lengths(motion: Motion) -> Float[np.ndarray, "B"]:
    """Medians, in the motion's own units."""
    start, stop = motion.skeleton.bones.T
    points = motion.points3d[motion.known]
    lengths: np.ndarray = np.median(np.linalg.norm(points[:, stop] - points[:, start], axis=2), 0)
    return lengths


def given_height(motion: Motion) -> float:
    """The player's height that was given, which scales a motion in metres; 1 for other motions.

    Legs and trunk stand that tall, however long marks have made the arms (`standing_length`).
    """
    if motion.units != "m":
        return 1.0
    skeleton = motion.skeleton
    usual = standing_length(skeleton.lengths, skeleton)
    return standing_length(_bone_lengths(motion), skeleton) / usual


def stature_change(motion: Motion, camera: WorldCamera) -> float:
    """The player's height in the motion over the one that told the camera what a metre is.

    1 where they are alike, or another thing told it.
    """
    if camera.stature is None or motion.units != "m":
        return 1.0
    change = given_height(motion) / camera.stature
    return change if abs(change - 1) > SAME_STATURE else 1.0


def _turned_pose(
    motion: Motion, camera: WorldCamera, at_root: Float[np.ndarray, "T 2"], hips: list[int]
) -> Float[np.ndarray, "T J 3"]:
    """Joints relative to the middle of the hips, in the world's axes and the motion's units."""
    relative = motion.points3d - motion.points3d[:, hips].mean(axis=1, keepdims=True)
    return np.einsum("tik,tnk->tni", sight_axes(camera, at_root), relative)


def _on_ground(
    camera: WorldCamera, feet: Float[np.ndarray, "T 2 2"], height: float
) -> Float[np.ndarray, "T 2 3"]:
    """Where lines of sight through the feet meet the plane at a height; NaN at the horizon."""
    places = []
    for foot in range(2):
        _, ray = sight_lines(camera, feet[:, foot])
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (height - camera.centre[:, 2]) / ray[:, 2]
        along = np.where((along > 0) & (along < 100), along, np.nan)
        places.append(camera.centre + along[:, None] * ray)
    return np.stack(places, axis=1)


def _speed_across(
    motion: Motion, camera: WorldCamera, ground: Float[np.ndarray, "T 2 3"], shots: Shots
) -> Float[np.ndarray, "T 2"]:
    """Speeds of the feet across the line of sight, as if they were on the ground, m/s."""
    reach = max(1, round(REACH * motion.fps))
    before, after = np.arange(len(ground)), np.arange(len(ground))
    for shot in shots:
        before[shot] = np.maximum(before[shot] - reach, shot.start)
        after[shot] = np.minimum(after[shot] + reach, shot.stop - 1)
    sight = ground - camera.centre[:, None]
    sight = sight / np.linalg.norm(sight, axis=2, keepdims=True)
    way = ground[after] - ground[before]
    across = way - (way * sight).sum(axis=2, keepdims=True) * sight
    seconds = np.maximum(motion.time[after] - motion.time[before], 1e-6)
    return np.linalg.norm(across, axis=2) / seconds[:, None]


def _slow_and_low(
    speed: Float[np.ndarray, "T 2"], height: Float[np.ndarray, "T 2"], limit: float
) -> Bool[np.ndarray, "T 2"]:
    """Feet that hardly move against the ground, and are the lower ones of the pose."""
    with np.errstate(invalid="ignore"):
        return (speed < limit) & (height - height.min(axis=1, keepdims=True) < LOWER_BY)


def _long_enough(
    standing: Bool[np.ndarray, "T 2"], fps: float, shots: Shots
) -> Bool[np.ndarray, "T 2"]:
    """Without spells that are too short to stand, shot by shot."""
    kept = np.zeros_like(standing)
    for shot in shots:
        kept[shot] = without_short_runs(standing[shot], max(2, round(SPELL * fps)))
    return kept


def _distance_by_size(
    motion: Motion, camera: WorldCamera, at_root: Float[np.ndarray, "T 2"]
) -> Float[np.ndarray, "T"]:
    """How far away the player is by his size, in the motion's units.

    Off the camera's axis a picture is larger by 1 / cosine (`ground_evidence.size_residuals`).
    """
    ray, _ = sight_lines(camera, at_root)
    return camera.focal / (ray[:, 2] * motion.scale)


def _size(
    camera: WorldCamera,
    ground: Float[np.ndarray, "T 2 3"],
    by_size: Float[np.ndarray, "T"],
    contact: Bool[np.ndarray, "T 2"],
) -> float:
    """Size of the player by the court over that of the motion."""
    depth = np.linalg.norm(ground - camera.centre[:, None], axis=2)
    return float(np.nanmedian((depth / by_size[:, None])[contact]))


def _number_stances(contact: Bool[np.ndarray, "T 2"], shots: Shots) -> _StanceFrames:
    """Number every spell of standing; none goes on from one shot to the next."""
    frames, feet, spells, count = [], [], [], 0
    shot_of = np.zeros(len(contact), dtype=int)
    shot_of[[shot.start for shot in shots]] = 1
    shot_of = np.cumsum(shot_of)
    for foot in range(2):
        standing = np.flatnonzero(contact[:, foot])
        begins = np.diff(standing, prepend=-9) > 1
        begins |= np.diff(shot_of[standing], prepend=0) > 0
        number = np.cumsum(begins) - 1 + count
        frames.append(standing)
        feet.append(np.full(len(standing), foot))
        spells.append(number)
        count = int(number[-1]) + 1 if len(standing) else count
    return _StanceFrames(
        np.concatenate(frames), np.concatenate(feet), np.concatenate(spells), count
    )


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What is known of the root's place, in metres."""

    at_root: Float[np.ndarray, "T 2"]
    feet: Float[np.ndarray, "T 2 3"]
    """Ankles relative to the root."""
    ground: Float[np.ndarray, "T 2 3"]
    """Where the ankles were if they stood."""
    seen: Bool[np.ndarray, "T"]
    scale: float
    ankle: float
    """Height of the ankle above the ground."""


def _solve(
    motion: Motion, camera: WorldCamera, evidence: _Evidence, stances: _StanceFrames, shots: Shots
) -> Float[np.ndarray, "T 3"]:
    """The root in all frames, and with it the places on which feet stand."""
    count = len(motion.time)
    size = 3 * count + 2 * stances.count
    steady = [
        *_sight_rows(motion, camera, evidence, size),
        _smoothness_rows(motion.fps, size, shots),
    ]
    weight = np.ones(len(stances.frame))
    solution = np.zeros(size)
    for _ in range(ROUNDS):
        rows = [*steady, *_stance_rows(camera, evidence, stances, weight, size)]
        matrix = vstack([a for a, _ in rows]).tocsr()
        right = np.concatenate([b for _, b in rows])
        normal = (matrix.T @ matrix + 1e-9 * _eye(size)).tocsc()
        solution = spsolve(normal, matrix.T @ right)
        root = solution[: 3 * count].reshape(count, 3)
        place = solution[3 * count :].reshape(-1, 2)
        off = root[stances.frame] + evidence.feet[stances.frame, stances.foot]
        off = off - np.column_stack(
            [place[stances.spell], np.full(len(stances.frame), evidence.ankle)]
        )
        weight = 1 / (1 + (np.linalg.norm(off, axis=1) / (3 * POSE)) ** 2)
    return solution[: 3 * count].reshape(count, 3).copy()


def _eye(size: int) -> csr_matrix:
    index = np.arange(size)
    return csr_matrix((np.ones(size), (index, index)), shape=(size, size))


Rows = tuple[csr_matrix, Float[np.ndarray, "m"]]


def _rows(
    parts: list[tuple[np.ndarray, np.ndarray]], right: Float[np.ndarray, "m"], size: int
) -> Rows:
    """Equations from (columns, values) pairs, one entry of each in every row."""
    number = np.arange(len(right))
    entries = np.concatenate([value for _, value in parts])
    where = (np.tile(number, len(parts)), np.concatenate([column for column, _ in parts]))
    return coo_matrix((entries, where), shape=(len(right), size)).tocsr(), right


def _sight_rows(motion: Motion, camera: WorldCamera, evidence: _Evidence, size: int) -> list[Rows]:
    """The root lies on its line of sight, about as far away as the player is small."""
    seen = np.flatnonzero(evidence.seen)
    _, ray = sight_lines(camera, evidence.at_root)
    ray, centre = ray[seen], camera.centre[seen]
    far = evidence.scale * _distance_by_size(motion, camera, evidence.at_root)[seen]
    side = np.cross(ray, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    sigma = PIXELS * far / camera.focal[seen]
    made = []
    for axis, spread, reach in (
        (side, sigma, 0.0),
        (np.cross(side, ray), sigma, 0.0),
        (ray, SIZE * far, far),
    ):
        parts = [(3 * seen + k, axis[:, k] / spread) for k in range(3)]
        made.append(_rows(parts, ((axis * centre).sum(axis=1) + reach) / spread, size))
    return made


def _smoothness_rows(fps: float, size: int, shots: Shots) -> Rows:
    """Accelerations are about zero."""
    middle = np.concatenate([np.arange(shot.start + 1, shot.stop - 1) for shot in shots])
    pace = fps**2 / ACCELERATION
    columns = (3 * middle[:, None] + np.arange(3)).ravel()
    ones = np.full(len(columns), pace)
    parts = [(columns - 3, ones), (columns, -2 * ones), (columns + 3, ones)]
    return _rows(parts, np.zeros(len(columns)), size)


def _stance_rows(
    camera: WorldCamera,
    evidence: _Evidence,
    stances: _StanceFrames,
    weight: Float[np.ndarray, "n"],
    size: int,
) -> list[Rows]:
    """Standing feet are in one place, on the ground, on their lines of sight."""
    t, foot = stances.frame, stances.foot
    offset, ground = evidence.feet[t, foot], evidence.ground[t, foot]
    places = 3 * len(evidence.seen) + 2 * stances.spell
    tight = np.sqrt(weight) / POSE
    made = [
        _rows([(3 * t + k, tight), (places + k, -tight)], -tight * offset[:, k], size)
        for k in range(2)
    ]
    made.append(_rows([(3 * t + 2, tight)], tight * (evidence.ankle - offset[:, 2]), size))
    sight = ground - camera.centre[t]
    far = np.linalg.norm(sight, axis=1)
    flat = sight[:, :2] / np.linalg.norm(sight[:, :2], axis=1, keepdims=True)
    sigma = PIXELS * far / camera.focal[t]
    steep = np.abs(sight[:, 2]) / far
    for axis, spread in ((flat[:, ::-1] * [-1, 1], sigma), (flat, sigma / steep)):
        parts = [(places + k, axis[:, k] / spread) for k in range(2)]
        made.append(_rows(parts, (axis * ground[:, :2]).sum(axis=1) / spread, size))
    return made
