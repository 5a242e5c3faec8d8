import logging
from fractions import Fraction

import pytest

from keyrecon import KeyreconError
from keyrecon.app.golf import fit_file
from keyrecon.app.project import start
from keyrecon.io.durable import write_durably
from keyrecon.io.video import open_video
from keyrecon.io.workspace import Workspace

TICKS = list(range(0, 240, 12))
WIDE = Fraction(4, 3)
REMEDY = r"pixels of 4:3 .*ffmpeg -i .* -vf \"scale=.*iw\*sar.*:ih,setsar=1\""


@pytest.fixture
def wide(write_numbered):
    return write_numbered("wide.mp4", TICKS, aspect=WIDE)


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "mov"])
def test_a_video_of_wide_pixels_is_refused_with_the_way_to_square_ones(write_numbered, suffix):
    with pytest.raises(KeyreconError, match=REMEDY) as fault:
        open_video(write_numbered(f"wide.{suffix}", TICKS, aspect=WIDE))
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize("aspect", [None, Fraction(1), Fraction(1001, 1000), Fraction(996, 1000)])
def test_pixels_that_are_square_but_for_rounding_or_of_which_nothing_is_told_are_square(
    write_numbered, aspect
):
    assert len(open_video(write_numbered("square.mp4", TICKS, aspect=aspect))) == 20


def test_no_project_is_made_of_wide_pixels(wide, tmp_path):
    for make in (start, lambda video, folder: fit_file(video, None, folder)):
        with pytest.raises(KeyreconError, match="4:3"):
            make(wide, tmp_path / "p")
    assert not (tmp_path / "p").exists()


def test_wide_pixels_are_not_added_to_square_ones(wide, write_numbered, tmp_path):
    square = write_numbered("square.mp4", TICKS)
    project = Workspace.create(tmp_path / "p", open_video(square), square, {})
    with pytest.raises(KeyreconError, match="4:3"):
        project.add_video(wide, {})
    assert len(project.video()) == 20


def test_a_project_that_has_wide_pixels_goes_on_and_says_so_once(
    wide, write_numbered, tmp_path, caplog
):
    square = write_numbered("square.mp4", TICKS)
    project = Workspace.create(tmp_path / "p", open_video(square), square, {})
    taken = project.project_file.read_text().replace(
        open_video(square).fingerprint, open_video(wide, square_only=False).fingerprint
    )
    write_durably(project.project_file, taken)
    square.write_bytes(wide.read_bytes())
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        assert len(Workspace(project.folder).video()) == 20
        assert len(Workspace(project.folder).video()) == 20
    told = [r.getMessage() for r in caplog.records if str(square) in r.getMessage()]
    assert len(told) == 1 and "4:3" in told[0]
