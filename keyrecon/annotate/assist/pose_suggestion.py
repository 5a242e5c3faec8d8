"""Annotated figures of one half of the body, made ready to be fitted to a few frames.

`matching.propagate` brings figures onto all frames of a video; what helps a person while marking
needs them on one frame, or on the annotated ones, and at once. So only the frames that are asked
for are looked at.

Joints of frames that nobody annotated yet, from the few that somebody did.

What `matching.propagate` does for a whole video is done for a single frame here: the annotated
figures that look most like it are brought onto its edges, limbs of others are tried, the
combination that leaves the least of the edges unexplained is taken and fitted once more. There is
no path through time to lean on, so it takes a fraction of a second; each annotated frame makes the
next ghost better.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.propagation.body_frame import BodyFrame, stabilise_player
from keyrecon.propagation.correspondence import ElementIndex, index_elements, list_elements
from keyrecon.propagation.edge_template import AnnotatedPoses, EdgeTemplates, make_edge_templates
from keyrecon.propagation.foot_evidence import learn_foot_offsets
from keyrecon.propagation.half_body import BodyHalf, split_body
from keyrecon.propagation.half_propagation import BORROWED, joint_confidence
from keyrecon.propagation.hypotheses import (
    PoseHypotheses,
    fit_similar,
    join_hypotheses,
    propose_limbs,
)
from keyrecon.propagation.normal_equations import add_joint_observations
from keyrecon.propagation.propagation import (
    LEAST_MARKED,
    PropagateOptions,
    distances_to,
    gather_poses,
)
from keyrecon.propagation.registration import FittedFigures, RegistrationStep, register_templates
from keyrecon.propagation.selection import choose_limbs
from keyrecon.propagation.trajectory_smoothing import (
    DATA_WEIGHT,
    HELD,
    LOOSE,
    SEARCH_RADII,
    SmoothingInput,
)
from keyrecon.records import Annotations, Preparation

OPTIONS = PropagateOptions()
HIPS = 0.45
"""Where the hips are on the way from head to mid-feet (Drillis and Contini: .53 of stature)."""


@dataclass(frozen=True, eq=False)
class SuggestionScene:
    """A video whose player was found, and the annotated frames to learn from."""

    preparation: Preparation
    window: BodyFrame
    sources: Annotations

    def from_pixels(
        self, points: Float[np.ndarray, "K J 2"], frames: Int[np.ndarray, "K"]
    ) -> Complex[np.ndarray, "K J"]:
        """Joints of some frames in player coordinates."""
        return self.window.from_pixels(points, frames[:, None])

    def at(self, points: Float[np.ndarray, "T 2"]) -> Complex[np.ndarray, "T"]:
        """A point of every frame in player coordinates."""
        return self.window.from_pixels(points, np.arange(len(points)))


def scene_of(preparation: Preparation, sources: Annotations) -> SuggestionScene:
    """The scene of a preparation."""
    return SuggestionScene(
        preparation, stabilise_player(preparation.track, preparation.camera), sources
    )


@dataclass(frozen=True, eq=False)
class Fitting:
    """Figures of K annotated frames, to be fitted to N frames."""

    puppets: EdgeTemplates
    """Rows of `listed` and `feet` are the N frames."""
    index: ElementIndex
    distance: Float[np.ndarray, "N K"]
    """Pose distance, player heights."""
    shift: Complex[np.ndarray, "N K"]
    """From each figure to the same figure in each frame, by head or feet."""
    sources: Int[np.ndarray, "K"]
    """Frame numbers."""


def prepare_fitting(
    scene: SuggestionScene,
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    frames: Int[np.ndarray, "N"],
) -> Fitting:
    """Dress the annotated figures of a half; `joints` has what the other half gives to it."""
    preparation, window = scene.preparation, scene.window
    poses = gather_poses(scene.sources, window, half, joints[:, half.joints[half.given]])
    edges = tuple(preparation.contours.edges[t] for t in frames)
    index = index_elements(edges, _some(window, frames))
    distance = distances_to(preparation.pose_distances, half.name, poses.frames)[frames]
    at = scene.at(preparation.track.head if half.name == "upper" else preparation.track.mid_feet)
    shift = at[frames][:, None] - at[poses.frames]
    return Fitting(_dress(scene, poses, frames), index, distance, shift, poses.frames)


def _some(window: BodyFrame, frames: Int[np.ndarray, "N"]) -> BodyFrame:
    return BodyFrame(window.origin[frames], window.height[frames])


def _dress(
    scene: SuggestionScene, poses: AnnotatedPoses, frames: Int[np.ndarray, "N"]
) -> EdgeTemplates:
    """Annotated figures, and what is looked at in the frames that are asked for."""
    edges, half, window = scene.preparation.contours.edges, poses.half, scene.window
    known = replace(poses, frames=np.arange(len(poses.frames)))
    outlines = tuple(edges[t] for t in poses.frames)
    puppets = make_edge_templates(outlines, _some(window, poses.frames), known, OPTIONS.elements)
    wanted = tuple(edges[t] for t in frames)
    puppets = replace(puppets, listed=list_elements(wanted, half.name, OPTIONS.elements))
    if half.name == "upper":
        return puppets
    tracked = window.from_pixels(scene.preparation.track.feet, np.arange(len(edges))[:, None])
    feet = learn_foot_offsets(half, poses.frames, poses.joints, tracked)
    return replace(puppets, feet=replace(feet, points=feet.points[frames]))


def marked_figures(annotations: Annotations, half: BodyHalf) -> Int[np.ndarray, "K"]:
    """Frames that serve as figures of one half of the body; none until each bone is seen once."""
    marked = np.isfinite(annotations.joints[:, half.joints, 0])
    served = marked[:, half.own].mean(axis=1) >= LEAST_MARKED
    bones = half.bones[~half.given[half.bones].any(axis=1)]
    whole = marked[served][:, bones].all(axis=2).any(axis=0).all()
    return annotations.frames[served & whole]


def stand_in(scene: SuggestionScene, joints: Complex[np.ndarray, "T J"], upper: BodyHalf) -> None:
    """Fill in what the lower body gives to the upper one where nothing better is known."""
    track = scene.preparation.track
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


SETTLING = tuple(RegistrationStep(reach, LOOSE.length, LOOSE.swing) for reach in SEARCH_RADII)
"""Last fit of the chosen figure, as `settle` does it for all frames at once."""
MOST = 10
"""Annotated figures looked at for each half; with more a ghost gets slower and no better."""
_PULL = 1 / DATA_WEIGHT**2
"""Weight of the chosen proposal in the last fit."""
_PER_FIGURE = [field for field in fields(AnnotatedPoses) if field.name != "half"]


@dataclass(frozen=True, eq=False)
class PoseSuggestion:
    """Foreseen joints of one frame."""

    joints: Float[np.ndarray, "J 2"]
    """px; NaN where that half of the body has no annotated frame yet."""
    confidence: Float[np.ndarray, "J"]
    """0-1"""
    source: Int[np.ndarray, "J"]
    """Annotated frame that each joint comes from, -1 for none."""


def choose_sources(preparation: Preparation, annotations: Annotations, frame: int) -> Annotations:
    """The other annotated frames that look most like `frame`: all that its ghost depends on."""
    others = take_rows(annotations, annotations.frames != frame)
    near = []
    for half in split_body(annotations.skeleton):
        figures = marked_figures(others, half)
        distance = distances_to(preparation.pose_distances, half.name, figures)[frame]
        near.append(figures[np.argsort(distance, kind="stable")[:MOST]])
    return take_rows(others, np.isin(others.frames, np.concatenate(near)))


def suggest_joints(
    preparation: Preparation,
    sources: Annotations,
    frame: int,
    held: Float[np.ndarray, "J 2"] | None = None,
) -> PoseSuggestion:
    """Joints of `frame` from annotated frames; what is marked there already is `held`, px."""
    skeleton = sources.skeleton
    scene = scene_of(preparation, sources)
    lower, upper = split_body(skeleton)
    joints = np.full((len(preparation.track.head), len(skeleton.names)), np.nan + 0j)
    joints[sources.frames] = scene.from_pixels(sources.joints, sources.frames)
    if held is not None:
        joints[frame] = scene.window.from_pixels(held, frame)
    confidence, source = np.zeros(joints.shape[1]), np.full(joints.shape[1], -1)
    beyond = np.setdiff1d(marked_figures(sources, upper), marked_figures(sources, lower))
    for half, frames in ((lower, np.array([frame, *beyond])), (upper, np.array([frame]))):
        own = half.joints[half.own]
        if len(marked_figures(sources, half)):
            fitting = prepare_fitting(scene, half, joints, frames)
            found, sure, come_from = _suggest_half(fitting, joints[frames][:, half.joints])
            joints[frames[:, None], own] = found
            confidence[own], source[own] = sure[0], come_from[0]
        if half is lower:
            stand_in(scene, joints, upper)
    pixels = scene.window.to_pixels(joints[frame], frame)
    return PoseSuggestion(np.where(source[:, None] < 0, np.nan, pixels), confidence, source)


def _suggest_half(
    fitting: Fitting, known: Complex[np.ndarray, "N J"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(own joints, confidence, source frame) of one half; `known` joints stay."""
    puppets, index = fitting.puppets, fitting.index
    fitted = fit_similar(puppets, index, fitting.distance, fitting.shift, OPTIONS.similar)
    candidates = join_hypotheses(fitted, propose_limbs(puppets, index, fitted, BORROWED))
    chosen, which = _choose(puppets, candidates)
    chosen = np.where(np.isfinite(known), known, chosen)
    weight = np.where(np.isfinite(known), HELD, _PULL)
    similar = fitted.which[:, 0]
    start = FittedFigures(np.arange(len(known)), similar, chosen)
    settled = register_templates(
        puppets, index, start, SETTLING, add_joint_observations(chosen, weight)
    ).joints
    confidence = joint_confidence(puppets, index, SmoothingInput(chosen, similar), settled)
    own = puppets.half.own
    return settled[:, own], confidence[:, own], fitting.sources[which[:, own]]


def _choose(
    puppets: EdgeTemplates, candidates: PoseHypotheses
) -> tuple[Complex[np.ndarray, "N J"], Int[np.ndarray, "N J"]]:
    """The best proposals, each frame by itself: (joints, figure that they come from)."""
    nobody = replace(
        puppets.poses, **{f.name: getattr(puppets.poses, f.name)[:0] for f in _PER_FIGURE}
    )
    found = []
    for n in range(len(candidates.which)):
        one = PoseHypotheses(
            *(getattr(candidates, f.name)[n : n + 1] for f in fields(PoseHypotheses))
        )
        feet = puppets.feet and replace(puppets.feet, points=puppets.feet.points[n : n + 1])
        alone = replace(puppets, poses=nobody, listed=puppets.listed[n : n + 1], feet=feet)
        found.append(choose_limbs(alone, one))
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))
