"""The recipe: everything up to the person, and everything after.

`prepare` finds the player, draws edge elements, compares all frames and chooses the keyframes
that a person should annotate. `reconstruct` carries the annotated joints to every frame, lifts
them to 3D and refines the motion. Both call their stages through `keep`: by default it just
runs them; the command line passes one that returns stored results where nothing has changed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.golf.swing_prior import SwingPriorOptions, fit_swing_prior
from keyrecon.io.formats.model_file import BUILT_IN_DEPTH_MODEL, read_depth_model, read_motion_model
from keyrecon.io.video import Video
from keyrecon.keyframes.distance_matrix import CompareOptions, compare_frames
from keyrecon.keyframes.selection import (
    KeyframeOptions,
    adopt_keyframes,
    choose_keyframes,
    count_labels,
)
from keyrecon.lifting.lifting import LiftOptions, LiftResult, lift_motion
from keyrecon.lifting.priors.depth_model import DepthModel
from keyrecon.progress import Progress, silent
from keyrecon.propagation.propagation import LEAST_MARKED, PropagateOptions, propagate_joints
from keyrecon.records import (
    SOURCES,
    Annotations,
    Background,
    CameraPath,
    Colors,
    JointTracks,
    Keyframes,
    Motion,
    Pick,
    PlayerContours,
    PoseDistances,
    Survey,
    Track,
)
from keyrecon.segmentation.background_model import BackgroundOptions, build_background
from keyrecon.segmentation.color_model import ColorOptions, learn_colors
from keyrecon.segmentation.contours import EdgeOptions, find_edges
from keyrecon.tracking.camera_motion import CameraMotionOptions, estimate_camera_motion
from keyrecon.tracking.detection import EVERY_FRAME, FindOptions, find_player
from keyrecon.tracking.tracker import TrackOptions, track_player

Keep = Callable[..., Any]


@dataclass(frozen=True)
class Options:
    """What every stage can be told."""

    camera: CameraMotionOptions = field(default_factory=CameraMotionOptions)
    colors: ColorOptions = field(default_factory=ColorOptions)
    find: FindOptions = field(default_factory=FindOptions)
    track: TrackOptions = field(default_factory=TrackOptions)
    background: BackgroundOptions = field(default_factory=BackgroundOptions)
    edges: EdgeOptions = field(default_factory=EdgeOptions)
    compare: CompareOptions = field(default_factory=CompareOptions)
    keyframes: KeyframeOptions = field(default_factory=KeyframeOptions)
    propagate: PropagateOptions = field(default_factory=PropagateOptions)
    depths: str = "built-in"
    """What helps with depth signs that nobody gave: 'built-in', 'none', or a file that
    `keyrecon depths` wrote."""
    prior: Literal["none", "golf"] = "none"
    """'golf' lets the swing prior tell depth signs and what nobody saw between keyframes."""
    swing: SwingPriorOptions = field(default_factory=SwingPriorOptions)
    """How the golf prior is fitted, where it is asked for."""
    lift: LiftOptions = field(default_factory=LiftOptions)


@dataclass(frozen=True, eq=False)
class Preparation:
    """Everything known before a person annotates keyframes."""

    video: Video
    camera: CameraPath
    colors: Colors
    track: Track
    background: Background
    figures: PlayerContours
    comparison: PoseDistances
    keyframes: Keyframes

    @property
    def survey(self) -> Survey:
        """What is needed to carry joints over."""
        return Survey(self.figures, self.track, self.camera, self.comparison, self.keyframes)


def run(
    name: str,
    stage: Callable[..., Any],
    *inputs: object,
    options: object = None,
    progress: Progress = silent,
) -> Any:
    """Run a stage; the simplest `keep`. The name is for those that store results."""
    return stage(*inputs, **({} if options is None else {"options": options}), progress=progress)


def prepare(
    video: Video,
    picks: Sequence[Pick],
    options: Options = Options(),
    keep: Keep = run,
    progress: Progress = silent,
) -> Preparation:
    """Find the player, compare all frames and choose the keyframes to annotate (Section 4).

    Raises KeyreconError when a pick is off the picture, the player is not found in most frames,
    or the annotation budget cannot be met.
    """
    picks = tuple(picks)
    count_labels(options.keyframes, len(video))  # a person waits minutes for the choice itself

    def make(name: str, stage: Callable[..., Any], *inputs: object) -> Any:
        stage_options = getattr(options, name)
        return keep(name, stage, *inputs, options=stage_options, progress=progress)

    camera = make("camera", estimate_camera_motion, video)
    colors = make("colors", learn_colors, video, picks)
    rough = make("find", find_player, video, colors, camera)
    background = make("background", build_background, video, camera, rough)
    track = make("track", track_player, video, rough, camera, background, colors)
    figures = make("edges", find_edges, video, track, camera, background, colors)
    comparison = make("compare", compare_frames, figures.edges, track)
    keyframes = make("keyframes", choose_keyframes, comparison, video.fps)
    return Preparation(video, camera, colors, track, background, figures, comparison, keyframes)


def reconstruct(
    preparation: Preparation,
    annotations: Annotations,
    options: Options = Options(),
    keep: Keep = run,
    progress: Progress = silent,
) -> Motion:
    """Carry the annotated joints to every frame and recover the 3D motion (Sections 5 and 6).

    Lengths are in metres where `options.lift.height` is given, else in body heights. Raises
    KeyreconError when keyframes are not annotated.
    """
    model = _depth_model(options)  # a wrong file is told of before minutes are spent
    preparation = _with_annotated(preparation, annotations, options, progress)
    video, keyframes = preparation.video, preparation.keyframes
    tracks = keep(
        "propagate",
        propagate_joints,
        video,
        preparation.survey,
        annotations,
        options=options.propagate,
        progress=progress,
    )
    height, expected = preparation.track.height, None
    if options.prior == "golf":
        pictures = height, (video.width, video.height)
        known = (tracks, annotations, read_motion_model(), pictures, video.time)
        expected = keep("swing", fit_swing_prior, *known, options=options.swing, progress=progress)
    inputs = (tracks, annotations, keyframes, height, video.fps, expected, model)
    lifted = keep("lift", lift_motion, *inputs, options=options.lift, progress=progress)
    return assemble_motion(preparation, annotations, (tracks, lifted), options.lift.height)


def _depth_model(options: Options) -> DepthModel | None:
    """The depth model that was asked for."""
    if options.depths == "none":
        return None
    return read_depth_model(
        BUILT_IN_DEPTH_MODEL if options.depths == "built-in" else Path(options.depths)
    )


def _with_annotated(
    preparation: Preparation, annotations: Annotations, options: Options, progress: Progress
) -> Preparation:
    """The keyframes that were annotated, where these are not just the ones asked for."""
    asked, lower = preparation.keyframes, annotations.skeleton.is_lower
    marked = np.isfinite(annotations.joints).all(axis=2)
    served = [marked[:, half].mean(axis=1) >= LEAST_MARKED for half in (~lower, lower)]
    frames = tuple(annotations.frames[rows] for rows in served)
    if not all(len(f) for f in frames):
        name = "upper" if not len(frames[0]) else "lower"
        raise KeyreconError(f"No frame has most joints of the {name} body annotated.")
    if np.array_equal(frames[0], asked.upper.frames) and np.array_equal(
        frames[1], asked.lower.frames
    ):
        return preparation
    adopted = adopt_keyframes(
        preparation.comparison, asked, frames, options.keyframes, progress=progress
    )
    return replace(preparation, keyframes=adopted)


def assemble_motion(
    preparation: Preparation,
    annotations: Annotations,
    found: tuple[JointTracks, LiftResult],
    height: float | None,
) -> Motion:
    """The result with the evidence behind each joint, in metres where a height was given."""
    tracks, lifted = found
    video, carried = preparation.video, np.isfinite(tracks.joints).all(axis=2)
    source = np.where(carried, SOURCES.index("propagated"), SOURCES.index("interpolated"))
    source[carried & lifted.rejected] = SOURCES.index("refined")
    marked = np.isfinite(annotations.joints).all(axis=2)
    source[annotations.frames] = np.where(
        marked, SOURCES.index("annotated"), source[annotations.frames]
    )
    return Motion(
        skeleton=annotations.skeleton,
        points3d=lifted.points3d,
        points2d=lifted.points2d,
        points2d_propagated=tracks.joints,
        confidence=np.where(lifted.rejected, 0.0, tracks.confidence),
        source=source,
        scale=lifted.scale,
        fps=video.fps,
        time=video.time,
        units="body heights" if height is None else "m",
        keyframes=annotations.frames,
    )


def as_printed(options: Options = Options()) -> Options:
    """The forms that the paper prints, for every stage that has another default."""
    return replace(
        options,
        find=replace(options.find, pace=EVERY_FRAME),
        track=replace(options.track, method="paper"),
        keyframes=replace(options.keyframes, method="paper"),
        propagate=replace(options.propagate, method="paper"),
        depths="none",
        lift=replace(options.lift, method="paper"),
    )


def with_height(options: Options, height: float) -> Options:
    """Options for an athlete of a known height, metres."""
    return replace(options, lift=replace(options.lift, height=height))
