"""Annotated frames seen through one another.

Every annotated frame is fitted with the annotated figures that look most like it, itself left out:
where they put the joints is what the other marks say about this frame. All frames are fitted at
once, which takes a second or two.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.assist.figures import look_at, marked_figures, prepare_fitting, stand_in
from keyrecon.matching.candidates import fit_similar
from keyrecon.matching.halves import split_body
from keyrecon.records import Annotations, Survey

MOST = 5
"""Other figures that each frame is fitted with."""


@dataclass(frozen=True, eq=False)
class Lookalikes:
    """One half of the body on K annotated frames, as S other annotated frames have it."""

    members: Int[np.ndarray, "J"]
    """Joints of the skeleton that this half has of its own."""
    frames: Int[np.ndarray, "K"]
    sources: Int[np.ndarray, "K S"]
    """Row in `frames` that each figure comes from."""
    away: Float[np.ndarray, "K S J J"]
    """From each mark (first J) to where a figure has each joint (second J), player heights; NaN
    where nothing is marked."""
    misfit: Float[np.ndarray, "K S"]
    """Share of the figure that finds no edges, 0-1; NaN where there is no such figure."""


def compare_marks(survey: Survey, annotations: Annotations) -> tuple[Lookalikes, ...]:
    """Both halves of the body, as far as two frames of a half are marked."""
    scene = look_at(survey, annotations)
    lower, upper = split_body(annotations.skeleton)
    joints = np.full((len(survey.track.head), len(annotations.skeleton.names)), np.nan + 0j)
    marks = scene.from_pixels(annotations.joints, annotations.frames)
    joints[annotations.frames] = marks
    found = []
    for half in (lower, upper):
        frames = marked_figures(annotations, half)
        own = half.joints[half.own]
        if len(frames) > 1:
            beyond = np.setdiff1d(marked_figures(annotations, upper), frames)
            asked = np.concatenate([frames, beyond]) if half is lower else frames
            fitting = prepare_fitting(scene, half, joints, asked)
            fitting.distance[np.arange(len(frames)), np.arange(len(frames))] = np.inf
            most = min(MOST, len(frames) - 1)
            fitted = fit_similar(
                fitting.puppets, fitting.index, fitting.distance, fitting.shift, most
            )
            places = fitted.joints[:, :, half.own]
            misfit = fitted.misfit.mean(axis=2)
            best = misfit.argmin(axis=1)[len(frames) :]
            joints[beyond[:, None], own] = places[np.arange(len(frames), len(asked)), best]
            known = joints[frames][:, own]
            away = np.abs(known[:, None, :, None] - places[: len(frames), :, None])
            found.append(
                Lookalikes(own, frames, fitted.which[: len(frames)], away, misfit[: len(frames)])
            )
        if half is lower:
            stand_in(scene, joints, upper)
    return tuple(found)
