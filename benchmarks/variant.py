"""One clip from the first stage that a change can affect, scored.

A clip is a rendered sequence with its truth, or a real video whose picks and keyframe marks lie in
`annotations/` and whose other frames were marked by eye in `annotations/real/`. Its stages before
the change are taken from the clip's store.
"""

import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ParamSpec, TypeVar

import cv2
import numpy as np
from accuracy import SHORT, Case, solve
from sequences import OTHER, TENNIS, render
from unseen import unseen_model

from keyrecon.body import LSP14
from keyrecon.io.formats.coco import read_coco
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.stages import PACKAGE, StageStore
from keyrecon.io.video import open_video
from keyrecon.library import reconstruct
from keyrecon.metrics import pa_mpjpe, pck, read_truth
from keyrecon.pipeline import Options, prepare
from keyrecon.records import Motion, Pick

ANNOTATIONS = PACKAGE.parent / "annotations"
MARKED_BUDGET = 0.05
"""Budget at which the keyframes of the real clips were chosen and marked (annotations/README)."""
HEAD, SHIN = 0.130, 0.246
"""Share of the stature (Drillis and Contini 1966, as printed in Winter, Biomechanics)."""
HEAD_TO_FEET = 0.92
"""From the middle of the head to between the feet, share of the stature: half a head and the
height of a foot less."""
TORSO = LSP14.index("right_hip"), LSP14.index("left_shoulder")

Inputs = ParamSpec("Inputs")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Task:
    """What to run."""

    clip: str
    first: str
    """The first stage to run, or 'all': all of them, and keep their results."""
    work: str
    mocap: str
    videos: str
    frames: int | None = None
    part: str = ""
    """Picks of this part are moved ..."""
    offset: tuple[float, float] = (0.0, 0.0)
    """... by this, in lengths of a head or a shin."""
    seed: int = 0
    """Added to the seed of the click noise and the height's error."""


