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
from keyrecon.propagation.correspondence import ElementIndex, index_elements, list_half_elements
from keyrecon.propagation.edge_template import AnnotatedPoses, EdgeTemplates, make_edge_templates
from keyrecon.propagation.foot_evidence import learn_foot_offsets
from keyrecon.propagation.half_body import BodyHalf, split_body
from keyrecon.propagation.hypotheses import (
    PoseHypotheses,
    fit_similar,
    join_hypotheses,
    propose_limbs,
)
from keyrecon.propagation.normal_equations import joint_equations
from keyrecon.propagation.propagation import (
    LEAST_MARKED,
    LIMB_HYPOTHESES,
    PropagateOptions,
    distances_to,
    gather_poses,
    joint_confidence,
)
from keyrecon.propagation.registration import RegistrationStep, TemplateFits, register_templates
from keyrecon.propagation.selection import ChosenLimbs, choose_limbs
from keyrecon.propagation.trajectory_smoothing import (
    FIXED_WEIGHT,
    HYPOTHESIS_SPREAD,
    SEARCH_RADII,
    SHAPE_PRIOR,
    ChosenHypotheses,
)
from keyrecon.records import Annotations, Preparation

OPTIONS = PropagateOptions()
HIPS = 0.45
"""Where the hips are on the way from head to mid-feet (Drillis and Contini: .53 of stature)."""


@dataclass(frozen=True, eq=False)
class SuggestionScene:
    """A video whose player was found, and the annotated frames to learn from."""

    preparation: Preparation
    body_frame: BodyFrame
    sources: Annotations

    def from_pixels(
        self, points: Float[np.ndarray, "K J 2"], frames: Int[np.ndarray, "K"]
    ) -> Complex[np.ndarray, "K J"]:
        """Joints of some frames in player coordinates."""
        return self.body_frame.from_pixels(points, frames[:, None])

    def at(self, points: Float[np.ndarray, "T 2"]) -> Complex[np.ndarray, "T"]:
        """A point of every frame in player coordinates."""
        return self.body_frame.from_pixels(points, np.arange(len(points)))


def scene_of(preparation: Preparation, sources: Annotations) -> SuggestionScene:
    """The scene of a preparation."""
    return SuggestionScene(
        preparation,
        stabilise_player(preparation.track, preparation.camera, preparation.video.fps),
        sources,
    )


@dataclass(frozen=True, eq=False)
class Fitting:
    """Figures of K annotated frames, to be fitted to N frames."""

    templates: EdgeTemplates
    """Rows of `frame_elements` and `feet` are the N frames."""
    index: ElementIndex
    distance: Float[np.ndarray, "N K"]
    """Pose distance, player heights."""
    shift: Complex[np.ndarray, "N K"]
    """From each figure to the same figure in each frame, by head or feet."""
    sources: Int[np.ndarray, "K"]
    """Frame numbers."""
    fps: float


def prepare_fitting(
    scene: SuggestionScene,
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    frames: Int[np.ndarray, "N"],
) -> Fitting:
    """Dress the annotated figures of a half; `joints` has what the other half gives to it."""
    preparation, body_frame = scene.preparation, scene.body_frame
    poses = gather_poses(scene.sources, body_frame, half, joints[:, half.joints[half.fixed]])
    edges = tuple(preparation.contours.edges[t] for t in frames)
    index = index_elements(edges, _some(body_frame, frames))
    distance = distances_to(preparation.pose_distances, half.name, poses.frames)[frames]
    at = scene.at(preparation.track.head if half.name == "upper" else preparation.track.mid_feet)
    shift = at[frames][:, None] - at[poses.frames]
    templates = _dress(scene, poses, frames)
    fps = preparation.video.fps
    return Fitting(templates, index, distance, shift, poses.frames, fps)


def _some(body_frame: BodyFrame, frames: Int[np.ndarray, "N"]) -> BodyFrame:
    return BodyFrame(body_frame.origin[frames], body_frame.height[frames])


def _dress(
    scene: SuggestionScene, poses: AnnotatedPoses, frames: Int[np.ndarray, "N"]
) -> EdgeTemplates:
    """Annotated figures, and what is looked at in the frames that are asked for."""
    edges, half, body_frame = scene.preparation.contours.edges, poses.half, scene.body_frame
    known = replace(poses, frames=np.arange(len(poses.frames)))
    outlines = tuple(edges[t] for t in poses.frames)
    templates = make_edge_templates(
        outlines, _some(body_frame, poses.frames), known, OPTIONS.elements
    )
    wanted = tuple(edges[t] for t in frames)
    templates = replace(
        templates, frame_elements=list_half_elements(wanted, half.name, OPTIONS.elements)
    )
    if half.name == "upper":
        return templates
    tracked = body_frame.from_pixels(scene.preparation.track.feet, np.arange(len(edges))[:, None])
    feet = learn_foot_offsets(half, poses.frames, poses.joints, tracked)
    return replace(templates, feet=replace(feet, points=feet.points[frames]))


