"""Annotated figures of one half of the body, made ready to be fitted to a few frames.

`matching.propagate` brings figures onto all frames of a video; what helps a person while marking
needs them on one frame, or on the annotated ones, and at once. So only the frames that are asked
for are looked at.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.matching.correspondence import ElementIndex, index_elements, list_elements
from keyrecon.matching.feet import learn_feet
from keyrecon.matching.halves import Half
from keyrecon.matching.propagate import LEAST_MARKED, PropagateOptions, distances_to, gather_poses
from keyrecon.matching.puppet import Poses, Puppets, make_puppets
from keyrecon.matching.window import Window, follow_player
from keyrecon.records import Annotations, Survey

OPTIONS = PropagateOptions()
HIPS = 0.45
"""Where the hips are on the way from head to mid-feet (Drillis and Contini: .53 of stature)."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A video whose player was found, and the annotated frames to learn from."""

    survey: Survey
    window: Window
    sources: Annotations

    def from_pixels(
        self, points: Float[np.ndarray, "K J 2"], frames: Int[np.ndarray, "K"]
    ) -> Complex[np.ndarray, "K J"]:
        """Joints of some frames in player coordinates."""
        return self.window.from_pixels(points, frames[:, None])

    def at(self, points: Float[np.ndarray, "T 2"]) -> Complex[np.ndarray, "T"]:
        """A point of every frame in player coordinates."""
        return self.window.from_pixels(points, np.arange(len(points)))


def look_at(survey: Survey, sources: Annotations) -> Scene:
    """The scene of a survey."""
    return Scene(survey, follow_player(survey.track, survey.camera), sources)


@dataclass(frozen=True, eq=False)
class Fitting:
    """Figures of K annotated frames, to be fitted to N frames."""

    puppets: Puppets
    """Rows of `listed` and `feet` are the N frames."""
    index: ElementIndex
    distance: Float[np.ndarray, "N K"]
    """Pose distance, player heights."""
    shift: Complex[np.ndarray, "N K"]
    """From each figure to the same figure in each frame, by head or feet."""
    sources: Int[np.ndarray, "K"]
    """Frame numbers."""


def prepare_fitting(
    scene: Scene,
    half: Half,
    joints: Complex[np.ndarray, "T J"],
    frames: Int[np.ndarray, "N"],
) -> Fitting:
    """Dress the annotated figures of a half; `joints` has what the other half gives to it."""
    survey, window = scene.survey, scene.window
    poses = gather_poses(scene.sources, window, half, joints[:, half.joints[half.given]])
    edges = tuple(survey.figures.edges[t] for t in frames)
    index = index_elements(edges, _some(window, frames))
    distance = distances_to(survey.comparison, half.name, poses.frames)[frames]
    at = scene.at(survey.track.head if half.name == "upper" else survey.track.mid_feet)
    shift = at[frames][:, None] - at[poses.frames]
    return Fitting(_dress(scene, poses, frames), index, distance, shift, poses.frames)


def _some(window: Window, frames: Int[np.ndarray, "N"]) -> Window:
    return Window(window.origin[frames], window.height[frames])


def _dress(scene: Scene, poses: Poses, frames: Int[np.ndarray, "N"]) -> Puppets:
    """Annotated figures, and what is looked at in the frames that are asked for."""
    edges, half, window = scene.survey.figures.edges, poses.half, scene.window
    known = replace(poses, frames=np.arange(len(poses.frames)))
    outlines = tuple(edges[t] for t in poses.frames)
    puppets = make_puppets(outlines, _some(window, poses.frames), known, OPTIONS.elements)
    wanted = tuple(edges[t] for t in frames)
    puppets = replace(puppets, listed=list_elements(wanted, half.name, OPTIONS.elements))
    if half.name == "upper":
        return puppets
    tracked = window.from_pixels(scene.survey.track.feet, np.arange(len(edges))[:, None])
    feet = learn_feet(half, poses.frames, poses.joints, tracked)
    return replace(puppets, feet=replace(feet, points=feet.points[frames]))


def marked_figures(annotations: Annotations, half: Half) -> Int[np.ndarray, "K"]:
    """Frames that serve as figures of one half of the body; none until each bone is seen once."""
    marked = np.isfinite(annotations.joints[:, half.joints, 0])
    served = marked[:, half.own].mean(axis=1) >= LEAST_MARKED
    bones = half.bones[~half.given[half.bones].any(axis=1)]
    whole = marked[served][:, bones].all(axis=2).any(axis=0).all()
    return annotations.frames[served & whole]


def stand_in(scene: Scene, joints: Complex[np.ndarray, "T J"], upper: Half) -> None:
    """Fill in what the lower body gives to the upper one where nothing better is known."""
    track = scene.survey.track
    hips = scene.at(track.head + HIPS * (track.mid_feet - track.head))[:, None]
    given = upper.joints[upper.given]
    joints[:, given] = np.where(np.isnan(joints[:, given]), hips, joints[:, given])


def take_rows(annotations: Annotations, rows: Bool[np.ndarray, "K"]) -> Annotations:
    """Some of the annotated frames."""
    return replace(
        annotations,
        frames=annotations.frames[rows],
        joints=annotations.joints[rows],
        visible=annotations.visible[rows],
        nearer=annotations.nearer[rows],
    )
