"""A motion as other programs want it: upright, on a floor at 0, and at a constant rate.

Camera axes (x right, y down, z away) become x right, y up, z towards the camera: half a turn
about x, so that right-handed stays right-handed. One camera tells neither how far away the player
is nor where the ground lies, so three things are estimated, and every file or the line that
`keyrecon export` prints for it says so:

- Up. The line from the ankles to the hips is upright on average. Where its median leans towards
  or away from the camera by more than people do (`LEAN`), the camera looked down or up, and the
  lean is taken out.
- The floor. It lies an ankle's height under the lower ankle, at the median of that ankle over the
  second around each frame: most of a second one foot stands, also of one with a jump in it. It
  follows the player, because a step away from a camera that looks down shows as a rise.
- Over what. The middle of the hips is over the origin in the first frame.

Where a camera that is known has told where the player stands in every frame (`points3d_world` of
motion.npz), nothing is estimated here: the origin is at the middle of the net of a court, elsewhere
under the player's first stance, x to the right. Where it has not for a moment (`BRIDGED_SECONDS`),
the joints there go straight on from before to after, or are missing where a format can say so;
where it has not for longer, all frames are estimated, since both in one file would be two origins.
The file says which.

Where the floor is estimated every shot of a video stands by itself. Where shots do not show the
player there is no figure: markers are missing there, and formats that hold a figure in every frame
have it stand still.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, median_filter
from scipy.spatial.transform import Rotation

from keyrecon.body import ANKLE_HEIGHT, Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion
from keyrecon.timeline import cut_motion, frames_before
from keyrecon.world.records import COURT, GROUND, Origin

UNEVEN = 0.1
"""Frame times that stray further than this share of a frame from an even spacing are uneven.
Some containers round times to milliseconds, 6 % of a frame at 120 fps."""
STANCE_SECONDS = 1.0
"""Time over which the lower ankle tells the floor. On five rendered sequences (serves, volleys,
strokes; cameras that look down by 6 to 32 degrees) the lower ankle's height over the floor is
wrong by 1.3-2.7 cm with .5 s, 2.3-3.8 with 1, 3.0-6.3 with 2 and 4.1-13.2 with one floor for all
(root mean square about the mean); with .5 s jumps lose 5 to 10 cm of their height, with 1 s 0 to
4. `benchmarks/floor.py` measures it."""
BRIDGED_SECONDS = 0.3
"""Time without a place in the world over which the joints go straight on: a runner who brakes with
5 m/s^2 is then off by 5.6 cm in the middle of it, no more than where a foot stands is off."""
LEAN = np.radians(10)
"""Median lean of the legs up to which the camera is taken to be level. Rendered, cameras that look
down by 3 to 10 degrees gave 1 to 7, one by 32 degrees 21 (the lifting has flattened the rest);
real swings and rallies by a level camera gave -1 to 6."""


@dataclass(frozen=True, eq=False)
class WorldJoints:
    """Joints in the world: metres, y away from the camera, z up."""

    points: Float[np.ndarray, "T J 3"]
    """NaN in frames where the camera was not found."""
    origin: Origin


World = WorldJoints | None
"""None where no camera has put the motion into the world."""
NO_MOTION = "No usable shot is among these frames: there is no motion to write."
IN_WORLD = {
    COURT: "on the court: origin on the ground at the middle of the net, x along the net to the "
    "right, feet where the court's lines put them",
    GROUND: "on the ground: origin under the player's first stance, x to the right, feet where the "
    "camera's place, height and tilt put them (as keyrecon ground estimates them)",
}
WITH_WORLD = ", and the world's besides"
"""Said of files that hold the motion in both axes."""


@dataclass(frozen=True, eq=False)
class StandingMotion:
    """A motion that stands on the floor y = 0."""

    skeleton: Skeleton
    points: Float[np.ndarray, "N J 3"]
    """x right, y up, z towards the camera; NaN in frames without a motion."""
    time: Float[np.ndarray, "N"]
    """Seconds from the first frame."""
    fps: float
    """Mean frames per second."""
    units: str
    stature: float
    """In `units`."""
    placing: str
    """How it was turned and placed, for whoever opens the file."""
    timing: str
    """What was done to the frame times."""

    @property
    def known(self) -> Bool[np.ndarray, "N"]:
        """Frames in which there is a figure."""
        return np.isfinite(self.points).all(axis=(1, 2))

    def standing_still(self) -> "StandingMotion":
        """With the last figure held where there is none, and the first before it."""
        known = np.flatnonzero(self.known)
        if len(known) == len(self.points):
            return self
        timing = f"{self.timing}; where the video does not show the player the figure stands still"
        held = known[frames_before(known, len(self.points))]
        return replace(self, points=self.points[held], timing=timing)


def y_up(points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Points in camera axes with Y up and Z towards the camera."""
    return points * np.array([1.0, -1.0, -1.0])


