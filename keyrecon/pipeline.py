"""The recipe: everything up to the person, and everything after.

`prepare` finds the player, draws edge elements, compares all frames and chooses the keyframes
that a person should annotate. `reconstruct` propagates the annotated joints to every frame, lifts
them to 3D and refines the motion. Both call their stages through `keep`: by default it just
calls them; the command line passes one that returns stored results where nothing has changed.
Nothing here reads or writes a file: learnt models come in as values (`Models`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, ParamSpec, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Int

from keyrecon.errors import KeyreconError
from keyrecon.golf.records import MotionModel
from keyrecon.golf.swing_prior import SwingPriorOptions, fit_swing_prior
from keyrecon.io.video import Video
from keyrecon.keyframes.distance_matrix import CompareOptions, compare_frames
from keyrecon.keyframes.pose_time import pose_seconds
from keyrecon.keyframes.selection import (
    KeyframeOptions,
    adopt_keyframes,
    choose_keyframes,
    count_labels,
    keep_marked,
)
from keyrecon.lifting.lifting import LiftOptions, LiftPriors, LiftResult, lift_motion
from keyrecon.lifting.priors.depth_model import DepthModel
from keyrecon.numerics.threads import one_order_of_sums
from keyrecon.progress import Progress, silent
from keyrecon.propagation.propagation import LEAST_MARKED, PropagateOptions, propagate_joints
from keyrecon.records import (
    SOURCES,
    Annotations,
    JointTracks,
    Motion,
    Pick,
    Preparation,
    TrackAnchors,
)
from keyrecon.segmentation.background_model import BackgroundOptions, build_background
from keyrecon.segmentation.color_model import ColorOptions, learn_colors
from keyrecon.segmentation.contours import EdgeOptions, find_edges
from keyrecon.segmentation.marked_bodies import anchors_from_bodies, picks_from_bodies
from keyrecon.tracking.anchors import contradicted_frames, least_sure_frames
from keyrecon.tracking.camera_motion import CameraMotionOptions, estimate_camera_motion
from keyrecon.tracking.detection import EVERY_FRAME, FindOptions, find_player
from keyrecon.tracking.mark_flow import FlowOptions, track_marked_joints
from keyrecon.tracking.tracker import TrackOptions, track_player
from keyrecon.uncertainty import expected_error

Inputs = ParamSpec("Inputs")
Result = TypeVar("Result")


@runtime_checkable
class Keep(Protocol):
    """Calls a stage, or gives what the same call gave before.

    The name is for those that store results. Arguments and result are typed as the stage's own.
    """

    def __call__(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The stage's result for these inputs."""
        ...


def call_stage(
    name: str,
    stage: Callable[Inputs, Result],
    /,
    *inputs: Inputs.args,
    **named: Inputs.kwargs,
) -> Result:
    """Call a stage; the simplest `Keep`."""
    with one_order_of_sums():
        return stage(*inputs, **named)


@dataclass(frozen=True)
class Options:
    """What every stage can be told."""

    camera: CameraMotionOptions = field(default_factory=CameraMotionOptions)
    colors: ColorOptions = field(default_factory=ColorOptions)
    find: FindOptions = field(default_factory=FindOptions)
    track: TrackOptions = field(default_factory=TrackOptions)
    flow: FlowOptions = field(default_factory=FlowOptions)
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
class Models:
    """What was learnt from captures before; None does without."""

    depth: DepthModel | None = None
    """Helps with depth signs that nobody gave."""
    swing: MotionModel | None = None
    """Golf's prior; needed where `Options.prior` asks for it."""


def prepare(
    video: Video,
    picks: Sequence[Pick],
    options: Options = Options(),
    keep: Keep = call_stage,
    progress: Progress = silent,
    marks: Annotations | None = None,
) -> Preparation:
    """Find the player, compare all frames and choose the keyframes to annotate.

    ECCV 2004, Section 4. What the player looks like is told by picks, by the bodies of `marks`,
    or by both; marked heads and feet are fixed points of the track.
    Raises KeyreconError when a pick is off the picture, the player is not
    found in most frames, or the annotation budget cannot be met.
    """
    # a person waits minutes for the choice itself
    count_labels(options.keyframes, len(video), video.fps)
    camera = keep(
        "camera", estimate_camera_motion, video, options=options.camera, progress=progress
    )
    clicks, anchors = tuple(picks), TrackAnchors.none()
    if marks is not None:
        clicks += picks_from_bodies(marks, (video.width, video.height))
        flow = keep(
            "flow", track_marked_joints, video, marks, options=options.flow, progress=progress
        )
        anchors = anchors_from_bodies(marks, flow)
    colors = keep("colors", learn_colors, video, clicks, options=options.colors, progress=progress)
    detected = keep(
        "find", find_player, video, colors, camera, anchors, options=options.find, progress=progress
    )
    background = keep(
        "background",
        build_background,
        video,
        camera,
        detected,
        options=options.background,
        progress=progress,
    )
    track = keep(
        "track",
        track_player,
        video,
        detected,
        camera,
        background,
        colors,
        anchors,
        options=options.track,
        progress=progress,
    )
    contours = keep(
        "edges",
        find_edges,
        video,
        track,
        camera,
        background,
        colors,
        options=options.edges,
        progress=progress,
    )
    distances = keep(
        "compare",
        compare_frames,
        contours.edges,
        track,
        options=options.compare,
        progress=progress,
    )
    keyframes = keep(
        "keyframes",
        choose_keyframes,
        distances,
        video.fps,
        options=options.keyframes,
        progress=progress,
    )
    return Preparation(video, camera, colors, track, background, contours, distances, keyframes)


