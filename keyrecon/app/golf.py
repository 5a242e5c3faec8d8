"""`keyrecon golf fit`: from a video and a few clicks to a project with motion, overlay and report.

The project folder holds project.toml and cache/ like any other (`io.workspace`), and besides

    golf_clicks.json   six joints of the address, clicked on the page or in a file
    golf_marks.json    corrections, if any (`io.formats.golf_marks`); they hold
    motion.npz, overlay.mp4, report.html

so that an interrupted fit goes on where it stopped, and one that is repeated is done at once.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from keyrecon.app.golf_recipe import find_swing
from keyrecon.app.project import load_annotations
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError, quoted
from keyrecon.golf.click_checks import check_pose
from keyrecon.golf.clicks import GolfClicks, check_clicks, clicked_pose
from keyrecon.golf.fit.handedness import mirror_marks
from keyrecon.golf.marks import join_marks
from keyrecon.golf.mirroring import mirror_clicks, mirror_found
from keyrecon.golf.plausibility import SwingDoubt
from keyrecon.golf.records import (
    KEY_POSTURES,
    NO_MARKS,
    FittedSwing,
    MotionModel,
    Observations,
    RecordedSwing,
    SwingMarks,
)
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.durable import make_folder, put_aside, write_durably
from keyrecon.io.fingerprint import has_fingerprint
from keyrecon.io.formats.clicks import read_clicks
from keyrecon.io.formats.golf_marks import read_golf_marks
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.formats.swing_file import write_swing
from keyrecon.io.held_video import hold_frames, mirror_video, with_exposure
from keyrecon.io.option_tables import check_options
from keyrecon.io.project_folder import GOLF_RESULTS
from keyrecon.io.project_videos import relative_path
from keyrecon.io.provenance import (
    forget_run,
    golf_digest,
    motion_stamp,
    note_exports,
    note_fitted,
)
from keyrecon.io.video import Video, open_video
from keyrecon.io.work_lock import lock_folder
from keyrecon.io.workspace import GOLF, Workspace
from keyrecon.keeping import Keep, call_stage
from keyrecon.progress import Progress, silent
from keyrecon.report.golf_measures import measure_swing, record_swing
from keyrecon.report.golf_page import write_golf_report
from keyrecon.report.golf_pictures import write_golf_overlay
from keyrecon.report.golf_table import write_golf_table
from keyrecon.tracking.camera_motion import estimate_camera_motion

CLICKS_FILE = "golf_clicks.json"
TABLE_FILE, OVERLAY_FILE = GOLF_RESULTS
SHORTEST_SWING = 0.7
"""Seconds from the beginning of the upswing to the hit, at least: the fastest tour players take
0.93 (21 + 7 frames at 30 a second: 0.7 + 0.23; Novosel & Garrity, Tour Tempo, 2004)."""


@dataclass(frozen=True, eq=False)
class GolfFit:
    """A fitted swing and what it was fitted to."""

    fitted: FittedSwing
    observations: Observations
    doubts: tuple[SwingDoubt, ...] = ()
    """What speaks against it."""
    notes: tuple[str, ...] = ()
    """What was found of the film."""
    shown: tuple[bool, bool, bool, bool] = (True, True, True, True)
    """Which key postures it shows."""


BUILT_IN = Path("built-in")
"""How the prior is named that comes with keyrecon."""


@dataclass(frozen=True)
class GolfSettings:
    """Options that are given for one fit; None takes the project's, or the default."""

    method: Literal["swing", "windows"] | None = None
    """How the model is fitted."""
    components: int | None = None
    """Components of the prior used at most."""
    prior: Path | None = None
    """A swing prior of `keyrecon golf train`, or BUILT_IN."""

    def applied_to(self, options: GolfOptions, folder: Path) -> GolfOptions:
        """The options of the project in a folder with those given here in their place."""
        components = options.fit.components if self.components is None else self.components
        prior = options.prior if self.prior is None else relative_path(self.prior, folder)
        return replace(
            options,
            method=options.method if self.method is None else self.method,
            fit=replace(options.fit, components=components),
            prior="" if self.prior == BUILT_IN else prior,
        )


