"""Accuracy of `keyrecon golf fit` on rendered swings that the prior has not seen.

Run: python benchmarks/golf.py OUT [--mocap FOLDER] [--only NAME ...]

FOLDER holds two captured swings of different players (default ../shared/data/mocap/golf). Each is
filmed face-on and down the line, at 30 and 60 frames per second, with a club and motion blur, and
also at another tempo and with a steeper or flatter plane. The prior is learnt from the other
player's swing alone. A person is imitated who clicks six points in the first frame (3 px noise),
gives the true stature and knows nothing of the camera.

Rows of the table: the mean motion as it is placed at the start; joints alone; joints and club;
everything; everything with guided club detection, which is what `keyrecon golf fit` gives; the
paper's sliding windows; and four annotated keyframes besides. A club counts as visible where at
least half of its shaft stands out from what is behind it, and seems at least a third as long as the
longest it seems in the film: one that points at the camera has no angle.

OUT/SCENE/ablation.jpg shows the rows: the fitted golfer at the key postures in the picture.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from keyrecon.app.golf_recipe import refine_fit
from keyrecon.app.golf_training import read_swings
from keyrecon.body import LSP14
from keyrecon.golf.candidates import find_candidates, place_in_film
from keyrecon.golf.clicks import ClickedPose, GolfClicks, clicked_pose
from keyrecon.golf.fit.fitting import FitOptions, WeightOptions
from keyrecon.golf.observation import observe_swing
from keyrecon.golf.observe.film import Film
from keyrecon.golf.prior.captured_swing import change_swing
from keyrecon.golf.prior.skeleton import size_body, turns_from_swing
from keyrecon.golf.prior.training import TrainOptions, collect_swings, learn_motion
from keyrecon.golf.prior.variation import tilt_arms
from keyrecon.golf.records import (
    NO_MARKS,
    FittedSwing,
    MotionModel,
    Observations,
    Swing,
    SwingMarks,
)
from keyrecon.golf.scene import observe_scene
from keyrecon.golf.swing_fit import GolfOptions, fit_observations
from keyrecon.io.formats.model_file import read_motion_model, write_motion_model
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.io.held_video import hold_frames
from keyrecon.io.storage import load_record, save_record
from keyrecon.io.video import Video, open_video
from keyrecon.metrics import evaluate_motion, read_truth
from keyrecon.report.golf_pictures import draw_golfer
from keyrecon.synthetic.cameras import CameraPlanOptions, View
from keyrecon.synthetic.golf import SwingFilm, film_swing
from keyrecon.synthetic.sequence import SceneOptions

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
        camera=CameraPlanOptions(scene.view, player_px=370.0),
        shutter=0.006 if scene.fps > 50 else 0.010,
        left_handed=scene.left_handed,
        workers=1,
    )
    film_swing(swing, SwingFilm(options, scene.fps, tempo=scene.tempo), folder)
    return folder


def click(
    truth: dict[str, np.ndarray], scene: Scene, size: tuple[int, int], seed: int
) -> GolfClicks:
    """What a person clicks in the first frame."""
    rng = np.random.default_rng([seed, 77])
    first = truth["points2d"][0]
    places = {name: first[LSP14.index(name)] for name in CLICKED}
    places["root"] = first[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    clicked = {
        name: tuple((p + rng.normal(0, CLICK_NOISE, 2)).tolist()) for name, p in places.items()
    }
    return GolfClicks(
        0, size, clicked, left_handed=scene.left_handed, stature=float(truth["height_m"])
    )


def annotate(truth: dict[str, np.ndarray], seed: int) -> SwingMarks:
    """All joints of four frames: address, top, hit and finish, marked with 2 px of noise."""
    frames = np.unique(np.round(truth["keys"]).astype(int))
    rng = np.random.default_rng([seed, 78])
    joints = truth["points2d"][frames]
    return SwingMarks.of_joints(frames, joints + rng.normal(0, 2.0, joints.shape))


def learn_without(player: int, swings: tuple[Swing, ...], out: Path) -> MotionModel:
    """The prior of the other player's swing, made once."""
    file = out / f"prior-without-{'ab'[player]}.npz"
    if not file.is_file():
        options = TrainOptions()
        database = collect_swings((swings[1 - player],), options)
        write_motion_model(file, learn_motion(database, "the other player's swing", options))
    return read_motion_model(file)


