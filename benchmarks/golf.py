"""Accuracy of `keyrecon golf fit` on rendered swings that the prior has not seen.

Run: python benchmarks/golf.py OUT [--mocap FOLDER] [--only NAME ...]

FOLDER holds two captured swings of different players (default ../shared/data/mocap/golf). Each is
filmed face-on and down the line, at 30 and 60 frames per second, with a club and motion blur, and
also at another tempo and with a steeper or flatter plane. The prior is learnt from the other
player's swing alone. A person is imitated who clicks six points in the first frame (3 px noise),
gives the true stature and knows nothing of the camera.

Rows of the table: the mean motion as it is placed at the start; joints alone; everything; the
paper's sliding windows; everything and four annotated keyframes.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from keyrecon.body import LSP14
from keyrecon.formats.motion_model import read_motion_model, write_motion_model
from keyrecon.golf.clicks import Clicks
from keyrecon.golf.fit import FitOptions, WeightOptions
from keyrecon.golf.look import LookOptions, look_at_swing
from keyrecon.golf.records import FittedSwing, Marks, MotionModel, Observations, Swing
from keyrecon.golf.retarget import change_swing
from keyrecon.golf.skeleton import size_body, turns_from_swing
from keyrecon.golf.train import TrainOptions, collect_swings, learn_motion
from keyrecon.golf.variation import tilt_arms
from keyrecon.golf_job import GolfOptions, fit_observations
from keyrecon.metrics import evaluate_motion, read_truth
from keyrecon.storage import load_record, save_record
from keyrecon.swings import read_swings
from keyrecon.synthetic.cameras import CameraOptions, View
from keyrecon.synthetic.golf import SwingFilm, film_swing
from keyrecon.synthetic.sequence import SceneOptions
from keyrecon.video import Video, open_video

MOCAP = Path(__file__).parent.parent.parent / "shared" / "data" / "mocap" / "golf"
CLICKED = ("head_top", "right_knee", "left_knee", "right_ankle", "left_ankle")
CLICK_NOISE = 3.0


@dataclass(frozen=True)
class Scene:
    """One filmed swing."""

    name: str
    player: int
    view: View
    fps: float
    tempo: float = 1.0
    plane: float = 0.0
    """Degrees by which the arms are steeper than captured."""
    left_handed: bool = False


SCENES = (
    Scene("a-faceon-60", 0, View.FACE_ON, 60.0),
    Scene("a-dtl-30", 0, View.DOWN_THE_LINE, 30.0),
    Scene("b-faceon-30", 1, View.FACE_ON, 30.0),
    Scene("b-dtl-60", 1, View.DOWN_THE_LINE, 60.0),
    Scene("a-faceon-fast-60", 0, View.FACE_ON, 60.0, tempo=1.4),
    Scene("b-dtl-steep-30", 1, View.DOWN_THE_LINE, 30.0, tempo=1.3, plane=10.0),
    Scene("a-faceon-left-30", 0, View.FACE_ON, 30.0, plane=-8.0, left_handed=True),
)


def film(scene: Scene, swings: tuple[Swing, ...], out: Path) -> Path:
    """Render a scene, once."""
    folder = out / scene.name
    if (folder / "truth.npz").is_file():
        return folder
    swing = swings[scene.player]
    if scene.plane:
        turns, place = turns_from_swing(swing)
        tilt_arms(swing, turns, scene.plane)
        swing = change_swing(swing, size_body(swing.stature), turns, place)
    options = SceneOptions(
        seed=SCENES.index(scene),
        camera=CameraOptions(scene.view, player_px=370.0),
        shutter=0.006 if scene.fps > 50 else 0.010,
        left_handed=scene.left_handed,
        workers=1,
    )
    film_swing(swing, SwingFilm(options, scene.fps, tempo=scene.tempo), folder)
    return folder


def click(truth: dict[str, np.ndarray], scene: Scene, size: tuple[int, int], seed: int) -> Clicks:
    """What a person clicks in the first frame."""
    rng = np.random.default_rng([seed, 77])
    first = truth["points2d"][0]
    places = {name: first[LSP14.index(name)] for name in CLICKED}
    places["root"] = first[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    clicked = {
        name: tuple((p + rng.normal(0, CLICK_NOISE, 2)).tolist()) for name, p in places.items()
    }
    return Clicks(0, size, clicked, left_handed=scene.left_handed, stature=float(truth["height_m"]))


def annotate(truth: dict[str, np.ndarray], seed: int) -> Marks:
    """All joints of four frames: address, top, hit and finish, marked with 2 px of noise."""
    frames = np.unique(np.round(truth["keys"]).astype(int))
    rng = np.random.default_rng([seed, 78])
    joints = truth["points2d"][frames]
    return Marks(frames, joints + rng.normal(0, 2.0, joints.shape))


def learn_without(player: int, swings: tuple[Swing, ...], out: Path) -> MotionModel:
    """The prior of the other player's swing, made once."""
    file = out / f"prior-without-{'ab'[player]}.npz"
    if not file.is_file():
        options = TrainOptions()
        database = collect_swings((swings[1 - player],), options)
        write_motion_model(file, learn_motion(database, "the other player's swing", options))
    return read_motion_model(file)


