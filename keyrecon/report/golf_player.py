"""The player of a swing's report: the video with figure and paths on it, and the body in space.

The page draws figure and paths itself, so that they can be put on and off, over a small video that
is cut to where the swing happens. One or two swings; the second is shown at the moment of the first
swing's frame, by the key postures: between two of them time is stretched evenly.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.golf.records import RecordedSwing
from keyrecon.io.video import Video
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.report.drawing import bone_sides, drawn_bones, head_bone, trunk_outline
from keyrecon.report.golf_measures import KEY_NAMES
from keyrecon.report.markup import data_block, pack, text, to_json
from keyrecon.report.pictures import CLIP_QUALITY, video_uri

CLIP_HEIGHT, CLIP_WIDTH = 560, 620
"""Largest sides of the small video, px."""
SEEK_EVERY = 5
"""Frames between two that a browser can jump to; scrubbing decodes this many."""
ROOM = 0.12
"""Around the player, shares of his height."""
ANKLE = 0.05
"""Of the ankles above the ground, shares of the height of the figure."""


@dataclass(frozen=True, eq=False)
class SwingClip:
    """The small video of a swing and where it lies in the pictures."""

    name: str
    uri: str
    size: tuple[int, int]
    """Width and height, px."""
    corner: Float[np.ndarray, "2"]
    """Its upper left corner in the pictures, px."""
    scale: float
    """px of the small video per px of the pictures."""


@dataclass(frozen=True)
class SwingWindow:
    """The part of the pictures in which a swing happens, px."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def part(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


def find_window(video: Video, swing: RecordedSwing) -> SwingWindow:
    """Where player and club are at any time to which the swing was fitted."""
    body = swing.motion.points2d[swing.fitted].reshape(-1, 2)
    room = ROOM * np.ptp(body[:, 1])
    size = np.array([video.width, video.height])
    club = np.clip(swing.club2d[swing.fitted].reshape(-1, 2), 0, size)
    low = np.maximum(np.minimum(body.min(axis=0) - room, club.min(axis=0) - room / 4), 0)
    high = np.minimum(np.maximum(body.max(axis=0) + room, club.max(axis=0) + room / 4), size)
    (left, top), (right, bottom) = low.astype(int).tolist(), high.astype(int).tolist()
    if right - left < 16 or bottom - top < 16:  # a fit that went out of the picture
        return SwingWindow(0, 0, video.width, video.height)
    return SwingWindow(left, top, right, bottom)


