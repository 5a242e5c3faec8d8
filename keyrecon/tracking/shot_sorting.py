"""Which shots of a video show the player, whole and at the size that was marked.

Whatever a shot shows, a player is looked for in it and, in a crowd or a close-up, something is
found. But where head, shirt, legs and shoes of this player lie to one another is peculiar: the maps
of the player's colours, cut out below the head as it was found, are held against those of the shots
in which a person clicked or marked the player. Where they do not correlate, it is somebody or
something else; where they do a little, it is somebody dressed alike, or the player found badly:
nothing is made of it until a person tells which. Pictures shown several times make a replay in slow
motion. A shot in which a person clicked or marked shows the player; what a person says of a shot
stands over all of this.

With the numbers below all of 383 shots of half an hour were told rightly, put together of rendered
points, close-ups, replays in slow motion, black and another player (`benchmarks/hours.py`);
`benchmarks/shot_likeness.py` prints what real shots of the player and of others have.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float

from keyrecon.errors import KeyreconError
from keyrecon.io.frame_reader import read_grey, read_small, shrinking
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import cut_affine
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import PERHAPS, PLAYER, CameraPath, Colors, Shots, Track, TrackAnchors
from keyrecon.segmentation.color_model import (
    color_bins,
    foot_table,
    look_up,
    posterior_tables,
    to_lab,
)
from keyrecon.segmentation.player_crops import Cropping
from keyrecon.segmentation.repeated_frames import COMPARED_WIDTH, find_repeats, picture_change
from keyrecon.tracking.detection import FindOptions, find_player
from keyrecon.tracking.shots import PLAIN, thumbnail

FRAMES = 16
"""Of a shot that are looked at, evenly spread. Evidence: above."""
TALL = 48.0
"""Of the player in the pictures, px. Evidence: above."""
CELLS = 12, 8
"""Rows and columns that a map of colours is averaged to: .13 by .22 player heights. Evidence:
above."""
UNLIKE = 0.4
"""Likeness below which a shot shows somebody or something else. Evidence: of 306 shots of other
people 280 have at most .39 or nobody is found, 26 .40 to .75; of 36 of the player one has .13,
behind a caption."""
MORE_REPEATED = 0.25
"""Share of repeated frames beyond that of the shots with clicks or marks from which a shot is slow
motion: half speed repeats every second picture. Half of that; evidence: above."""


@dataclass(frozen=True)
class ShotOptions:
    """Which shots are worked on, where a video has several."""

    shortest: Annotated[float, within(0, 60)] = 0.5
    """Shorter shots are left out, seconds.

    No stroke is that short.
    """
    alike: Annotated[float, within(0, 1)] = 0.8
    """How alike the colours must be for a shot to show the player, from 0 to 1; lower it where
    shots are left out that show the player.

    Correlation of the player's colours with those of the shots with clicks or marks, as a share of
    what frames of these have with one another. Evidence: of 36 shots of the player in eighteen
    real clips 26 have .80 and more, 306 of somebody else .75 and less.
    """
    use: str = ""
    """Shots that are used whatever they seem to show, in however few frames the head is found, by
    number: '3,5'. `keyrecon keyframes` lists them; the first is 1."""
    skip: str = ""
    """Shots that are left out, by number: '2'."""


@dataclass(frozen=True, eq=False)
class PlayerDetection:
    """What was found of the player in one shot."""

    track: Track | None
    """None where no path of a head and feet was found."""
    why: str
    """Why there is none."""
    layout: Float[np.ndarray, "n P y x"]
    """Where the player's colours are, in some frames, relative to the head."""
    plain: bool
    """Whether the pictures show nothing, such as black."""
    repeated: float
    """Share of the frames that show the picture of the one before."""


def detect_in_shot(
    video: Video,
    colors: Colors,
    camera: CameraPath,
    anchors: TrackAnchors,
    options: FindOptions = FindOptions(),
    progress: Progress = silent,
) -> PlayerDetection:
    """Look for the player in one shot of several: there may be none."""
    nothing = np.zeros((0, len(colors.names) + 1, *CELLS), np.float32)
    plain, repeated = _look_over(video)
    if plain:
        return PlayerDetection(None, "", nothing, plain, repeated)
    try:
        track = find_player(video, colors, camera, anchors, options, progress)
    except KeyreconError as missing:
        return PlayerDetection(None, str(missing), nothing, plain, repeated)
    return PlayerDetection(track, "", _layouts(video, colors, track), plain, repeated)


def _look_over(video: Video) -> tuple[bool, float]:
    """Whether a shot shows nothing at all, and the share of its frames that are repeated."""
    contrast, change, before = [], [0.0], None
    for grey in read_grey(video, min(COMPARED_WIDTH, video.width)):
        contrast.append(thumbnail(grey).contrast)
        now = grey.astype(np.int16)
        if before is not None:
            change.append(picture_change(before, now))
        before = now
    repeats = find_repeats(np.array(change))
    return float(np.median(contrast)) < PLAIN, float(repeats.mean())


