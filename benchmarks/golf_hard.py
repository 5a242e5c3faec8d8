"""A rendered golf swing made harder in ways that are known: what the whole fit makes of it.

Run: python benchmarks/golf_hard.py OUT [--scene NAME] [--only ROW ...]

One scene of `golf.py` (OUT is its folder; what is there is used), fitted from its six clicks as
`keyrecon golf fit` does, as it is and

    hand       before a camera held by hand: up to 13 px, half a degree
    drift      before one that drifts by 4 % of the width
    practice   after a waggle and a practice swing to the top and slowly back
    repeats    with every fourth picture shown twice
    double     with a second golfer beside the player: himself, mirrored, three quarters as tall
    mirror     mirrored, with the player's other hand told: the same swing to the digit
    exchanged  with left and right of knees and ankles exchanged in the clicks: refused or warned of

Columns are those of `golf.py`, errors of the key postures in frames at 60 per second; joints are
measured in the frames of the swing that was asked for.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from golf import MOCAP, SCENES, Scene, click, club_angle, club_visible, film, learn_without

from keyrecon.app.golf import GolfFit, check_evidence, fit_video
from keyrecon.app.golf_training import read_swings
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks
from keyrecon.golf.records import MotionModel
from keyrecon.io.held_video import hold_frames, mirror_video
from keyrecon.io.video import Video, open_video
from keyrecon.io.video_writer import write_video
from keyrecon.metrics import pa_mpjpe, read_truth

Picture = np.ndarray
Truth = dict[str, np.ndarray]
HAND, DRIFT = 13.0, 0.04
"""Largest shift by hand, px, and the share of the width by which a camera drifts."""


@dataclass(frozen=True, eq=False)
class Row:
    """How a row differs from the scene."""

    order: np.ndarray
    """The scene's frame that each frame shows."""
    first: int = 0
    """The frame with which the swing that is asked for begins."""
    warp: Callable[[int], np.ndarray] = lambda _: np.eye(2, 3)
    """(2, 3): where the pixels of a frame go."""
    picture: Callable[[Picture], Picture] = lambda shown: shown


def hand_held(count: int, fps: float, size: tuple[int, int]) -> Callable[[int], np.ndarray]:
    """A camera held by hand: frequencies of a standing person's sway and tremor."""
    random, seconds = np.random.default_rng(1), np.arange(count) / fps
    path = np.zeros((count, 2))
    for hertz in (0.4, 0.9, 1.7, 3.1):
        for axis in (0, 1):
            path[:, axis] += np.sin(2 * np.pi * (hertz * seconds + random.random())) / hertz**0.5
    path *= HAND / np.abs(path).max()
    turn, middle = np.radians(0.5) * np.sin(2 * np.pi * 0.7 * seconds), np.array(size) / 2

    def warp(t: int) -> np.ndarray:
        c, s = np.cos(turn[t]), np.sin(turn[t])
        rotation = np.array([[c, -s], [s, c]])
        return np.column_stack([rotation, middle - rotation @ middle + path[t]])

    return warp


