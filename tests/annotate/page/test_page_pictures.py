"""Pictures on the annotator's page: videos upright, short and damaged, and players cut off."""

import pytest
from numbered_videos import turn
from page_driver import BROWSER, serving
from page_project import make_project, write_numbered_video

from keyrecon import KeyreconError

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
UPRIGHT = """
() => {
  const canvas = document.querySelector("#strip canvas"), pen = canvas.getContext("2d");
  const opaque = (x) => pen.getImageData(x * canvas.width, canvas.height / 2, 1, 1).data[3] > 0;
  return opaque(0.5) && !opaque(0.02) && !opaque(0.98);
}
"""
"""Whether the first small picture is in the middle of its place and leaves both sides free."""


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write_numbered_video(tmp_path_factory.mktemp("pictures") / "numbered.mp4")


def test_small_pictures_of_an_upright_video_keep_their_shape(tmp_path, video, visit):
    folder = make_project(tmp_path / "p", turn(video, tmp_path / "upright.mp4", 90))
    with serving(folder) as server:
        person = visit(server)
        person.press("Alt+1")
        person.page.click("#bodies-colours")
        person.page.wait_for_function(UPRIGHT)


def test_a_frame_that_cannot_be_shown_is_told_once(tmp_path, video, visit, monkeypatch):
    def broken(*_):
        raise KeyreconError("frame 40 cannot be decoded; the file is damaged there")

    with serving(make_project(tmp_path / "p", video)) as server:
        monkeypatch.setattr(type(server.session.frames.video), "frames", broken)
        person = visit(server)
        person.await_text("#notice-text", "cannot be decoded; the file is damaged there")