def stature(motion: Motion) -> float:
    """Standing height in the units of the motion, from all bones and their known proportions."""
    parent, child = motion.skeleton.bones.T
    bones = np.linalg.norm(motion.points3d[:, child] - motion.points3d[:, parent], axis=-1)
    return float(np.nanmedian(bones, axis=0).sum() / motion.skeleton.lengths.sum())


def is_uneven(motion: Motion) -> bool:
    """Whether the frames of a motion are unevenly spaced in time."""
    even = motion.time[0] + np.arange(len(motion.time)) / motion.fps
    return bool(np.abs(motion.time - even).max() > UNEVEN / motion.fps)


def stand_on_floor(
    motion: Motion, even_times: bool = True, world: World = None, gaps: bool = False
) -> StandingMotion:
    """The motion with Y up, feet on the floor, and the first frame over the origin.

    With `even_times`, frames that are unevenly spaced are replaced by as many at even times.
    Joints in the `world` are taken as they are if all frames of the motion have a place there, or
    lack it for a moment only, which is bridged or, with `gaps`, left without a figure.
    Raises KeyreconError where joints are missing.
    """
    parts, known = motion.stretches, motion.known
    if world is not None:
        lost = known & np.isnan(world.points).any(axis=(1, 2))
        if lost.any() and _is_brief(lost, motion):
            bridged = replace(world, points=_bridge(world.points, lost, motion))
            standing = stand_on_floor(motion, even_times, bridged)
            return _with_gaps(standing, lost, motion) if gaps else _with_bridge_note(standing, lost)
        if lost.any():
            standing = stand_on_floor(motion, even_times)
            instead = (
                f"; not on the {world.origin}, since the place there is unknown in {lost.sum()} of "
                f"{known.sum()} frames (the others can be exported by themselves)"
            )
            return replace(standing, placing=standing.placing + instead)
    if len(parts) > 1 or not known.all():
        return _stand_in_shots(motion, parts, even_times, world)
    return _stand(motion, even_times, world)


def _is_brief(lost: Bool[np.ndarray, "T"], motion: Motion) -> bool:
    """Whether no stretch of a shot that is lost is long, or at its beginning or end."""
    for part in motion.stretches:
        edges = np.flatnonzero(np.diff(lost[part].astype(int)))
        if lost[part][[0, -1]].any():
            return False
        first, last = part.start + edges[::2], part.start + edges[1::2]
        seconds = motion.time[last] - motion.time[first]
        if (seconds > BRIDGED_SECONDS * (1 + 1e-9)).any():
            return False
    return True


def _bridge(
    points: Float[np.ndarray, "T J 3"], lost: Bool[np.ndarray, "T"], motion: Motion
) -> Float[np.ndarray, "T J 3"]:
    """Joints everywhere: where they are lost they go straight on within their shot."""
    whole = points.copy()
    for part in motion.stretches:
        gone, time = lost[part], motion.time[part]
        if gone.any():
            here, skeleton = whole[part], motion.skeleton
            here[gone] = _resample(here[~gone], time[~gone], time[gone], skeleton)
    return whole


def _with_bridge_note(standing: StandingMotion, lost: Bool[np.ndarray, "T"]) -> StandingMotion:
    """The same, with what was bridged."""
    note = f"; the place there is unknown in {lost.sum()} of {len(lost)} frames, which are bridged"
    return replace(standing, placing=standing.placing + note)


