"""Records of usable shots, put end to end and back over the frames of the file."""

from dataclasses import replace

import numpy as np
import pytest
from small_motion import make_motion

from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.keyframes.absence import select_frames
from keyrecon.records import PLAYER, JointTracks, PoseDistances, Shots, Track
from keyrecon.timeline import (
    cut_motion,
    join_frames,
    motion_in_file,
    scatter_distances,
    scatter_frames,
    scatter_track,
    take_frames,
)

SHOTS = Shots((0, 20, 30, 45), 60, (PLAYER, "black", PLAYER, PLAYER))
USED = np.r_[0:20, 30:60]


def test_usable_shots_stand_end_to_end():
    np.testing.assert_array_equal(SHOTS.usable_frames, USED)
    assert SHOTS.joined().first == (0, 20, 35)
    assert SHOTS.joined().n_frames == 50
    assert SHOTS.number[[0, 19, 20, 30, 59]].tolist() == [0, 0, 1, 2, 3]


def test_work_in_each_shot_does_not_reach_into_the_next():
    steps = SHOTS.in_each(lambda part: np.diff(part, prepend=part[:1]), np.arange(60.0) ** 2)
    assert (steps[[0, 20, 30, 45]] == 0).all()


def make_tracks(count, seed=0):
    rng = np.random.default_rng(seed)
    return JointTracks(
        rng.random((count, 4, 2)),
        rng.random((count, 4)),
        rng.random((count, 2)),
    )


def test_frames_that_are_taken_and_put_back_are_where_they_were_and_nothing_is_between():
    tracks = make_tracks(60)
    back = scatter_frames(take_frames(tracks, USED), USED, 60)
    np.testing.assert_array_equal(back.joints[USED], tracks.joints[USED])
    between = np.setdiff1d(np.arange(60), USED)
    assert np.isnan(back.joints[between]).all()
    assert (back.confidence[between] == 0).all()
    np.testing.assert_array_equal(back.exchange_evidence[USED], tracks.exchange_evidence[USED])
    assert (back.exchange_evidence[between] == 0).all()


def test_what_nobody_looked_at_stays_untold():
    tracks = replace(make_tracks(60), exchange_evidence=None)
    parts = [take_frames(tracks, part) for part in SHOTS.parts]
    assert join_frames(parts).exchange_evidence is None
    assert scatter_frames(take_frames(tracks, USED), USED, 60).exchange_evidence is None


def test_parts_that_are_joined_are_the_whole():
    tracks = make_tracks(60)
    whole = join_frames([take_frames(tracks, part) for part in SHOTS.parts])
    np.testing.assert_array_equal(whole.joints, tracks.joints)


def test_a_track_is_nowhere_in_other_shots():
    count = len(USED)
    track = Track(
        np.ones((count, 2)),
        np.ones((count, 2, 2)),
        np.ones(count),
        np.ones((count, 4)),
        np.ones(count),
    )
    spread = scatter_track(track, USED, 60)
    assert spread.known.tolist() == np.isin(np.arange(60), USED).tolist()
    assert (spread.confidence[~spread.known] == 0).all()
    assert np.isfinite(spread.head).all()


def test_pose_distances_come_back_as_they_were():
    rng = np.random.default_rng(0)
    count = len(USED)
    upper, lower = rng.random((2, count, count)).astype(np.float32)
    everyone = np.arange(count)
    distances = PoseDistances(
        upper, lower, everyone, everyone, np.zeros((2, count), np.float32),
        rng.random((2, count - 1)).astype(np.float32), np.ones(count), np.ones((2, count)),
    )  # fmt: skip
    spread = scatter_distances(distances, USED, 60)
    assert len(spread.row) == 60
    assert (spread.visibility_score[20:30] == 0).all()
    assert (spread.seen[:, 20:30] == 0).all()
    back = select_frames(spread, USED)
    np.testing.assert_array_equal(back.upper, upper)
    np.testing.assert_array_equal(back.frames, everyone)
    np.testing.assert_array_equal(back.row, everyone)


@pytest.fixture
def gapped():
    motion = motion_in_file(make_motion(50), SHOTS, np.arange(60) / 50.0)
    return motion


def test_a_motion_has_stretches_that_end_at_cuts_and_gaps(gapped):
    assert gapped.stretches == (slice(0, 20), slice(30, 45), slice(45, 60))
    assert len(gapped.time) == 60
    assert np.isnan(gapped.points2d[20:30]).all()


def test_a_motion_with_gaps_is_written_and_read(gapped, tmp_path):
    write_motion(tmp_path / "motion.npz", gapped)
    back = read_motion(tmp_path / "motion.npz")
    np.testing.assert_array_equal(back.points3d, gapped.points3d)
    np.testing.assert_array_equal(back.cuts, gapped.cuts)


def test_a_range_of_a_motion_counts_cuts_from_its_start(gapped):
    assert cut_motion(gapped, slice(30, 60)).cuts.tolist() == [15]
