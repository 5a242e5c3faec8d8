"""What every frame of a film shows of a player: where he is, and what may be his club.

One pass separates the player from the scene, one over the full pictures detects line segments that
may be the club's shaft. Neither depends on which swing is taken for the swing, or on marks.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.observe.film import Film
from keyrecon.golf.observe.foreground import (
    Foreground,
    ForegroundOptions,
    FrameForeground,
    separate_player,
)
from keyrecon.golf.observe.line_segments import (
    LineSegmentOptions,
    LineSegments,
    detect_line_segments,
    drop_static_segments,
)
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses, ShaftOptions, propose_shafts
from keyrecon.io.frame_reader import side_by_side
from keyrecon.io.video import Video
from keyrecon.progress import Progress, silent

ACTIVE_PART, ACTIVE_FRAMES = 0.2, 16
"""Share of the frames in which a player is said to be active, and how many of them are asked for
what stays in place."""


@dataclass(frozen=True)
class SwingSceneOptions:
    """How player and club are detected."""

    foreground: ForegroundOptions = field(default_factory=ForegroundOptions)
    """The player against the scene."""
    line_segments: LineSegmentOptions = field(default_factory=LineSegmentOptions)
    """Parts of the shaft."""
    shaft_hypotheses: ShaftOptions = field(default_factory=ShaftOptions)
    """What may be the club."""


@dataclass(frozen=True, eq=False)
class SwingScene:
    """What is seen in all frames of a film."""

    film: Film
    foreground: Foreground
    packed_players: UInt8[np.ndarray, "T h b"]
    """The player's masks, eight pixels to a byte."""
    shafts: tuple[ShaftHypotheses, ...]
    """What may be the club."""

    @property
    def players(self) -> Bool[np.ndarray, "T h w"]:
        """The player's masks."""
        width = self.foreground.likely.shape[2]
        return np.unpackbits(self.packed_players, axis=2, count=width).astype(bool)


def observe_scene(
    video: Video,
    film: Film,
    pose: ClickedPose,
    options: SwingSceneOptions = SwingSceneOptions(),
    progress: Progress = silent,
) -> SwingScene:
    """Player and club in the frames of a film; `pose` is that of its clicked frame.

    Raises KeyreconError where the clicks lie on no player.
    """
    shown = film.open(video)
    foreground = separate_player(shown, pose, options.foreground, progress)
    frames = (foreground.frame(t) for t in range(len(shown)))
    players = np.stack(list(side_by_side(FrameForeground.player, frames)))
    shafts = detect_shafts(shown, foreground, players, pose.shoulders, options, progress)
    return SwingScene(film, foreground, np.packbits(players, axis=2), tuple(shafts))


def detect_shafts(
    video: Video,
    foreground: Foreground,
    players: Bool[np.ndarray, "T h w"],
    shoulders: Float[np.ndarray, "2"],
    options: SwingSceneOptions = SwingSceneOptions(),
    progress: Progress = silent,
) -> list[ShaftHypotheses]:
    """What may be the club in every frame; `shoulders` is the middle between them, px."""

    def detect(numbered: tuple[int, UInt8[np.ndarray, "h w"]]) -> LineSegments:
        frame, grey = numbered
        return detect_line_segments(
            np.ascontiguousarray(grey), foreground.frame(frame), options.line_segments
        )

    pictures = progress(enumerate(video.grey_frames()), "Detecting the club", len(video))
    segments = list(side_by_side(detect, pictures))
    segments = drop_static_segments(segments, foreground.height, most_active(players))

    def propose(numbered: tuple[int, LineSegments]) -> ShaftHypotheses:
        frame, of_frame = numbered
        return propose_shafts(
            of_frame, foreground.frame(frame), players[frame], shoulders, options.shaft_hypotheses
        )

    return list(side_by_side(propose, enumerate(segments)))


def most_active(players: Bool[np.ndarray, "T h w"]) -> Int[np.ndarray, "n"]:
    """Some of the frames in which the player's outline moves most."""
    moved = np.array([(a ^ b).mean() for a, b in pairwise(players)])
    several = max(2, round(ACTIVE_PART * len(players)))
    busiest = np.sort(np.argsort(-moved, kind="stable")[:several])
    return busiest[np.unique(np.linspace(0, len(busiest) - 1, ACTIVE_FRAMES).astype(int))]
