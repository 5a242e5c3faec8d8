"""One clip with a change in it, run as far as the change reaches, and scored.

A clip is a rendered sequence with its truth, or a real video whose joints were marked by eye
(`annotations/real/`). A rendered sequence begins with its picks, or, where its name ends in
"-body", with one marked body, as a real video does with its first marks.
"""

from collections.abc import Sequence as Listing
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from accuracy import SHORT, Case, solve
from real import Clip, choose_bodies, hits, load_clip, take
from sequences import OTHER, TENNIS, Sequence, render
from unseen import unseen_model, unseen_sides
from variant_store import Finished, Unchanged, VariantStore

from keyrecon.annotation_budget import LONG_SHARE
from keyrecon.body import LSP14
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.video import open_video
from keyrecon.library import reconstruct
from keyrecon.metrics import pa_mpjpe, pck, read_truth
from keyrecon.pipeline import Options, prepare
from keyrecon.records import Annotations, Pick

BODY = "-body"
"""Ends the name of a rendered sequence that begins with a marked body, not with picks."""
BODY_FRAME = 180
"""Where it is marked: the first frame that has picks, too."""
MARKED = 0.06
"""Share of a real clip's frames that are marked, always the same ones: what is measured on stays
the same, whatever keyframes a variant would ask for."""
FIRST_BODIES = 4
"""Of these, so many are known before the player is followed."""
HEAD, SHIN = 0.130, 0.246
"""Share of the stature (Drillis and Contini 1966, as printed in Winter, Biomechanics)."""
HEAD_TO_FEET = 0.92
"""From the middle of the head to between the feet, share of the stature: half a head and the
height of a foot less."""
MOVED = {"head": ("head_top", "neck"), "foot": ("left_ankle", "right_ankle")}
"""Joints of a marked body that move with a part."""
TORSO = LSP14.index("right_hip"), LSP14.index("left_shoulder")


@dataclass(frozen=True)
class Task:
    """What to run."""

    clip: str
    work: str
    mocap: str
    frames: int = 0
    """First frames of a rendered sequence; 0 for all."""
    changed: tuple[str, ...] | None = None
    """Stages that use what is changed, '' for what runs between them; None runs all stages as they
    are and keeps their results."""
    held: tuple[str, ...] = ()
    """Stages that are taken as they were, whatever goes into them."""
    unsigned: bool = True
    """Whether to lift without depth signs from the person, too."""
    part: str = ""
    """Picks or marks of this part are moved ..."""
    offset: tuple[float, float] = (0.0, 0.0)
    """... by this, in lengths of a head or a shin."""
    seed: int = 0
    """Added to the seed of the click noise and the height's error."""


@dataclass(frozen=True)
class Outcome:
    """Scores of one clip; all are None where a variant changed no bit of any stage's result."""

    pck: float | None = None
    """Carried PCK@0.2, 0-1."""
    pa: float | None = None
    """PA-MPJPE, mm; None where nothing is known in 3D."""
    pa_unsigned: float | None = None
    """The same where nobody gave depth signs."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Of every stage that ran."""
    called: dict[str, dict[str, list[str]]] = field(default_factory=dict)
    """Per stage, what the functions that were called mention, by module; not of a variant."""


def run_task(task: Task) -> Outcome:
    """Run the clip's stages that a change can affect, and score what comes out."""
    cv2.setNumThreads(1)
    names = {s.name: s for s in (*TENNIS, *OTHER)}
    name = task.clip.removesuffix(BODY)
    run = run_rendered if name in names else run_real
    changed = None if task.changed is None else frozenset(task.changed)
    store = VariantStore(Path(task.work) / task.clip / "sensitivity" / str(task.frames), changed)
    store.held = frozenset(task.held)
    try:
        with store.watched():
            found = run(task, names.get(name), store)
    except Unchanged:
        return Outcome()
    return replace(found, seconds=store.seconds, called=store.called())


