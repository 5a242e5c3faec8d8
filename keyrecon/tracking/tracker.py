"""Follow the player through every frame: head and both feet (Section 4.1, taken further).

The rough track (see `find`) is right most of the time, and wrong where a racket, a line or the
other leg passes for a shoe. Its clear frames teach correlation filters what this player's head and
feet look like (see `learn`, `correlation`): leg above the shoe, shoe, court beneath. Every frame is
cut out around the rough head, the peaks of the filters' responses are candidates, and the cheapest
path through them is the track (see `connect`). It is right more often than the rough one, in
frames that are not clear too, so the filters are learnt once more from it. What they are learnt
from the second time needs no more than some frames of every second.

`method="paper"` keeps the path through colour and radial symmetry as it was found.
"""

from dataclasses import dataclass, fields, replace
from typing import Literal, TypeVar

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.io.frame_reader import side_by_side
from keyrecon.io.video import Video
from keyrecon.progress import Progress, silent
from keyrecon.records import Background, CameraPath, Colors, Track
from keyrecon.segmentation.background_model import ForegroundModel
from keyrecon.segmentation.player_crops import ABOVE, Channels, Cropping, Crops, cut_crops
from keyrecon.tracking.correlation_filters import (
    Filters,
    clear_frames,
    respond,
    sound_frames,
    spectrum,
    train_filters,
)
from keyrecon.tracking.linking import Detections, FootMotionModel, link_feet, link_head
from keyrecon.tracking.radial_symmetry import find_peaks
from keyrecon.tracking.scale import player_boxes, standing_height, zoom
from keyrecon.tracking.visibility import is_visible

Record = TypeVar("Record", Crops, CameraPath, Track)

PACE = 16.0
"""Frames per second that filters learnt from clear frames look at: examples for the next ones."""
OWN_COLORS = 0.035
"""Foreground is asked for this far around a foot, player heights."""
STILL_SHARE = 0.3
"""Weight of a foot where nothing differs from the scene: a line, or a shoe of its colour."""
LEAST_OWN = 0.5
"""Less foreground around a foot makes it doubtful."""
BENEATH = 0.07, 0.2, 0.04
"""A foot has nothing of the player beneath it from the first to the second of these, and as far
aside as the third, player heights; a place on the shin has."""
ON_LEG, LEAST_LEG = 0.5, 0.5
"""Share of the response that a place loses which has this share of the player's colours beneath."""
BELOW_HEAD = 0.4
"""Feet are farther below the head than this, player heights."""
MEMORY = 0.24
"""A hidden foot is remembered for this long, seconds: a step lasts about as long."""
UNSURE, SURE = 2.0, 1.0
"""Costs of taking a foot for hidden behind the other: filters that know clear frames only respond
weakly to a foot in a rarer place, the next ones do not."""
HEADS, FEET = 4, 8
"""Candidates kept of each, per frame."""


@dataclass(frozen=True)
class TrackOptions:
    """How the player is followed."""

    method: Literal["filters", "paper"] = "filters"
    """'filters': parts are found again by what they look like; 'paper': as they were found."""
    player: float = 56.0
    """Height of the player in the crops, px; smaller is faster and less exact."""
    examples: int = 160
    """Frames that the filters are learnt from, at most."""
    head_speed: float = 3.0
    """Usual speed of the head, player heights per second."""
    foot_speed: float = 2.0
    """Usual speed of the feet, player heights per second; a step is faster, a stance slower."""
    foot_rate: float = 4.0
    """Feet that move to and fro more often than this are smoothed, times per second."""
    envelope: float = 5.0
    """The standing height may change over this time, seconds."""


def track_player(
    video: Video,
    rough: Track,
    camera: CameraPath,
    background: Background,
    colors: Colors,
    options: TrackOptions = TrackOptions(),
    progress: Progress = silent,
) -> Track:
    """Head, feet, standing height, box and confidence in every frame."""
    if options.method == "paper":
        return rough
    cropping = Cropping(rough, options.player)
    crops = cut_crops(video, cropping, ForegroundModel(background, camera), progress)
    shot = _Detector(crops, cropping, camera, zoom(camera, video), video.fps)
    channels = Channels.of(colors, cropping.size)
    few = shot.every(max(1, round(video.fps / PACE)))
    filters = _learn(few, channels, few.cropping.track, clear_frames(few.cropping.track), options)
    first = _connect(_detect(few, channels, filters, progress), few, UNSURE, options)
    filters = _learn(few, channels, first, sound_frames(first), options)
    return _connect(_detect(shot, channels, filters, progress), shot, SURE, options)


