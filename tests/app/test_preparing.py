"""What the automatic part tells of the shots of a video and of the track."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from page_project import write_numbered_video

from keyrecon.annotate.assist import project_cache
from keyrecon.app import preparing, project
from keyrecon.app.annotator import _warnings
from keyrecon.app.preparing import (
    describe_hiding,
    describe_identity,
    describe_light,
    describe_shots,
    describe_truncation,
)
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.records import (
    PERHAPS,
    PLAYER,
    Annotations,
    CameraPath,
    Pick,
    Preparation,
    Shots,
    Track,
    TrackVerification,
)
from keyrecon.segmentation.marked_bodies import anchors_from_bodies


def test_every_shot_is_told_with_its_frames_and_what_it_shows():
    shots = Shots((0, 20, 70), 100, (PLAYER, "black", PLAYER))
    (line,) = describe_shots(shots)
    assert line.startswith("3 shots, 2 usable")
    assert "2 (20-69) black" in line
    assert "3 (70-99) the player" in line


def test_a_video_of_one_shot_tells_nothing():
    assert describe_shots(Shots.between((), 100)) == []


def test_shots_that_a_person_must_tell_of_are_named():
    shows = (PLAYER, PERHAPS, "black", *(PERHAPS,) * 12)
    shots = Shots(tuple(range(0, 150, 10)), 150, shows)
    _, asked = describe_shots(shots)
    assert asked.startswith("Perhaps the player, or somebody dressed alike: shots 2 (10-19), 4 (")
    assert "14 (130-139) and 1 more. Look" in asked


FRAMES = np.arange(0, 200, 4)


def verified(truncated=(), meeting=(), hidden=(), unlinked=()):
    """What is seen of a player who stands at (100, 50), in frames of ranges."""
    cut = np.isin(FRAMES, truncated)
    near = np.isin(FRAMES, meeting)[:, None]
    distractor = np.where(near, (140.0, 50.0), np.nan)
    apart = np.isin(FRAMES, unlinked)
    return TrackVerification(FRAMES, cut, distractor, np.isin(FRAMES, hidden), apart)


def identity(meeting=(), known=(), jump=None, unlinked=()):
    head = np.tile((100.0, 50.0), (200, 1))
    if jump is not None:
        head[jump:, 0] += 400
    feet = np.repeat(head[:, None] + np.array([0, 100]), 2, axis=1)
    sure = 1.0 - np.isin(np.arange(200), unlinked)
    track = Track(head, feet, np.full(200, 100.0), np.zeros((200, 4)), sure)
    still = CameraPath(np.tile(np.eye(3), (200, 1, 1)), np.ones(200))
    shots = Shots.between((), 200)
    seen = verified(meeting=meeting, unlinked=unlinked)
    return describe_identity(track, still, 25.0, shots, seen, known)


def test_feet_that_the_picture_cuts_off_are_told_with_how_often_and_where():
    (line,) = describe_truncation(verified(truncated=range(40, 101)))
    assert "in about 32% of the frames (longest: 40-100)" in line
    assert describe_truncation(verified(truncated=range(8))) == []


def test_a_change_of_the_light_within_a_usable_shot_is_told():
    light = np.r_[np.linspace(0.8, 1.6, 50), np.full(100, 0.9), np.linspace(0.2, 3, 50)]
    path = CameraPath(np.tile(np.eye(3), (200, 1, 1)), np.ones(200), (50, 150), exposure=light)
    shots = Shots((0, 50, 150), 200, (PLAYER, PLAYER, "black"))
    (line,) = describe_light(path, shots)
    assert "frame 49 is 2.0 times as bright as frame 0" in line
    assert _warnings(f"Took 3 s.\n{line}\nNext: x") == line
    assert describe_light(path, replace(shots, shows=("black", PLAYER, "black"))) == []
    assert describe_light(replace(path, exposure=None), shots) == []
    (line,) = describe_light(replace(path, exposure=0 * light + 0.4), shots)
    assert "as if 2.5 times as bright" in line
    assert _warnings(line) == line


def test_what_is_laid_over_the_player_is_told_and_shown_on_the_page():
    (line,) = describe_hiding(verified(hidden=[4, *range(100, 133)]))
    assert "in about 20% of the frames (longest: 100-132)" in line
    assert _warnings(f"Took 3 s.\n{line}\nNext: x") == line
    assert describe_hiding(verified(hidden=range(8))) == []


def test_who_looks_like_the_player_is_told_until_the_player_is_marked_on_both_sides():
    (line,) = identity(meeting=range(90, 111))
    assert "comes close in frames 92-108" in line
    assert "in frame 50, 150 to be sure" in line
    assert "in frame 150 to be sure" in identity(meeting=range(90, 111), known=[20])[0]
    assert identity(meeting=range(90, 111), known=[20, 180]) == []
    assert identity() == []


def test_nobody_meets_a_player_who_is_not_seen():
    (line,) = identity(meeting=range(90, 111), unlinked=range(80, 200))
    assert "jumps" in line


def test_a_hop_of_the_track_is_told_with_its_frame():
    (line,) = identity(jump=120)
    assert "in frame 12" in line
    assert _warnings(f"Took 3 s.\n{line}\nNext: x") == line


def test_frames_beyond_a_hop_that_nothing_joins_to_the_player_are_told_once():
    (line,) = identity(jump=120, unlinked=range(120, 200))
    assert "frames 120-199" in line and "frame 159." in line
    assert _warnings(f"Took 3 s.\n{line}\nNext: x") == line


def test_what_speaks_against_the_track_is_shown_on_the_page():
    lines = [*describe_truncation(verified(truncated=range(100))), *identity(range(90, 111))]
    assert _warnings("\n".join(["Player found.", *lines])) == "\n".join(lines)


def standing_bodies(places):
    """Bodies marked in frames, each at a place across the picture."""
    heights = {"head": 40, "neck": 60, "shoulder": 62, "elbow": 80, "wrist": 95, "hip": 100}
    heights |= {"knee": 130, "ankle": 160}
    sides = {"left": 4, "right": -4}
    body = [
        (sides.get(name.split("_")[0], 0), heights.get(name.split("_")[-1], 40))
        for name in LSP14.names
    ]
    joints = np.array([[(x + beside, y) for beside, y in body] for x in places.values()], float)
    seen, sides_of_bones = np.ones(joints.shape[:2], bool), np.zeros((len(joints), 13), int)
    return Annotations(LSP14, np.array([*places]), joints, seen, sides_of_bones)


@pytest.fixture
def following(tmp_path, monkeypatch):
    """(prepare, used): prepares a project with bodies, `used` lists those that the track is made
    with; `shots` are what the automatic part tells of the video."""
    project.start(write_numbered_video(tmp_path / "v.mp4"), tmp_path / "p")
    workspace, used = Workspace(tmp_path / "p"), []
    workspace.prepared_marks_file.parent.mkdir()
    video = workspace.video()

    def follow(_workspace, video, _options, marks, _progress):
        """A track through the marks that it is given, and straight on between them."""
        marks = standing_bodies({2: 50, 9: 50}) if marks is None else marks
        used.append(marks.frames.tolist())
        times = np.arange(len(video))
        across = np.interp(times, marks.frames, marks.joints[:, LSP14.index("neck"), 0])
        bodies = standing_bodies(dict(zip(times.tolist(), across.tolist(), strict=True)))
        anchors = anchors_from_bodies(bodies)
        even = np.ones(len(video))
        track = Track(anchors.head, anchors.feet, 120 * even, np.zeros((len(video), 4)), even)
        made = object.__new__(Preparation)  # nothing but its track and its shots is looked at
        object.__setattr__(made, "track", track)
        object.__setattr__(made, "shots", prepare_with.shots)
        return preparing.ProjectPreparation(made)

    monkeypatch.setattr(preparing, "_without_outlier_picks", follow)

    def prepare_with(places):
        marks = standing_bodies(places)
        made = preparing.prepare_project(workspace, video, marks, Options(), silent)
        return made.preparation.track.head[6, 0]

    prepare_with.shots = Shots.between((), len(video))
    return prepare_with, used


def test_a_mark_that_was_taken_back_teaches_the_track_no_more(following):
    prepare_with, used = following
    assert prepare_with({2: 50, 6: 120, 9: 60}) == 120  # somebody else was marked in frame 6
    assert abs(prepare_with({2: 50, 9: 60}) - 55) < 5
    prepare_with({2: 50, 5: 54, 9: 60})
    assert used == [[2, 6, 9], [2, 9], [2, 9]]  # what is added in place changes nothing


def test_a_mark_that_was_moved_is_told_to_the_track_and_one_that_was_nudged_is_not(following):
    prepare_with, used = following
    prepare_with({2: 50, 9: 50})
    assert prepare_with({2: 50, 6: 50, 9: 52}) == 50  # of a player of 120
    assert abs(prepare_with({2: 50, 6: 50, 9: 60}) - 50) < 0.1
    assert used == [[2, 9], [2, 9], [2, 6, 9]]


def test_marks_of_a_track_that_is_made_without_any_are_not_recalled(following, tmp_path):
    prepare_with, _ = following
    prepare_with({2: 50, 9: 50})
    file = Workspace(tmp_path / "p").prepared_marks_file
    assert file.is_file()
    clicked = Workspace(tmp_path / "p", force=True)
    clicked.add_picks([Pick(0, "head", 50.0, 40.0), Pick(0, "foot", 50.0, 160.0)])
    preparing.prepare_project(clicked, clicked.video(), None, Options(), silent)
    assert not file.is_file()


def test_a_mark_in_a_shot_that_is_left_out_is_told_to_the_track_once(following):
    prepare_with, used = following
    prepare_with({2: 50, 9: 50})
    n_frames = prepare_with.shots.n_frames
    prepare_with.shots = Shots((0, 5), n_frames, (PLAYER, "somebody else"))
    prepare_with({2: 50, 7: 50, 9: 50})  # where the track would go on to anyway
    prepare_with({2: 50, 3: 50, 7: 50, 9: 50})
    assert used == [[2, 9], [2, 9], [2, 7, 9], [2, 7, 9]]


def test_the_page_recalls_the_track_that_was_made_without_the_outlying_clicks(
    tmp_path, monkeypatch
):
    project.start(write_numbered_video(tmp_path / "v.mp4"), tmp_path / "p")
    workspace = Workspace(tmp_path / "p")
    workspace.stages.folder.mkdir()
    wrong, right = Pick(9, "head", 90.0, 5.0), [(0, "head", 10.0, 9.0), (0, "foot", 8.0, 40.0)]
    workspace.add_picks([wrong, *(Pick(*click) for click in right)])

    def prepare(video, picks, *_, **__):
        made = object.__new__(Preparation)
        sure = np.full(len(video), 0.77 if wrong in picks else 0.99)
        object.__setattr__(made, "track", SimpleNamespace(confidence=sure, clicks=[*picks]))
        return made

    for module in (preparing, project_cache):
        monkeypatch.setattr(module, "prepare", prepare)
    monkeypatch.setattr(preparing, "outlier_picks", lambda *_: [wrong])
    made = preparing.prepare_project(workspace, workspace.video(), None, Options(), silent)
    assert made.rejected_picks == (wrong,)
    monkeypatch.setattr(
        preparing, "outlier_picks", lambda made, _: [wrong] * (wrong in made.track.clicks)
    )
    alone = preparing.prepare_project(workspace, workspace.video(), None, Options(), silent)
    assert alone.rejected_picks == (wrong,)  # though the track without it passes there
    page = project_cache.ProjectCache(workspace)
    assert page._prepared().track.clicks == made.preparation.track.clicks
    workspace.add_picks([Pick(5, "foot", 12.0, 40.0)])  # whoever clicks on still has that help
    assert page._prepared().track.clicks == made.preparation.track.clicks