class PartialStore(StageStore):
    """Takes stages from the store up to one, and runs that and all after it.

    Joints are propagated once: depth signs, which are all that a second set of marks differs in,
    do not count for that.
    """

    def __init__(self, folder: Path, first: str) -> None:
        """`first`: the stage to begin with; 'all' runs and stores them all."""
        super().__init__(folder, force=first == "all")
        self.first = first
        self.begun = False
        self.propagated: object = None

    def keep(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The stored result, or the result made now."""
        if name == "propagate" and self.propagated is not None:
            return self.propagated
        result = self._make(name, stage, inputs, named)
        if name == "propagate":
            self.propagated = result
        return result

    def _make(self, name: str, stage: Callable[..., Result], inputs: tuple, named: dict) -> Result:
        self.begun |= name == self.first
        if not self.begun:
            return super().keep(name, stage, *inputs, **named)
        started = time.perf_counter()
        result = stage(*inputs, **named)
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started
        return result


@dataclass(frozen=True)
class Outcome:
    """Scores of one clip."""

    pck: float
    """Carried PCK@0.2, 0-1."""
    pa: float | None
    """PA-MPJPE, mm; None where nothing is known in 3D."""
    pa_unsigned: float | None
    """The same where nobody gave depth signs."""
    seconds: dict[str, float]
    """Of every stage that ran."""
    called: dict[str, list[str]] = field(default_factory=dict)
    """What the functions name that were called, by module; only of a run of all stages."""


class CalledNames:
    """Names that the package's functions mention which are called, by module."""

    def __init__(self) -> None:
        """Nothing yet."""
        self.codes: set[object] = set()

    def __enter__(self) -> "CalledNames":
        """Watch this thread and those that it starts."""
        threading.setprofile(self._watch)
        sys.setprofile(self._watch)
        return self

    def __exit__(self, *fault: object) -> None:
        """Watch no more."""
        sys.setprofile(None)
        threading.setprofile(None)

    def _watch(self, frame: object, event: str, _: object) -> None:
        if event == "call":
            self.codes.add(frame.f_code)

    def by_module(self) -> dict[str, list[str]]:
        """The names, by the module's file below the package."""
        names: dict[str, set[str]] = {}
        for code in self.codes:
            file = Path(code.co_filename)
            if code.co_name != "<module>" and file.is_relative_to(PACKAGE):
                names.setdefault(str(file.relative_to(PACKAGE)), set()).update(code.co_names)
        return {module: sorted(found) for module, found in names.items()}


def run_task(task: Task) -> Outcome:
    """Run the clip's stages that a change can affect, and score what comes out."""
    cv2.setNumThreads(1)
    run = run_rendered if any(s.name == task.clip for s in (*TENNIS, *OTHER)) else run_real
    if task.first != "all":
        return run(task)
    with CalledNames() as called:
        found = run(task)
    return replace(found, called=called.by_module())


def run_rendered(task: Task) -> Outcome:
    """A rendered sequence, marked from its truth."""
    sequence = next(s for s in (*TENNIS, *OTHER) if s.name == task.clip)
    folder = render(sequence, Path(task.work), Path(task.mocap))
    depths, _ = unseen_model(sequence, Path(task.work), Path(task.mocap))
    truth = read_truth(folder / "truth.npz")
    count = min(task.frames or len(truth["points3d"]), len(truth["points3d"]))
    truth = {name: cut(values, count, len(truth["points3d"])) for name, values in truth.items()}
    video = open_video(folder / "video.mp4", end=count)
    options = replace(Options(), depths=str(depths))
    if count / video.fps <= SHORT:
        options = with_budget(options, 2 * options.keyframes.budget)
    store = PartialStore(folder / "sensitivity" / str(count), task.first)
    picks = moved_picks(folder / "picks.json", count, task)
    preparation = prepare(video, picks, options, store.keep)
    sequence = replace(sequence, seed=sequence.seed + task.seed)
    case = Case(sequence, preparation, truth, store)
    motion, unsigned = (solve(case, options, signs) for signs in (True, False))
    errors = [pa_mpjpe(1000 * m.points3d, 1000 * truth["points3d"]) for m in (motion, unsigned)]
    carried = pck(motion.points2d_propagated, truth["points2d"], TORSO)
    return Outcome(carried, *errors, store.seconds)


def run_real(task: Task) -> Outcome:
    """A real clip, scored on frames marked by eye that are no keyframes; nothing is known in 3D."""
    video = open_video(Path(task.videos) / f"{task.clip}.mp4")
    size = video.width, video.height
    marks = read_coco(ANNOTATIONS / f"{task.clip}.json", LSP14, len(video), size)
    truth = read_coco(ANNOTATIONS / "real" / f"{task.clip}.json", LSP14, len(video), size)
    folder = Path(task.work) / task.clip
    folder.mkdir(parents=True, exist_ok=True)
    store = PartialStore(folder / "sensitivity" / str(len(video)), task.first)
    options = with_budget(Options(), MARKED_BUDGET)
    picks = moved_picks(ANNOTATIONS / f"{task.clip}.picks.json", len(video), task)
    preparation = prepare(video, picks, options, store.keep)
    motion: Motion = reconstruct(preparation, marks, options, store.keep)
    rows = ~np.isin(truth.frames, marks.frames)
    carried = motion.points2d_propagated[truth.frames[rows]]
    return Outcome(pck(carried, truth.joints[rows], TORSO), None, None, store.seconds)


def with_budget(options: Options, budget: float) -> Options:
    """Options with another number of keyframes."""
    return replace(options, keyframes=replace(options.keyframes, budget=budget))


def cut(values: np.ndarray, count: int, frames: int) -> np.ndarray:
    """The first frames of what there is for each frame."""
    return values[:count] if values.ndim and len(values) == frames else values


def moved_picks(file: Path, count: int, task: Task) -> tuple[Pick, ...]:
    """The picks up to a frame, those of one part moved."""
    picks = tuple(pick for pick in read_picks(file) if pick.frame < count)
    if not picks:
        raise SystemExit(f"{file} has no picks before frame {count}; use more frames.")
    if not task.part:
        return picks
    length = {"head": HEAD, "foot": SHIN}[task.part] * stature(picks)
    x, y = (length * share for share in task.offset)
    return tuple(
        replace(p, x=p.x + x, y=p.y + y) if p.part == task.part else p for p in picks
    )  # fmt: skip


def stature(picks: tuple[Pick, ...]) -> float:
    """Height of the player in the frames where head and feet were picked, px."""
    found = []
    for frame in {p.frame for p in picks}:
        head, feet = (
            [(p.x, p.y) for p in picks if p.frame == frame and p.part == part]
            for part in ("head", "foot")
        )
        if head and feet:
            off = np.mean(head, axis=0) - np.mean(feet, axis=0)
            found.append(float(np.linalg.norm(off)) / HEAD_TO_FEET)
    return float(np.median(found))