def whole_film(video: Video) -> Film:
    """All frames: where a capture has ended its last posture is held, which looks like repeats."""
    every, last = np.arange(len(video)), len(video) - 1
    return Film(
        every, video.time, every.astype(float), np.tile(np.eye(3), (len(video), 1, 1)),
        (video.width, video.height), np.zeros(2), True, (0, last), 0.0, (0, last),
    )  # fmt: skip


def observe(video: Video, pose: ClickedPose, model: MotionModel, folder: Path) -> Observations:
    """What is observed in a video, kept beside it."""
    file = folder / "observations.npz"
    if not file.is_file():
        began = time.perf_counter()
        film = whole_film(video)
        scene = observe_scene(video, film, place_in_film(pose, film))
        (likeliest, *_) = find_candidates(scene, pose, NO_MARKS, model)
        observed = observe_swing(video, scene, likeliest, pose, NO_MARKS, model)
        if not observed.film.is_whole(video):
            raise SystemExit(f"{folder.name}: frames were left out, though all are of the swing.")
        save_record(file, observed.observations)
        (folder / "seconds.txt").write_text(f"{time.perf_counter() - began:.1f}")
    return load_record(file)


POINTS = WeightOptions(foreground=0.0, silhouette=0.0, matches=0.0)
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
    keys: tuple[float, ...]
    """Errors of the key postures, in frames at 60 per second."""
    club: float
    """Share of the frames with a visible club in which the fitted one is within 5 degrees."""
    seconds: float


def measure(
    fitted: FittedSwing, truth: dict[str, np.ndarray], fps: float, seconds: float = 0.0
) -> Result:
    """Errors against the truth."""
    scores = evaluate_motion(fitted.motion, truth)
    apart = (fitted.keys - truth["keys"]) * 60 / fps
    off = club_angle(fitted.club2d, truth["club2d"])[club_visible(truth)]
    return Result(
        scores.pa_mpjpe, scores.n_mpjpe, tuple(apart.round(1)), float((off < 5).mean()), seconds
    )


def club_visible(truth: dict[str, np.ndarray]) -> np.ndarray:
    """Frames in which a person can tell the angle of the club."""
    length = np.linalg.norm(truth["club2d"][:, 1] - truth["club2d"][:, 0], axis=1)
    return (truth["club_visible"] >= 0.5) & (length > length.max() / 3)


def describe_club(detected: np.ndarray, fitted: np.ndarray, truth: dict[str, np.ndarray]) -> str:
    """How well the club was detected in the frames in which it is visible."""
    visible = club_visible(truth)
    off = club_angle(detected, truth["club2d"])[visible]
    either = np.where(np.isfinite(off), off, club_angle(fitted, truth["club2d"])[visible])
    known = np.isfinite(off)
    return (
        f"visible in {visible.mean():.0%} of the frames; of these detected {known.mean():.0%}, "
        f"within 5 degrees {(off < 5).mean():.0%} ({(off[known] < 5).mean():.0%} of the detected), "
        f"detected or else fitted {(either < 5).mean():.0%}"
    )