def fit_file(
    video_file: Path,
    clicks_file: Path | None,
    folder: Path,
    slow_motion: float | None = None,
    force: bool = False,
    options: GolfOptions = GolfOptions(),
    progress: Progress = silent,
    settings: GolfSettings = GolfSettings(),
) -> str:
    """Fit a swing in a project folder; returns what to print. `force` makes every stage again.

    Without a file of clicks those are taken that the project has. `settings` override `options`,
    and these what the project remembers.
    """
    model = read_prior(settings.applied_to(options, folder), folder)
    factor = 1.0 if slow_motion is None else slow_motion
    is_new = not (folder / "project.toml").is_file()
    video = open_video(video_file, slow_motion=factor, square_only=is_new)
    if clicks_file is not None:
        check_evidence(read_clicks(clicks_file), video, model, factor, str(clicks_file))
    else:
        check_length(video, factor)
    check_options(settings.applied_to(options, folder))
    with lock_folder(folder, "keyrecon golf fit"):
        workspace = open_golf_project(folder, video, clicks_file, slow_motion, force)
        return fit_project(workspace, options, progress, settings)


def read_prior(options: GolfOptions, folder: Path) -> MotionModel:
    """The prior of the project in a folder; KeyreconError tells how to name another."""
    file = folder / options.prior if options.prior else BUILT_IN_SWING_PRIOR
    if not file.is_file():
        raise KeyreconError(
            f"There is no swing prior at {file}; name the one to fit with: keyrecon golf fit VIDEO "
            f"--out {quoted(folder)} --prior FILE ({BUILT_IN} for the one that keyrecon has)."
        )
    return read_motion_model(file)


def fit_project(
    workspace: Workspace,
    options: GolfOptions = GolfOptions(),
    progress: Progress = silent,
    settings: GolfSettings = GolfSettings(),
) -> str:
    """Fit a swing in a project that has its clicks; returns what to print."""
    began = time.perf_counter()
    video, folder = workspace.video(), workspace.folder
    options = settings.applied_to(workspace.options(options, GolfOptions(), GOLF), folder)
    model = read_prior(options, folder)
    slow_motion = workspace.project["video"].get("slow_motion")
    fitting = replace(options, prior="")  # stages know the prior by its content
    if slow_motion is not None:
        fitting = without_slow_motion_search(fitting)
    with workspace.remembering(options, GolfOptions(), GOLF):
        digest, clicks = golf_digest(workspace), kept_clicks(workspace)
        check_evidence(clicks, video, model, slow_motion or 1.0, str(workspace.golf_clicks_file))
        video = hold_frames(video)
        marks = kept_marks(workspace, video)
        fit = fit_video(video, clicks, model, fitting, workspace.stages.keep, progress, marks)
    if workspace.stages.seconds or not _is_written(workspace, fit.fitted):
        write_results(workspace, video, fit, model, progress)
    note_fitted(workspace, digest)
    spent = time.perf_counter() - began
    return "\n".join(
        [
            describe_tempo(_record(fit)),
            *(f"Note: {note}." for note in fit.notes),
            *describe_doubts(fit.doubts, folder),
            f"{folder}/motion.npz, golf.csv, overlay.mp4, report.html: {len(video)} frames, "
            f"{spent:.0f} s ({spent / len(video):.2f} s per frame).",
        ]
    )


def without_slow_motion_search(options: GolfOptions) -> GolfOptions:
    """Options for a film of which a person told how fast it plays: no slow motion is searched."""
    return replace(options, observation=replace(options.observation, find_slow_motion=False))


def kept_clicks(workspace: Workspace) -> GolfClicks:
    """The project's clicks; KeyreconError tells where to click while there are none."""
    if not workspace.golf_clicks_file.is_file():
        folder = quoted(workspace.folder)
        raise KeyreconError(
            f"{workspace.folder} has no clicks yet. Click six joints of the address on the page of "
            f"keyrecon annotate {folder}, and fit the swing there; or give --clicks FILE."
        )
    return read_clicks(workspace.golf_clicks_file)


