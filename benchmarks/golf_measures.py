"""How far a coach's numbers are off on rendered swings, at the true key postures.

    python benchmarks/golf_measures.py OUT

fits the scenes of benchmarks/golf.py (OUT is its folder; what is there is used, also the errors of
an earlier run: remove measures.json from a scene's folder to measure it anew) and compares turns,
spine, sway and lift with those of the captured body, at the true address, top, hit and finish. The
root mean square of each is what `keyrecon.report.golf_measures.MEASURE_ERRORS` tells; how far the
key postures are off in time is what `KEY_ERRORS` tells. A scene takes half a minute.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from golf import MOCAP, SCENES, Scene, click, film, learn_without, observe

from keyrecon.app.golf_recipe import refine_fit
from keyrecon.app.golf_training import read_swings
from keyrecon.golf.clicks import clicked_pose
from keyrecon.golf.records import RecordedSwing, Swing
from keyrecon.golf.swing_fit import fit_observations
from keyrecon.io.held_video import hold_frames
from keyrecon.io.video import open_video
from keyrecon.metrics import read_truth
from keyrecon.report.golf_measures import AT, KEY_ERRORS, measure_curves, record_swing

UP = np.array([0.0, 1.0, 0.0])
"""Of the rendered world."""


def true_swing(swing: RecordedSwing, truth: dict[str, np.ndarray]) -> RecordedSwing:
    """The swing as it really was."""
    return replace(
        swing,
        motion=replace(swing.motion, points3d=truth["points3d"]),
        keys=truth["keys"],
        vertical=truth["rotation"][0] @ UP,
    )


def measure_errors(swing: RecordedSwing, truth: dict[str, np.ndarray]) -> dict[str, list[float]]:
    """Errors of every number at the true key postures where it says something."""
    real = true_swing(swing, truth)
    frames = np.arange(len(swing.motion.time))
    errors = {}
    at_true_keys = replace(swing, keys=truth["keys"])
    for ours, theirs in zip(measure_curves(at_true_keys), measure_curves(real), strict=True):
        at = truth["keys"][list(AT[ours.name])]
        errors[ours.name] = np.interp(at, frames, ours.values - theirs.values).tolist()
    return errors


def measure_scene(scene: Scene, swings: tuple[Swing, ...], out: Path) -> dict[str, list[float]]:
    """Errors of a scene's numbers, and of its key postures in seconds, kept beside its video."""
    folder = film(scene, swings, out)
    file = folder / "measures.json"
    if not file.is_file():
        truth = read_truth(folder / "truth.npz")
        video = hold_frames(open_video(folder / "video.mp4"))
        model = learn_without(scene.player, swings, out)
        clicks = click(truth, scene, (video.width, video.height), SCENES.index(scene))
        seen = observe(video, clicked_pose(clicks), model, folder)
        fitted = fit_observations(seen, video, model)
        swing = record_swing(*refine_fit(fitted, seen, video, model))
        errors = measure_errors(swing, truth)
        errors["key postures"] = ((swing.keys - truth["keys"]) / scene.fps).tolist()
        file.write_text(json.dumps(errors))
    kept: dict[str, list[float]] = json.loads(file.read_text())
    return kept


def at_all_keys(name: str, errors: np.ndarray) -> list[float]:
    """Errors at all key postures: 0 before the first at which a number says something.

    After the last one it keeps its error.
    """
    first, *_, last = AT[name]
    before, after = [0.0] * first, [float(errors[-1])] * (len(KEY_ERRORS) - 1 - last)
    return [*before, *errors.tolist(), *after]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--mocap", type=Path, default=MOCAP)
    parser.add_argument("--only", nargs="*")
    arguments = parser.parse_args()
    swings = read_swings([arguments.mocap])
    together: dict[str, list[list[float]]] = {}
    for scene in SCENES:
        if arguments.only and scene.name not in arguments.only:
            continue
        for name, errors in measure_scene(scene, swings, arguments.out).items():
            together.setdefault(name, []).append(errors)
            print(f"{scene.name:<18} {name:<14} {np.round(errors, 3)}", flush=True)
    print("\nRoot mean square at address, top, hit and finish")
    for name, errors in together.items():
        square = np.sqrt(np.mean(np.square(errors), axis=0))
        if name in AT:
            print(f"  {name:<14} {np.round(at_all_keys(name, square), 1)}")
        else:
            print(f"  {name:<14} {square.round(3)} s")


if __name__ == "__main__":
    main()