def with_marked_keyframes(
    preparation: Preparation,
    marks: Annotations,
    options: Options = Options(),
    progress: Progress = silent,
) -> Preparation:
    """The same with the frames that are marked already among the keyframes."""
    keyframes = keep_marked(
        preparation.pose_distances,
        preparation.keyframes,
        marked_frames(marks),
        options.keyframes,
        progress,
    )
    return replace(preparation, keyframes=keyframes)


def marked_frames(marks: Annotations) -> tuple[Int[np.ndarray, "u"], Int[np.ndarray, "l"]]:
    """Frames that have most joints of the upper body marked, and of the lower."""
    lower = marks.skeleton.is_lower
    marked = np.isfinite(marks.joints).all(axis=2)
    upper_frames, lower_frames = (
        marks.frames[marked[:, half].mean(axis=1) >= LEAST_MARKED] for half in (~lower, lower)
    )
    return upper_frames, lower_frames


def frames_off_marks(preparation: Preparation, marks: Annotations) -> Int[np.ndarray, "n"]:
    """Marked frames in which the track has the head or a foot elsewhere.

    Where there are any, `prepare` with these marks follows the player anew.
    """
    return contradicted_frames(preparation.track, anchors_from_bodies(marks))


def frames_to_mark(
    preparation: Preparation,
    marked: Int[np.ndarray, "n"],
    count: int,
) -> Int[np.ndarray, "m"]:
    """Frames in which a whole body would teach most, in addition to those marked.

    Where the track is least sure, and where the pose has changed most since the nearest mark.
    """
    fps = preparation.video.fps
    time = pose_seconds(preparation.pose_distances, fps)
    return least_sure_frames(preparation.track, marked, fps, count, time)


def reconstruct(
    preparation: Preparation,
    annotations: Annotations,
    models: Models,
    options: Options = Options(),
    keep: Keep = call_stage,
    progress: Progress = silent,
) -> Motion:
    """Propagate the annotated joints to every frame and recover the 3D motion.

    ECCV 2004, Sections 5 and 6. Lengths are in metres where `options.lift.height` is given, else
    in body heights. Raises KeyreconError when keyframes are not annotated.
    """
    preparation = _with_annotated_keyframes(preparation, annotations, options, progress)
    video, height = preparation.video, preparation.track.height
    tracks = carry_joints(preparation, annotations, options, keep, progress)
    expected = None
    if options.prior == "golf" and models.swing is not None:
        expected = keep(
            "swing",
            fit_swing_prior,
            tracks,
            annotations,
            models.swing,
            height,
            video,
            options=options.swing,
            progress=progress,
        )
    lifted = keep(
        "lift",
        lift_motion,
        tracks,
        annotations,
        preparation.keyframes,
        height,
        video.fps,
        LiftPriors(expected, models.depth),
        options=options.lift,
        progress=progress,
    )
    return assemble_motion(video, annotations, tracks, lifted, options.lift.height)


def carry_joints(
    preparation: Preparation,
    annotations: Annotations,
    options: Options = Options(),
    keep: Keep = call_stage,
    progress: Progress = silent,
) -> JointTracks:
    """The annotated joints in every frame of the video."""
    video, flow = preparation.video, None
    if options.propagate.method == "fused":
        flow = keep(
            "flow", track_marked_joints, video, annotations, options=options.flow, progress=progress
        )
    return keep(
        "propagate",
        propagate_joints,
        preparation,
        annotations,
        flow,
        options=options.propagate,
        progress=progress,
    )


def _with_annotated_keyframes(
    preparation: Preparation, annotations: Annotations, options: Options, progress: Progress
) -> Preparation:
    """The keyframes that were annotated, where these are not just the ones asked for."""
    asked = preparation.keyframes
    of_upper, of_lower = marked_frames(annotations)
    for name, frames in (("upper", of_upper), ("lower", of_lower)):
        if not len(frames):
            raise KeyreconError(f"No frame has most joints of the {name} body annotated.")
    if np.array_equal(of_upper, asked.upper.frames) and np.array_equal(
        of_lower, asked.lower.frames
    ):
        return preparation
    adopted = adopt_keyframes(
        preparation.pose_distances, asked, (of_upper, of_lower), options.keyframes, progress
    )
    return replace(preparation, keyframes=adopted)


def assemble_motion(
    video: Video,
    annotations: Annotations,
    tracks: JointTracks,
    lifted: LiftResult,
    height: float | None,
) -> Motion:
    """The result with the evidence behind each joint, in metres where a height was given."""
    propagated = np.isfinite(tracks.joints).all(axis=2)
    source = np.where(propagated, SOURCES.index("propagated"), SOURCES.index("interpolated"))
    source[propagated & lifted.rejected] = SOURCES.index("refined")
    marked = np.isfinite(annotations.joints).all(axis=2)
    source[annotations.frames] = np.where(
        marked, SOURCES.index("annotated"), source[annotations.frames]
    )
    motion = Motion(
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
    return replace(motion, expected_error=expected_error(motion))


def as_printed(options: Options = Options()) -> Options:
    """The forms that the paper prints, for every stage that has another default."""
    return replace(
        options,
        find=replace(options.find, pace=EVERY_FRAME),
        compare=replace(options.compare, largest="observed"),
        track=replace(options.track, method="paper"),
        keyframes=replace(options.keyframes, method="paper"),
        propagate=replace(options.propagate, method="paper"),
        depths="none",
        lift=replace(options.lift, method="paper"),
    )


def with_height(options: Options, height: float) -> Options:
    """Options for an athlete of a known height, metres."""
    return replace(options, lift=replace(options.lift, height=height))
