"""What the annotator keeps of a project: results of the stages, and what follows from the marks.

Everything is loaded when it is first asked for and again when its file has changed; what follows
from the automatic part is dropped when that was made anew. Suggestions are kept by the marks they
depend on, so that an edit makes only those anew that it touches. The body is estimated in a thread
of its own: an answer about a pose takes the latest estimate there is, and waits only for the first.
"""

import hashlib
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from threading import Lock, RLock, Thread
from typing import Any, Generic, TypeVar

import numpy as np
from jaxtyping import Float, Int

from keyrecon.annotate.assist.body_estimate import BodyEstimate, estimate_body
from keyrecon.annotate.assist.flow_suggestion import nearest_marks, surer_by_flow
from keyrecon.annotate.assist.mark_appearance import (
    MarkAppearance,
    compare_appearance,
    describe_frames,
)
from keyrecon.annotate.assist.neighbours import Neighbours, find_neighbours
from keyrecon.annotate.assist.pose_suggestion import (
    PoseSuggestion,
    choose_sources,
    scene_of,
    suggest_joints,
)
from keyrecon.annotate.assist.preview import Strip, cut_strip
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.coco import read_coco
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, marked_frames, prepare
from keyrecon.propagation.appearance import PlayerFeatures
from keyrecon.records import Annotations, CameraPath, Colors, Motion, Pick, Preparation
from keyrecon.segmentation.color_model import learn_colors
from keyrecon.tracking.camera_motion import estimate_shot_motion

Key = TypeVar("Key")
Value = TypeVar("Value")


class LatestResult(Generic[Key, Value]):
    """The result for the key that was asked for last. One thread at a time makes it: who asks for
    the same meanwhile waits for it, and everybody gets the result for the own key."""

    def __init__(self, make: Callable[..., Value]) -> None:
        """Keep what `make(key, ...)` returns."""
        self._make, self._lock = make, Lock()
        self._kept: tuple[Key, Value] | None = None

    def get(self, key: Key, *inputs: Any) -> Value:
        """The result for `key`, made from it and from `inputs` that follow from it."""
        with self._lock:
            kept = self._kept
            if kept is None or kept[0] != key:
                kept = self._kept = key, self._make(key, *inputs)
            return kept[1]


class _Derived:
    """What follows from one preparation and the marks."""

    def __init__(self, preparation: Preparation) -> None:
        """Nothing was asked for yet."""
        self.preparation = preparation
        self.suggestions: dict[int, tuple[str, PoseSuggestion]] = {}
        self.estimating: tuple[str, Future[BodyEstimate]] | None = None
        self.body: BodyEstimate | None = None
        self.neighbours: LatestResult[str, tuple[Neighbours, ...]] = LatestResult(
            lambda _, annotations: find_neighbours(preparation, annotations)
        )
        self.appearance: LatestResult[str, MarkAppearance | None] = LatestResult(
            lambda _, annotations: self._compare_appearance(annotations)
        )
        self._features: PlayerFeatures | None = None

    def _compare_appearance(self, annotations: Annotations) -> MarkAppearance | None:
        """Only frames that were not described yet are read. One thread at a time is here."""
        preparation = self.preparation
        body_frame = scene_of(preparation, annotations).body_frame
        self._features = describe_frames(
            preparation, body_frame, annotations.frames, self._features
        )
        return compare_appearance(preparation, body_frame, annotations, self._features)

    def estimate_body(self, annotations: Annotations) -> BodyEstimate:
        """From marks, and from such suggestions as there are where half of the body is marked."""
        suggestions = {frame: one for frame, (_, one) in [*self.suggestions.items()]}
        video, track = self.preparation.video, self.preparation.track
        return estimate_body(annotations, suggestions, track.height, video.fps)

    def is_latest(self, key: str) -> bool:
        """Whether no other marks came since."""
        estimating = self.estimating
        return estimating is None or estimating[0] == key


