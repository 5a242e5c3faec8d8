"""Track the player through every frame: head and both feet (Section 4.1, taken further).

The rough track (see `detection`) is right most of the time, and wrong where a racket, a line or the
other leg passes for a shoe. On its clear frames correlation filters are trained for this player's
head and feet (see `correlation_filters`): leg above the shoe, shoe, court beneath. Every frame is
cut out around the rough head, the peaks of the filters' responses are detections, and the cheapest
path through them is the track (see `linking`). It is right more often than the rough one, in
frames that are not clear too, so the filters are trained once more on it. The second training
needs no more than some frames of every second. Filters that only marks have taught say in the end
how sure all this is (see `mark_filters`).

`method="paper"` keeps the path through colour and radial symmetry, the rough track.
"""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Literal, TypeVar

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.io.frame_reader import side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.viterbi import TransitionModel
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Background, CameraPath, Colors, Track, TrackAnchors
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.segmentation.player_crops import ABOVE_HEAD, Channels, Cropping, Crops, cut_crops
from keyrecon.timeline import part_of_path
from keyrecon.tracking.anchors import FollowedHeads, fixed_places
from keyrecon.tracking.correlation_filters import (
    Examples,
    Filters,
    clear_frames,
    make_examples,
    respond,
    sound_frames,
    spectrum,
    train_filters,
)
from keyrecon.tracking.linking import (
    MAX_GAP_SECONDS,
    Detections,
    FootMotionModel,
    link_feet,
    link_head,
)
from keyrecon.tracking.mark_filters import MarkFilters, doubted
from keyrecon.tracking.radial_symmetry import find_peaks
from keyrecon.tracking.scale import SizeEvidence, with_standing_height
from keyrecon.tracking.visibility import is_visible

Record = TypeVar("Record", Crops, Track)

TRAINING_RATE = 16.0
"""Frames per second that are linked to train the second filters on. Halved: at most 0.4 points, 1.1
mm on one clip."""
FOOT_RADIUS = 0.035
"""Foreground counts this far around a foot, player heights: half the length of a shoe. Halved: at
most 0.7 points, 0.2 mm on one clip."""
FOOT_BACKGROUND_WEIGHT = 0.3
"""Weight of a foot where nothing differs from the scene: a line, or a shoe of its colour. Halved,
others with it: at most 0.2 points, 0.5 mm on one clip."""
MIN_FOREGROUND = 0.5
"""Less foreground around a foot makes it less likely. Halved, others with it: at most 0.2 points,
0.5 mm on one clip."""
LEG_TOP, LEG_BOTTOM, LEG_ASIDE = 0.07, 0.2, 0.04
"""A foot has nothing of the player beneath it from the first to the second of these, and as far
aside as the third, player heights; a place on the shin has. Halved, others with it: at most 0.2
points, 0.5 mm on one clip."""
LEG_PENALTY, LEG_SHARE = 0.5, 0.5
"""Share of the response that a place loses which has this share of the player's colours beneath.
Halved, others with it: at most 0.5 points, 0.8 mm on one clip."""
FEET_BELOW_HEAD = 0.4
"""Feet are farther below the head than this, player heights: those of a deep crouch. Halved, others
with it: at most 0.5 points, 0.8 mm on one clip."""
MEMORY_SECONDS = 0.24
"""An occluded foot is propagated for this long: a step lasts about as long. Halved, others with it:
at most 0.5 points, 0.8 mm on one clip."""
FIRST_OCCLUSION_COST, OCCLUSION_COST = 2.0, 1.0
"""Costs of taking a foot for hidden behind the other: filters trained on clear frames only respond
weakly to a foot in a rarer place, the next ones do not. Halved, others with it: at most 0.5 points,
0.8 mm on one clip."""
MARK_WEIGHT = 3
"""Examples that a marked frame counts for: it is right, a tracked one may not be. Halved, others
with it: at most 0.5 points, 0.8 mm on one clip."""
MAX_HEADS, MAX_FEET = 4, 8
"""Candidates kept of each, per frame. Halved, others with it: at most 0.5 points, 0.8 mm on one
clip."""


