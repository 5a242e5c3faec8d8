"""Real clips with their marks, changed in ways that are known."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import real
from court_variants import barred, blurred, captioned, noisy, tone

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video

ROWS = 720.0
"""Rows of the picture for which lengths are told."""
Picture = np.ndarray


@dataclass(frozen=True, eq=False)
class Change:
    """How a variant differs from its clip."""

    picture: Callable[[int, Picture], Picture]
    warp: Callable[[int], np.ndarray]
    """(2, 3): where pixels of a frame go."""
    step: int = 1
    """Every how manieth frame is shown."""
    crf: int = 20


def same_place(_: int) -> np.ndarray:
    """No pixel moves."""
    return np.eye(2, 3)


def shake(clip: real.Clip) -> Change:
    """A camera that drifts and is held by hand."""
    video, random = clip.video, np.random.default_rng(1)
    seconds = np.arange(len(video)) / video.fps
    path = np.zeros((len(video), 2))
    for hertz in (0.4, 0.9, 1.7, 3.1):
        for axis in (0, 1):
            path[:, axis] += np.sin(2 * np.pi * (hertz * seconds + random.random())) / hertz**0.5
    path *= 13 * video.height / ROWS / np.abs(path).max()
    path[:, 0] += 0.04 * video.width * np.linspace(-0.5, 0.5, len(video))
    turn = np.radians(0.4) * np.sin(2 * np.pi * 0.7 * seconds)

    def warp(t: int) -> np.ndarray:
        c, s = np.cos(turn[t]), np.sin(turn[t])
        middle = np.array([video.width, video.height]) / 2
        rotation = np.array([[c, -s], [s, c]])
        return np.column_stack([rotation, middle - rotation @ middle + path[t]])

    def picture(t: int, shown: Picture) -> Picture:
        size = video.width, video.height
        return cv2.warpAffine(shown, warp(t), size, borderMode=cv2.BORDER_REPLICATE)

    return Change(picture, warp)


def crowd(clip: real.Clip) -> Change:
    """People who sway close beside the player."""
    video, random = clip.video, np.random.default_rng(2)
    marked = clip.truth.joints.reshape(-1, 2)
    low, high = np.nanmin(marked, axis=0), np.nanmax(marked, axis=0)
    tall = high[1] - low[1]
    people = []
    for side, edge in ((-1, low[0]), (1, high[0])):
        for away in (0.22, 0.5, 0.8):
            people.append(
                (edge + side * away * tall, random.random(), random.integers(30, 226, (3, 3)))
            )

    def picture(t: int, shown: Picture) -> Picture:
        out, second = shown.copy(), t / video.fps
        for x, phase, colours in people:
            sway = 0.03 * tall * np.sin(2 * np.pi * (0.5 * second + phase))
            at = np.array([x + sway, high[1] - 0.02 * tall])
            parts = (
                ((0, -0.24), (0.07, 0.24)),
                ((0, -0.62), (0.1, 0.18)),
                ((0, -0.88), (0.05, 0.07)),
            )
            for (middle, axes), colour in zip(parts, colours.tolist(), strict=True):
                centre = np.rint(at + tall * np.array(middle)).astype(int)
                size = np.rint(tall * np.array(axes)).astype(int)
                cv2.ellipse(out, centre.tolist(), size.tolist(), 0, 0, 360, colour, -1, cv2.LINE_AA)
        return out

    return Change(picture, same_place)


def half(clip: real.Clip) -> Change:
    """Half the size, compressed hard."""
    size = tuple(n // 4 * 2 for n in (clip.video.width, clip.video.height))

    def picture(_: int, shown: Picture) -> Picture:
        return cv2.resize(shown, size, interpolation=cv2.INTER_AREA)

    scale = size[0] / clip.video.width
    reduced = np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2]])
    return Change(picture, lambda _: reduced, crf=32)


def rate(_: real.Clip) -> Change:
    """Every other frame."""
    return Change(lambda _, shown: shown, same_place, step=2)


def dark(_: real.Clip) -> Change:
    """A third of the light, and noise."""
    random = np.random.default_rng(3)

    def picture(_: int, shown: Picture) -> Picture:
        noise = random.normal(0, 6, shown.shape[:2])[..., None]
        return np.clip(shown / 3 + noise, 0, 255).astype(np.uint8)

    return Change(picture, same_place)


def looks(look: Callable[[Picture, int], Picture], crf: int = 20) -> Callable[[real.Clip], Change]:
    """Pixels stay where they are and look otherwise."""
    return lambda _: Change(lambda t, shown: look(shown, t), same_place, crf=crf)


def repeats(_: real.Clip) -> Change:
    """Every fourth picture stands in the next one's place too."""
    held: list[Picture] = []

    def picture(t: int, shown: Picture) -> Picture:
        if t % 4 != 1:
            held[:] = [shown]
        return held[0]

    return Change(picture, same_place)