def beside(truth: Truth) -> Callable[[Picture], Picture]:
    """The player once more on the freer side, mirrored and smaller."""
    places = truth["points2d"].reshape(-1, 2)
    low, high = places.min(axis=0), places.max(axis=0)
    tall, middle = high[1] - low[1], float(low[0] + high[0]) / 2

    def picture(shown: Picture) -> Picture:
        width = shown.shape[1]
        side = 1 if width - 1 - high[0] > low[0] else -1
        reach = int(0.45 * tall)
        left, right = (int(np.clip(middle + k * reach, 0, width)) for k in (-1, 1))
        rows = slice(max(0, int(low[1] - 0.1 * tall)), int(high[1] + 0.05 * tall))
        other = np.ascontiguousarray(shown[rows, left:right][:, ::-1])
        other = cv2.resize(other, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
        start = int(middle + side * 0.9 * tall - other.shape[1] / 2)
        first, last = max(0, start), min(width, start + other.shape[1])
        out = shown.copy()
        out[rows.stop - len(other) : rows.stop, first:last] = other[:, first - start : last - start]
        return out

    return picture


def practice(keys: np.ndarray, count: int, fps: float) -> np.ndarray:
    """A waggle, twice, and a practice swing to the top and slowly back, then the swing."""
    start, top = keys[:2].round().astype(int)
    waggle = start + np.round(0.25 * (top - start) * np.sin(np.linspace(0, np.pi, int(0.6 * fps))))
    rest = np.full(int(0.5 * fps), start)
    back = np.linspace(top, start, int(1.5 * fps)).round()
    before = [rest, waggle, waggle, rest, np.arange(start, top + 1), back, rest]
    return np.concatenate([*before, np.arange(count)]).astype(int)


def make_row(name: str, truth: Truth, video: Video) -> Row:
    """A row of the table."""
    every, size = np.arange(len(video)), (video.width, video.height)
    if name == "hand":
        return Row(every, warp=hand_held(len(video), video.fps, size))
    if name == "drift":
        way = DRIFT * video.width * np.linspace(-0.5, 0.5, len(video))
        return Row(every, warp=lambda t: np.array([[1.0, 0, way[t]], [0, 1, 0]]))
    if name == "practice":
        order = practice(truth["keys"], len(video), video.fps)
        return Row(order, len(order) - len(video))
    if name == "repeats":
        return Row(np.sort(np.concatenate([every, every[::4]])))
    return Row(every, picture=beside(truth)) if name == "double" else Row(every)


def write_row(row: Row, video: Video, truth: Truth, path: Path) -> tuple[Video, Truth]:
    """The scene as a row shows it, written once, and its truth."""
    if not path.is_file():
        pictures = list(video.frames())
        size = (video.width, video.height)
        shown = (
            cv2.warpAffine(
                row.picture(pictures[k]), row.warp(t), size, borderMode=cv2.BORDER_REPLICATE
            )
            for t, k in enumerate(row.order)
        )
        write_video(path, shown, video.fps, 20)

    def move(points: np.ndarray) -> np.ndarray:
        warps = np.stack([row.warp(t) for t in range(len(row.order))])
        return np.einsum("tij,tnj->tni", warps[:, :, :2], points[row.order]) + warps[:, None, :, 2]

    last = np.arange(row.first, len(row.order))
    changed = truth | {
        "points3d": truth["points3d"][row.order],
        "points2d": move(truth["points2d"]),
        "club2d": move(truth["club2d"]),
        "club_visible": truth["club_visible"][row.order],
        "keys": np.interp(truth["keys"], row.order[last], last),
    }
    return open_video(path), changed


def exchange(clicks: GolfClicks) -> GolfClicks:
    """The clicks with left and right of knees and ankles exchanged."""
    joints = dict(clicks.joints)
    for joint in ("knee", "ankle"):
        one, other = f"left_{joint}", f"right_{joint}"
        joints[one], joints[other] = joints[other], joints[one]
    return replace(clicks, joints=joints)


def mirror(clicks: GolfClicks) -> GolfClicks:
    """The clicks in a mirror."""
    sides = {"left": "right", "right": "left"}
    joints = {}
    for name, (x, y) in clicks.joints.items():
        side, _, rest = name.partition("_")
        other = f"{sides[side]}_{rest}" if side in sides else name
        joints[other] = (clicks.size[0] - 1 - x, y)
    return replace(clicks, joints=joints, left_handed=not clicks.left_handed)


def describe(fit: GolfFit, truth: Truth, first: int, fps: float) -> str:
    """A row's figures."""
    fitted, part = fit.fitted, slice(first, None)
    ours, theirs = fitted.motion.points3d[part], truth["points3d"][part]
    keys = (fitted.keys - truth["keys"]) * 60 / fps
    off = club_angle(fitted.club2d, truth["club2d"])[part][club_visible(truth)[part]]
    warned = "; ".join(f"{doubt.text} ({doubt.frame})" for doubt in fit.doubts)
    return (
        f"PA-MPJPE {pa_mpjpe(1000 * ours, 1000 * theirs):5.1f} mm   keys {keys.round(1)}   "
        f"club {(off < 5).mean():4.0%}   {warned}"
    )


def check_mirror(ours: GolfFit, theirs: GolfFit) -> str:
    """Whether one fit is the other one's mirror image."""
    flipped = ours.fitted.motion.points3d[:, LSP14.mirror] * [-1.0, 1.0, 1.0]
    same = np.array_equal(flipped, theirs.fitted.motion.points3d)
    return "the mirrored swing to the digit" if same else "NOT the mirrored swing"


ROWS = ("plain", "hand", "drift", "practice", "repeats", "double", "mirror", "exchanged")


def fit_row(
    name: str, scene: Scene, folder: Path, model: MotionModel, truth: Truth, video: Video
) -> str:
    """Fit a row; returns its line."""
    row = make_row(name, truth, video)
    shown, changed = write_row(row, video, truth, folder / f"hard-{name}.mp4")
    held = hold_frames(shown)
    at_start = changed | {"points2d": changed["points2d"][row.first :]}
    clicks = click(at_start, scene, (video.width, video.height), SCENES.index(scene))
    clicks = replace(clicks, frame=row.first)
    if name == "exchanged":
        try:
            check_evidence(exchange(clicks), held, model, 1.0, "The clicks")
            found = fit_video(held, exchange(clicks), model)
        except KeyreconError as fault:
            return f"refused: {fault}"
        return describe(found, changed, row.first, video.fps)
    found = fit_video(held, clicks, model)
    if name == "mirror":
        return check_mirror(fit_video(mirror_video(held), mirror(clicks), model), found)
    return describe(found, changed, row.first, video.fps)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--scene", default="b-faceon-30", choices=[s.name for s in SCENES])
    parser.add_argument("--only", nargs="*", choices=ROWS, default=ROWS)
    parser.add_argument("--mocap", type=Path, default=MOCAP)
    arguments = parser.parse_args()
    swings = read_swings([arguments.mocap])
    (scene,) = (s for s in SCENES if s.name == arguments.scene)
    folder = film(scene, swings, arguments.out)
    truth, video = read_truth(folder / "truth.npz"), open_video(folder / "video.mp4")
    model = learn_without(scene.player, swings, arguments.out)
    for name in arguments.only:
        print(f"{name:<10}{fit_row(name, scene, folder, model, truth, video)}", flush=True)


if __name__ == "__main__":
    main()