def kept_marks(workspace: Workspace, video: Video) -> SwingMarks:
    """What a person marked in the swing: corrections of a fit, and joints of keyframes."""
    size = video.width, video.height
    marks = read_golf_marks(workspace.golf_marks_file, len(video), size)
    if not workspace.annotations_file.is_file():
        return marks
    bodies = load_annotations(workspace, video)
    return join_marks(marks, SwingMarks.of_joints(bodies.frames, bodies.joints))


def check_evidence(
    clicks: GolfClicks, video: Video, model: MotionModel, slow_motion: float, origin: str
) -> None:
    """Raises KeyreconError where clicks and video cannot be those of a swing."""
    check_clicks(clicks, len(video), (video.width, video.height))
    check_pose(clicked_pose(clicks), model, origin)
    check_length(video, slow_motion)


def fit_video(
    video: Video,
    clicks: GolfClicks,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
    keep: Keep = call_stage,
    progress: Progress = silent,
    marks: SwingMarks = NO_MARKS,
) -> GolfFit:
    """Observe a swing, fit the model to it, and hold what a person marked.

    Raises KeyreconError where no player or no swing is observed.
    """
    pose = clicked_pose(clicks)
    seen, own_marks = video, marks
    if clicks.left_handed:
        seen, pose = mirror_video(video), mirror_clicks(pose)
        own_marks = mirror_marks(marks, video.width)
    camera = keep("camera", estimate_camera_motion, seen, progress=progress)
    seen = with_exposure(seen, camera.exposure)
    swing = find_swing(seen, camera, pose, model, options, keep, progress, own_marks)
    if clicks.left_handed:
        swing = keep("mirrored", mirror_found, swing, video.width)
    return GolfFit(swing.fitted, swing.observations, swing.doubts, swing.notes, swing.shown)


def check_length(video: Video, slow_motion: float) -> None:
    """Raises KeyreconError where a video is too short for a swing."""
    seconds = float(video.time[-1])
    if seconds < SHORTEST_SWING:
        slowed = f" ({slow_motion:g} times slower than life)" if slow_motion != 1 else ""
        raise KeyreconError(
            f"{video.path} lasts {seconds:.2f} s{slowed}, but from the upswing to the hit alone a "
            f"swing takes {SHORTEST_SWING:g} s or more; use the whole clip, and see to --slowmo."
        )


def open_golf_project(
    folder: Path,
    video: Video,
    clicks_file: Path | None,
    slow_motion: float | None = None,
    force: bool = False,
) -> Workspace:
    """The project of a video in a folder, made if need be, with a copy of the clicks.

    Raises KeyreconError where the folder holds another project.
    """
    if (folder / "project.toml").is_file():
        workspace = Workspace(folder, force)
        _require_same_video(workspace, video, slow_motion)
        if not (folder / workspace.project["video"]["path"]).is_file():
            workspace.relink(video.path)
        if slow_motion is not None and "slow_motion" not in workspace.project["video"]:
            workspace.set_slow_motion(slow_motion)
        if clicks_file is not None:
            keep_clicks(workspace, clicks_file.read_bytes())
        if not workspace.is_golf:
            workspace.become_golf()
        return workspace
    make_folder(folder)
    if clicks_file is not None:
        write_durably(folder / CLICKS_FILE, clicks_file.read_bytes())
    Workspace.create(folder, video, video.path, {"slow_motion": slow_motion}, GOLF)
    return Workspace(folder, force)


