"""What the automatic part tells of the shots of a video."""

from keyrecon.app.preparing import describe_shots
from keyrecon.records import PLAYER, Shots


def test_every_shot_is_told_with_its_frames_and_what_it_shows():
    shots = Shots((0, 20, 70), 100, (PLAYER, "black", PLAYER))
    (line,) = describe_shots(shots)
    assert line.startswith("3 shots, 2 usable")
    assert "2 (20-69) black" in line
    assert "3 (70-99) the player" in line


def test_a_video_of_one_shot_tells_nothing():
    assert describe_shots(Shots.between((), 100)) == []
