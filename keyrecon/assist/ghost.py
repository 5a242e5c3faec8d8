"""Joints of frames that nobody annotated yet, from the few that somebody did.

What `matching.propagate` does for a whole video is done for single frames here: the annotated
figures that look most like a frame are brought onto its edges, limbs of others are tried, the
combination that leaves the least of the edges unexplained is taken and fitted once more. There is
no path through time to lean on, so it takes a fraction of a second; each annotated frame makes the
next ghost better.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.matching.borrow import borrow_limbs
from keyrecon.matching.candidates import Candidates, fit_similar, join_candidates
from keyrecon.matching.choose import choose_limbs
from keyrecon.matching.correspondence import index_elements, list_elements
from keyrecon.matching.feet import learn_feet
from keyrecon.matching.fit import Figures, Step, fit_figures
from keyrecon.matching.follow import BORROWED, judge_joints
from keyrecon.matching.halves import Half, split_body
from keyrecon.matching.propagate import LEAST_MARKED, PropagateOptions, distances_to, gather_poses
from keyrecon.matching.puppet import Poses, Puppets, make_puppets
from keyrecon.matching.rows import observe_joints
from keyrecon.matching.settle import FOLLOW, HELD, LOOSE, REACHES, Proposal
from keyrecon.matching.window import Window, follow_player
from keyrecon.records import Annotations, Survey

SETTLING = tuple(Step(reach, LOOSE.length, LOOSE.swing) for reach in REACHES)
"""Last fit of the chosen figure, as `settle` does it for all frames at once."""


MOST = 10
"""Annotated figures of each half that are looked at; with more a ghost gets slower and no better."""
OPTIONS = PropagateOptions()
_PULL = 1 / FOLLOW**2
"""Weight of the chosen proposal in the last fit."""
HIPS = 0.45
"""Where the hips are on the way from head to mid-feet (Drillis and Contini: .53 of stature)."""
_PER_FIGURE = [field for field in fields(Poses) if field.name != "half"]


@dataclass(frozen=True, eq=False)
class Ghost:
    """Foreseen joints of one frame."""

    joints: Float[np.ndarray, "J 2"]
    """px; NaN where that half of the body has no annotated frame yet."""
    confidence: Float[np.ndarray, "J"]
    """0-1"""
    source: Int[np.ndarray, "J"]
    """Annotated frame that each joint comes from, -1 for none."""


def choose_sources(survey: Survey, annotations: Annotations, frame: int) -> Annotations:
    """The other annotated frames that look most like `frame`: all that its ghost depends on."""
    others = take_rows(annotations, annotations.frames != frame)
    near = []
    for half in split_body(annotations.skeleton):
        figures = _figures(others, half)
        distance = distances_to(survey.comparison, half.name, figures)[frame]
        near.append(figures[np.argsort(distance, kind="stable")[:MOST]])
    return take_rows(others, np.isin(others.frames, np.concatenate(near)))


def foresee_joints(
    survey: Survey,
    sources: Annotations,
    frame: int,
    held: Float[np.ndarray, "J 2"] | None = None,
) -> Ghost:
    """Joints of `frame` from annotated frames; what is marked there already is `held`, px."""
    skeleton = sources.skeleton
    window = follow_player(survey.track, survey.camera)
    lower, upper = split_body(skeleton)
    joints = np.full((len(survey.track.head), len(skeleton.names)), np.nan + 0j)
    joints[sources.frames] = window.from_pixels(sources.joints, sources.frames[:, None])
    if held is not None:
        joints[frame] = window.from_pixels(held, frame)
    confidence, source = np.zeros(joints.shape[1]), np.full(joints.shape[1], -1)
    view = _View(survey, window, sources)
    beyond = np.setdiff1d(_figures(sources, upper), _figures(sources, lower))
    for half, frames in ((lower, np.array([frame, *beyond])), (upper, np.array([frame]))):
        own = half.joints[half.own]
        if len(_figures(sources, half)):
            found, sure, come_from = _foresee_half(view, half, joints, frames)
            joints[frames[:, None], own] = found
            confidence[own], source[own] = sure[0], come_from[0]
        elif half is lower:
            _stand_in(survey, window, joints, upper)
    pixels = window.to_pixels(joints[frame], frame)
    return Ghost(np.where(source[:, None] < 0, np.nan, pixels), confidence, source)


def take_rows(annotations: Annotations, rows: Bool[np.ndarray, "K"]) -> Annotations:
    """Some of the annotated frames."""
    return replace(
        annotations,
        frames=annotations.frames[rows],
        joints=annotations.joints[rows],
        visible=annotations.visible[rows],
        nearer=annotations.nearer[rows],
    )


def _stand_in(
    survey: Survey, window: Window, joints: Complex[np.ndarray, "T J"], upper: Half
) -> None:
    """Joints that the lower body gives to the upper one, while nobody has marked any."""
    track = survey.track
    hips = track.head + HIPS * (track.mid_feet - track.head)
    given = upper.joints[upper.given]
    usual = window.from_pixels(hips, np.arange(len(hips)))[:, None]
    joints[:, given] = np.where(np.isnan(joints[:, given]), usual, joints[:, given])


@dataclass(frozen=True, eq=False)
class _View:
    """What is looked at."""

    survey: Survey
    window: Window
    sources: Annotations


def _figures(annotations: Annotations, half: Half) -> Int[np.ndarray, "K"]:
    """Frames that serve as figures of one half of the body."""
    marked = np.isfinite(annotations.joints[:, half.joints[half.own], 0])
    return annotations.frames[marked.mean(axis=1) >= LEAST_MARKED]


def _foresee_half(
    view: _View, half: Half, joints: Complex[np.ndarray, "T J"], frames: Int[np.ndarray, "N"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(own joints, confidence, source frame) of one half in some frames."""
    survey, window = view.survey, view.window
    poses = gather_poses(view.sources, window, half, joints[:, half.joints[half.given]])
    puppets = _dress(view, poses, frames)
    edges = tuple(survey.figures.edges[t] for t in frames)
    index = index_elements(edges, _some(window, frames))
    distance = distances_to(survey.comparison, half.name, poses.frames)[frames]
    anchor = survey.track.head if half.name == "upper" else survey.track.mid_feet
    at = window.from_pixels(anchor, np.arange(len(anchor)))
    shift = at[frames][:, None] - at[poses.frames]
    fitted = fit_similar(puppets, index, distance, shift, OPTIONS.similar)
    candidates = join_candidates(fitted, borrow_limbs(puppets, index, fitted, BORROWED))
    chosen, which = _choose(puppets, candidates)
    known = joints[frames][:, half.joints]
    chosen = np.where(np.isfinite(known), known, chosen)
    weight = np.where(np.isfinite(known), HELD, _PULL)
    every = np.arange(len(frames))
    start = Figures(every, fitted.which[:, 0], chosen)
    settled = fit_figures(puppets, index, start, SETTLING, observe_joints(chosen, weight)).joints
    proposal = Proposal(chosen, fitted.which[:, 0])
    confidence = judge_joints(puppets, index, proposal, settled)
    own = half.own
    return settled[:, own], confidence[:, own], poses.frames[which[:, own]]