def _with_gaps(
    standing: StandingMotion, lost: Bool[np.ndarray, "T"], motion: Motion
) -> StandingMotion:
    """Without a figure where what was bridged is nearest in time."""
    frames = np.arange(len(lost))
    nearest = np.rint(np.interp(standing.time, motion.time - motion.time[0], frames)).astype(int)
    points = np.where(lost[nearest, None, None], np.nan, standing.points)
    note = f"; left out are {lost.sum()} of {len(lost)} frames, in which the place there is unknown"
    return replace(standing, points=points, placing=standing.placing + note)


def _stand_in_shots(
    motion: Motion, parts: tuple[slice, ...], even_times: bool, world: World
) -> StandingMotion:
    """Each stretch of frames as `_stand` places it; NaN in the frames between."""
    _check_whole(motion)
    placed = [
        _stand(
            cut_motion(motion, part),
            False,
            None if world is None else replace(world, points=world.points[part]),
        )
        for part in parts
    ]
    points = np.full(motion.points3d.shape, np.nan)
    for part, standing in zip(parts, placed, strict=True):
        points[part] = standing.points
    time, fps = motion.time - motion.time[0], motion.fps
    if not is_uneven(motion):
        time = np.arange(len(time)) / fps
    elif even_times:
        uneven, time = time, np.linspace(0, time[-1], len(time))
        fps = (len(time) - 1) / float(time[-1])
        even = np.full(points.shape, np.nan)
        for part in parts:
            inside = (time >= uneven[part][0]) & (time <= uneven[part][-1])
            even[inside] = _resample(points[part], uneven[part], time[inside], motion.skeleton)
        points = even
    longest = max(range(len(parts)), key=lambda k: parts[k].stop - parts[k].start)
    alone = world is not None or len(parts) == 1
    apart = "" if alone else f"; each of {len(parts)} shots by itself"
    gaps = f", {(~motion.known).sum()} of them without a figure" if not motion.known.all() else ""
    return replace(
        placed[longest],
        points=points,
        time=time,
        fps=fps,
        placing=placed[longest].placing + apart,
        timing=describe_times(motion, even_times) + gaps,
    )


def _check_whole(motion: Motion) -> None:
    """KeyreconError where a frame lacks a joint and not all of them."""
    finite = np.isfinite(motion.points3d).all(axis=2)
    missing = np.argwhere(~finite & finite.any(axis=1, keepdims=True))
    if not finite.any():
        raise KeyreconError(NO_MOTION)
    if len(missing):
        frame, joint = missing[0]
        raise KeyreconError(
            f"Frame {frame} has no {motion.skeleton.names[joint]}; this format needs every joint, "
            "use .csv or .npz."
        )


def _stand(motion: Motion, even_times: bool, world: World) -> StandingMotion:
    """A motion of one shot in which every frame is known."""
    _check_whole(motion)
    units, size, lean = motion.units, stature(motion), camera_pitch(motion)
    placing = _describe_placing(lean)
    if world is not None:
        points = world.points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
        units, size = "m", stature(replace(motion, points3d=points))
        placing = IN_WORLD[world.origin]
    else:
        points = y_up(motion.points3d) @ Rotation.from_euler("x", -lean).as_matrix().T
        points[..., 1] -= _floor(points, motion, size)[:, None]
        points[..., [0, 2]] -= _middle(points, motion.skeleton)[0, [0, 2]]
    time, fps = motion.time - motion.time[0], motion.fps
    if not is_uneven(motion):
        time = np.arange(len(time)) / fps
    elif even_times:
        uneven, time = time, np.linspace(0, time[-1], len(time))
        points = _resample(points, uneven, time, motion.skeleton)
        fps = (len(time) - 1) / float(time[-1])
    return StandingMotion(
        skeleton=motion.skeleton,
        points=points,
        time=time,
        fps=fps,
        units=units,
        stature=size,
        placing=placing,
        timing=describe_times(motion, even_times),
    )