def cut_clip(video: Video, swing: RecordedSwing, progress: Progress = silent) -> SwingClip:
    """The small video of a swing, at the pace of its motion."""
    window = find_window(video, swing)
    width, height = window.right - window.left, window.bottom - window.top
    scale = min(1.0, CLIP_HEIGHT / height, CLIP_WIDTH / width)
    size = (2 * max(8, round(width * scale / 2)), 2 * max(8, round(height * scale / 2)))
    pictures = (
        cv2.resize(picture[window.part], size, interpolation=cv2.INTER_AREA)
        for picture in progress(video.frames(), "Cutting the report's video", len(video))
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        write_video(path, pictures, swing.motion.fps, CLIP_QUALITY, SEEK_EVERY)
        uri = video_uri(path.read_bytes())
    corner = np.array([window.left, window.top], float)
    return SwingClip(video.path.name, uri, size, corner, size[0] / width)


def player(swings: Sequence[RecordedSwing], clips: Sequence[SwingClip]) -> str:
    """The player; the page has one."""
    names = ("A", "B")[: len(swings)] if len(swings) > 1 else ("",)
    cells = "".join(
        _cell(number, name, clip)
        for number, (name, clip) in enumerate(zip(names, clips, strict=True))
    )
    postures = "".join(
        f'<button type="button" data-key="{number}">{name}</button>'
        for number, name in enumerate(KEY_NAMES)
    )
    views = "".join(
        f'<button type="button" data-yaw="{yaw}" data-pitch="{pitch}">{name}</button>'
        for name, yaw, pitch in (
            ("Camera", 0, 0), ("Right", 90, 0), ("Left", -90, 0), ("Above", 0, 90), ("Free", 35, 18)
        )
    )  # fmt: skip
    kind = "two" if len(swings) > 1 else "one"
    return (
        f'<div class="golf-player {kind}">{cells}</div><div class="views-bar">'
        f'<span class="chooser">Go to</span>{postures}<span class="chooser">In 3D from</span>'
        f'{views}<label><input type="checkbox" id="show-figure" checked> figure</label>'
        '<label><input type="checkbox" id="show-paths" checked> hands and club</label></div>'
        f"{_transport()}{data_block('golf-data', to_json(_numbers(swings, clips)))}"
    )


def _cell(number: int, name: str, clip: SwingClip) -> str:
    caption = f"<figcaption>{name}: {text(clip.name)}</figcaption>" if name else ""
    return (
        f'<figure class="swing">{caption}<div class="screens"><div class="screen" '
        f'style="aspect-ratio:{clip.size[0]}/{clip.size[1]}">'
        f'<video data-swing="{number}" src="{clip.uri}" muted playsinline preload="auto" '
        f'aria-label="The swing {name}"></video><canvas data-drawn="{number}"></canvas></div>'
        f'<div class="plate"><canvas data-space="{number}" tabindex="0" '
        f'aria-label="Turnable 3D figure {name}"></canvas></div></div>'
        f'<output data-now="{number}"></output></figure>'
    )


def _transport() -> str:
    speeds = "".join(
        f'<option value="{speed}"{" selected" if speed == 0.25 else ""}>{speed:g}&times;</option>'
        for speed in (0.05, 0.1, 0.25, 0.5, 1)
    )
    return (
        '<footer class="transport"><button type="button" id="play" aria-label="Play">▶</button>'
        '<input type="range" id="frame" min="0" value="0" step="1" aria-label="Frame">'
        f'<label>speed <select id="speed">{speeds}</select></label></footer>'
    )


def _numbers(swings: Sequence[RecordedSwing], clips: Sequence[SwingClip]) -> dict[str, object]:
    """What the page's script draws from."""
    return {
        "names": list(KEY_NAMES),
        "swings": [_swing_numbers(s, c) for s, c in zip(swings, clips, strict=True)],
    }


def _swing_numbers(swing: RecordedSwing, clip: SwingClip) -> dict[str, object]:
    motion, skeleton = swing.motion, swing.motion.skeleton
    shown = np.where(swing.fitted, 1.0, np.nan)[:, None, None]
    flat = shown * np.concatenate([motion.points2d, swing.club2d], axis=1)
    solid = np.concatenate([swing.standing_points, swing.standing_club], axis=1)
    solid = solid @ Rotation.align_vectors([[0, -1, 0]], [swing.vertical])[0].as_matrix().T
    first = int(np.clip(np.nan_to_num(np.round(swing.keys[0])), 0, len(solid) - 1))
    height = float(np.ptp(solid[first, : len(skeleton.names), 1]))
    hips = [skeleton.index("right_hip"), skeleton.index("left_hip")]
    ankles = [skeleton.index("right_ankle"), skeleton.index("left_ankle")]
    middle = solid[first, hips].mean(axis=0)
    level = float(solid[first, ankles, 1].mean() + ANKLE * height)
    joints = len(skeleton.names)
    return {
        "fps": motion.fps,
        "time": pack(motion.time),
        "size": list(clip.size),
        "flat": pack((flat - clip.corner + 0.5) * clip.scale - 0.5),
        "solid": pack(solid - middle),
        "level": level - float(middle[1]),
        "height": height,
        "units": motion.units,
        "bones": [*drawn_bones(skeleton).tolist(), [joints, joints + 1]],
        "sides": [*bone_sides(skeleton).tolist(), 3],
        "trunk": trunk_outline(skeleton),
        "head": head_bone(skeleton),
        "keys": np.nan_to_num(swing.keys).round(2).tolist(),
    }
