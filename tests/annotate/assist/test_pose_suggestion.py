"""Joints predicted on frames that nobody annotated, and what annotated frames say of each other."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_player import marks, scene, standing, turned

from keyrecon.annotate.assist import pose_suggestion
from keyrecon.annotate.assist.neighbours import find_neighbours
from keyrecon.annotate.assist.pose_suggestion import choose_sources, suggest_joints, take_rows
from keyrecon.body import LSP14
from keyrecon.records import Edges

ARMS = (("right_shoulder", ("right_elbow", "right_wrist")), ("right_elbow", ("right_wrist",)))
LEGS = (("left_hip", ("left_knee", "left_ankle")), ("left_knee", ("left_ankle",)))
COUNT = 24


def playing():
    """Poses whose right arm and left leg swing, each at its own pace."""
    poses = []
    for t in range(COUNT):
        pose = standing()
        for (joint, moved), swing in zip((*ARMS, *LEGS), (0.5, 0.4, 0.25, 0.2), strict=True):
            pose = turned(pose, joint, moved, swing * np.sin(0.4 * t + len(moved)))
        poses.append(pose)
    return poses


@pytest.fixture(scope="module")
def game():
    return scene(playing(), (0, 8, 16))


def away(game, suggestion, frame):
    preparation, truth = game
    return (
        np.linalg.norm(suggestion.joints - truth[frame], axis=1) / preparation.track.height[frame]
    )


def foresee(game, frames, frame):
    preparation, truth = game
    sources = choose_sources(preparation, marks(truth, frames), frame)
    return suggest_joints(preparation, sources, frame)


def test_a_pose_between_annotated_ones_is_foreseen(game):
    suggestion = foresee(game, (0, 3, 6, 9, 12, 15), 10)
    assert away(game, suggestion, 10).max() < 0.04
    assert np.median(away(game, suggestion, 10)) < 0.01
    assert np.isin(suggestion.source, (0, 3, 6, 9, 12, 15)).all()


def test_a_frame_without_any_edge_is_suggested_what_others_show(game):
    """As one of a shot that is left out, until it is marked."""
    preparation, truth = game
    found = vars(preparation.edges[10])
    none = Edges(**{name: values[:0] for name, values in found.items()})
    edges = tuple(none if t == 10 else e for t, e in enumerate(preparation.edges))
    bare = replace(preparation, edges=edges)
    sources = choose_sources(bare, marks(truth, (0, 3, 9)), 10)
    assert np.isfinite(suggest_joints(bare, sources, 10).joints).all()


def test_player_coordinates_are_made_once_for_however_many_suggestions(game, monkeypatch):
    """Of an hour of video they take seconds, and suggestions are made one after the other."""
    made, make = [], pose_suggestion.stabilise_shots
    monkeypatch.setattr(
        pose_suggestion, "stabilise_shots", lambda *video: made.append(1) or make(*video)
    )
    preparation = replace(game[0])
    for frame in (5, 11):
        sources = choose_sources(preparation, marks(game[1], (0, 3, 9)), frame)
        suggest_joints(preparation, sources, frame)
    assert len(made) == 1


def test_the_more_is_annotated_the_better_the_ghosts(game):
    few, many = (
        np.mean([away(game, foresee(game, frames, t), t).mean() for t in (5, 11, 17, 22)])
        for frames in ((0,), (0, 3, 7, 9, 13))
    )
    assert many < few


def test_a_half_that_nobody_marked_has_no_ghost(game):
    preparation, truth = game
    annotations = marks(truth, (0, 6))
    joints = np.where(LSP14.is_lower[:, None], np.nan, annotations.joints)
    suggestion = suggest_joints(preparation, replace(annotations, joints=joints), 8)
    assert np.isnan(suggestion.joints[LSP14.is_lower]).all()
    assert np.isfinite(suggestion.joints[~LSP14.is_lower]).all()
    assert (suggestion.source[LSP14.is_lower] == -1).all()


def test_a_half_of_which_a_joint_was_never_marked_has_no_ghost_yet(game):
    preparation, truth = game
    annotations = marks(truth, (0, 6))
    annotations.joints[:, LSP14.index("left_elbow")] = np.nan
    suggestion = suggest_joints(preparation, annotations, 8)
    assert np.isnan(suggestion.joints[~LSP14.is_lower]).all()
    assert np.isfinite(suggestion.joints[LSP14.is_lower]).all()


def test_a_frame_is_never_foreseen_from_its_own_marks(game):
    preparation, truth = game
    sources = choose_sources(preparation, marks(truth, (0, 6, 12)), 6)
    assert sources.frames.tolist() == [0, 12]


def test_what_is_marked_on_the_frame_already_stays_where_it_is(game):
    preparation, truth = game
    wrist = LSP14.index("right_wrist")
    held = np.full((14, 2), np.nan)
    held[wrist] = truth[10, wrist] + [9.0, -7.0]
    sources = choose_sources(preparation, marks(truth, (0, 6, 12)), 10)
    suggestion = suggest_joints(preparation, sources, 10, held)
    np.testing.assert_allclose(suggestion.joints[wrist], held[wrist], atol=0.1)


def test_true_marks_agree_with_one_another_and_a_moved_one_does_not(game):
    preparation, truth = game
    annotations = marks(truth, range(0, COUNT, 2))
    wrist = LSP14.index("right_wrist")
    joints = annotations.joints.copy()
    joints[4, wrist] += 0.15 * preparation.track.height[8]
    for moved in (annotations, replace(annotations, joints=joints)):
        _, upper = find_neighbours(preparation, moved)
        place = upper.members.tolist().index(wrist)
        nearest = np.diagonal(upper.distance, axis1=2, axis2=3)[:, :, place].min(axis=1)
        assert (np.delete(nearest, 4) < 0.05).all()
    assert nearest[4] > 0.1


def test_a_frame_is_compared_with_others_only(game):
    preparation, truth = game
    for look in find_neighbours(preparation, marks(truth, (0, 4, 8, 12))):
        assert look.sources.shape == (4, 3)
        assert not (look.sources == np.arange(4)[:, None]).any()


def test_one_annotated_frame_has_nothing_to_be_compared_with(game):
    preparation, truth = game
    annotations = marks(truth, (0, 4))
    assert find_neighbours(preparation, take_rows(annotations, annotations.frames == 0)) == ()
