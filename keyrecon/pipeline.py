"""The recipe: everything up to the person, and everything after.

`prepare` finds the player, draws edge elements, compares all frames and chooses the keyframes
that a person should annotate. `reconstruct` propagates the annotated joints to every frame, lifts
them to 3D and refines the motion. Both call their stages through `keep`: by default it just
calls them; the command line passes one that returns stored results where nothing has changed.
Nothing here reads or writes a file: learnt models come in as values (`Models`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Int

from keyrecon.body_models.depth_model import DepthModel
from keyrecon.body_models.side_model import SideModel
from keyrecon.errors import KeyreconError
from keyrecon.golf.records import MotionModel
from keyrecon.golf.swing_prior import SwingPriorOptions, fit_swing_prior
from keyrecon.io.frame_reader import in_threads
from keyrecon.io.held_video import with_exposure
from keyrecon.io.video import Video
from keyrecon.keeping import Keep, call_stage, parallel_map_elsewhere, parallel_map_of
from keyrecon.keyframes.absence import legs_outside, without_legs
from keyrecon.keyframes.adoption import adopt_keyframes, keep_marked
from keyrecon.keyframes.distance_matrix import CompareOptions, compare_frames
from keyrecon.keyframes.pose_time import pose_seconds
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes, count_labels
from keyrecon.lifting.lifting import LiftOptions, LiftPriors, LiftResult, lift_motion
from keyrecon.lifting.marked_sizes import marked_heights
from keyrecon.progress import Progress, silent
from keyrecon.propagation.marked_poses import LEAST_MARKED
from keyrecon.propagation.propagation import PropagateOptions
from keyrecon.records import (
    SOURCES,
    Annotations,
    JointTracks,
    Motion,
    Pick,
    Preparation,
    Shots,
    TrackAnchors,
)
from keyrecon.segmentation.background_model import BackgroundOptions
from keyrecon.segmentation.color_model import ColorOptions, learn_colors
from keyrecon.segmentation.contours import EdgeOptions
from keyrecon.segmentation.marked_bodies import (
    anchors_from_bodies,
    picks_from_bodies,
    with_heights,
)
from keyrecon.shots.following import FollowOptions, follow_marks, follow_player
from keyrecon.shots.groups import propagate_in_groups
from keyrecon.shots.usable import in_file, marks_in_shots, usable_part
from keyrecon.timeline import (
    cut_motion,
    motion_in_file,
    part_of_marks,
    scatter_frames,
    take_frames,
    without_steps_over_cuts,
)
from keyrecon.tracking.anchors import frames_off_anchors, least_sure_frames
from keyrecon.tracking.camera_motion import CameraMotionOptions, estimate_camera_motion
from keyrecon.tracking.detection import EVERY_FRAME, FindOptions
from keyrecon.tracking.mark_flow import FlowOptions
from keyrecon.tracking.shot_sorting import ShotOptions
from keyrecon.tracking.tracker import TrackOptions
from keyrecon.uncertainty import expected_error
from keyrecon.unseen import without_hidden_legs, without_unseen


@dataclass(frozen=True)
class Options:
    """The options of every stage."""

    camera: CameraMotionOptions = field(default_factory=CameraMotionOptions)
    shots: ShotOptions = field(default_factory=ShotOptions)
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
    """What helps `keyrecon run` where nobody said which end of a limb is nearer: 'built-in',
    'none', or a file of `keyrecon depths`."""
    sides: str = "built-in"
    """What tells `keyrecon run` left arms from right ones by the pose of the whole body:
    'built-in', 'none', or a file of `keyrecon sides`."""
    prior: Literal["none", "golf"] = "none"
    """'golf': a model of golf swings helps `keyrecon run` with depth and between the keyframes.

    It tells depth signs and what nobody saw between keyframes.
    """
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
    sides: SideModel | None = None
    """Helps to tell left arms from right ones."""


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
        "camera", estimate_camera_motion, video,
        options=options.camera, progress=progress,
        parallel_map=parallel_map_elsewhere(keep, in_threads),
    )  # fmt: skip
    video = with_exposure(video, camera.exposure)
    clicks, anchors = tuple(picks), TrackAnchors.none()
    if marks is not None:
        clicks += picks_from_bodies(marks, (video.width, video.height))
        shots = Shots.between(camera.cuts, len(video))
        flow = follow_marks(video, marks, shots, options.flow, keep, progress)
        anchors = anchors_from_bodies(marks, flow)
    colors = keep("colors", learn_colors, video, clicks, options=options.colors, progress=progress)
    if marks is not None:
        heights = keep("sizes", marked_heights, marks, colors.height, video.fps, shots)
        anchors = with_heights(anchors, marks.frames, heights)
    follow_options = FollowOptions(
        options.shots, options.find, options.background, options.track, options.edges
    )
    followed = follow_player(video, camera, colors, clicks, anchors, follow_options, keep, progress)
    distances = keep(
        "compare",
        compare_frames,
        followed.edges,
        followed.track,
        options=options.compare,
        progress=progress,
        parallel_map=parallel_map_of(keep),
    )
    distances = without_steps_over_cuts(distances, followed.shots.joined())
    outside = legs_outside(followed.track, video.height)
    if outside.any():
        distances = without_legs(distances, outside)
    keyframes = keep(
        "keyframes",
        choose_keyframes,
        distances,
        video.fps,
        options=options.keyframes,
        progress=progress,
    )
    return in_file(video, camera, colors, followed, distances, keyframes)


def with_marked_keyframes(
    preparation: Preparation,
    marks: Annotations,
    options: Options = Options(),
    progress: Progress = silent,
) -> Preparation:
    """The same with the frames of usable shots that are marked already among the keyframes."""
    keyframes = keep_marked(
        preparation.pose_distances,
        preparation.keyframes,
        marked_frames(marks_in_shots(marks, preparation.shots)),
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
    return frames_off_anchors(preparation.track, anchors_from_bodies(marks))


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
    in body heights. Where nobody is seen for long there is no motion. Raises KeyreconError when
    keyframes are not annotated.
    """
    shots, whole = preparation.shots, preparation.video
    if not all(shots.usable):
        annotations = marks_in_shots(annotations, shots)
    preparation = _with_annotated_keyframes(preparation, annotations, options, progress)
    part, marks, tracks = _carry_usable(preparation, annotations, models, options, keep, progress)
    lifted = _lift(part, tracks, marks, models, options, keep, progress)
    motion = assemble_motion(part.video, marks, tracks, lifted, options.lift.height, part.shots)
    if len(shots.parts) > 1:
        motion = motion_in_file(motion, shots, whole.time)
    # A prior of the whole motion tells what nobody saw.
    return without_unseen(motion) if options.prior == "none" else motion


