"""Several pose hypotheses for every frame: similar templates, other limbs, tracked neighbours.

From the annotated frames that are most like a frame, each template registered to its edges; from
the best of these with the limbs of other annotated frames; and from the annotated frames before
and after it in time, tracked step by step at the speed they have and registered at each step. The
first two kinds never drift but may take one leg for the other; the last knows which leg is which
for as long as it does not lose the player.

Few annotated frames cannot have every combination of arms and legs, but each of their limbs can be
had by itself: turned about the shoulder or hip of the frame, the one that matches the most edges is
a good start. Of limbs that end at the same place only the best is kept.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.correspondence import ElementIndex, TemplateFits, score_fits
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.registration import (
    COARSE_TO_FINE,
    RegistrationStep,
    register_templates,
    shape_equations,
)
from keyrecon.records import Shots

TRACKING_SCHEDULE = (RegistrationStep(0.05, 0.006, 0.02), RegistrationStep(0.03, 0.006, 0.02))
"""Corrections of a pose that was predicted from the neighbouring frame. Halved or doubled, others
with it: at most 0.3 points, 0.3 mm on one clip."""
LENGTH_PRIOR = RegistrationStep(0.0, 0.04, 1.0)
"""How firmly its bones keep the lengths of the most similar annotated frame. Halved or doubled,
others with it: at most 0.3 points, 0.1 mm on one clip."""
DISSIMILARITY_COST, MAX_DISSIMILARITY = 0.5, 4.0
"""Prior cost per median distance to the nearest keyframe, which counts up to so many times. Halved
or doubled, others with it: at most 0.3 points, 0.6 mm on one clip. None of the three nearest is so
far in the eight rendered sequences (at most 3.95 medians) and three real rallies; in swings, whose
median is that of somebody who stands, some are at 4 to 8."""
TRACKING_COST_PER_SECOND, MAX_TRACKING_SECONDS = 1.0, 3.0
"""Prior cost of a tracked pose, by the time since its annotated frame, and the time that counts.
Halved or doubled, others with it: at most 0.1 points, 0.2 mm on one clip. With no end to it: the
same bits on four clips of 6 s."""
VELOCITY_PERSISTENCE = 0.9
"""Share of its velocity that a joint is expected to keep over 1/50 s: joints of a tennis stroke
change it by a tenth or so. Halved or doubled, others with it: at most 0.1 points, 0.2 mm on one
clip."""
LIMB_SCHEDULE = (
    RegistrationStep(0.08, 0.02, 0.05, stride=2),
    RegistrationStep(0.06, 0.02, 0.08, stride=2),
    RegistrationStep(0.05, 0.02, 0.08),
)
"""A limb hypothesis starts nearer to its place than a whole template. Halved or doubled, others
with it: at most 0.1 points, 0.2 mm on one clip."""
MIN_FLOW_CONFIDENCE = 0.02
"""Flow that is less sure than this leads nowhere. A quarter more or less, others with it: at most
1.5 points, 2.1 mm on nine clips."""
LIMB_HYPOTHESIS_COST = 1.0
"""Prior cost of another frame's limb: without edges that speak for it, a pose keeps its limbs.
Halved or doubled, others with it: at most 0.0 points, 0.1 mm on one clip."""


@dataclass(frozen=True, eq=False)
class PoseHypotheses:
    """S hypotheses for each frame."""

    joints: Complex[np.ndarray, "T S J"]
    residual: Float[np.ndarray, "T S B"]
    """Of every bone, 0-1 (`FitScores`)."""
    unexplained: Float[np.ndarray, "T S 3 F"]
    """How far each of the frame's elements is from each part of the body."""
    template: Int[np.ndarray, "T S"]
    """Row of the annotated frame that it comes from, or that is most similar."""
    prior_cost: Float[np.ndarray, "T S"]
    """Cost before edges are considered; infinite where there is no hypothesis."""
    unlikeness: Float[np.ndarray, "T S 2 J"]
    """How unlike marks joints look (`JointAppearance`); 0 where pictures were not looked at."""
    bone_unlikeness: Float[np.ndarray, "T S 2 B"]
    """The same of the middles of limbs' bones."""
    color_unlikeness: Float[np.ndarray, "T S 2 B"]
    """How improbable the colours along limbs' bones are (`BoneColors`), nats."""

    @property
    def best(self) -> Int[np.ndarray, "T"]:
        """The hypothesis of every frame that edges fit best."""
        return self.residual.mean(axis=2).argmin(axis=1)

    @property
    def best_joints(self) -> Complex[np.ndarray, "T J"]:
        """Its joints."""
        return self.joints[np.arange(len(self.joints)), self.best]