def run_rendered(task: Task, sequence: Sequence, store: VariantStore) -> Outcome:
    """A rendered sequence, marked from its truth."""
    folder = render(sequence, Path(task.work), Path(task.mocap))
    depths, _ = unseen_model(sequence, Path(task.work), Path(task.mocap))
    truth = read_truth(folder / "truth.npz")
    count = min(task.frames or len(truth["points3d"]), len(truth["points3d"]))
    truth = {name: cut(values, count, len(truth["points3d"])) for name, values in truth.items()}
    video = open_video(folder / "video.mp4", end=count)
    sides = unseen_sides(sequence, Path(task.work), Path(task.mocap))
    options = replace(Options(), depths=str(depths), sides=str(sides))
    if count / video.fps <= SHORT:
        budget = 2 * LONG_SHARE
        options = replace(options, keyframes=replace(options.keyframes, budget=budget))
    sequence = replace(sequence, seed=sequence.seed + task.seed)
    if task.clip.endswith(BODY):
        body = body_of(truth, sequence, task)
        preparation = prepare(video, (), options, store.keep, marks=body)
    else:
        picks = moved_picks(folder / "picks.json", count, task)
        preparation = prepare(video, picks, options, store.keep)
    case = Case(sequence, preparation, truth, store)
    scores = []
    for signs in (True, False)[: 1 + task.unsigned]:
        motion = solve(case, options, signs)
        scores.append(pa_mpjpe(1000 * motion.points3d, 1000 * truth["points3d"]))
    carried = pck(motion.points2d_propagated, truth["points2d"], TORSO)
    return Outcome(carried, *scores)


def body_of(truth: dict[str, np.ndarray], sequence: Sequence, task: Task) -> Annotations:
    """A whole body as a person marks it, with click noise."""
    joints = truth["points2d"][[BODY_FRAME]]
    tall = np.ptp(joints[..., 1]) / HEAD_TO_FEET
    noise = np.random.default_rng(sequence.seed).normal(0, 3.0 / 400 * tall, joints.shape)
    seen = truth["visible"][[BODY_FRAME]].astype(bool)
    nearer = np.zeros((1, len(LSP14.bones)), dtype=np.int64)
    return moved_marks(
        Annotations(LSP14, np.array([BODY_FRAME]), joints + noise, seen, nearer), task
    )


def run_real(task: Task, _: None, store: VariantStore) -> Outcome:
    """A real clip, scored on frames marked by eye; nothing is known in 3D, so nothing is lifted."""
    clip = load_clip(task.clip)
    first = choose_bodies(clip, FIRST_BODIES)
    count = max(FIRST_BODIES, round(MARKED * len(clip.video)))
    rows = np.union1d(first, evenly(np.setdiff1d(np.arange(len(clip.truth.frames)), first), count))
    marks = take(clip, rows, rows)
    store.last = "propagate"
    bodies = moved_marks(take(clip, first, first), task)
    try:
        preparation = prepare(clip.video, (), Options(), store.keep, marks=bodies)
        reconstruct(preparation, marks, Options(), store.keep)
    except Finished as finished:
        joints = finished.result.joints
    used = held_out(clip, marks) & clip.seen
    return Outcome(float(hits(joints, clip, 0.2)[used].mean()))


def evenly(rows: np.ndarray, count: int) -> np.ndarray:
    """So many of the rows, spread evenly, less those marked first."""
    more = count - FIRST_BODIES
    return rows[np.linspace(0, len(rows) - 1, more + 2).round().astype(int)[1:-1]]


def held_out(clip: Clip, marks: Annotations) -> np.ndarray:
    """(K, J): truth that is not among the marks."""
    marked = np.isin(clip.truth.frames, marks.frames)
    return np.isfinite(clip.truth.joints[..., 0]) & ~marked[:, None]


def cut(values: np.ndarray, count: int, frames: int) -> np.ndarray:
    """The first frames of what there is for each frame."""
    return values[:count] if values.ndim and len(values) == frames else values


def moved_marks(marks: Annotations, task: Task) -> Annotations:
    """The marks, those of one part moved by a share of a head or of a shin."""
    if not task.part:
        return marks
    joints = marks.joints.copy()
    stature = np.nanmedian(np.nanmax(joints[..., 1], axis=1) - np.nanmin(joints[..., 1], axis=1))
    length = {"head": HEAD, "foot": SHIN}[task.part] * float(stature) / HEAD_TO_FEET
    for name in MOVED[task.part]:
        joints[:, LSP14.index(name)] += length * np.array(task.offset)
    return replace(marks, joints=joints)


def moved_picks(file: Path, count: int, task: Task) -> tuple[Pick, ...]:
    """The picks up to a frame, those of one part moved."""
    picks = tuple(pick for pick in read_picks(file) if pick.frame < count)
    if not picks:
        raise SystemExit(f"{file} has no picks before frame {count}; use more frames.")
    if not task.part:
        return picks
    length = {"head": HEAD, "foot": SHIN}[task.part] * stature_of(picks)
    x, y = (length * share for share in task.offset)
    return tuple(
        replace(p, x=p.x + x, y=p.y + y) if p.part == task.part else p for p in picks
    )  # fmt: skip


def stature_of(picks: Listing[Pick]) -> float:
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