def describe_times(motion: Motion, even_times: bool = False) -> str:
    """How many frames there are, and whether they are those of the video."""
    count = f"{len(motion.time)} frames"
    if not is_uneven(motion):
        return f"{count}, those of the video, at {motion.fps:.6g} per second"
    if not even_times:
        return f"{count}, those of the video, at its own uneven times"
    rate = (len(motion.time) - 1) / float(motion.time[-1] - motion.time[0])
    return (
        f"{count}, as many as in the video, moved from its uneven times to even ones at "
        f"{rate:.6g} per second"
    )


def camera_pitch(motion: Motion) -> float:
    """How far the camera looked down, radians, as the legs tell it; 0 within `LEAN`."""
    names = motion.skeleton.names
    if not {f"{s}_{j}" for s in ("left", "right") for j in ("hip", "ankle")} <= set(names):
        return 0.0
    points = y_up(motion.points3d)
    ankles, hips = (
        (points[:, names.index(f"left_{j}")] + points[:, names.index(f"right_{j}")]) / 2
        for j in ("ankle", "hip")
    )
    legs = hips - ankles
    lean = float(np.median(np.arctan2(legs[:, 2], legs[:, 1])))
    return lean if abs(lean) > LEAN else 0.0


def _floor(
    points: Float[np.ndarray, "T J 3"], motion: Motion, size: float
) -> Float[np.ndarray, "T"]:
    """Height of the floor under each frame."""
    skeleton = motion.skeleton
    ankles = [j for j, name in enumerate(skeleton.names) if name.endswith("ankle")]
    ends = [j for j in range(len(skeleton.names)) if j not in skeleton.parents]
    lowest = points[:, ankles or ends, 1].min(axis=1)
    seconds = float(motion.time[-1] - motion.time[0])
    rate = (len(lowest) - 1) / seconds if seconds > 0 else motion.fps
    window = min(round(STANCE_SECONDS * rate), len(lowest) - 1) | 1
    # Mirrored at the ends: a copy of the last frame would follow a foot that is in the air.
    level = median_filter(lowest, window, mode="mirror")
    smooth = gaussian_filter1d(level, window / 4, mode="mirror")
    return smooth - (ANKLE_HEIGHT * size if ankles else 0.0)


def _middle(points: Float[np.ndarray, "T J 3"], skeleton: Skeleton) -> Float[np.ndarray, "T 3"]:
    """Middle of the hips, or the root of a skeleton without them."""
    hips = [j for j, name in enumerate(skeleton.names) if name in ("left_hip", "right_hip")]
    return points[:, hips or [skeleton.root]].mean(axis=1)


def _resample(
    points: Float[np.ndarray, "T J 3"],
    time: Float[np.ndarray, "T"],
    even: Float[np.ndarray, "N"],
    skeleton: Skeleton,
) -> Float[np.ndarray, "N J 3"]:
    """Joints at other times.

    Bones turn along the chord of their directions and lengths are interpolated, so that a bone of
    constant length keeps it.
    """
    resampled = np.empty((len(even), *points.shape[1:]))
    root = skeleton.root
    resampled[:, root] = _interpolate(even, time, points[:, root])
    for parent, child in skeleton.bones:
        bone = points[:, child] - points[:, parent]
        length = np.interp(even, time, np.linalg.norm(bone, axis=1))
        direction = unit_vectors(_interpolate(even, time, bone), 1e-12)
        resampled[:, child] = resampled[:, parent] + length[:, None] * direction
    return resampled


def _interpolate(
    at: Float[np.ndarray, "N"], time: Float[np.ndarray, "T"], values: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "N 3"]:
    return np.stack([np.interp(at, time, values[:, k]) for k in range(3)], axis=1)


def _describe_placing(lean: float) -> str:
    level = (
        "the camera is taken to be level"
        if lean == 0
        else f"the camera looked {'down' if lean > 0 else 'up'} by {abs(np.degrees(lean)):.0f} "
        "degrees as the legs tell it, which is taken out"
    )
    return (
        "feet on the floor at 0, estimated under the lower ankle second by second; hips over the "
        f"origin in the first frame; {level}"
    )