@dataclass(frozen=True)
class TrackOptions:
    """How the player is tracked."""

    method: Literal["filters", "paper"] = "filters"
    """'filters' learn the player's looks from the clear frames; 'paper' has colour and radial
    symmetry alone."""
    player: Annotated[float, within(24, 600)] = 56.0
    """Height of the player in the crops, px; smaller is faster and less exact.

    Halved, others with it: at most 0.5 points, 0.8 mm on one clip.
    """
    examples: Annotated[int, within(4, 5000)] = 160
    """Frames that the filters learn from, at most; fewer are faster.

    Halved, others with it: at most 1.0 points, 0.2 mm on one clip.
    """
    head_speed: Annotated[float, within(0.1, 60)] = 3.0
    """Usual speed of the head, player heights per second; higher for wilder motion.

    Halved, others with it: at most 1.0 points, 0.2 mm on one clip.
    """
    foot_speed: Annotated[float, within(0.1, 40)] = 2.0
    """Usual speed of the feet, player heights per second; a step is faster, a stance slower.

    Halved, others with it: at most 1.0 points, 0.2 mm on one clip.
    """
    foot_rate: Annotated[float, within(0.2, 80)] = 4.0
    """Feet that move to and fro more often than this are smoothed, times per second.

    Halved, others with it: at most 1.0 points, 0.2 mm on one clip.
    """
    envelope: Annotated[float, within(0.2, 100)] = 5.0
    """Seconds in which the player may come nearer or go away by much; less for a camera that zooms
    fast.

    Halved, others with it: at most 1.0 points, 0.2 mm on one clip.
    """


def track_player(
    video: Video,
    rough: Track,
    camera: CameraPath,
    background: Background,
    colors: Colors,
    anchors: TrackAnchors,
    options: TrackOptions = TrackOptions(),
    progress: Progress = silent,
) -> Track:
    """Head, feet, standing height, box and confidence in every frame.

    Heads and feet of the anchors are passed through, those that a person marked are examples for
    the filters.
    """
    if options.method == "paper":
        return rough
    cropping = Cropping.below_heads(rough, options.player)
    crops = cut_crops(video, cropping, ForegroundModel(background, camera), progress)
    evidence = SizeEvidence.of(camera, video, anchors)
    numbers = np.arange(len(video))
    head, feet = fixed_places(anchors, numbers, camera)
    followed = FollowedHeads.of(anchors, numbers, camera, float(np.median(rough.height)))
    frames = _CroppedFrames(
        crops, cropping, options.player, rough, camera, evidence, head, feet, followed, video.fps
    )
    channels = Channels.of(colors, cropping.size)
    size = video.width, video.height
    taught = _Taught.by(anchors, frames, channels, size, options.examples)
    sparse = frames.every(max(1, round(video.fps / TRAINING_RATE)))
    filters = _train(sparse, channels, sparse.rough, clear_frames(sparse.rough), taught, options)
    detections = _detect(sparse, channels, filters, None, progress)
    first = _link(detections, sparse, FIRST_OCCLUSION_COST, options)
    filters = _train(sparse, channels, first, sound_frames(first), taught, options)
    detections = _detect(frames, channels, filters, taught.filters, progress)
    track = _link(detections, frames, OCCLUSION_COST, options)
    looks = [found.looks for found in detections]
    return _through_anchors(doubted(track, looks, cropping, video.height), anchors)


