"""The player followed through a video of several shots."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_player import SIZE, draw_player, film, heads, picks, scene

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.keeping import call_stage
from keyrecon.records import PLAYER, CameraPath, TrackAnchors
from keyrecon.segmentation.color_model import learn_colors
from keyrecon.shots.following import FollowOptions, follow_player
from keyrecon.tracking.shot_sorting import ShotOptions

COUNT, SHOWN = 40, 12


@pytest.fixture(scope="module")
def two_shots(tmp_path_factory):
    """The player in every frame of the first shot, and in the first 12 of 40 of the second."""
    folder = tmp_path_factory.mktemp("shots")
    player = list(film(folder / "player.mp4", COUNT).frames())
    nobody = list(film(folder / "nobody.mp4", COUNT, empty=True).frames())
    pictures = [*player, *player[:SHOWN], *nobody[SHOWN:]]
    write_video(folder / "both.mp4", pictures, open_video(folder / "player.mp4").fps)
    return open_video(folder / "both.mp4")


@pytest.fixture(scope="module")
def follow(two_shots):
    still = np.tile(np.eye(3), (2 * COUNT, 1, 1))
    camera = CameraPath(still, np.ones(2 * COUNT), cuts=(COUNT,))
    clicks = tuple(picks(COUNT))
    colors = learn_colors(two_shots, clicks)

    def follow(use):
        options = FollowOptions(shots=ShotOptions(use=use))
        nothing = TrackAnchors.none()
        return follow_player(two_shots, camera, colors, clicks, nothing, options, call_stage)

    return follow


def test_a_shot_that_hardly_shows_the_player_is_left_out_unless_it_is_asked_for(follow):
    assert follow("").shots.shows == (PLAYER, "nobody found")
    asked = follow("2")
    assert asked.shots.shows == (PLAYER, PLAYER)
    seen, unseen = np.split(asked.track.confidence[COUNT:], [SHOWN])
    assert seen[:-2].min() > 0.2
    assert unseen[3:].max() == 0


def test_somebody_to_whom_the_player_would_have_to_jump_is_not_followed(tmp_path):
    still = CameraPath(np.tile(np.eye(3), (2 * COUNT, 1, 1)), np.ones(2 * COUNT))
    ours, theirs = (170, 70), (330, 100)

    def pictures():
        for x, y in [ours] * COUNT + [theirs] * COUNT:
            picture = scene()
            draw_player(picture, x, y)
            yield picture[30 : 30 + SIZE[0], 80 : 80 + SIZE[1]]

    write_video(tmp_path / "film.mp4", pictures(), 30.0, crf=18)
    video = open_video(tmp_path / "film.mp4")
    shift = np.array(ours) - heads(COUNT)[0]
    clicks = tuple(replace(p, x=p.x + shift[0], y=p.y + shift[1]) for p in picks(COUNT))
    colors = learn_colors(video, clicks)
    nothing, options = TrackAnchors.none(), FollowOptions()
    followed = follow_player(video, still, colors, clicks, nothing, options, call_stage)
    assert (followed.track.confidence[: COUNT - 3] > 0).all()
    assert (followed.track.confidence[COUNT:] == 0).all()
    assert all(len(edges.points) for edges in followed.edges[: COUNT - 3])
    assert not any(len(edges.points) for edges in followed.edges[COUNT:])
    unlinked = followed.verification.frames[followed.verification.unlinked]
    assert unlinked.min() >= COUNT - 3 and unlinked.max() > 2 * COUNT - 10
