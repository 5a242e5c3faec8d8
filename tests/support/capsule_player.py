"""An athlete with the joints of LSP14 whose limbs are capsules: outlines without drawing."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from keyrecon.body import LSP14
from keyrecon.io.video import Video
from keyrecon.keyframes.distance_matrix import compare_frames
from keyrecon.records import (
    Annotations,
    CameraPath,
    Colors,
    Edges,
    HalfKeyframes,
    Keyframes,
    Preparation,
    Shots,
    Track,
)

STEP, INSIDE_SPACING = 0.018, 0.04
SHIRT, SHORTS, SKIN, HAIR = range(4)
STANDING = {  # player heights from the head, y down
    "head_top": (0.0, -0.08), "neck": (0.0, 0.10),
    "right_shoulder": (-0.13, 0.13), "left_shoulder": (0.13, 0.13),
    "right_elbow": (-0.25, 0.27), "left_elbow": (0.25, 0.27),
    "right_wrist": (-0.37, 0.37), "left_wrist": (0.37, 0.37),
    "right_hip": (-0.08, 0.46), "left_hip": (0.08, 0.46),
    "right_knee": (-0.13, 0.72), "left_knee": (0.13, 0.72),
    "right_ankle": (-0.16, 0.98), "left_ankle": (0.16, 0.98),
}  # fmt: skip
LIMBS = (  # from, to, radius, colour
    ("neck", "head_top", 0.055, HAIR),
    ("neck", "right_hip", 0.075, SHIRT), ("neck", "left_hip", 0.075, SHIRT),
    ("right_shoulder", "left_shoulder", 0.045, SHIRT),
    ("right_shoulder", "right_elbow", 0.035, SHIRT), ("left_shoulder", "left_elbow", 0.035, SHIRT),
    ("right_elbow", "right_wrist", 0.025, SKIN), ("left_elbow", "left_wrist", 0.025, SKIN),
    ("right_hip", "right_knee", 0.05, SHORTS), ("left_hip", "left_knee", 0.05, SHORTS),
    ("right_knee", "right_ankle", 0.033, SKIN), ("left_knee", "left_ankle", 0.033, SKIN),
)  # fmt: skip


def standing():
    """Joints (14, 2) of a standing player, player heights from the head."""
    return np.array([STANDING[name] for name in LSP14.names])


def turned(pose, joint, moved, angle):
    """The pose with joints `moved` turned about `joint`."""
    pose = pose.copy()
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    center = pose[LSP14.index(joint)]
    rows = [LSP14.index(name) for name in moved]
    pose[rows] = center + (pose[rows] - center) @ rotation.T
    return pose


def outline(pose, scale, origin):
    """Edge elements of a pose in px, region on the left; none inside a limb of its colour."""
    points, tangents, colors, owners = [], [], [], []
    ends = [(pose[LSP14.index(a)], pose[LSP14.index(b)]) for a, b, _, _ in LIMBS]
    for row, ((start, stop), (_, _, radius, color)) in enumerate(zip(ends, LIMBS, strict=True)):
        length = np.linalg.norm(stop - start)
        axis = (stop - start) / length
        side = np.array([-axis[1], axis[0]])
        along = np.arange(0, length, STEP)[:, None]
        turn = np.arange(0, np.pi, STEP / radius)[:, None]
        arc = np.cos(turn) * side + np.sin(turn) * axis
        across = np.tile(side, (len(along), 1))
        normal = np.concatenate([across, arc, -across, -arc])
        base = [start + along * axis, np.tile(stop, (len(arc), 1))]
        base += [stop - along * axis, np.tile(start, (len(arc), 1))]
        points.append(np.concatenate(base) + radius * normal)
        # y points down: left of the tangent (1, 0) is (0, -1), up on the picture
        tangents.append(np.stack([normal[:, 1], -normal[:, 0]], axis=1))
        colors.append(np.full(len(normal), color))
        owners.append(np.full(len(normal), row))
    points, tangents, colors, owners = map(np.concatenate, (points, tangents, colors, owners))
    kept = np.ones(len(points), dtype=bool)
    for row, ((start, stop), (_, _, radius, color)) in enumerate(zip(ends, LIMBS, strict=True)):
        bone = stop - start
        foot = np.clip((points - start) @ bone / (bone @ bone), 0, 1)[:, None]
        inside = np.linalg.norm(points - start - foot * bone, axis=1) < radius - 1e-9
        kept &= ~(inside & (colors == color) & (owners != row))
    points, tangents, colors = points[kept], tangents[kept], colors[kept]
    upper, lower = points[:, 1] < 0.46, points[:, 1] > 0.38
    inside = silhouette(pose) * scale + origin
    return Edges(points * scale + origin, tangents, colors, upper, lower, inside)


def silhouette(pose):
    """Places of a grid within any limb of a pose, player heights."""
    across = INSIDE_SPACING * np.arange(-40, 41)
    grid = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
    inside = np.zeros(len(grid), dtype=bool)
    for a, b, radius, _ in LIMBS:
        start, bone = pose[LSP14.index(a)], pose[LSP14.index(b)] - pose[LSP14.index(a)]
        along = np.clip((grid - start) @ bone / (bone @ bone), 0, 1)[:, None]
        inside |= np.linalg.norm(grid - start - along * bone, axis=1) < radius
    return grid[inside]


def scene(poses, keyframes, scale=180.0, origin=(600.0, 200.0)):
    """(preparation, truth (T, 14, 2) px) of poses; scale and origin may differ by frame."""
    count = len(poses)
    scale = np.broadcast_to(scale, count).astype(float)
    origin = np.broadcast_to(origin, (count, 2)).astype(float)
    edges = tuple(map(outline, poses, scale, origin))
    truth = np.asarray(poses) * scale[:, None, None] + origin[:, None]
    feet = truth[:, [LSP14.index("right_ankle"), LSP14.index("left_ankle")]]
    height = feet.mean(axis=1)[:, 1] - origin[:, 1]
    track = Track(origin, feet, height, np.zeros((count, 4)), np.ones(count))
    comparison = compare_frames(edges, track)
    halves = [_assign(getattr(comparison, name), keyframes) for name in ("upper", "lower")]
    camera = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))
    colors = Colors((), np.zeros((0, 8)), np.zeros(8), 1.0)
    prepared = Preparation(
        pictures(count),
        camera,
        colors,
        track,
        edges,
        comparison,
        Keyframes(*halves, 10, 0.95),
        Shots.between((), count),
    )
    return prepared, truth


def _assign(distance, keyframes):
    frames = np.array(keyframes)
    best = distance[:, frames].argmin(axis=1)
    nearest = distance[:, frames].min(axis=1)
    return HalfKeyframes(
        frames, frames[best], np.ones(len(distance), bool), 1.0, 0.02, nearest, len(frames)
    )


def marks(truth, keyframes):
    """The truth on the keyframes."""
    frames = np.array(keyframes)
    seen = np.ones((len(frames), 14), bool)
    return Annotations(LSP14, frames, truth[frames], seen, np.zeros((len(frames), 13), int))


def hide(annotations, name):
    """The same with a joint that is placed though hidden on all frames."""
    visible = annotations.visible.copy()
    visible[:, LSP14.index(name)] = False
    return replace(annotations, visible=visible)


class Pictures(Video):
    """A video whose textured picture never changes, without a file."""

    def frames(self, start=0, stop=None, width=None):
        """The same picture over and over."""
        every = -(-self.width // width) if width else 1
        picture = np.random.default_rng(0).integers(0, 255, (self.height, self.width, 3))
        for _ in range(start, len(self) if stop is None else stop):
            yield picture.astype(np.uint8)[::every, ::every]

    def chosen_frames(self, numbers, last):
        """Some of them."""
        yield from (p for n, p in enumerate(self.frames(0, last + 1)) if n in numbers)


def pictures(count, fps=50.0):
    """A video of `count` pictures that never change."""
    stamps = np.arange(count)
    return Pictures(Path("none.mp4"), 1280, 720, stamps, stamps / fps, fps, 0, False, None)
