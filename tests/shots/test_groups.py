import numpy as np
import pytest

from keyrecon.records import Shots
from keyrecon.shots.groups import group_shots

SHOTS = Shots.between((300, 420, 1500, 1530), 2000)
ANNOTATED = np.array([10, 302, 700, 1990])


@pytest.fixture(params=[100, 400, 1000])
def groups(request):
    return group_shots(SHOTS, ANNOTATED, 25.0, request.param)


def test_every_frame_counts_in_one_group(groups):
    own = np.concatenate([np.arange(group.own.start, group.own.stop) for group in groups])
    np.testing.assert_array_equal(own, np.arange(2000))


def test_annotated_frames_are_in_every_group_with_those_beside_them_in_their_shots(groups):
    for group in groups:
        assert np.isin(ANNOTATED, group.frames).all()
        assert np.isin(np.arange(698, 703), group.frames).all()
        assert (np.diff(group.frames) > 0).all()
        assert np.isin(np.arange(group.own.start, group.own.stop), group.frames).all()
    alone = group_shots(SHOTS, np.array([302]), 25.0, 400)[-1]
    beside = alone.frames[alone.frames < 420]
    np.testing.assert_array_equal(beside, np.arange(300, 307))


def test_groups_are_no_larger_than_they_may_be(groups):
    assert max(group.own.stop - group.own.start for group in groups) <= 1000
    assert len(group_shots(SHOTS, ANNOTATED, 25.0, 1500)) == 2


def test_pieces_of_one_shot_reach_into_one_another_and_shots_do_not():
    first, second = group_shots(Shots.between((), 1000), np.zeros(0, int), 25.0, 500)
    assert first.frames[-1] == 549
    assert second.frames[0] == 450
    first, second = group_shots(Shots.between((500,), 1000), np.zeros(0, int), 25.0, 500)
    assert (first.frames[-1], second.frames[0]) == (499, 500)


def test_a_short_video_is_one_group():
    (only,) = group_shots(SHOTS, ANNOTATED, 25.0)
    np.testing.assert_array_equal(only.frames, np.arange(2000))