def lit(clip: real.Clip) -> Change:
    """Light that flickers by a tenth, and doubles while the clip lasts."""

    def picture(t: int, shown: Picture) -> Picture:
        flicker = 1 + 0.1 * np.sin(2 * np.pi * 8.3 * t / clip.video.fps)
        light = flicker * 2 ** (t / len(clip.video) - 0.7)
        return np.clip(shown * light, 0, 255).astype(np.uint8)

    return Change(picture, same_place)


def turned(warp: Callable[[int], np.ndarray]) -> Change:
    """A camera that moves, or is held, so."""

    def picture(t: int, shown: Picture) -> Picture:
        size = shown.shape[1], shown.shape[0]
        return cv2.warpAffine(shown, warp(t), size, borderMode=cv2.BORDER_REPLICATE)

    return Change(picture, warp)


def zoom(clip: real.Clip) -> Change:
    """A camera that zooms in by a quarter, on the player's place."""
    middle = np.nanmedian(clip.truth.joints.reshape(-1, 2), axis=0)

    def warp(t: int) -> np.ndarray:
        scale = 1 + 0.25 * t / len(clip.video)
        return np.column_stack([scale * np.eye(2), (1 - scale) * middle])

    return turned(warp)


def rolled(clip: real.Clip) -> Change:
    """A camera that is held askew by four degrees."""
    middle = (clip.video.width - 1) / 2, (clip.video.height - 1) / 2
    return turned(lambda _: cv2.getRotationMatrix2D(middle, 4.0, 1.0))


def without_colours(shown: Picture, _: int) -> Picture:
    """Brightness alone."""
    return cv2.cvtColor(cv2.cvtColor(shown, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)


def framed(shown: Picture, t: int) -> Picture:
    """Bars, a table of scores and a caption."""
    return barred(0.06)(captioned(shown, t), t)


CLIP_CHANGES: dict[str, Callable[[real.Clip], Change]] = {
    "plain": looks(lambda shown, _: shown),
    "half": half,
    "rate": rate,
    "repeats": repeats,
    "dark": dark,
    "flat": looks(tone(0.35, 90)),
    "bright": looks(tone(1.5, 20)),
    "noise": looks(noisy(14)),
    "grey": looks(without_colours),
    "lit": lit,
    "blur": looks(blurred(0.0022)),
    "shake": shake,
    "zoom": zoom,
    "crowd": crowd,
    "framed": looks(framed),
    "rolled": rolled,
}
"""What clips of any kind are put through."""


def move_points(change: Change, frame: int, points: np.ndarray) -> np.ndarray:
    """Where (..., 2) points of a frame go."""
    warp = change.warp(frame)
    return points @ warp[:, :2].T + warp[:, 2]


def change_clip(clip: real.Clip, change: Change, path: Path) -> real.Clip:
    """A clip with its truth as a variant shows it; the file is written once."""
    step = change.step
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        shown = (change.picture(t, p) for t, p in enumerate(clip.video.frames()) if t % step == 0)
        write_video(path, shown, clip.video.fps / step, crf=change.crf)
    truth, video = clip.truth, open_video(path)
    rows = np.flatnonzero(truth.frames % step == 0)
    joints = np.stack([move_points(change, int(truth.frames[k]), truth.joints[k]) for k in rows])
    marks = replace(
        truth, frames=truth.frames[rows] // step, joints=joints, visible=truth.visible[rows],
        nearer=truth.nearer[rows], absent=(),
    )  # fmt: skip
    scale = float(np.linalg.norm(change.warp(0)[:, 0]))
    return replace(
        clip, video=video, truth=marks, seen=clip.seen[rows], action=clip.action[rows],
        torso=scale * clip.torso,
    )  # fmt: skip
