"""Hypotheses that edges and pictures say nothing about, to be chosen among."""

import numpy as np

from keyrecon.propagation.edge_template import AnnotatedPoses, EdgeTemplates, TemplateElements
from keyrecon.propagation.hypotheses import PoseHypotheses


def choice(half, joints, cost, longest):
    """Templates without elements or marks, and hypotheses that edges say nothing about."""
    count, width = cost.shape
    none = np.zeros(0, int)
    poses = AnnotatedPoses(
        half, none, joints[:0, 0], np.zeros((0, len(half.joints)), bool), longest
    )
    empty = TemplateElements(
        *(np.zeros((1, 1), t) for t in (int, float, complex, complex, int, float))
    )
    weights = np.zeros((1, 1, len(half.joints)), np.float32)
    templates = EdgeTemplates(poses, empty, weights, np.full((count, 1), -1))
    hypotheses = PoseHypotheses(
        joints,
        np.zeros((count, width, len(half.bones))),
        np.zeros((count, width, 3, 1)),
        np.zeros((count, width), int),
        cost,
        np.zeros((count, width, 2, len(half.joints))),
        np.zeros((count, width, 2, len(half.bones))),
        np.zeros((count, width, 2, len(half.bones))),
    )
    return templates, hypotheses