def _layouts(video: Video, colors: Colors, track: Track) -> Float[np.ndarray, "n P y x"]:
    """Maps of every part's colours below the head; left and right are alike."""
    frames = np.unique(np.linspace(0, len(video) - 1, FRAMES).round().astype(int))
    cropping = Cropping.below_heads(track, TALL)
    width = cropping.reading_width(video)
    to_small = shrinking(width / video.width)
    tables = np.stack([*posterior_tables(colors), foot_table(colors)]).astype(np.float32)
    layouts = []
    pictures = read_small(video, width, set(frames.tolist()))
    for t, picture in zip(frames.tolist(), pictures, strict=True):
        way = (to_small @ cropping.crop_to_picture(t))[:2]
        maps = look_up(tables, color_bins(to_lab(cut_affine(picture, way, cropping.size))))
        small = [cv2.resize(one, CELLS[::-1], interpolation=cv2.INTER_AREA) for one in maps]
        both = np.stack(small)
        layouts.append((both + both[..., ::-1]) / 2)
    return np.stack(layouts)


def sort_shots(
    shots: Shots,
    detections: Sequence[PlayerDetection],
    picked: Bool[np.ndarray, "S"],
    fps: float,
    options: ShotOptions = ShotOptions(),
    dissolves: tuple[int, ...] = (),
) -> Shots:
    """The shots with what each shows; `picked` are those in which a person clicked or marked,
    `dissolves` the first frames of those that are none.

    Raises KeyreconError where a person's shot is asked for that is none, or where no shot is left.
    """
    likeness = likeness_to_told(detections, picked)
    repeats = [seen.repeated for seen, tell in zip(detections, picked, strict=True) if tell]
    usual = float(np.median(repeats)) if repeats else 0.0
    used, skipped = (numbered_shots(text, len(picked)) for text in (options.use, options.skip))
    shows = []
    for number, (part, seen) in enumerate(zip(shots.parts, detections, strict=True)):
        if number in skipped:
            shows.append("left out by --shots.skip")
        elif number in used or picked[number]:
            shows.append(PLAYER if seen.track is not None else "nobody found")
        elif part.start in dissolves:
            shows.append("a dissolve")
        elif seen.plain:
            shows.append("black")
        elif part.stop - part.start < options.shortest * fps:
            shows.append("too short")
        elif seen.repeated > usual + MORE_REPEATED:
            shows.append("slow motion")
        elif seen.track is None:
            shows.append("nobody found")
        else:
            shows.append(_who(likeness[number], options))
    if PLAYER not in shows:
        first = next(
            s for s, tell in zip(detections, picked, strict=True) if tell or not picked.any()
        )
        raise KeyreconError(f"No shot of the video shows the player. {first.why}".strip())
    return Shots(shots.first, shots.n_frames, tuple(shows))


def _who(likeness: float, options: ShotOptions) -> str:
    """Whom a shot shows in which somebody was found."""
    if likeness >= options.alike:
        return PLAYER
    return PERHAPS if likeness >= UNLIKE else "somebody else"


def likeness_to_told(
    detections: Sequence[PlayerDetection], picked: Bool[np.ndarray, "S"]
) -> Float[np.ndarray, "S"]:
    """Of each shot with those that a person told of, relative to what these have themselves.

    `UNLIKE` where nobody was found in those: whether it is the player, a person must tell.
    """
    known = [s.layout for s, tell in zip(detections, picked, strict=True) if tell and len(s.layout)]
    if not known:
        return np.full(len(detections), UNLIKE if picked.any() else 1.0)
    usual = np.concatenate(known)
    expected = _centred(np.median(usual, axis=0)[None])[0]
    reference = float(np.median(_centred(usual) @ expected))
    return np.array(
        [
            float(np.median(_centred(s.layout) @ expected)) / max(reference, 1e-6)
            if len(s.layout)
            else 0.0
            for s in detections
        ]
    )


def _centred(layouts: Float[np.ndarray, "n P y x"]) -> Float[np.ndarray, "n q"]:
    """Unit vectors of what stands out of each map's mean."""
    apart = layouts - layouts.mean(axis=(2, 3), keepdims=True)
    flat = apart.reshape(len(apart), -1)
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)


def numbered_shots(text: str, count: int) -> set[int]:
    """Shots by the numbers that a person gave, such as '3,5', counted from 0 here and from 1 there.

    Raises KeyreconError for anything else than numbers of the `count` shots.
    """
    words = text.replace(",", " ").split()
    if not all(word.isdigit() and 1 <= int(word) <= count for word in words):
        raise KeyreconError(
            f"Shots are named by their numbers, 1 to {count}, such as '3,5'; got '{text}'."
        )
    return {int(word) - 1 for word in words}