@dataclass(frozen=True, eq=False)
class MarkPredictions:
    """Joints predicted from marks by optical flow and by straight lines, player coordinates."""

    flow: Complex[np.ndarray, "T J"]
    """0 where flow says nothing."""
    flow_confidence: Float[np.ndarray, "T J"]
    """0 where it does not join two marks."""
    lines: Complex[np.ndarray, "T J"]
    seconds: Float[np.ndarray, "T J"]
    """From the nearest mark of the joint."""

    @property
    def joints(self) -> Complex[np.ndarray, "T J"]:
        """By flow where it is at all sure, else by lines."""
        return np.where(self.flow_confidence > MIN_FLOW_CONFIDENCE, self.flow, self.lines)


def join_hypotheses(*parts: PoseHypotheses) -> PoseHypotheses:
    """All hypotheses side by side."""
    names = [field.name for field in fields(PoseHypotheses)]
    return PoseHypotheses(*(np.concatenate([getattr(p, n) for p in parts], axis=1) for n in names))


def fit_similar(
    templates: EdgeTemplates,
    index: ElementIndex,
    distance: Float[np.ndarray, "T K"],
    shift: Complex[np.ndarray, "T K"],
    most: int,
) -> PoseHypotheses:
    """Fit the `most` similar templates to every frame; `shift` aligns template and frame first."""
    ranked = np.argsort(distance, axis=1, kind="stable")[:, :most]
    frames, rows = np.repeat(np.arange(len(ranked)), ranked.shape[1]), ranked.ravel()
    start = templates.poses.joints[rows] + shift[frames, rows][:, None]
    fitted = fit_hypotheses(templates, index, TemplateFits(frames, rows, start), COARSE_TO_FINE)
    median = max(float(np.median(distance.min(axis=1))), 1e-9)
    dissimilarity = np.take_along_axis(distance, ranked, axis=1) / median
    cost = DISSIMILARITY_COST * np.minimum(dissimilarity, MAX_DISSIMILARITY)
    return replace(fitted, prior_cost=cost)