def _lift(
    preparation: Preparation,
    tracks: JointTracks,
    annotations: Annotations,
    models: Models,
    options: Options,
    keep: Keep,
    progress: Progress,
) -> LiftResult:
    """From the picture to space, along the golf swing of the prior where there is one."""
    video, height = preparation.video, preparation.track.height
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
            options=swing_prior_options(options, video),
        )
    return keep(
        "lift",
        lift_motion,
        tracks,
        annotations,
        preparation.keyframes,
        height,
        video.fps,
        LiftPriors(expected, models.depth, preparation.shots, focal_length(options.lift, video)),
        options=options.lift,
        progress=progress,
    )


def swing_prior_options(options: Options, video: Video) -> SwingPriorOptions:
    """Options of the swing prior with the player's height and the focal length, where known."""
    focal, height = focal_length(options.lift, video), options.lift.height
    swing = options.swing if focal is None else replace(options.swing, focal=focal / video.width)
    return swing if height is None else replace(swing, stature=height)


def focal_length(options: LiftOptions, video: Video) -> float | None:
    """Focal length by the field of view, px; None where that is not known."""
    if options.field_of_view is None:
        return None
    return float(video.width / 2 / np.tan(np.radians(options.field_of_view) / 2))


def carry_joints(
    preparation: Preparation,
    annotations: Annotations,
    models: Models,
    options: Options = Options(),
    keep: Keep = call_stage,
    progress: Progress = silent,
) -> JointTracks:
    """The annotated joints in every frame of the video."""
    shots = preparation.shots
    _, _, tracks = _carry_usable(preparation, annotations, models, options, keep, progress)
    return (
        tracks if all(shots.usable) else scatter_frames(tracks, shots.usable_frames, shots.n_frames)
    )


def _carry_usable(
    preparation: Preparation,
    annotations: Annotations,
    models: Models,
    options: Options,
    keep: Keep,
    progress: Progress,
) -> tuple[Preparation, Annotations, JointTracks]:
    """The usable shots end to end, the marks in them, and these in every frame of them."""
    flow, shots = None, preparation.shots
    if options.propagate.method == "fused":
        flow = follow_marks(preparation.video, annotations, shots, options.flow, keep, progress)
    if not all(shots.usable):
        flow = flow and take_frames(flow, shots.usable_frames)
        annotations = part_of_marks(annotations, shots.usable_frames)
    part = usable_part(preparation)
    tracks = propagate_in_groups(
        part, annotations, flow, models.sides, options.propagate, keep, progress
    )
    outside = legs_outside(part.track, part.video.height)
    return part, annotations, without_hidden_legs(tracks, annotations, outside)


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
    shots: Shots | None = None,
) -> Motion:
    """The result with the evidence behind each joint, in metres where a height was given."""
    propagated = np.isfinite(tracks.joints).all(axis=2) & (tracks.confidence > 0)
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
        exchange_evidence=tracks.exchange_evidence,
        elsewhere=tracks.elsewhere,
    )
    if shots is None:
        shots = Shots.between((), len(video))
    errors = [expected_error(cut_motion(motion, shot)) for shot in shots.parts]
    return replace(motion, expected_error=np.concatenate(errors))


def as_printed(options: Options = Options()) -> Options:
    """The forms that the paper prints, for every stage that has another default."""
    return replace(
        options,
        find=replace(options.find, pace=EVERY_FRAME, other_trunk=1.0, doubtful=0.0),
        compare=replace(options.compare, largest="observed"),
        track=replace(options.track, method="paper"),
        keyframes=replace(options.keyframes, method="paper"),
        propagate=replace(options.propagate, method="paper"),
        depths="none",
        sides="none",
        prior="none",
        lift=replace(options.lift, method="paper"),
    )


def with_height(options: Options, height: float | None) -> Options:
    """Options for an athlete of some height, metres; None where it is not known."""
    return replace(options, lift=replace(options.lift, height=height))


def with_field_of_view(options: Options, degrees: float | None) -> Options:
    """Options for a camera of some angle across the picture; None where it is not known."""
    return replace(options, lift=replace(options.lift, field_of_view=degrees))
