"""What the other marked frames say about each: the poses most similar to it, fitted to it.

The annotated poses most similar to a frame are fitted to it as edge templates, its own left out.
All frames are fitted at once, which takes a second or two.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.annotate.assist.pose_suggestion import (
    fill_in_hips,
    prepare_fitting,
    scene_of,
    template_frames,
)
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.hypotheses import fit_similar
from keyrecon.records import Annotations, Preparation

MAX_NEIGHBOURS = 5
"""Other poses fitted to each frame."""


@dataclass(frozen=True, eq=False)
class Neighbours:
    """One half of the body on K annotated frames, as S other annotated poses have it."""

    members: Int[np.ndarray, "J"]
    """Joints of the skeleton that this half has of its own."""
    frames: Int[np.ndarray, "K"]
    sources: Int[np.ndarray, "K S"]
    """Row in `frames` that each fitted pose comes from."""
    distance: Float[np.ndarray, "K S J J"]
    """From each mark (first J) to where a fitted pose has each joint (second J), player heights;
    NaN where nothing is marked."""
    residual: Float[np.ndarray, "K S"]
    """Share of the template that finds no edges, 0-1; NaN where there is none."""


def find_neighbours(preparation: Preparation, annotations: Annotations) -> tuple[Neighbours, ...]:
    """Both halves of the body, as far as two frames of a half are marked."""
    scene = scene_of(preparation, annotations)
    lower, upper = split_body(annotations.skeleton)
    joints = np.full((len(preparation.track.head), len(annotations.skeleton.names)), np.nan + 0j)
    marks = scene.from_pixels(annotations.joints, annotations.frames)
    joints[annotations.frames] = marks
    neighbours = []
    for half in (lower, upper):
        frames = template_frames(annotations, half)
        members = half.joints[half.free]
        if len(frames) > 1:
            only_upper = np.setdiff1d(template_frames(annotations, upper), frames)
            fitted_frames = np.concatenate([frames, only_upper]) if half is lower else frames
            fitting = prepare_fitting(scene, half, joints, fitted_frames)
            fitting.distance[np.arange(len(frames)), np.arange(len(frames))] = np.inf
            count = min(MAX_NEIGHBOURS, len(frames) - 1)
            fitted = fit_similar(
                fitting.templates, fitting.index, fitting.distance, fitting.shift, count
            )
            places = fitted.joints[:, :, half.free]
            residual = fitted.residual.mean(axis=2)
            best = residual.argmin(axis=1)[len(frames) :]
            rest = np.arange(len(frames), len(fitted_frames))
            joints[only_upper[:, None], members] = places[rest, best]
            known = joints[frames][:, members]
            distance = np.abs(known[:, None, :, None] - places[: len(frames), :, None])
            sources = fitted.template[: len(frames)]
            neighbours.append(
                Neighbours(members, frames, sources, distance, residual[: len(frames)])
            )
        if half is lower:
            fill_in_hips(scene, joints, upper)
    return tuple(neighbours)
