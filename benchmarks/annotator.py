"""The annotator's page in a driven browser: work per keyframe, accuracy of its marks, speed.

    python benchmarks/annotator.py [--demo DIR]

Takes the sequence and the keyframes of `keyrecon demo --out DIR` (made if they are not there) and
marks them through the page from the truth with 2 px of noise, once by clicks alone, once by
correcting what the page suggests. Both sets of marks and the same marks imported without the page
are reconstructed and compared. Prints tables, asserts nothing.
"""

import argparse
import shutil
import statistics
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app import project, running
from keyrecon.app.console import show
from keyrecon.app.demo import CLICK_NOISE, run_demo
from keyrecon.body import LSP14
from keyrecon.io.formats.coco import read_coco, write_coco
from keyrecon.io.formats.keyframes import keyframes_from_json
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options
from keyrecon.records import Annotations
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth

sys.path.append(str(Path(__file__).parent.parent / "tests" / "support"))
from page_driver import SCREEN, Person, browser, serving

MAX_SUGGESTION_ERROR = 0.02
"""A suggestion is corrected where it is off by more than this share of the player's height."""
LARGE = (1920, 1080)
"""Picture that switching between keyframes is timed with, px."""


@dataclass(frozen=True)
class Work:
    """What one keyframe cost."""

    joints: int
    clicks: int
    drags: int
    keys: int
    """To take the suggestion."""
    depth_keys: int
    """To say which ends are nearer."""

    @property
    def placing(self) -> int:
        """Everything done until the joints were right."""
        return self.clicks + self.drags + self.keys


@dataclass(frozen=True)
class Answers:
    """What a careful person knows about the keyframes."""

    marks: Annotations

    def frame(self, frame: int) -> int:
        """Row of a keyframe."""
        return int(np.flatnonzero(self.marks.frames == frame)[0])

    def place(self, frame: int, joint: str) -> np.ndarray:
        """Where a joint is clicked."""
        return self.marks.joints[self.frame(frame), LSP14.index(joint)]

    def signs(self, frame: int) -> dict[str, int]:
        """Depth signs by limb."""
        row = self.marks.nearer[self.frame(frame)]
        names = [LSP14.names[child] for _, child in LSP14.bones]
        return {name: int(sign) for name, sign in zip(names, row, strict=True) if sign}


def begin(demo: Path, name: str) -> Path:
    """A copy of the demo's project without marks."""
    folder = demo / name
    shutil.rmtree(folder, ignore_errors=True)
    left_out = ("annotat*", "motion.npz", "report.html", "keyframes", "lift-*", "propagate-*", ".*")
    shutil.copytree(demo / "project", folder, ignore=shutil.ignore_patterns(*left_out))
    return folder


def mark_by_clicks(person: Person, frame: int, answers: Answers) -> Work:
    """Every joint by a click, every depth given; suggestions are not used."""
    person.open(frame)
    return finish(person, frame, answers, (person.clicks, person.drags, person.keys))


def correct_suggestion(person: Person, frame: int, answers: Answers, max_error: float) -> Work:
    """Joints that are off by more than `max_error` px are dragged, the rest is taken."""
    person.open(frame)
    before = person.clicks, person.drags, person.keys
    offered = person.suggestion(frame)
    for joint, (x, y, _) in offered.items():
        place = answers.place(frame, joint)
        if np.hypot(x - place[0], y - place[1]) > max_error:
            person.drag((x, y), place)
    if offered:
        person.take_suggestion()
    return finish(person, frame, answers, before)


def finish(person: Person, frame: int, answers: Answers, before: tuple[int, int, int]) -> Work:
    """Click what is still asked for, give the depths; what was done since `before`."""
    person.mark_joints(partial(answers.place, frame))
    clicks, drags, keys = person.clicks - before[0], person.drags - before[1], person.keys
    person.give_depths(answers.signs(frame), partial(answers.place, frame))
    person.await_saved()
    joints = person.page.locator("#joints .marked").count()
    return Work(joints, clicks, drags, keys - before[2], person.keys - keys)


def mark_all(
    folder: Path, frames: list[int], way: partial, own: list[int] | None = None
) -> tuple[list[Work], list[float]]:
    """Mark the keyframes of a project through its page; work by keyframe, pose answers in ms.

    The lists of checks are not open meanwhile, so they are not computed. Frames of the person's
    `own` are keyframes too.
    """
    assistant = replace(make_assistant(Workspace(folder)), checks=None, next_frames=None)
    with browser() as chromium, serving(folder, assistant) as server:
        person = Person(chromium.new_context(viewport=SCREEN), server.credentials.address)
        if own:
            person.add_keyframes(own)
            person.page.reload()
            person.await_text("#done-count", "of")
        work = [way(person, frame) for frame in show(frames, "Marking keyframes", len(frames))]
        poses = person.durations("pose")
        person.page.close()
    return work, poses


def reconstruct(folder: Path, truth: Path, height: float) -> str:
    """Run what follows the marks, and its accuracy."""
    workspace = Workspace(folder)
    options = running.run_options(workspace, Options(), height)
    running.run(workspace, options, show, partial=True)
    return project.evaluate(folder, truth)


