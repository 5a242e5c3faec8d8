"""Check the track against the video: truncation, occlusion by overlays, and distractors.

The tracker's path passes through any candidates that there are: its confidence may be as high for
another player in the same clothes as for the right one and, where nothing is marked, for a knee at
the lower edge as for a shoe. What is found here is reported; neither the track nor the motion
changes.

Truncation: feet that are in the picture have ground beneath them; where they are cut off, the
player's colours reach the last row. So does a shadow: where feet were marked, the size of the
player decides whether the picture ends above them.

Distractors: the mean of the player's own part maps is a template for a matched filter. Its response
away from the player, relative to that on the player, finds figures alike; since back-projection is
coarse, the colours from top to bottom must be the player's too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from scipy.fft import irfft2, next_fast_len, rfft2

from keyrecon.io.frame_reader import read_small, shrinking
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.progress import Progress, silent
from keyrecon.records import (
    Background,
    CameraPath,
    Colors,
    Track,
    TrackAnchors,
    TrackVerification,
)
from keyrecon.segmentation.color_model import color_bins, look_up, posterior_tables, to_lab
from keyrecon.segmentation.foreground_model import ForegroundModel

RATE = 6.0
"""Frames looked at per second: who walks past the player is seen three times within a height."""
MOST_VIEWS = 600
"""Frames of a shot that are judged together, by what the player looks like in them: 100 seconds. A
reduced frame of a player of 350 in 720 px takes 0.2 MB, one of 170 in 360 px as much."""
PLAYER = 56.0
"""Height of the player in the pictures looked at, px: a shin is three wide."""
EDGE_ROWS, EDGE_WIDTH, LEG_WIDTH = 0.02, 0.35, 0.03
"""Of the last rows, of the player's colours looked for in them to either side of the feet, and of
what is found at least, player heights. Three rendered clips cut above the ankles have such in 68 to
97 % of the frames, cut through the shoes in 75 to 95 %; cut under the soles in none, nor have five
real clips."""
FEET_NEAR_EDGE = 0.5
"""Feet farther above the lower edge are in the picture, player heights: a knee is .25 up."""
SOLES = 1.08
"""How far the soles are below the centre of the head, in units of its height above the middle of
the feet: a stride sets one shoe before the other, and soles lie .03 below ankles (Drillis and
Contini: ankles .039 statures up)."""
SHOWN_SECONDS = 0.25
"""So long before and after both feet were marked they are in the picture: a step takes twice that.
It decides only what is told of the track."""
SCENE_ENDS = 0.9
"""Share of a row that no player covers: the picture was rounded beyond the background there. It
decides only what is told of the track."""
LOOKS_LIKE = 0.45
"""Response of a distractor, of the median on the player. In frames of three rendered clips with two
alike .46 to .57 in the median, of the same clips without the other .27 at most, of five real clips
.40 at most (a broadcast)."""
SAME_COLORS = 20.0
"""Mean difference from the player's colours from top to bottom, Lab values, lightness halved. The
player differs from the median by 7 to 11, another one in the same clothes by 11 to 14, in other
clothes by 32 to 34."""
APART = (0.4, 0.6)
"""A distractor is farther than this from the player's head, across or along, player heights. It
decides only what is told of the track."""
MEETS = 1.0
"""Nearer than this the track may change over, player heights. It decides only what is told of the
track."""
HIDDEN_SHARE, WAY_POINTS = 0.15, 13
"""Share of the way from head to feet, of so many points, from which something hides the player: a
trunk is a third of it."""
STRIPES = 8
"""Of which colours are compared, from head to feet. The differences of `SAME_COLORS` were measured
with it."""


def verify_track(
    video: Video,
    track: Track,
    camera: CameraPath,
    background: Background,
    colors: Colors,
    anchors: TrackAnchors = TrackAnchors.none(),
    progress: Progress = silent,
) -> TrackVerification:
    """Look for cut-off feet and for distractors in a few frames per second."""
    sized = bool((anchors.marked & np.isfinite(anchors.feet).all(axis=(1, 2))).any())
    frames = np.arange(0, len(video), max(1, round(video.fps / RATE)))
    read = _read_views(video, track, frames, ForegroundModel(background, camera), colors, progress)
    shown = _feet_shown(frames, anchors, video.fps)
    truncated: list[bool] = []
    distractors: list[np.ndarray] = []
    while views := list(islice(read, MOST_VIEWS)):
        rows = slice(len(truncated), len(truncated) + len(views))
        distractors.append(_find_distractors(views, track.confidence[frames[rows]]))
        truncated += [
            not known and view.is_truncated(sized)
            for view, known in zip(views, shown[rows], strict=True)
        ]
    hidden = hidden_shares(track, background)[frames] > HIDDEN_SHARE
    passing = _lasting(np.concatenate(distractors))
    return TrackVerification(frames, np.array(truncated), passing, hidden)


def _feet_shown(
    frames: Int[np.ndarray, "n"], anchors: TrackAnchors, fps: float
) -> Bool[np.ndarray, "n"]:
    """Whether both feet were marked about then, or followed from a mark: who crouches has his head
    as low as one whose feet the edge cuts off."""
    known = anchors.frames[np.isfinite(anchors.feet).all(axis=(1, 2))]
    apart = np.abs(frames[:, None] - known).min(axis=1, initial=len(frames) * fps)
    return np.asarray(apart <= SHOWN_SECONDS * fps)


def hidden_shares(track: Track, background: Background) -> Float[np.ndarray, "T"]:
    """Share of the ways from head to feet that lies behind something laid over the picture."""
    rows, columns = background.overlay.shape
    along = np.linspace(0, 1, WAY_POINTS)[:, None]
    ways = track.head[:, None, None] + along * (track.feet - track.head[:, None])[:, :, None]
    x, y = np.moveaxis(
        np.rint(warp_points(shrinking(background.shrink), ways.reshape(-1, 2))), 1, 0
    )
    inside = (x >= 0) & (y >= 0) & (x < columns) & (y < rows)
    place = y.clip(0, rows - 1).astype(int), x.clip(0, columns - 1).astype(int)
    return (inside & background.overlay[place]).reshape(len(track.head), -1).mean(axis=1)


@dataclass(frozen=True, eq=False)
class _View:
    """A reduced frame: where the player's colours are, and the colours themselves."""

    tables: Float32[np.ndarray, "C bins"]
    """Back-projection of each part by colour bin; one for all views."""
    colors: UInt8[np.ndarray, "h w 3"]
    """CIE Lab as OpenCV stores it."""
    foreground: Float32[np.ndarray, "h w"]
    shrink: float
    head: Float[np.ndarray, "2"]
    """Of the player, reduced px, as the rest."""
    feet: Float[np.ndarray, "2 2"]
    height: float

    @property
    def covered(self) -> Bool[np.ndarray, "h w"]:
        """Where something covers the scene."""
        return self.foreground > 0.5

    @property
    def lab(self) -> Float32[np.ndarray, "h w 3"]:
        """Colours as numbers."""
        return self.colors.astype(np.float32)

    @property
    def parts(self) -> Float32[np.ndarray, "C h w"]:
        """Back-projection of each part where the scene is covered."""
        return look_up(self.tables, color_bins(self.colors)) * self.foreground

    def is_truncated(self, sized: bool) -> bool:
        """Whether the player's colours reach the last rows under the feet.

        Where the player is `sized` by marked feet, only where the picture ends above the soles.
        """
        covered = self.covered
        rows, columns = covered.shape
        if rows - 1 - self.feet[:, 1].max() > FEET_NEAR_EDGE * self.height:
            return False
        middle, reach = float(self.feet[:, 0].mean()), EDGE_WIDTH * self.height
        first, last = (round(np.clip(middle + s * reach, 0, columns - 1)) for s in (-1, 1))
        # a row that is covered from side to side lies beyond the scene's last one
        end = rows - int((covered.mean(axis=1) < SCENE_ENDS)[::-1].argmax())
        if sized and self.head[1] + SOLES * self.height < end:
            return False
        edge = max(1, round(EDGE_ROWS * self.height))
        player = self.parts[:, max(0, end - edge) : end, first : last + 1]
        return bool((player.max(axis=0).mean(axis=0) > 0.4).sum() > LEG_WIDTH * self.height)

    def stripes(self, head: Float[np.ndarray, "2"], height: float) -> Float[np.ndarray, "S 3"]:
        """Mean colours of what covers the scene, from a head down; NaN where nothing does."""
        lab, covered = self.lab, self.covered
        rows, columns = covered.shape
        colors = np.full((STRIPES, 3), np.nan)
        first, last = (round(np.clip(head[0] + s * 0.12 * height, 0, columns)) for s in (-1, 1))
        for stripe in range(STRIPES):
            top, bottom = (head[1] + height * (stripe + s) / STRIPES for s in (-0.5, 0.5))
            window = np.s_[
                round(np.clip(top, 0, rows)) : round(np.clip(bottom, 0, rows)), first:last
            ]
            if covered[window].sum() >= 3:
                colors[stripe] = lab[window][covered[window]].mean(axis=0)
        return colors