def look(video: Video, clicks: Clicks, model: MotionModel, folder: Path) -> Observations:
    """What is seen in a video, kept beside it."""
    file = folder / "seen.npz"
    if not file.is_file():
        began = time.perf_counter()
        save_record(file, look_at_swing(video, clicks, model.keys, LookOptions()))
        (folder / "seconds.txt").write_text(f"{time.perf_counter() - began:.1f}")
    return load_record(file)


POINTS = WeightOptions(foreground=0.0, away=0.0, matches=0.0)
WAYS = {
    "joints alone": GolfOptions(fit=FitOptions(weights=replace(POINTS, club=0.0))),
    "joints and club": GolfOptions(fit=FitOptions(weights=POINTS)),
    "everything": GolfOptions(),
    "windows of the paper": GolfOptions(method="windows"),
}


@dataclass(frozen=True)
class Result:
    """Errors of one fit."""

    pa_mpjpe: float
    n_mpjpe: float
    keys: float
    """Largest error of top and hit, in frames at 60 per second."""
    club: float
    """Share of the frames in which the fitted club is within 5 degrees in the picture."""
    seconds: float


def judge(fitted: FittedSwing, truth: dict[str, np.ndarray], fps: float, seconds: float) -> Result:
    """Errors against the truth."""
    scores = evaluate_motion(fitted.motion, truth)
    apart = np.abs(fitted.keys - truth["keys"])[1:3].max() * 60 / fps
    off = club_angle(fitted.club_seen, truth["club2d"])
    return Result(scores.pa_mpjpe, scores.n_mpjpe, float(apart), float((off < 5).mean()), seconds)


def club_angle(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Angle between two clubs in the picture, degrees; NaN where one is not known."""
    ways = [ends[:, 1] - ends[:, 0] for ends in (ours, theirs)]
    turn = ways[0][:, 0] * ways[1][:, 1] - ways[0][:, 1] * ways[1][:, 0]
    return np.degrees(np.abs(np.arctan2(turn, (ways[0] * ways[1]).sum(axis=1))))


def fit_all(scene: Scene, swings: tuple[Swing, ...], out: Path) -> Iterator[tuple[str, Result]]:
    """All rows of a scene."""
    folder = film(scene, swings, out)
    truth, video = read_truth(folder / "truth.npz"), open_video(folder / "video.mp4")
    model = learn_without(scene.player, swings, out)
    clicks = click(truth, scene, (video.width, video.height), SCENES.index(scene))
    seen = look(video, clicks, model, folder)
    off = club_angle(seen.club, truth["club2d"])
    found = np.isfinite(off)
    spent = (folder / "seconds.txt").read_text()
    apart = np.round((seen.keys - truth["keys"]) * 60 / scene.fps, 1)
    print(
        f"{scene.name}: {len(video)} frames, looked at in {spent} s; "
        f"club seen in {found.mean():.0%}, within 5 degrees in {(off[found] < 5).mean():.0%} of "
        f"these; keys off by {apart} frames at 60/s"
    )
    still = GolfOptions(fit=replace(FitOptions(), steps=0))
    marked = replace(seen, marks=annotate(truth, SCENES.index(scene)))
    rows = {"mean motion at the start": (seen, still)}
    rows |= {name: (seen, way) for name, way in WAYS.items()}
    rows["and four keyframes"] = (marked, GolfOptions())
    for name, (observations, options) in rows.items():
        began = time.perf_counter()
        fitted = fit_observations(observations, clicks, model, video, options)
        yield name, judge(fitted, truth, scene.fps, time.perf_counter() - began)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--mocap", type=Path, default=MOCAP)
    parser.add_argument("--only", nargs="*")
    told = parser.parse_args()
    swings = read_swings([told.mocap])
    together: dict[str, list[Result]] = {}
    for scene in [s for s in SCENES if not told.only or s.name in told.only]:
        for name, result in fit_all(scene, swings, told.out):
            together.setdefault(name, []).append(result)
            print_row(name, [result])
    print(f"\nMean of {len(next(iter(together.values())))} scenes")
    for name, results in together.items():
        print_row(name, results)


def print_row(name: str, results: list[Result]) -> None:
    """One line of the table."""
    pa, n, keys, club, seconds = np.mean(
        [(r.pa_mpjpe, r.n_mpjpe, r.keys, r.club, r.seconds) for r in results], axis=0
    )
    print(f"  {name:<26} PA-MPJPE {pa:5.1f} mm   N-MPJPE {n:6.1f} mm   top and hit {keys:4.1f} "
          f"frames   club {club:4.0%}   {seconds:5.1f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
