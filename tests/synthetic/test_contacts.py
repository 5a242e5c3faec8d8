"""Which foot stands is told by ankles and toes together."""

import numpy as np

from keyrecon.synthetic.contacts import find_contacts

FPS = 50.0


def feet(frames=100):
    """Two feet flat on the floor."""
    ankles = np.tile([[0.1, 0.08, 0.0], [-0.1, 0.08, 0.0]], (frames, 1, 1)).astype(float)
    return ankles, ankles + np.array([0, -0.05, 0.17])


def test_feet_that_lie_on_the_floor_stand():
    assert find_contacts(*feet(), FPS).all()


def test_a_foot_whose_heel_rises_about_its_toes_stands():
    ankles, toes = feet()
    angle = np.linspace(0, 0.6, 30)
    away = ankles[0, 0] - toes[0, 0]
    turned = [away[1] * np.cos(angle) - away[2] * np.sin(angle),
              away[2] * np.cos(angle) + away[1] * np.sin(angle)]  # fmt: skip
    ankles[60:90, 0, 1:] = toes[0, 0, 1:] + np.stack(turned, axis=1)
    ankles[90:, 0] = ankles[89, 0]
    assert ankles[95, 0, 1] > 0.15
    assert find_contacts(ankles, toes, FPS)[:, 0].all()


def test_a_foot_that_swings_or_is_held_up_does_not_stand():
    ankles, toes = feet()
    swing = np.linspace(0, 0.8, 20)
    for points in (ankles, toes):
        points[40:60, 1, 2] += swing
        points[60:, 1, 2] += swing[-1]
        points[60:, 1, 1] += 0.1
    contact = find_contacts(ankles, toes, FPS)
    assert contact[:38, 1].all() and not contact[42:, 1].any()
    assert contact[:, 0].all()


def test_captured_toes_may_end_above_the_floor():
    ankles, toes = feet()
    toes[..., 1] += 0.06
    assert find_contacts(ankles, toes, FPS).all()