def time_switching(demo: Path) -> dict[str, list[float]]:
    """Going from keyframe to keyframe in a large video; ms."""
    large = demo / "large.mp4"
    source = open_video(demo / "sequence" / "video.mp4", 0, 600)
    if not large.is_file():
        import cv2

        pictures = (cv2.resize(picture, LARGE) for picture in source.frames())
        write_video(large, show(pictures, "Enlarging", len(source)), source.fps)
    folder = demo / "switching"
    shutil.rmtree(folder, ignore_errors=True)
    project.start(large, folder)
    with browser() as chromium, serving(folder) as server:
        person = Person(chromium.new_context(viewport=SCREEN), server.credentials.address)
        person.add_keyframes(range(10, 600, 20))
        person.page.reload()  # as one who opens a project whose keyframes are known
        person.await_text("#done-count", "of")
        person.open(10)
        for frame in range(30, 600, 20):
            person.page.wait_for_timeout(1000)  # a person looks before going on
            person.press("d")
            person.page.wait_for_selector(f"#picture[data-frame='{frame}']")
        switching = person.durations("keyframe")[1:]
        person.add_keyframes(set(range(500)) - set(range(10, 600, 20)))
        return {
            "next keyframe, 1920x1080": switching,
            "picture to picture, scrolling 500": person.scroll_times("#frame-list"),
        }


def describe_work(name: str, work: list[Work]) -> str:
    """One line of the table."""
    parts = ("joints", "clicks", "drags", "keys", "placing", "depth_keys")
    columns = [statistics.mean(getattr(one, part) for one in work) for part in parts]
    worst = max(one.placing for one in work)
    return f"{name:<26}" + "".join(f"{value:>9.2f}" for value in columns) + f"{worst:>9}"


def describe_times(name: str, times: list[float]) -> str:
    """Median and worst."""
    return f"{name:<40}{statistics.median(times):>8.1f}{max(times):>8.1f}  ms ({len(times)} times)"


def on_both_ends(marks: Annotations) -> Annotations:
    """Without depth signs of limbs of which an end is not marked: the page asks for none."""
    parents, children = marks.skeleton.bones.T
    marked = np.isfinite(marks.joints[:, :, 0])
    return replace(marks, nearer=marks.nearer * (marked[:, parents] & marked[:, children]))


def compare(demo: Path, answers: Answers, truth: Path) -> None:
    """Mark through the page and without it; print work and accuracy."""
    frames, facts = answers.marks.frames.tolist(), read_truth(truth)
    tall = MAX_SUGGESTION_ERROR * float(np.median(np.ptp(facts["points2d"][..., 1], axis=1)))
    video = open_video(demo / "sequence" / "video.mp4")
    size = video.width, video.height
    imported = begin(demo, "imported")
    write_coco(imported / "annotations.json", answers.marks, size)
    clicked, corrected = begin(demo, "clicked"), begin(demo, "corrected")
    by_clicks, poses = mark_all(clicked, frames, partial(mark_by_clicks, answers=answers))
    by_taking, _ = mark_all(
        corrected, frames, partial(correct_suggestion, answers=answers, max_error=tall)
    )
    print(f"\n{'per keyframe':<26}{'joints':>9}{'clicks':>9}{'drags':>9}{'keys':>9}"
          f"{'placing':>9}{'depth':>9}{'worst':>9}")  # fmt: skip
    print(describe_work("clicks alone", by_clicks))
    print(describe_work("suggestions corrected", by_taking))
    print(describe_times("\npose in space after an edit", poses))
    for folder in (imported, clicked, corrected):
        print(f"\n{folder.name}: {describe_difference(folder, answers.marks, size)}")
        print(reconstruct(folder, truth, round(float(facts["height_m"]), 2)))


def describe_difference(folder: Path, marks: Annotations, size: tuple[int, int]) -> str:
    """How far the marks on file are from those that were meant."""
    found = read_coco(folder / "annotations.json", LSP14, 10**6, size)
    off = np.abs(found.joints - marks.joints)
    signs = (found.nearer == marks.nearer)[marks.nearer != 0]
    return f"marks within {np.nanmax(off):.2f} px of those meant, {signs.mean():.1%} of the signs"


def known_answers(demo: Path) -> Answers:
    """The truth with click noise on the demo's keyframes."""
    truth = read_truth(demo / "sequence" / "truth.npz")
    keyframes = keyframes_from_json((demo / "project" / "keyframes.json").read_text())
    noise = MarkOptions(CLICK_NOISE)
    marks = mark_from_truth(keyframes, truth["points2d"], truth["points3d"], None, noise)
    return Answers(on_both_ends(marks))


def main() -> None:
    """Everything, in order."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--demo", type=Path, default=Path("demo"), help="folder of keyrecon demo")
    demo = parser.parse_args().demo
    if not (demo / "project" / "keyframes.json").is_file():
        run_demo("tennis", demo, show, print)
    compare(demo, known_answers(demo), demo / "sequence" / "truth.npz")
    for name, times in time_switching(demo).items():
        print(describe_times(name, times))


if __name__ == "__main__":
    main()