def _some(window: Window, frames: Int[np.ndarray, "N"]) -> Window:
    return Window(window.origin[frames], window.height[frames])


def _dress(view: _View, poses: Poses, frames: Int[np.ndarray, "N"]) -> Puppets:
    """Annotated figures, and what is looked at in the frames that are asked for."""
    edges, half, window = view.survey.figures.edges, poses.half, view.window
    known = replace(poses, frames=np.arange(len(poses.frames)))
    outlines = tuple(edges[t] for t in poses.frames)
    puppets = make_puppets(outlines, _some(window, poses.frames), known, OPTIONS.elements)
    wanted = tuple(edges[t] for t in frames)
    puppets = replace(puppets, listed=list_elements(wanted, half.name, OPTIONS.elements))
    if half.name == "upper":
        return puppets
    tracked = window.from_pixels(view.survey.track.feet, np.arange(len(edges))[:, None])
    feet = learn_feet(half, poses.frames, poses.joints, tracked)
    return replace(puppets, feet=replace(feet, points=feet.points[frames]))


def _choose(
    puppets: Puppets, candidates: Candidates
) -> tuple[Complex[np.ndarray, "N J"], Int[np.ndarray, "N J"]]:
    """The best proposals, each frame by itself: (joints, figure that they come from)."""
    nobody = replace(
        puppets.poses, **{f.name: getattr(puppets.poses, f.name)[:0] for f in _PER_FIGURE}
    )
    found = []
    for n in range(len(candidates.which)):
        one = Candidates(*(getattr(candidates, f.name)[n : n + 1] for f in fields(Candidates)))
        feet = puppets.feet and replace(puppets.feet, points=puppets.feet.points[n : n + 1])
        alone = replace(puppets, poses=nobody, listed=puppets.listed[n : n + 1], feet=feet)
        found.append(choose_limbs(alone, one))
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))
