"""What the frames annotated so far say about the body: its size, and poses whose signs are known.

A keyframe of one half of the body shows no whole trunk, and without a trunk nobody can tell which
way a limb points. Joints that are not marked are therefore taken from the suggestion for the frame,
with the spread that propagated joints have.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.annotate.assist.pose_estimate import FrameObservation
from keyrecon.annotate.assist.pose_suggestion import PoseSuggestion
from keyrecon.body import Skeleton
from keyrecon.lifting.depth_signs import choose_depth_signs
from keyrecon.lifting.limb_lengths import BodySize, LengthOptions, estimate_lengths
from keyrecon.lifting.marked_sizes import HEAD_TO_FEET
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.taylor import foreshorten_bones
from keyrecon.records import Annotations, JointTracks

UNCONFIRMED_SIGN = 0.3
"""Weight of a sign that nobody gave, against one that was given."""


@dataclass(frozen=True, eq=False)
class BodyEstimate:
    """The player's body, as far as annotated frames tell."""

    size: BodySize
    frames: Int[np.ndarray, "K"]
    vectors: Float[np.ndarray, "K B 3"]
    """Bone vectors of the annotated frames, body heights."""
    confidence: Float[np.ndarray, "K B"]
    """0-1: how far the sign of each bone's depth can be believed."""
    skeleton: Skeleton

    def exemplars(self, frame: int) -> ExemplarPrior | None:
        """All other frames as evidence for the signs of this one; None without any."""
        rows = np.flatnonzero(self.frames != frame)
        if not len(rows):
            return None
        nowhere, unguided = np.full(len(rows), -1), np.zeros((1, self.vectors.shape[1]))
        return ExemplarPrior(
            self.vectors[rows], nowhere, self.confidence[rows], unguided, self.skeleton
        )

    def observe(
        self,
        frame: int,
        joints: Float[np.ndarray, "J 2"],
        nearer: Int[np.ndarray, "B"],
        suggestion: PoseSuggestion | None = None,
    ) -> FrameObservation:
        """A frame's marks (px), and its suggestion where nothing is marked."""
        marked = np.isfinite(joints[:, 0])
        places = joints
        if suggestion is not None:
            places = np.where(marked[:, None], joints, suggestion.joints)
        spread = np.where(marked, LengthOptions.click_noise, LengthOptions.track_noise)
        return FrameObservation(places / self.size.scale[frame], spread, nearer)


def estimate_body(
    annotations: Annotations,
    suggestions: Mapping[int, PoseSuggestion],
    height_px: Float[np.ndarray, "T"],
    fps: float,
) -> BodyEstimate:
    """Size and signs from everything annotated; `suggestions` by frame, where there are any."""
    skeleton, n_bones = annotations.skeleton, len(annotations.skeleton.bones)
    size = _measure(annotations, height_px, fps)
    plain = BodyEstimate(
        size, annotations.frames[:0], np.zeros((0, n_bones, 3)), np.zeros((0, n_bones)), skeleton
    )
    rows = zip(annotations.frames.tolist(), annotations.joints, annotations.nearer, strict=True)
    observed = [plain.observe(t, joints, signs, suggestions.get(t)) for t, joints, signs in rows]
    if not observed:
        return plain
    joints, spread = np.stack([s.joints for s in observed]), np.stack([s.spread for s in observed])
    bones = foreshorten_bones(joints, spread, size.lengths, skeleton)
    signs = choose_depth_signs(bones, annotations.nearer, size.breadths, skeleton)
    vectors = np.concatenate([bones.in_plane, (signs.sign * bones.depth)[..., None]], axis=-1)
    known = np.isfinite(joints[:, skeleton.bones, 0]).all(axis=2)
    guessed = UNCONFIRMED_SIGN * (2 * signs.probability - 1)
    confidence = known * np.where(annotations.nearer != 0, 1.0, guessed)
    return BodyEstimate(size, annotations.frames, vectors, confidence, skeleton)


def _measure(annotations: Annotations, height_px: Float[np.ndarray, "T"], fps: float) -> BodySize:
    """The body's size; that of the table while nothing is marked."""
    skeleton = annotations.skeleton
    ends = annotations.joints[:, skeleton.bones]
    if not np.isfinite(ends).all(axis=(2, 3)).any():
        across = np.array([breadth.length for breadth in skeleton.breadths])
        return BodySize(skeleton, skeleton.lengths, across, height_px / HEAD_TO_FEET)
    nothing = np.full((len(height_px), len(skeleton.names), 2), np.nan)
    nowhere = np.zeros(nothing.shape[:2])
    tracks = JointTracks(nothing, nowhere)
    return estimate_lengths(tracks, annotations, height_px, fps)