class ProjectCache:
    """One project; safe to ask from several threads."""

    def __init__(self, workspace: Workspace) -> None:
        """Open the project of a workspace."""
        self._workspace = workspace
        self._lock = RLock()
        self._worker = ThreadPoolExecutor(1)
        self._loaded: dict[str, _Loaded] = {}
        self._derived: _Derived | None = None
        self._colors: LatestResult[tuple[Pick, ...], Colors] = LatestResult(
            lambda picks: learn_colors(self.video, picks)
        )
        self._strip: LatestResult[tuple[int, ...], tuple[Strip, CameraPath]] = LatestResult(
            self._cut_strip
        )

    def is_ready(self, patience: float, then: Callable[[], None]) -> bool:
        """Whether the automatic part is loaded as its files are now, after `patience` seconds at
        most; where it is not, `then` is called when it is. Nobody waits for it when the server is
        stopped."""
        loading = Thread(target=self.preparation, daemon=True)
        loading.start()
        loading.join(patience)
        if not loading.is_alive():
            return True

        def tell() -> None:
            loading.join()
            then()

        Thread(target=tell, daemon=True).start()
        return False

    def preparation(self) -> Preparation | None:
        """The automatic part; None before it was run, or when its results are gone."""
        workspace = self._workspace
        made = workspace.keyframes_file, workspace.prepared_marks_file
        noted = workspace.prepared_picks_file
        picks = noted if noted.is_file() else workspace.picks_file
        files = tuple(file for file in (*made, picks) if file.exists())
        if not {*made} & {*files}:
            return None
        return self._load("preparation", files, self._prepared)

    def _from_preparation(self) -> _Derived | None:
        """What follows from the automatic part, nothing of which outlives it."""
        preparation = self.preparation()
        with self._lock:
            if preparation is None:
                return None
            if self._derived is None or self._derived.preparation is not preparation:
                self._derived = _Derived(preparation)
            return self._derived

    def prepared_bodies(self) -> Int[np.ndarray, "n"]:
        """Frames with the whole bodies that the player was followed with."""
        marks = self._prepared_marks()
        if marks is None:
            return np.zeros(0, dtype=np.int64)
        return np.intersect1d(*marked_frames(marks))

    def motion(self) -> Motion | None:
        """The result of the last run, if there was one."""
        file = self._workspace.motion_file
        return self._load("motion", (file,), lambda: read_motion(file))

    @cached_property
    def video(self) -> Video:
        """The project's video."""
        return self._workspace.video()

    def colors(self, picks: tuple[Pick, ...]) -> Colors:
        """What the picked parts look like."""
        return self._colors.get(picks)

    def strip(self, frames: tuple[int, ...]) -> tuple[Strip, CameraPath]:
        """Pictures of some frames and others around them, and how the camera moves between."""
        return self._strip.get(frames)

    def _cut_strip(self, frames: tuple[int, ...]) -> tuple[Strip, CameraPath]:
        strip = cut_strip(self.video, frames)
        return strip, estimate_shot_motion(strip)

    def suggestion(self, annotations: Annotations, frame: int) -> PoseSuggestion | None:
        """Where the joints of a frame probably are; None where nothing tells."""
        derived = self._from_preparation()
        return None if derived is None else _suggest(derived, annotations, frame)

    def any_suggestion(self, annotations: Annotations, frame: int) -> PoseSuggestion | None:
        """The last suggestion for the frame, at once, even if marks were added since."""
        derived = self._from_preparation()
        if derived is None:
            return None
        kept = derived.suggestions.get(frame)
        return _suggest(derived, annotations, frame) if kept is None else kept[1]

    def neighbours(self, annotations: Annotations) -> tuple[Neighbours, ...]:
        """Annotated frames compared with one another."""
        derived = self._from_preparation()
        if derived is None:
            return ()
        key = _digest(annotations.frames, annotations.joints)
        return derived.neighbours.get(key, annotations)

    def appearance(self, annotations: Annotations) -> MarkAppearance | None:
        """Looks of the marks compared with those of other annotated frames."""
        derived = self._from_preparation()
        if derived is None or not len(annotations.frames):
            return None
        key = _digest(annotations.frames, annotations.joints, annotations.visible)
        return derived.appearance.get(key, annotations)

    def body(self, annotations: Annotations, wait: bool = False) -> BodyEstimate | None:
        """The player's body: the latest estimate, or with `wait` that from all these marks."""
        derived = self._from_preparation()
        if derived is None:
            return None
        key = _digest(annotations.frames, annotations.joints, annotations.nearer)
        with self._lock:
            if derived.estimating is None or derived.estimating[0] != key:
                work = self._worker.submit(derived.estimate_body, annotations)
                derived.estimating = key, work
                self._worker.submit(self._suggest_other_halves, derived, annotations, key)
            work, latest = derived.estimating[1], derived.body
        if latest is not None and not (wait or work.done()):
            return latest
        body = work.result()
        with self._lock:
            if derived.body is None or derived.is_latest(key):
                derived.body = body
        return body

    def _suggest_other_halves(self, derived: _Derived, annotations: Annotations, key: str) -> None:
        """Make the suggestions that are lacking until there are other marks, or another
        preparation; then estimate anew."""
        half = ~np.isfinite(annotations.joints[:, :, 0]).all(axis=1)
        lacking = [t for t in annotations.frames[half].tolist() if t not in derived.suggestions]
        for frame in lacking:
            if derived is not self._derived or not derived.is_latest(key):
                return
            _suggest(derived, annotations, frame)
        with self._lock:
            if lacking and derived.is_latest(key):
                derived.estimating = None

    def _prepared(self) -> Preparation:
        """The stored results of the automatic part, with the keyframes that were asked for."""
        workspace = Workspace(self._workspace.folder)
        options = workspace.options(Options(), Options())
        recall = workspace.stages.recall
        video, marks = workspace.video(), self._prepared_marks()
        preparation = prepare(video, self._prepared_picks(marks), options, recall, marks=marks)
        if not workspace.keyframes_file.is_file():
            return preparation
        keyframes = read_keyframes(workspace.keyframes_file)
        if len(keyframes.upper.nearest) != len(preparation.video):
            raise KeyreconError(f"{workspace.keyframes_file} belongs to another video.")
        return replace(preparation, keyframes=keyframes)

    def _prepared_picks(self, marks: Annotations | None) -> tuple[Pick, ...]:
        """The clicks that the automatic part was made with; those there are in a project of a
        former version."""
        workspace = self._workspace
        if workspace.prepared_picks_file.is_file():
            return read_picks(workspace.prepared_picks_file)
        return workspace.picks() if marks is None or workspace.picks_file.is_file() else ()

    def _prepared_marks(self) -> Annotations | None:
        """The marks that the automatic part was made with."""
        workspace, video = self._workspace, self.video
        file, size = workspace.prepared_marks_file, (video.width, video.height)
        return read_coco(file, workspace.skeleton, len(video), size) if file.is_file() else None

    def _load(self, name: str, files: tuple[Path, ...], read: Callable[[], Any]) -> Any:
        """What `read` gives, read again when a file changes; the last there was if it cannot be.

        What could not be read is tried again when stage results are added.
        """
        stamps = tuple(_stamp(file) for file in files)
        inputs = stamps, _stamp(self._workspace.stages.folder)
        with self._lock:
            loaded = self._loaded.get(name, _Loaded())
            if None not in stamps and stamps != loaded.stamps and inputs != loaded.failed_with:
                try:
                    loaded = _Loaded(read(), stamps)
                except KeyreconError:
                    loaded = replace(loaded, failed_with=inputs)
                self._loaded[name] = loaded
            return loaded.value


