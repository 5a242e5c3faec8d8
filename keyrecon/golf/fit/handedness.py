"""Left-handed players: observations are mirrored for the right-handed model, the result back.

Exchanging left and right of a picture moves the principal point with it, and mirrors space about
the plane x = 0 of the camera.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.fit.swing_search import SwingEvidence
from keyrecon.golf.prior.skeleton import NAMES
from keyrecon.golf.records import (
    Camera,
    Capsules,
    InitialJoints,
    Matches,
    Observations,
    RootPose,
    SwingMarks,
)

MIRROR_X = np.array([-1.0, 1.0, 1.0])
_OTHER_SIDE = {"left": "right", "right": "left"}


def _mirror_name(name: str) -> str:
    side, _, joint = name.partition("_")
    return f"{_OTHER_SIDE[side]}_{joint}" if side in _OTHER_SIDE else name


SEGMENT_MIRROR = np.array([NAMES.index(_mirror_name(name)) for name in NAMES])
"""Index of each segment's mirror image."""


def mirror_pixels(pixels: Float[np.ndarray, "*n 2"], width: int) -> Float[np.ndarray, "*n 2"]:
    """Points of a picture of some width with left and right exchanged."""
    mirrored = pixels.copy()
    mirrored[..., 0] = width - 1 - pixels[..., 0]
    return mirrored


def mirror_initial(joints: InitialJoints, width: int) -> InitialJoints:
    """Initial joints of the mirrored player, in the same order."""
    names = tuple(_mirror_name(name) for name in joints.names)
    return InitialJoints(joints.frame, names, mirror_pixels(joints.places, width))


def mirror_observations(observations: Observations, width: int) -> Observations:
    """What would have been observed of the mirrored player in pictures of some width."""
    camera, matches = observations.camera, observations.matches
    return replace(
        observations,
        camera=Camera(camera.focal, mirror_pixels(camera.principal, width)),
        initial=mirror_initial(observations.initial, width),
        joints=mirror_pixels(observations.joints[:, LSP14.mirror], width),
        spread=observations.spread[:, LSP14.mirror],
        club=mirror_pixels(observations.club, width),
        foreground=tuple(mirror_pixels(f, width) for f in observations.foreground),
        silhouette_distance=observations.silhouette_distance[:, :, ::-1],
        matches=Matches(
            matches.frame, mirror_pixels(matches.start, width), mirror_pixels(matches.end, width)
        ),
        marks=mirror_marks(observations.marks, width),
    )


def mirror_marks(marks: SwingMarks, width: int) -> SwingMarks:
    """What would have been marked of the mirrored player."""
    return replace(
        marks, joints=mirror_pixels(marks.joints[:, LSP14.mirror], width),
        shafts=mirror_pixels(marks.shafts, width),
    )  # fmt: skip


def mirror_pose(pose: RootPose) -> RootPose:
    """The pose in mirrored space, whose right limbs are the left ones of before.

    Capsules must be mirrored with it.
    """
    flip = np.diag(MIRROR_X)
    return RootPose(
        pose.origins[:, SEGMENT_MIRROR] * MIRROR_X, flip @ pose.rotations[:, SEGMENT_MIRROR] @ flip
    )


def mirror_capsules(capsules: Capsules) -> Capsules:
    """Capsules of the mirrored body, for a mirrored pose."""
    return Capsules(
        SEGMENT_MIRROR[capsules.segment], capsules.start * MIRROR_X, capsules.end * MIRROR_X,
        capsules.radii,
    )  # fmt: skip


def mirror_evidence(evidence: SwingEvidence, width: int) -> SwingEvidence:
    """What a mirrored film of some width would show."""
    shafts = [replace(s, ends=mirror_pixels(s.ends, width)) for s in evidence.shafts]
    return replace(evidence, players=evidence.players[:, :, ::-1], shafts=tuple(shafts))
