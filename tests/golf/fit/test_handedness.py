"""A left-hander is the mirror image of a right-hander, down to which side a limb is on."""

from dataclasses import replace

import numpy as np
from golf_truth import camera_before, even_times, observe

from keyrecon.body import LSP14
from keyrecon.golf.fit.handedness import mirror_observations
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.prior.skeleton import NAMES, size_body
from keyrecon.golf.records import Camera, SwingFit, SwingState
from keyrecon.io.formats.model_file import read_motion_model

FRAMES = 12
CAMERA = Camera(900.0, np.array([320.0, 240.0]))


def described(left_handed):
    rotation, position = camera_before(160)
    model = read_motion_model()
    state = SwingState(
        np.zeros(4), even_times(FRAMES, 2), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    nothing = observe(np.ones((FRAMES, 14, 3)), np.ones((FRAMES, 2, 3)), CAMERA, 0.0)
    observations = replace(nothing, left_handed=left_handed)
    fit = SwingFit(model, size_body(1.8), state)
    return describe_fit(fit, observations, np.arange(FRAMES) / 60)


def capsule_starts(fitted, name):
    """Where the capsules of a segment begin in the first frame."""
    mine = np.flatnonzero(fitted.capsules.segment == NAMES.index(name))
    turned = fitted.pose.rotations[0, NAMES.index(name)] @ fitted.capsules.start[mine].T
    return fitted.pose.origins[0, NAMES.index(name)] + turned.T


def test_the_capsules_of_a_side_lie_on_the_joints_of_that_side():
    for left_handed in (False, True):
        fitted = described(left_handed)
        for side in ("left", "right"):
            for part, joint in (("upper_arm", "shoulder"), ("forearm", "elbow"), ("shank", "knee")):
                start = capsule_starts(fitted, f"{side}_{part}")[0]
                there = fitted.motion.points3d[0, LSP14.index(f"{side}_{joint}")]
                np.testing.assert_allclose(start, there, atol=1e-9, err_msg=f"{side} {part}")


def test_a_left_handers_capsules_are_those_of_the_mirror_image():
    right, left = described(False), described(True)
    flip = np.array([-1.0, 1, 1])
    for side, other in (("left", "right"), ("right", "left")):
        mirrored = capsule_starts(right, f"{other}_shank") * flip
        np.testing.assert_allclose(capsule_starts(left, f"{side}_shank"), mirrored, atol=1e-9)


def test_observations_mirrored_twice_are_those_there_were():
    away, rng = np.array([0.0, 0.0, 5.0]), np.random.default_rng(0)
    joints, club = (rng.normal(0, 1, (FRAMES, n, 3)) + away for n in (14, 2))
    seen = observe(joints, club, CAMERA, 0.0)
    twice = mirror_observations(mirror_observations(seen, 640), 640)
    np.testing.assert_allclose(twice.joints, seen.joints, atol=1e-9)
    np.testing.assert_allclose(twice.camera.principal, seen.camera.principal)
