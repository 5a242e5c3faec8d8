"""A small film of a swing with its truth and its clicks, and a quick fit of it."""

import json
import os
from contextlib import contextmanager
from dataclasses import replace

import pytest
from threadpoolctl import threadpool_limits

from keyrecon.app.golf import fit_file
from keyrecon.app.golf_demo import SEED, click_first_frame, draw_swing
from keyrecon.golf.fit.fitting import FitOptions
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.formats.clicks import write_clicks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import Video
from keyrecon.metrics import read_truth
from keyrecon.synthetic.golf import SwingFilm, film_swing

QUICK = GolfOptions(fit=FitOptions(components=4, steps=3), guided_rounds=1, candidates=1)


def film_small_swing(folder):
    """Write video.mp4, truth.npz and clicks.json."""
    film = SwingFilm(fps=24.0, before=0.3, after=0.2)
    camera = replace(film.scene.camera, width=400, height=300, player_px=190.0)
    film = replace(film, scene=replace(film.scene, camera=camera, workers=1))
    film_swing(draw_swing(read_motion_model(), SEED), film, folder)
    clicks = click_first_frame(read_truth(folder / "truth.npz"))
    joints = {name: (round(4 * x) / 4, round(4 * y) / 4) for name, (x, y) in clicks.joints.items()}
    write_clicks(folder / "clicks.json", replace(clicks, joints=joints))


def fit(swing, out, **more):
    """Fit the film in a folder, quickly unless `options` say otherwise."""
    options = more.pop("options", QUICK)
    return fit_file(swing / "video.mp4", swing / "clicks.json", out, options=options, **more)


@contextmanager
def count_decoded():
    """A list that grows by one for every frame that is decoded meanwhile."""
    counts, original = [], Video._decoded

    def spy(self, start, stop):
        for frame in original(self, start, stop):
            counts.append(1)
            yield frame

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Video, "_decoded", spy)
        yield counts


def fit_small_swing(folder):
    """The film, its fit in `project`, and told.json: what the fit said, how many frames it read.

    Linear algebra has all cores, as in a program that does not limit it.
    """
    film_small_swing(folder)
    with threadpool_limits(os.cpu_count(), "blas"), count_decoded() as decoded:
        said = fit(folder, folder / "project")
    (folder / "told.json").write_text(json.dumps({"said": said, "decoded": len(decoded)}))