@dataclass(frozen=True, eq=False)
class _CroppedFrames:
    """The frames that parts are detected in."""

    crops: Crops
    cropping: Cropping
    player: float
    """Height of the player in the crops, px."""
    rough: Track
    """The track that the crops lie on."""
    camera: CameraPath
    evidence: SizeEvidence
    """Of the player's size."""
    fixed_head: Float[np.ndarray, "T 1 2"]
    """Heads of the anchors, in the reference frame; else NaN."""
    fixed_feet: Float[np.ndarray, "T 2 2"]
    """The same of both feet."""
    followed: FollowedHeads
    """Heads that flow leads to."""
    fps: float

    def every(self, step: int) -> "_CroppedFrames":
        """Each `step`-th of the frames."""
        return _CroppedFrames(
            _thinned(self.crops, step),
            self.cropping.every(step),
            self.player,
            _thinned(self.rough, step),
            part_of_path(self.camera, slice(None, None, step)),
            self.evidence.every(step),
            self.fixed_head[::step],
            self.fixed_feet[::step],
            self.followed.every(step),
            self.fps / step,
        )


def _thinned(record: Record, step: int) -> Record:
    """Each `step`-th frame of a record of arrays."""
    return type(record)(*(getattr(record, field.name)[::step] for field in fields(record)))


def _train(
    frames: _CroppedFrames,
    channels: Channels,
    track: Track,
    usable: Int[np.ndarray, "n"],
    taught: "_Taught",
    options: TrackOptions,
) -> Filters:
    """Filters from marked frames and from some of the usable ones, spread evenly."""
    rows = np.linspace(0, len(usable) - 1, min(options.examples, len(usable)))
    chosen = usable[np.unique(rows.astype(int))]
    parts = np.concatenate([track.head[:, None], track.feet], axis=1)[chosen]
    examples = make_examples(frames.crops, channels, frames.cropping, chosen, parts)
    examples = examples if taught.marked is None else examples.joined(taught.marked)
    return train_filters(examples, frames.cropping.size, frames.player)


@dataclass(frozen=True, eq=False)
class _Taught:
    """What fixed points teach of the player's looks; nothing where head and feet never are."""

    marked: Examples | None = None
    """Frames on which head and feet are marked, each several times over."""
    filters: MarkFilters | None = None
    """Of these and of those in which flow has both."""

    @classmethod
    def by(
        cls,
        anchors: TrackAnchors,
        frames: _CroppedFrames,
        channels: Channels,
        size: tuple[int, int],
        most: int,
    ) -> "_Taught":
        """By at most so many fixed points in pictures of a size."""
        parts = np.concatenate([anchors.head[:, None], anchors.feet], axis=1)
        # comparisons with NaN are false; beneath the picture a foot looks like nothing
        whole = ((parts >= 0) & (parts < size)).all(axis=(1, 2))
        rows, marked = np.flatnonzero(whole), np.flatnonzero(whole & anchors.marked)
        if not len(marked):
            return cls()
        spread = np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)
        rows = np.union1d(rows[spread], marked)
        numbers = anchors.frames[rows]
        examples = make_examples(frames.crops, channels, frames.cropping, numbers, parts[rows])
        filters = MarkFilters.learn(examples, frames.cropping.size, frames.player)
        again = np.repeat(np.flatnonzero(anchors.marked[rows]), MARK_WEIGHT)
        return cls(examples.some(again), filters)


def _through_anchors(track: Track, anchors: TrackAnchors) -> Track:
    """The track with head and feet where they are fixed, and sure where both are."""
    head, feet, confidence = track.head.copy(), track.feet.copy(), track.confidence.copy()
    with_head, with_feet = (
        np.isfinite(part).all(axis=tuple(range(1, part.ndim)))
        for part in (anchors.head, anchors.feet)
    )
    head[anchors.frames[with_head]] = anchors.head[with_head]
    feet[anchors.frames[with_feet]] = anchors.feet[with_feet]
    confidence[anchors.frames[with_head & with_feet]] = 1.0
    return replace(track, head=head, feet=feet, confidence=confidence)


def _detect(
    frames: _CroppedFrames,
    channels: Channels,
    filters: Filters,
    told: MarkFilters | None,
    progress: Progress,
) -> list[Detections]:
    """Candidates of all frames, and how much every place looks like what was marked."""
    crops = frames.crops

    def detect(t: int) -> Detections:
        foreground = crops.foreground[t]
        features = channels.compute(crops.lab[t], foreground)
        shown = spectrum(features)
        found = detect_in_crop(
            respond(filters, shown), foreground, channels.player(features), frames.player
        )
        return found if told is None else replace(found, looks=told.responses(shown))

    numbers = progress(range(len(crops.lab)), "Detecting head and feet", len(crops.lab))
    return list(side_by_side(detect, numbers))


