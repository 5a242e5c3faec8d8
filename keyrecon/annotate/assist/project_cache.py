"""A project as the annotator thinks about it: what was prepared, and what marks have taught.

Everything is loaded when it is first asked for and again when its file has changed. Ghosts are kept
by the marks they depend on, so that an edit makes only those anew that it touches. The size of the
body is learnt in a thread of its own: an answer about a pose takes the latest there is, and waits
only for the first.
"""

import hashlib
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from threading import RLock, Thread
from typing import Any

import numpy as np
from jaxtyping import Float

from keyrecon.annotate.assist.body_estimate import BodyEstimate, estimate_body
from keyrecon.annotate.assist.checks import Neighbours, find_neighbours
from keyrecon.annotate.assist.pose_suggestion import PoseSuggestion, choose_sources, suggest_joints
from keyrecon.annotate.assist.preview import Strip, cut_strip
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.keyframes import keyframes_from_json
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, prepare
from keyrecon.records import Annotations, CameraPath, Colors, Motion, Pick, Preparation
from keyrecon.segmentation.color_model import learn_colors
from keyrecon.tracking.camera_motion import estimate_camera_motion


class ProjectCache:
    """One project; safe to ask from several threads."""

    def __init__(self, workspace: Workspace) -> None:
        """Study the project of a workspace."""
        self._workspace = workspace
        self._loading = RLock()
        self._learner = ThreadPoolExecutor(1)
        self._loaded: dict[str, _Loaded] = {}
        self._ghosts: dict[int, tuple[str, PoseSuggestion]] = {}
        self._learnt: tuple[str, Future[BodyEstimate]] | None = None
        self._knowledge: BodyEstimate | None = None
        self._looks: tuple[str, tuple[Neighbours, ...]] | None = None
        self._colors: tuple[tuple[Pick, ...], Colors] | None = None
        self._strip: tuple[tuple[int, ...], Strip, CameraPath] | None = None
        # ready when the page asks, and in nobody's way when the server is stopped
        Thread(target=self.preparation, daemon=True).start()

    def preparation(self) -> Preparation | None:
        """The automatic part; None before it was run, or when its results are gone."""
        files = self._workspace.keyframes_file, self._workspace.picks_file
        return self._load("preparation", files, self._prepared)

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
        if self._colors is None or self._colors[0] != picks:
            self._colors = picks, learn_colors(self.video, picks)
        return self._colors[1]

    def strip(self, frames: tuple[int, ...]) -> tuple[Strip, CameraPath]:
        """Pictures of some frames and others around them, and how the camera moves between."""
        if self._strip is None or self._strip[0] != frames:
            strip = cut_strip(self.video, frames)
            self._strip = frames, strip, estimate_camera_motion(strip)
        return self._strip[1:]

    def ghost(self, annotations: Annotations, frame: int) -> PoseSuggestion | None:
        """Where the joints of a frame probably are; None while nothing else is annotated."""
        preparation = self.preparation()
        if preparation is None:
            return None
        sources = choose_sources(preparation, annotations, frame)
        if not len(sources.frames):
            return None
        held = _marks_of(annotations, frame)
        key = _digest(sources.frames, sources.joints, held)
        known = self._ghosts.get(frame)
        if known is None or known[0] != key:
            known = key, suggest_joints(preparation, sources, frame, held)
            self._ghosts[frame] = known
        return known[1]

    def any_ghost(self, annotations: Annotations, frame: int) -> PoseSuggestion | None:
        """A ghost of the frame, even if marks were added since it was made: at once, if seen."""
        known = self._ghosts.get(frame)
        return self.ghost(annotations, frame) if known is None else known[1]

    def lookalikes(self, annotations: Annotations) -> tuple[Neighbours, ...]:
        """What annotated frames say of one another."""
        preparation = self.preparation()
        key = _digest(annotations.frames, annotations.joints)
        if preparation is None:
            return ()
        if self._looks is None or self._looks[0] != key:
            self._looks = key, find_neighbours(preparation, annotations)
        return self._looks[1]

    def knowledge(self, annotations: Annotations, wait: bool = False) -> BodyEstimate | None:
        """What is known of the body: the latest, or with `wait` all that these marks tell."""
        preparation = self.preparation()
        if preparation is None:
            return None
        key = _digest(annotations.frames, annotations.joints, annotations.nearer)
        with self._loading:
            if self._learnt is None or self._learnt[0] != key:
                work = self._learner.submit(self._learn, preparation, annotations)
                self._learnt = key, work
                self._learner.submit(self._foresee_halves, annotations, key)
            work = self._learnt[1]
        if wait or self._knowledge is None or work.done():
            self._knowledge = work.result()
        return self._knowledge

    def _learn(self, preparation: Preparation, annotations: Annotations) -> BodyEstimate:
        """From marks, and from such ghosts as there are where a frame shows half of the body."""
        ghosts = {frame: ghost for frame, (_, ghost) in [*self._ghosts.items()]}
        video, track = preparation.video, preparation.track
        return estimate_body(annotations, ghosts, track.height, video.fps)

    def _foresee_halves(self, annotations: Annotations, key: str) -> None:
        """Make the ghosts that are lacking, until there are other marks; then learn anew."""
        half = ~np.isfinite(annotations.joints[:, :, 0]).all(axis=1)
        lacking = [t for t in annotations.frames[half].tolist() if t not in self._ghosts]
        for frame in lacking:
            if self._learnt is None or self._learnt[0] != key:
                return
            self.ghost(annotations, frame)
        if lacking:
            self._learnt = None

    def _prepared(self) -> Preparation:
        """The stored results of the automatic part, with the keyframes that were asked for."""
        workspace = Workspace(self._workspace.folder)
        options = workspace.options(Options(), Options())
        recall = workspace.stages.recall
        found = prepare(workspace.video(), workspace.picks(), options, recall)
        asked = keyframes_from_json(workspace.keyframes_file.read_text())
        if len(asked.upper.nearest) != len(found.video):
            raise KeyreconError(f"{workspace.keyframes_file} belongs to another video.")
        return replace(found, keyframes=asked)

    def _load(self, name: str, files: tuple[Path, ...], read: Callable[[], Any]) -> Any:
        """What `read` gives, read again when a file changes; the last there was if it cannot be.

        What could not be read is tried again when stage results are added.
        """
        stamps = tuple(_stamp(file) for file in files)
        at_hand = stamps, _stamp(self._workspace.stages.folder)
        with self._loading:
            known = self._loaded.get(name, _Loaded())
            if None not in stamps and stamps != known.stamps and at_hand != known.failed_with:
                try:
                    known = _Loaded(read(), stamps)
                except KeyreconError:
                    known = replace(known, failed_with=at_hand)
                self._loaded[name] = known
            return known.value


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