def marked_figures(annotations: Annotations, half: BodyHalf) -> Int[np.ndarray, "K"]:
    """Frames that serve as figures of one half of the body; none until each bone is seen once."""
    marked = np.isfinite(annotations.joints[:, half.joints, 0])
    served = marked[:, half.free].mean(axis=1) >= LEAST_MARKED
    bones = half.bones[~half.fixed[half.bones].any(axis=1)]
    whole = marked[served][:, bones].all(axis=2).any(axis=0).all()
    return annotations.frames[served & whole]


def stand_in(scene: SuggestionScene, joints: Complex[np.ndarray, "T J"], upper: BodyHalf) -> None:
    """Fill in what the lower body gives to the upper one where nothing better is known."""
    track = scene.preparation.track
    hips = scene.at(track.head + HIPS * (track.mid_feet - track.head))[:, None]
    given = upper.joints[upper.fixed]
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


SETTLING = tuple(
    RegistrationStep(radius, SHAPE_PRIOR.length_spread, SHAPE_PRIOR.transverse_spread)
    for radius in SEARCH_RADII
)
"""Last fit of the chosen figure, as trajectory smoothing does it for all frames at once."""
MOST = 10
"""Annotated figures looked at for each half; with more a ghost gets slower and no better."""
_PULL = 1 / HYPOTHESIS_SPREAD**2
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
        joints[frame] = scene.body_frame.from_pixels(held, frame)
    confidence, source = np.zeros(joints.shape[1]), np.full(joints.shape[1], -1)
    beyond = np.setdiff1d(marked_figures(sources, upper), marked_figures(sources, lower))
    for half, frames in ((lower, np.array([frame, *beyond])), (upper, np.array([frame]))):
        own = half.joints[half.free]
        if len(marked_figures(sources, half)):
            fitting = prepare_fitting(scene, half, joints, frames)
            found, sure, come_from = _suggest_half(fitting, joints[frames][:, half.joints])
            joints[frames[:, None], own] = found
            confidence[own], source[own] = sure[0], come_from[0]
        if half is lower:
            stand_in(scene, joints, upper)
    pixels = scene.body_frame.to_pixels(joints[frame], frame)
    return PoseSuggestion(np.where(source[:, None] < 0, np.nan, pixels), confidence, source)


def _suggest_half(
    fitting: Fitting, known: Complex[np.ndarray, "N J"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(own joints, confidence, source frame) of one half; `known` joints stay."""
    templates, index = fitting.templates, fitting.index
    fitted = fit_similar(templates, index, fitting.distance, fitting.shift, OPTIONS.similar)
    hypotheses = join_hypotheses(fitted, propose_limbs(templates, index, fitted, LIMB_HYPOTHESES))
    limbs = _choose(templates, hypotheses, fitting.fps)
    chosen = np.where(np.isfinite(known), known, limbs.joints)
    weight = np.where(np.isfinite(known), FIXED_WEIGHT, _PULL)
    similar = fitted.template[:, 0]
    start = TemplateFits(np.arange(len(known)), similar, chosen)
    settled = register_templates(
        templates, index, start, SETTLING, joint_equations(chosen, weight)
    ).joints
    confidence = joint_confidence(templates, index, ChosenHypotheses(chosen, similar), settled)
    own = templates.half.free
    return settled[:, own], confidence[:, own], fitting.sources[limbs.template[:, own]]


def _choose(templates: EdgeTemplates, hypotheses: PoseHypotheses, fps: float) -> ChosenLimbs:
    """The best hypotheses, each frame by itself."""
    nobody = replace(
        templates.poses, **{f.name: getattr(templates.poses, f.name)[:0] for f in _PER_FIGURE}
    )
    chosen = []
    for n in range(len(hypotheses.template)):
        one = PoseHypotheses(
            *(getattr(hypotheses, f.name)[n : n + 1] for f in fields(PoseHypotheses))
        )
        feet = templates.feet and replace(templates.feet, points=templates.feet.points[n : n + 1])
        alone = replace(
            templates,
            poses=nobody,
            frame_elements=templates.frame_elements[n : n + 1],
            feet=feet,
        )
        chosen.append(choose_limbs(alone, one, fps))
    return ChosenLimbs(
        np.concatenate([one.joints for one in chosen]),
        np.concatenate([one.template for one in chosen]),
    )