def _read_views(
    video: Video,
    track: Track,
    frames: Int[np.ndarray, "n"],
    scene: ForegroundModel,
    colors: Colors,
    progress: Progress,
) -> Iterator[_View]:
    width = min(video.width, round(video.width * PLAYER / float(np.median(track.height))))
    shrink, tables = width / video.width, posterior_tables(colors).astype(np.float32)
    to_picture = np.linalg.inv(shrinking(shrink))
    pictures = read_small(video, width, set(frames.tolist()))
    for frame, picture in zip(
        frames.tolist(), progress(pictures, "Looking for others", len(frames)), strict=True
    ):
        lab = to_lab(picture)
        foreground = scene.foreground(lab, frame, to_picture).astype(np.float32)
        place = np.vstack([track.head[frame], track.feet[frame]]) * shrink + (shrink - 1) / 2
        height = float(track.height[frame]) * shrink
        yield _View(tables, lab, foreground, shrink, place[0], place[1:], height)


def _find_distractors(
    views: list[_View], confidence: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 2"]:
    """The figure most like the player, away from the player; NaN where none is like enough."""
    height = float(np.median([view.height for view in views]))
    template = _mean_player(views, confidence, height)
    places = [_best_places(view, template, height) for view in views]
    usual = float(np.median([own for own, _, _ in places]))
    colors = np.array([view.stripes(view.head, view.height) for view in views])
    mean = np.array([_known_median(stripe) for stripe in np.swapaxes(colors, 0, 1)])
    distractors = np.full((len(views), 2), np.nan)
    for row, (view, (_, response, place)) in enumerate(zip(views, places, strict=True)):
        if response >= LOOKS_LIKE * usual > 0:
            difference = (view.stripes(place, height) - mean) * (0.5, 1, 1)
            distance = np.linalg.norm(difference, axis=1)
            if np.isfinite(distance).any() and np.nanmean(distance) <= SAME_COLORS:
                distractors[row] = (place - (view.shrink - 1) / 2) / view.shrink
    return distractors


def _lasting(distractors: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    """Those that are there in the view before or after too."""
    known = np.isfinite(distractors[:, 0])
    lasting = known & (np.r_[known[1:], False] | np.r_[False, known[:-1]])
    return np.where(lasting[:, None], distractors, np.nan)


def _known_median(colors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """Median of the colours that are known; NaN where none is."""
    known = colors[np.isfinite(colors).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.full(3, np.nan)


def _margins(height: float) -> tuple[int, int, int]:
    """Of the template above the head, below it and to either side, px."""
    return round(0.25 * height), round(1.1 * height), round(0.35 * height)


def _mean_player(
    views: list[_View], confidence: Float[np.ndarray, "n"], height: float
) -> Float[np.ndarray, "C h w"]:
    """Mean of the part maps about the player, less the mean of each: a blob is no player."""
    above, below, aside = _margins(height)
    total, count = np.zeros((len(views[0].tables), above + below + 1, 2 * aside + 1)), 0
    sure = (confidence > 0) & (confidence >= min(0.5, float(np.median(confidence))))
    for view, is_sure in zip(views, sure, strict=True):
        if is_sure:
            scale = height / view.height
            corner = (aside, above) - scale * view.head
            way = np.array([[scale, 0, corner[0]], [0, scale, corner[1]]])
            size = (2 * aside + 1, above + below + 1)
            total += [cv2.warpAffine(part, way, size) for part in view.parts]
            count += 1
    mean = total / max(1, count)
    return (mean - mean.mean(axis=(1, 2), keepdims=True)).astype(np.float32)


def _best_places(
    view: _View, template: Float[np.ndarray, "C a b"], height: float
) -> tuple[float, float, Float[np.ndarray, "2"]]:
    """The template's response on the player, the best away from there, and its place."""
    columns = view.foreground.shape[1]
    response = _matched_filter(view.parts, template, _margins(height))
    y, x = np.ogrid[: len(response), :columns]
    across, along = np.abs(x - view.head[0]), np.abs(y - view.head[1])
    near = np.maximum(across, along) <= max(1.0, 0.12 * height)
    away = (across > APART[0] * height) | (along > APART[1] * height)
    if not away.any():
        return 0.0, 0.0, np.zeros(2)
    best = int(np.where(away, response, -np.inf).argmax())
    at_player = float(response[near].max()) if near.any() else 0.0
    return at_player, float(response.flat[best]), np.array([best % columns, best // columns], float)


def _matched_filter(
    parts: Float32[np.ndarray, "C h w"],
    template: Float32[np.ndarray, "C a b"],
    margins: tuple[int, int, int],
) -> Float32[np.ndarray, "h w"]:
    """Correlation of part maps with a template, summed over the parts; nothing is outside them.

    In the frequency domain, where the sum needs one transform back. What the template reaches
    beyond one side is the room beyond the other, as transforms take maps for periodic.
    """
    above, below, aside = margins
    rows, columns = parts.shape[1:]
    size = next_fast_len(rows + max(above, below), True), next_fast_len(columns + aside, True)
    spectra = rfft2(parts, size) * rfft2(template, size).conj()
    response = np.roll(irfft2(spectra.sum(axis=0), size), (above, aside), (0, 1))
    return response[:rows, :columns]


def find_meetings(
    verification: TrackVerification, track: Track, fps: float
) -> list[tuple[int, int]]:
    """First and last frames of the stretches in which a distractor is near the player who is seen,
    a second or more apart."""
    frames = verification.frames[track.confidence[verification.frames] > 0]
    distractor = verification.distractor[track.confidence[verification.frames] > 0]
    away = np.linalg.norm(track.head[frames] - distractor, axis=1)
    near = frames[away < MEETS * track.height[frames]]  # not where there is none, which is NaN
    if not len(near):
        return []
    breaks = np.flatnonzero(np.diff(near) > fps)
    firsts, lasts = near[np.r_[0, breaks + 1]], near[np.r_[breaks, len(near) - 1]]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