@dataclass(frozen=True, eq=False)
class _Detector:
    """The frames that are looked at."""

    crops: Crops
    cropping: Cropping
    camera: CameraPath
    magnification: Float[np.ndarray, "T"]
    """By the camera's zoom."""
    fps: float

    def every(self, step: int) -> "_Detector":
        """Each `step`-th of the frames."""
        return _Detector(
            _thinned(self.crops, step),
            Cropping(_thinned(self.cropping.track, step), self.cropping.player),
            _thinned(self.camera, step),
            self.magnification[::step],
            self.fps / step,
        )


def _thinned(record: Record, step: int) -> Record:
    """Each `step`-th frame of a record of arrays."""
    return type(record)(*(getattr(record, field.name)[::step] for field in fields(record)))


def _learn(
    shot: _Detector,
    channels: Channels,
    track: Track,
    frames: Int[np.ndarray, "n"],
    options: TrackOptions,
) -> Filters:
    """Filters from some of the frames, spread evenly."""
    rows = np.linspace(0, len(frames) - 1, min(options.examples, len(frames)))
    chosen = frames[np.unique(rows.astype(int))]
    return train_filters(shot.crops, channels, shot.cropping, track, chosen)


def _detect(
    shot: _Detector, channels: Channels, filters: Filters, progress: Progress
) -> list[Detections]:
    """Candidates of all frames."""
    crops, tall = shot.crops, shot.cropping.player

    def look(t: int) -> Detections:
        lab, foreground = crops.lab[t], crops.foreground[t]
        seen = channels.see(lab, foreground)
        return search_crop(
            respond(filters, spectrum(seen)), foreground, channels.player(seen), tall
        )

    frames = progress(range(len(crops.lab)), "Looking for head and feet", len(crops.lab))
    return list(side_by_side(look, frames))


def _connect(
    seen: list[Detections], shot: _Detector, behind: float, options: TrackOptions
) -> Track:
    """The track that the candidates give; a foot behind the other one costs `behind`."""
    camera, cropping, fps = shot.camera, shot.cropping, shot.fps
    step = float(np.median(cropping.track.height)) / fps
    head, head_confidence = link_head(seen, camera, cropping, options.head_speed * step)
    stiffness = (fps / (2 * np.pi * options.foot_rate)) ** 4
    gait = FootMotionModel(options.foot_speed * step, round(MEMORY * fps), behind, stiffness)
    feet, feet_confidence = link_feet(seen, camera, cropping, head, gait)
    frames = round(options.envelope * fps)
    height = standing_height(head, feet.mean(axis=1), shot.magnification, frames)
    confidence = np.sqrt(head_confidence * feet_confidence)
    track = Track(head, feet, height, player_boxes(head, feet, height), confidence)
    return replace(track, confidence=confidence * is_visible(shot.crops, cropping, track))


def search_crop(
    response: Float[np.ndarray, "2 h w"],
    foreground: UInt8[np.ndarray, "h w"],
    player: Float[np.ndarray, "h w"],
    tall: float,
) -> Detections:
    """Candidates in one crop, in its pixels."""
    heads, head_strength = find_peaks(np.maximum(response[0], 0), 2 * OWN_COLORS * tall, HEADS)
    low = np.zeros(foreground.shape, bool)
    low[round((ABOVE + BELOW_HEAD) * tall) :] = True
    reach = 2 * max(1, round(OWN_COLORS * tall)) + 1
    differs = foreground.astype(np.float32) / 255
    own = np.minimum(cv2.blur(differs, (reach, reach)) / LEAST_OWN, 1)
    own = STILL_SHARE + (1 - STILL_SHARE) * own
    own *= 1 - ON_LEG * np.minimum(_beneath(player, tall) / LEAST_LEG, 1)
    feet, foot_strength = find_peaks(np.maximum(response[1], 0) * own, OWN_COLORS * tall, FEET, low)
    covered = cv2.resize(differs, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) > 0.5
    return Detections(heads, head_strength, feet, foot_strength, covered)


def _beneath(player: Float[np.ndarray, "h w"], tall: float) -> Float[np.ndarray, "h w"]:
    """Share of the player's colours beneath every place: a shin has them, a foot has not."""
    top, bottom, aside = (round(share * tall) for share in BENEATH)
    rows = bottom - top
    mean = cv2.blur(player, (2 * aside + 1, rows), anchor=(aside, 0))
    under = np.zeros_like(player)
    under[:-top] = mean[top:]
    return under
