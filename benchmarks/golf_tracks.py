"""How well ankles, knees and the head are tracked through rendered swings, by several trackers.

Run: python benchmarks/golf_tracks.py SCENE [SCENE ...]

A SCENE is a folder of `benchmarks/golf.py` with video.mp4 and truth.npz. Every tracker begins at
the true place in the first frame. The paper uses the WSL tracker for these points; the others are
what OpenCV offers in its stead: pyramidal Lucas-Kanade from frame to frame, and CSRT. Printed are
the median and the 90th percentile of the distance to the truth, in per cent of the player's height,
over the frames in which the joint is visible.
"""

import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from keyrecon.body import LSP14
from keyrecon.golf.clicks import GolfClicks, clicked_pose
from keyrecon.golf.observe.appearance_tracker import track_patch
from keyrecon.golf.observe.foreground import Foreground, separate_player
from keyrecon.io.frame_reader import read_small
from keyrecon.io.video import open_video
from keyrecon.segmentation.color_model import to_lab

JOINTS = ("right_knee", "left_knee", "right_ankle", "left_ankle", "head_top")
PATCH = 0.1
"""Side of a tracked patch, player heights."""


def main() -> None:
    """Print a row per scene and tracker."""
    print(f"{'scene':22s}{'tracker':14s}{'median %':>9s}{'90 % below':>11s}")
    for folder in map(Path, sys.argv[1:]):
        for name, errors in measure(folder).items():
            print(f"{folder.name:22s}{name:14s}{np.median(errors):9.1f}"
                  f"{np.percentile(errors, 90):11.1f}", flush=True)  # fmt: skip


def measure(folder: Path) -> dict[str, np.ndarray]:
    """Errors of every tracker over joints and frames, per cent of the player's height."""
    video = open_video(folder / "video.mp4")
    truth = np.load(folder / "truth.npz")
    places, visible = truth["points2d"], truth["visible"]
    clicked = {name: tuple(places[0, LSP14.index(name)].tolist()) for name in JOINTS}
    clicked["root"] = tuple(places[0, [2, 3]].mean(axis=0).tolist())
    pose = clicked_pose(GolfClicks(0, (video.width, video.height), clicked))
    foreground = separate_player(video, pose)
    pictures = list(read_small(video, foreground.likely.shape[2]))
    measured: dict[str, list[np.ndarray]] = {name: [] for name in TRACKERS}
    for joint in JOINTS:
        index = LSP14.index(joint)
        offset = pose.head - pose.place(joint) if joint == "head_top" else np.zeros(2)
        start = (pose.place(joint) + offset) * foreground.shrink
        for name, track in TRACKERS.items():
            path = track(pictures, foreground, start, video.fps) / foreground.shrink - offset
            apart = np.linalg.norm(path - places[:, index], axis=1) / pose.height
            measured[name].append(100 * apart[visible[:, index]])
    return {name: np.concatenate(errors) for name, errors in measured.items()}


def track_by_wsl(
    pictures: list[np.ndarray], foreground: Foreground, start: np.ndarray, fps: float
) -> np.ndarray:
    """The tracker of the product."""
    lab = [to_lab(p) for p in pictures]
    height = foreground.height * foreground.shrink
    return track_patch(lab, list(foreground.likely), start, height, fps).places


def track_by_lucas_kanade(
    pictures: list[np.ndarray], foreground: Foreground, start: np.ndarray, fps: float
) -> np.ndarray:
    """Pyramidal Lucas-Kanade from frame to frame."""
    side = max(7, round(PATCH * foreground.height * foreground.shrink)) | 1
    grey = [cv2.cvtColor(p, cv2.COLOR_RGB2GRAY) for p in pictures]
    path = [start.astype(np.float32)[None]]
    for before, after in pairwise(grey):
        moved = cv2.calcOpticalFlowPyrLK(before, after, path[-1], None, winSize=(side, side))[0]
        path.append(moved)
    return np.concatenate(path).astype(float)


def track_by_csrt(
    pictures: list[np.ndarray], foreground: Foreground, start: np.ndarray, fps: float
) -> np.ndarray:
    """CSRT (Lukezic et al., CVPR 2017); a lost box stays where it was."""
    side = round(PATCH * foreground.height * foreground.shrink)
    box = [*(np.round(start).astype(int) - side // 2).tolist(), side, side]
    tracker = cv2.TrackerCSRT_create()
    tracker.init(pictures[0], box)
    path = [start]
    for picture in pictures[1:]:
        tracked, box = tracker.update(picture)
        path.append(np.array(box[:2]) + np.array(box[2:]) / 2 if tracked else path[-1])
    return np.array(path)


TRACKERS: dict[str, Callable[..., np.ndarray]] = {
    "WSL": track_by_wsl, "Lucas-Kanade": track_by_lucas_kanade, "CSRT": track_by_csrt,
}  # fmt: skip

if __name__ == "__main__":
    main()