def fit_hypotheses(
    templates: EdgeTemplates,
    index: ElementIndex,
    start: TemplateFits,
    schedule: tuple[RegistrationStep, ...],
) -> PoseHypotheses:
    """Fit and score templates, the same number for each frame, one frame after the other."""

    def fit(part: TemplateFits) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        fits = register_templates(templates, index, part, schedule)
        scores = score_fits(templates, index, fits)
        return fits.joints, scores.residual, scores.unexplained

    joints, residual, unexplained = start.in_blocks(fit)
    shape = (start.frames[-1] + 1, -1)
    return PoseHypotheses(
        joints.reshape(shape[0], -1, joints.shape[1]),
        residual.reshape(shape[0], -1, residual.shape[1]),
        unexplained.reshape(shape[0], -1, *unexplained.shape[1:]),
        start.template.reshape(shape),
        np.zeros((shape[0], len(joints) // shape[0])),
        np.zeros((shape[0], len(joints) // shape[0], 2, joints.shape[1])),
        np.zeros((shape[0], len(joints) // shape[0], 2, residual.shape[1])),
        np.zeros((shape[0], len(joints) // shape[0], 2, residual.shape[1])),
    )


def track_from_keyframes(
    templates: EdgeTemplates,
    index: ElementIndex,
    similar: Int[np.ndarray, "T"],
    shots: Shots,
    fps: float,
) -> PoseHypotheses:
    """Track every annotated pose forwards and back up to the next annotated one of its shot.

    Two hypotheses per frame: from the annotated frame before it, and from the one after it.
    """
    poses, count = templates.poses, len(similar)
    joints = np.zeros((2, count, poses.joints.shape[1]), complex)
    age = np.full((2, count), np.inf)
    joints[:, poses.frames], age[:, poses.frames] = poses.joints, 0
    way, last = np.repeat([0, 1], len(poses.frames)), np.tile(poses.frames, 2)
    velocity = np.zeros((len(last), joints.shape[2]), complex)
    persistence, shot = VELOCITY_PERSISTENCE ** (50 / fps), shots.number
    while len(last):
        ahead = last + np.where(way == 0, 1, -1)
        going = (ahead >= 0) & (ahead < count)
        going[going] = np.isinf(age[way[going], ahead[going]])
        going[going] = shot[ahead[going]] == shot[last[going]]
        way, last, ahead, velocity = way[going], last[going], ahead[going], velocity[going]
        predicted = joints[way, last] + persistence * velocity
        lengths = shape_equations(templates, predicted, poses.joints[similar[ahead]], LENGTH_PRIOR)
        start = TemplateFits(ahead, np.full(len(ahead), templates.average), predicted)
        fits = register_templates(templates, index, start, TRACKING_SCHEDULE, lengths)
        joints[way, ahead] = fits.joints
        age[way, ahead] = age[way, last] + 1
        last, velocity = ahead, joints[way, ahead] - joints[way, last]
    frames = np.repeat(np.arange(count), 2)
    paired = np.swapaxes(joints, 0, 1).reshape(2 * count, -1)
    tracked = TemplateFits(frames, np.full(2 * count, templates.average), paired)
    scored = fit_hypotheses(templates, index, tracked, ())
    frame_cost, most = TRACKING_COST_PER_SECOND / fps, MAX_TRACKING_SECONDS * fps
    cost = np.where(np.isfinite(age), frame_cost * np.minimum(age, most), np.inf)
    return replace(scored, template=np.repeat(similar[:, None], 2, axis=1), prior_cost=cost.T)


def fit_limbs(
    templates: EdgeTemplates,
    index: ElementIndex,
    hypotheses: PoseHypotheses,
    joints: Complex[np.ndarray, "T S J"],
) -> PoseHypotheses:
    """The best trunk with limbs of other annotated frames, fitted to edges."""
    frames, best = np.arange(len(joints)), hypotheses.best
    fitted = fit_poses(templates, index, joints, hypotheses.template[frames, best])
    cost = hypotheses.prior_cost[frames, best] + LIMB_HYPOTHESIS_COST
    return replace(fitted, prior_cost=np.repeat(cost[:, None], joints.shape[1], axis=1))


def fit_poses(
    templates: EdgeTemplates,
    index: ElementIndex,
    joints: Complex[np.ndarray, "T S J"],
    similar: Int[np.ndarray, "T"],
    schedule: tuple[RegistrationStep, ...] = LIMB_SCHEDULE,
) -> PoseHypotheses:
    """Given poses, fitted to edges with the average outline."""
    count, width = joints.shape[:2]
    frames = np.repeat(np.arange(count), width)
    average = np.full(len(frames), templates.average)
    start = TemplateFits(frames, average, joints.reshape(len(frames), -1))
    fitted = fit_hypotheses(templates, index, start, schedule)
    return replace(fitted, template=np.repeat(similar[:, None], width, axis=1))


def fit_mark_predictions(
    templates: EdgeTemplates,
    index: ElementIndex,
    predictions: MarkPredictions,
    similar: Int[np.ndarray, "T"],
) -> PoseHypotheses:
    """Two hypotheses per frame: where flow leads as it is, and straight lines fitted to edges."""
    flow = fit_poses(templates, index, predictions.joints[:, None], similar, ())
    lines = fit_poses(templates, index, predictions.lines[:, None], similar)
    return join_hypotheses(flow, lines)
