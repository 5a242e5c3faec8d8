"""`keyrecon demo golf`: a swing that the project films itself, fitted from six clicks.

The swing is drawn from the built-in prior with a style of its own, so its motion is known to be of
the kind that the prior knows; `benchmarks/golf.py` measures swings that it has not seen. The clicks
are those of a careful person in the first frame, made from the truth.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float

from keyrecon.app.golf import fit_file
from keyrecon.app.project import describe_scores
from keyrecon.body import LSP14
from keyrecon.golf.clicks import GolfClicks
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import NAMES, size_body
from keyrecon.golf.records import MotionModel, Swing, SwingState
from keyrecon.io.formats.clicks import write_clicks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.metrics import read_truth
from keyrecon.progress import Progress
from keyrecon.synthetic.golf import SwingFilm, film_swing

STATURE = 1.80
RATE = 120.0
SECONDS = (0.85, 0.30, 0.60)
"""Upswing, downswing and follow-through of a usual full swing."""
STYLE, SEED = 0.7, 4
"""Standard deviation of the coefficients, and the seed that draws them."""
TOES = 0.1
"""From ankle to toes, statures."""
CLICKED = ("head_top", "right_knee", "left_knee", "right_ankle", "left_ankle")
CLICK_NOISE = 2.0
"""px"""


def run_golf_demo(out: Path, progress: Progress, say: Callable[[str], None]) -> None:
    """Film a swing, fit the prior to it, print the accuracy; writes into `out`."""
    sequence = out / "sequence"
    model = read_motion_model()
    if not (sequence / "truth.npz").is_file():
        say(f"Rendering a golf swing into {sequence}.")
        film_swing(draw_swing(model, SEED), SwingFilm(), sequence, progress)
    truth = read_truth(sequence / "truth.npz")
    clicks = sequence / "clicks.json"
    write_clicks(clicks, click_first_frame(truth))
    say(fit_file(sequence / "video.mp4", clicks, out / "swing", progress=progress))
    say("\nAccuracy against the truth")
    say(describe_scores(read_motion(out / "swing" / "motion.npz"), sequence / "truth.npz"))


def draw_swing(model: MotionModel, seed: int) -> Swing:
    """A swing of the prior in a style drawn by a seed."""
    coefficients = np.random.default_rng([seed, 9]).normal(0, STYLE, len(model.components))
    times = np.concatenate([[0.0], np.cumsum(SECONDS)])
    frames = np.arange(round(times[-1] * RATE) + 1)
    phase = np.interp(frames / RATE, times, model.keys)
    return play_model(model, phase, coefficients, (times * RATE).round().astype(int))


def play_model(
    model: MotionModel,
    phase: Float[np.ndarray, "T"],
    coefficients: Float[np.ndarray, "C"],
    keys: np.ndarray,
) -> Swing:
    """The motion of a model in swing axes as a captured swing."""
    body = size_body(STATURE)
    frames = len(phase)
    axes = np.tile(np.eye(3), (frames, 1, 1))
    state = SwingState(coefficients, phase, axes, np.zeros((frames, 3)))
    pose = place_body(body, posture_at(model, phase, coefficients), state)
    feet = [NAMES.index("right_foot"), NAMES.index("left_foot")]
    toes = pose.origins[:, feet] - TOES * STATURE * pose.rotations[:, feet][..., 2]
    return Swing(
        "built-in", find_joints(body, pose), toes, find_club(body, pose), keys, RATE, STATURE
    )


def click_first_frame(truth: dict[str, np.ndarray]) -> GolfClicks:
    """Six clicks of a careful person who knows the player's height."""
    rng = np.random.default_rng([SEED, 10])
    first = truth["points2d"][0]
    places = {name: first[LSP14.index(name)] for name in CLICKED}
    places["root"] = first[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    clicked = {
        name: tuple((place + rng.normal(0, CLICK_NOISE, 2)).tolist())
        for name, place in places.items()
    }
    width, height = (2 * truth["principal"] + 1).round().astype(int).tolist()
    return GolfClicks(0, (width, height), clicked, stature=float(truth["height_m"]))