def _link(
    detections: list[Detections],
    frames: _CroppedFrames,
    occlusion_cost: float,
    options: TrackOptions,
) -> Track:
    """The track through the detections; a foot behind the other one costs `occlusion_cost`."""
    camera, cropping, fps = frames.camera, frames.cropping, frames.fps
    step = float(np.median(frames.rough.height)) / fps
    max_gap = round(MAX_GAP_SECONDS * fps)
    motion = TransitionModel(options.head_speed * step, max_gap)
    head, head_confidence = link_head(
        detections, camera, cropping, frames.fixed_head, frames.followed, motion
    )
    stiffness = (fps / (2 * np.pi * options.foot_rate)) ** 4
    memory = round(MEMORY_SECONDS * fps)
    gait = FootMotionModel(options.foot_speed * step, max_gap, memory, occlusion_cost, stiffness)
    feet, feet_confidence = link_feet(
        detections, camera, cropping, head, frames.rough.height, frames.fixed_feet, gait
    )
    cut = frames.evidence.cut(head)
    confidence = np.sqrt(head_confidence * np.where(cut, head_confidence, feet_confidence))
    window = round(options.envelope * fps)
    rough = Track(head, feet, frames.rough.height, frames.rough.box, confidence)
    track = with_standing_height(rough, frames.evidence, window, np.ones(len(head), dtype=bool))
    # beyond the edge of the picture nothing is seen
    strip = replace(track, feet=np.minimum(track.feet, (np.inf, frames.evidence.rows - 1)))
    visible = is_visible(frames.crops, cropping, strip, frames.rough.confidence > 0)
    if visible.all():
        return track
    track = replace(rough, confidence=confidence * visible)
    return with_standing_height(track, frames.evidence, window, visible)


def detect_in_crop(
    response: Float[np.ndarray, "2 h w"],
    foreground: UInt8[np.ndarray, "h w"],
    player: Float[np.ndarray, "h w"],
    tall: float,
) -> Detections:
    """Candidates in one crop, in its pixels, the player `tall` px high."""
    heads, head_strength = find_peaks(np.maximum(response[0], 0), 2 * FOOT_RADIUS * tall, MAX_HEADS)
    low = np.zeros(foreground.shape, bool)
    low[round((ABOVE_HEAD + FEET_BELOW_HEAD) * tall) :] = True
    size = 2 * max(1, round(FOOT_RADIUS * tall)) + 1
    differs = foreground.astype(np.float32) / 255
    weight = np.minimum(cv2.blur(differs, (size, size)) / MIN_FOREGROUND, 1)
    weight = FOOT_BACKGROUND_WEIGHT + (1 - FOOT_BACKGROUND_WEIGHT) * weight
    weight *= 1 - LEG_PENALTY * np.minimum(_leg_beneath(player, tall) / LEG_SHARE, 1)
    weighted = np.maximum(response[1], 0) * weight
    feet, foot_strength = find_peaks(weighted, FOOT_RADIUS * tall, MAX_FEET, low)
    covered = cv2.resize(differs, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) > 0.5
    return Detections(heads, head_strength, feet, foot_strength, covered)


def _leg_beneath(player: Float[np.ndarray, "h w"], tall: float) -> Float[np.ndarray, "h w"]:
    """Share of the player's colours beneath every place: a shin has them, a foot has not."""
    top, bottom, aside = (round(share * tall) for share in (LEG_TOP, LEG_BOTTOM, LEG_ASIDE))
    rows = bottom - top
    mean = cv2.blur(player, (2 * aside + 1, rows), anchor=(aside, 0))
    under = np.zeros_like(player)
    under[:-top] = mean[top:]
    return under
