"""Joints of a frame that nobody annotated yet, from the few frames that somebody did.

What `propagation` does for a whole video is done for a single frame here: edge templates of the
most similar annotated frames are registered on its edges, limbs of others are tried, the
combination that leaves the least of the edges unexplained is taken and registered once more. There
is no trajectory to be smoothed, so it takes a fraction of a second; each annotated frame makes the
next suggestion better. Templates fitted to the annotated frames themselves are what `checks` needs.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.propagation.body_frame import BodyFrame, stabilise_shots
from keyrecon.propagation.bone_bounds import bound_bones
from keyrecon.propagation.correspondence import (
    HYPOTHESIS_SPREAD,
    ElementIndex,
    TemplateFits,
    index_elements,
    joint_confidence,
)
from keyrecon.propagation.edge_template import (
    AnnotatedPoses,
    EdgeTemplates,
    feet_in_sight,
    learn_foot_offsets,
    list_half_elements,
    make_edge_templates,
)
from keyrecon.propagation.half_body import BodyHalf, split_body
from keyrecon.propagation.hypotheses import (
    PoseHypotheses,
    fit_limbs,
    fit_similar,
    join_hypotheses,
)
from keyrecon.propagation.limb_search import search_by_edges
from keyrecon.propagation.marked_poses import LEAST_MARKED, distances_to, gather_poses
from keyrecon.propagation.propagation import LIMB_HYPOTHESES, PropagateOptions
from keyrecon.propagation.registration import (
    FIXED_WEIGHT,
    RegistrationStep,
    joint_equations,
    register_templates,
)
from keyrecon.propagation.selection import ChosenLimbs, choose_limbs
from keyrecon.propagation.silhouette import Silhouettes, gather_silhouettes
from keyrecon.propagation.trajectory_smoothing import SEARCH_RADII, SHAPE_PRIOR
from keyrecon.records import Annotations, Preparation, Shots

OPTIONS = PropagateOptions()
HIP_POSITION = 0.45
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
    return SuggestionScene(preparation, _body_frame(preparation), sources)


@lru_cache(maxsize=1)
def _body_frame(preparation: Preparation) -> BodyFrame:
    """Kept from one suggestion to the next: of an hour of video it takes seconds."""
    made = preparation
    return stabilise_shots(made.track, made.camera, made.shots, made.video.fps)


@dataclass(frozen=True, eq=False)
class Fitting:
    """Edge templates of K annotated frames, to be fitted to N frames."""

    templates: EdgeTemplates
    """Rows of `frame_elements` and `feet` are the N frames."""
    index: ElementIndex
    distance: Float[np.ndarray, "N K"]
    """Pose distance, player heights."""
    shift: Complex[np.ndarray, "N K"]
    """From each template to the same pose in each frame, by head or feet."""
    sources: Int[np.ndarray, "K"]
    """Frame numbers."""
    silhouettes: Silhouettes
    """Of the N frames."""
    fps: float


def prepare_fitting(
    scene: SuggestionScene,
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    frames: Int[np.ndarray, "N"],
) -> Fitting:
    """Edge templates of a half; `joints` has what the other half gives to it."""
    preparation, body_frame = scene.preparation, scene.body_frame
    marks = body_frame.of_marks(scene.sources)
    poses = gather_poses(marks, bound_bones(marks), half, joints[:, half.joints[half.fixed]])
    edges = tuple(preparation.edges[t] for t in frames)
    own_frame = _select_frames(body_frame, frames)
    index, silhouettes = index_elements(edges, own_frame), gather_silhouettes(edges, own_frame)
    distance = distances_to(preparation.pose_distances, half.name, poses.frames)[frames]
    at = scene.at(preparation.track.head if half.name == "upper" else preparation.track.mid_feet)
    shift = at[frames][:, None] - at[poses.frames]
    templates = _make_templates(scene, poses, frames)
    fps = preparation.video.fps
    return Fitting(templates, index, distance, shift, poses.frames, silhouettes, fps)


def _select_frames(body_frame: BodyFrame, frames: Int[np.ndarray, "N"]) -> BodyFrame:
    return BodyFrame(body_frame.origin[frames], body_frame.height[frames])


def _make_templates(
    scene: SuggestionScene, poses: AnnotatedPoses, frames: Int[np.ndarray, "N"]
) -> EdgeTemplates:
    """Templates of the annotated frames, and the elements of the frames they are fitted to."""
    edges, half, body_frame = scene.preparation.edges, poses.half, scene.body_frame
    known = replace(poses, frames=np.arange(len(poses.frames)))
    outlines = tuple(edges[t] for t in poses.frames)
    templates = make_edge_templates(
        outlines, _select_frames(body_frame, poses.frames), known, OPTIONS.elements
    )
    wanted = tuple(edges[t] for t in frames)
    templates = replace(
        templates, frame_elements=list_half_elements(wanted, half.name, OPTIONS.elements)
    )
    if half.name == "upper":
        return templates
    track = scene.preparation.track
    tracked = body_frame.from_pixels(track.feet, np.arange(len(edges))[:, None])
    feet = learn_foot_offsets(poses, tracked, feet_in_sight(scene.preparation))
    return replace(templates, feet=feet.part(frames))


def template_frames(annotations: Annotations, half: BodyHalf) -> Int[np.ndarray, "K"]:
    """Frames that serve as templates of one half; none until each of its bones is marked once."""
    marked = np.isfinite(annotations.joints[:, half.joints, 0])
    sufficient = marked[:, half.free].mean(axis=1) >= LEAST_MARKED
    bones = half.bones[~half.fixed[half.bones].any(axis=1)]
    whole = marked[sufficient][:, bones].all(axis=2).any(axis=0).all()
    return annotations.frames[sufficient & whole]


def fill_in_hips(
    scene: SuggestionScene, joints: Complex[np.ndarray, "T J"], upper: BodyHalf
) -> None:
    """Fill in what the lower body gives to the upper one where nothing better is known."""
    track = scene.preparation.track
    hips = scene.at(track.head + HIP_POSITION * (track.mid_feet - track.head))[:, None]
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


FINAL_REGISTRATION = tuple(
    RegistrationStep(radius, SHAPE_PRIOR.length_spread, SHAPE_PRIOR.transverse_spread)
    for radius in SEARCH_RADII
)
"""Of the chosen pose, as trajectory smoothing does it for all frames at once."""
MAX_SOURCES = 10
"""Annotated frames used for each half; with more a suggestion gets slower and no better."""
HYPOTHESIS_WEIGHT = 1 / HYPOTHESIS_SPREAD**2
"""Weight of the chosen hypothesis in the final registration."""
_PER_POSE_FIELDS = [f for f in fields(AnnotatedPoses) if f.name not in ("half", "longest")]


@dataclass(frozen=True, eq=False)
class PoseSuggestion:
    """Suggested joints of one frame."""

    joints: Float[np.ndarray, "J 2"]
    """px; NaN where that half of the body has no annotated frame yet."""
    confidence: Float[np.ndarray, "J"]
    """0-1"""
    source: Int[np.ndarray, "J"]
    """Annotated frame that each joint comes from, -1 for none."""


def choose_sources(preparation: Preparation, annotations: Annotations, frame: int) -> Annotations:
    """The annotated frames most similar to `frame`: all that its suggestion depends on."""
    others = take_rows(annotations, annotations.frames != frame)
    near = []
    for half in split_body(annotations.skeleton):
        frames = template_frames(others, half)
        distance = distances_to(preparation.pose_distances, half.name, frames)[frame]
        near.append(frames[np.argsort(distance, kind="stable")[:MAX_SOURCES]])
    return take_rows(others, np.isin(others.frames, np.concatenate(near)))


def suggest_joints(
    preparation: Preparation,
    sources: Annotations,
    frame: int,
    marks: Float[np.ndarray, "J 2"] | None = None,
) -> PoseSuggestion:
    """Joints of `frame` from annotated frames; `marks` of its own stay (px)."""
    skeleton = sources.skeleton
    scene = scene_of(preparation, sources)
    lower, upper = split_body(skeleton)
    joints = np.full((len(preparation.track.head), len(skeleton.names)), np.nan + 0j)
    joints[sources.frames] = scene.from_pixels(sources.joints, sources.frames)
    if marks is not None:
        joints[frame] = scene.body_frame.from_pixels(marks, frame)
    confidence, source = np.zeros(joints.shape[1]), np.full(joints.shape[1], -1)
    only_upper = np.setdiff1d(template_frames(sources, upper), template_frames(sources, lower))
    for half, frames in ((lower, np.array([frame, *only_upper])), (upper, np.array([frame]))):
        members = half.joints[half.free]
        if len(template_frames(sources, half)):
            fitting = prepare_fitting(scene, half, joints, frames)
            suggested = _suggest_half(fitting, joints[frames][:, half.joints])
            joints[frames[:, None], members] = suggested.joints
            confidence[members] = suggested.confidence[0]
            source[members] = suggested.source[0]
        if half is lower:
            fill_in_hips(scene, joints, upper)
    pixels = scene.body_frame.to_pixels(joints[frame], frame)
    return PoseSuggestion(np.where(source[:, None] < 0, np.nan, pixels), confidence, source)


@dataclass(frozen=True, eq=False)
class _HalfSuggestion:
    """The joints that one half of the body has of its own, on N frames."""

    joints: Complex[np.ndarray, "N J"]
    confidence: Float[np.ndarray, "N J"]
    source: Int[np.ndarray, "N J"]
    """Frame that each joint comes from."""


def _suggest_half(fitting: Fitting, known: Complex[np.ndarray, "N J"]) -> _HalfSuggestion:
    """Joints of one half; those that are `known` stay."""
    templates, index = fitting.templates, fitting.index
    fitted = fit_similar(templates, index, fitting.distance, fitting.shift, OPTIONS.similar)
    limb_poses = search_by_edges(templates, index, fitted.best_joints, LIMB_HYPOTHESES)
    hypotheses = join_hypotheses(fitted, fit_limbs(templates, index, fitted, limb_poses))
    limbs = _choose_each(templates, hypotheses, fitting.silhouettes, fitting.fps)
    found = np.concatenate([one.joints for one in limbs])
    chosen = np.where(np.isfinite(known), known, found)
    weight = np.where(np.isfinite(known), FIXED_WEIGHT, HYPOTHESIS_WEIGHT)
    similar = fitted.template[:, 0]
    start = TemplateFits(np.arange(len(known)), similar, chosen)
    final = register_templates(
        templates, index, start, FINAL_REGISTRATION, joint_equations(chosen, weight)
    ).joints
    confidence = joint_confidence(templates, index, chosen, final)
    free = templates.half.free
    template = np.concatenate([one.template for one in limbs])
    source = fitting.sources[template[:, free]]
    return _HalfSuggestion(final[:, free], confidence[:, free], source)


def _choose_each(
    templates: EdgeTemplates, hypotheses: PoseHypotheses, silhouettes: Silhouettes, fps: float
) -> list[ChosenLimbs]:
    """The best hypotheses, each frame by itself."""
    no_poses = replace(
        templates.poses, **{f.name: getattr(templates.poses, f.name)[:0] for f in _PER_POSE_FIELDS}
    )
    chosen = []
    for n in range(len(hypotheses.template)):
        one = PoseHypotheses(
            *(getattr(hypotheses, f.name)[n : n + 1] for f in fields(PoseHypotheses))
        )
        feet = templates.feet and templates.feet.part(slice(n, n + 1))
        single = replace(
            templates,
            poses=no_poses,
            frame_elements=templates.frame_elements[n : n + 1],
            feet=feet,
        )
        silhouette = silhouettes.take(slice(n, n + 1))
        chosen.append(choose_limbs(single, one, Shots.between((), 1), fps, None, silhouette))
    return chosen
