"""Where a player stands by six clicks."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from keyrecon.golf.fit.initial_pose import LEVEL, _mean_points, estimate_initial_pose
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints
from keyrecon.io.formats.model_file import read_motion_model

NAMES = ("head_top", "root", "right_knee", "left_knee", "right_ankle", "left_ankle")
CENTRE = np.array([639.5, 359.5])


def placed(clicks, scale):
    """By the same clicks in a picture of another size."""
    camera = Camera(1000.0 * scale, (CENTRE + 0.5) * scale - 0.5)
    joints = InitialJoints(0, NAMES, (clicks + 0.5) * scale - 0.5)
    return estimate_initial_pose(joints, 0.0, camera, read_motion_model(), size_body(1.8))


@pytest.mark.parametrize("heading", [0.3, 1.6, 4.0])
def test_where_a_player_stands_does_not_hang_on_the_size_of_the_picture(heading):
    points = _mean_points(NAMES, 0.0, read_motion_model(), size_body(1.8))
    base = LEVEL @ Rotation.from_euler("y", heading).as_matrix()
    clicks, _ = project(points @ base.T + [0, 0.2, 5.0], Camera(1000.0, CENTRE))
    chance = np.random.default_rng(1)
    clicks += chance.normal(0, 0.02 * np.ptp(clicks[:, 1]), clicks.shape)  # other proportions
    one, other = (placed(clicks, scale) for scale in (1.0, 4.0))
    turned = Rotation.from_matrix(other.rotation @ one.rotation.T).magnitude()
    assert np.degrees(turned) < 0.05
    np.testing.assert_allclose(other.position, one.position, atol=0.003)