def club_angle(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Angle between two clubs in the picture, degrees; NaN where one is not known."""
    ways = [ends[:, 1] - ends[:, 0] for ends in (ours, theirs)]
    turn = ways[0][:, 0] * ways[1][:, 1] - ways[0][:, 1] * ways[1][:, 0]
    return np.degrees(np.abs(np.arctan2(turn, (ways[0] * ways[1]).sum(axis=1))))


def fit_all(scene: Scene, swings: tuple[Swing, ...], out: Path) -> Iterator[tuple[str, Result]]:
    """All rows of a scene."""
    folder = film(scene, swings, out)
    truth, video = read_truth(folder / "truth.npz"), hold_frames(open_video(folder / "video.mp4"))
    model = learn_without(scene.player, swings, out)
    clicks = click(truth, scene, (video.width, video.height), SCENES.index(scene))
    observations = observe(video, clicked_pose(clicks), model, folder)
    print(
        f"{scene.name}: {len(video)} frames, observed in {(folder / 'seconds.txt').read_text()} s"
    )
    fits: dict[str, FittedSwing] = {}
    still = GolfOptions(fit=replace(FitOptions(), steps=0))
    for name, options in {"mean motion at the start": still, **WAYS}.items():
        began = time.perf_counter()
        fits[name] = fit_observations(observations, video, model, options)
        yield name, measure(fits[name], truth, scene.fps, time.perf_counter() - began)
    began, name = time.perf_counter(), "and guided detection"
    fits[name], guided = refine_fit(fits["everything"], observations, video, model)
    yield name, measure(fits[name], truth, scene.fps, time.perf_counter() - began)
    marked = replace(guided, marks=annotate(truth, SCENES.index(scene)))
    began, with_marks = time.perf_counter(), "and four keyframes"
    fits[with_marks] = fit_observations(marked, video, model)
    yield with_marks, measure(fits[with_marks], truth, scene.fps, time.perf_counter() - began)
    first = describe_club(observations.club, fits["everything"].club2d, truth)
    print(f"  club at first: {first}")
    print(f"  club guided: {describe_club(guided.club, fits[name].club2d, truth)}")
    write_ablation(folder / "ablation.jpg", video, fits, guided)


SHOWN = ("mean motion at the start", "joints alone", "everything", "and guided detection")


def write_ablation(
    path: Path, video: Video, fits: dict[str, FittedSwing], observations: Observations
) -> None:
    """The golfer at the key postures, fitted in several ways: one way per row."""
    frames = np.clip(fits[SHOWN[-1]].keys.round().astype(int), 0, len(video) - 1).tolist()
    reach = fits[SHOWN[-1]].motion.points2d[frames].reshape(-1, 2)
    low, high = reach.min(axis=0), reach.max(axis=0)
    room = ROOM * (high[1] - low[1])
    (x0, y0), (x1, y1) = np.maximum(low - room, 0).astype(int), (high + room).astype(int)
    rows = []
    for name in SHOWN:
        drawn = [draw_golfer(video.frame(t), fits[name], observations.camera, t)[y0:y1, x0:x1]
                 for t in frames]  # fmt: skip
        row = np.hstack([reduce_picture(picture, PICTURE) for picture in drawn])
        rows.append(cv2.putText(row, name, (8, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255,) * 3, 2))
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1])


PICTURE, ROOM = 480, 0.25
"""Width of one of its pictures, px, and room around the player, his heights."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--mocap", type=Path, default=MOCAP)
    parser.add_argument("--only", nargs="*")
    arguments = parser.parse_args()
    swings = read_swings([arguments.mocap])
    together: dict[str, list[Result]] = {}
    for scene in [s for s in SCENES if not arguments.only or s.name in arguments.only]:
        for name, result in fit_all(scene, swings, arguments.out):
            together.setdefault(name, []).append(result)
            print_row(name, [result])
    print(f"\nMean of {len(next(iter(together.values())))} scenes")
    for name, results in together.items():
        print_row(name, results)


def print_row(name: str, results: list[Result]) -> None:
    """One line of the table; of several scenes the mean errors, of key postures without sign."""
    pa, n, club, seconds = np.mean(
        [(r.pa_mpjpe, r.n_mpjpe, r.club, r.seconds) for r in results], axis=0
    )
    keys = np.array([r.keys for r in results])
    apart = keys[0] if len(keys) == 1 else np.abs(keys).mean(axis=0)
    print(f"  {name:<26} PA-MPJPE {pa:5.1f} mm   N-MPJPE {n:6.1f} mm   keys {apart.round(1)}   "
          f"club {club:4.0%}   {seconds:5.1f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
