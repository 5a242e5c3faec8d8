"""Pictures of the annotator for the README, taken of the demo's project in a driven browser.

    python benchmarks/screenshots.py [--demo DIR] [--out annotations/pictures]

DIR is the folder of `keyrecon demo`. A third of its keyframes are marked, then the pages are
photographed at the size of a laptop's screen.
"""

import argparse
from functools import partial
from pathlib import Path

from annotator import Answers, begin, known_answers
from page_driver import SCREEN, Person, browser, serving

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.body import LSP14
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.video import open_video
from keyrecon.io.workspace import Workspace
from keyrecon.records import Annotations

QUALITY = 70
"""Of the JPEGs."""


def first_third(marks: Annotations) -> Annotations:
    """The marks of every third keyframe."""
    rows = slice(None, None, 3)
    return Annotations(
        marks.skeleton, marks.frames[rows], marks.joints[rows], marks.visible[rows],
        marks.nearer[rows],
    )  # fmt: skip


def photograph(person: Person, out: Path, name: str) -> None:
    """One picture of the page as it is."""
    person.page.wait_for_timeout(1500)
    person.page.screenshot(path=out / f"annotate-{name}.jpg", type="jpeg", quality=QUALITY)


def show_keyframe(person: Person, answers: Answers, frame: int, out: Path) -> None:
    """A keyframe with its suggestion, then with its depths."""
    person.open(frame)
    if person.suggestion(frame):
        photograph(person, out, "suggestion")
        person.take_suggestion()
    person.mark_joints(partial(answers.place, frame))
    person.pose()
    limb = list(answers.signs(frame))[-1]
    parent = LSP14.names[LSP14.parents[LSP14.index(limb)]]
    person.point_at((answers.place(frame, limb) + answers.place(frame, parent)) / 2)
    photograph(person, out, "depth")


def main() -> None:
    """Mark a third, photograph all pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--demo", type=Path, default=Path("demo"), help="folder of keyrecon demo")
    parser.add_argument("--out", type=Path, default=Path("annotations/pictures"))
    arguments = parser.parse_args()
    answers, folder = known_answers(arguments.demo), begin(arguments.demo, "tennis")
    video = open_video(arguments.demo / "sequence" / "video.mp4")
    size = video.width, video.height
    write_coco(folder / "annotations.json", first_third(answers.marks), size)
    write_motion(folder / "motion.npz", read_motion(arguments.demo / "project" / "motion.npz"))
    with browser() as chromium, serving(folder, make_assistant(Workspace(folder))) as server:
        context = chromium.new_context(viewport=SCREEN)
        person = Person(context, server.credentials.address)
        show_keyframe(person, answers, int(answers.marks.frames[7]), arguments.out)
        for key, page, name in (
            ("Alt+1", "bodies", "body"),
            (None, "pick", "colours"),
            ("Alt+3", "motion", "motion"),
        ):
            if key is None:
                person.page.click("#bodies-colours")
            else:
                person.press(key)
            person.page.wait_for_selector(f"#{page}-picture[data-frame]")
            person.page.wait_for_timeout(4000)
            photograph(person, arguments.out, name)
        context.close()


if __name__ == "__main__":
    main()