def _require_same_video(workspace: Workspace, video: Video, slow_motion: float | None) -> None:
    """Raises KeyreconError where a project is not one of this video with the usual joints."""
    folder, kept = workspace.folder, workspace.project["video"]
    if not has_fingerprint(video.path, kept["fingerprint"]):
        raise KeyreconError(
            f"{folder} is the project of another video ({Path(kept['path']).name}); name another "
            "folder for this one with --out."
        )
    if workspace.skeleton.names != LSP14.names:
        raise KeyreconError(
            f"{folder} is a project with a skeleton of its own, which a swing does not have; name "
            "another folder with --out."
        )
    earlier = kept.get("slow_motion")
    if earlier is not None and slow_motion not in (None, earlier):
        raise KeyreconError(
            f"{folder} was made with --slowmo {earlier:g}; name another folder with --out for "
            f"--slowmo {slow_motion:g}."
        )


def keep_clicks(workspace: Workspace, content: bytes) -> None:
    """Write the clicks into the project; other ones that were there stay beside them."""
    file = workspace.golf_clicks_file
    with workspace.exclusive():
        if file.is_file() and file.read_bytes() != content:
            put_aside(file)
        write_durably(file, content)


def write_results(
    workspace: Workspace, video: Video, fit: GolfFit, model: MotionModel, progress: Progress
) -> None:
    """Overlay, report and table, then the motion, whose presence tells that all are written."""
    folder = workspace.folder
    swing = _record(fit)
    write_golf_overlay(folder / OVERLAY_FILE, video, fit.fitted, fit.observations.camera, progress)
    write_golf_report(
        workspace.report_file, swing, fit.fitted, fit.observations, model, video, progress
    )
    write_golf_table(folder / TABLE_FILE, swing)
    forget_run(workspace)
    write_swing(workspace.motion_file, swing)
    exports = [folder / name for name in (OVERLAY_FILE, TABLE_FILE)]
    note_exports(workspace, exports, motion_stamp(workspace))


def _record(fit: GolfFit) -> RecordedSwing:
    """What is kept of a fit."""
    reasons = tuple(f"{doubt.text} (frame {doubt.frame})" for doubt in fit.doubts)
    return record_swing(fit.fitted, fit.observations, reasons, fit.notes, fit.shown)


def _is_written(workspace: Workspace, fitted: FittedSwing) -> bool:
    """Whether the results of this very fit lie in the project already."""
    exports = (workspace.folder / name for name in (OVERLAY_FILE, TABLE_FILE))
    files = (workspace.motion_file, workspace.report_file, *exports)
    return all(file.is_file() for file in files) and np.array_equal(
        read_motion(workspace.motion_file).points3d, fitted.motion.points3d
    )


def describe_tempo(swing: RecordedSwing) -> str:
    """Key postures and tempo in words; a fit without a downswing has no tempo, and a doubtful one
    no times that would pass for measurements."""
    start, top, hit, finish = swing.keys
    measures = measure_swing(swing)
    up, down, tempo = (measures.key(name) for name in ("upswing", "downswing", "tempo"))
    pace = [f"{m.value:.2f} s {way}" for m, way in ((up, "up"), (down, "down"))]
    pace.append(f"tempo {tempo.value:.1f} : 1 (give or take {tempo.doubt:.1f})")
    known = [
        text if np.isfinite(m.value) else f"no {m.name}"
        for m, text in zip((up, down, tempo), pace, strict=True)
    ]
    missing = [name for name, shown in zip(KEY_POSTURES, swing.shown, strict=True) if not shown]
    not_shown = f" ({' and '.join(missing)} not shown)" if missing else ""
    times = "" if swing.doubts else f"; {', '.join(known)}"
    return (
        f"Upswing from frame {start:.0f}, top {top:.0f}, hit {hit:.0f}, finish {finish:.0f}"
        f"{not_shown}{times}."
    )


def describe_doubts(doubts: Sequence[SwingDoubt], folder: Path) -> list[str]:
    """The warning of a fit that does not explain its video; no line where it does."""
    if not doubts:
        return []
    reasons = "; ".join(f"{doubt.text} (frame {doubt.frame})" for doubt in doubts)
    return [
        f"WARNING: this fit is doubtful: {reasons}. Do not use its angles. On the page of keyrecon "
        f"annotate {quoted(folder)}, mark joints, club or key postures there, and fit again."
    ]