def _suggest(derived: _Derived, annotations: Annotations, frame: int) -> PoseSuggestion | None:
    """A suggestion, kept by the marks that it depends on; None where nothing tells of the frame:
    no other is annotated, or nobody was found there."""
    preparation = derived.preparation
    sources = choose_sources(preparation, annotations, frame)
    if not len(sources.frames) or not len(preparation.edges[frame].points):
        return None
    marks, video = _marks_of(annotations, frame), preparation.video
    near = nearest_marks(annotations, frame, video.fps, preparation.shots)
    key = _digest(sources.frames, sources.joints, marks, near.frames, near.joints)
    kept = derived.suggestions.get(frame)
    if kept is None or kept[0] != key:
        suggested = suggest_joints(preparation, sources, frame, marks)
        kept = key, surer_by_flow(suggested, video, near, frame)
        derived.suggestions[frame] = kept
    return kept[1]


@dataclass(frozen=True)
class _Loaded:
    """What was read from files."""

    value: Any = None
    stamps: tuple[int | None, ...] = ()
    """When the files that it was read from had last changed."""
    failed_with: tuple = ()
    """Files and stage results of the last attempt that failed."""


def _stamp(path: Path) -> int | None:
    return path.stat().st_mtime_ns if path.exists() else None


def _marks_of(annotations: Annotations, frame: int) -> Float[np.ndarray, "J 2"]:
    row = np.flatnonzero(annotations.frames == frame)
    empty = np.full((len(annotations.skeleton.names), 2), np.nan)
    return annotations.joints[row[0]] if len(row) else empty


def _digest(*arrays: np.ndarray) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
