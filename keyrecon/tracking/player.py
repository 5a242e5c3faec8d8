"""Where the player is: head, feet, size and box in every frame (Section 4.1).

In pictures reduced so that the player is about 96 px tall, every frame is searched whole:

    colour back-projection x foreground -> Gaussian low-pass -> radial symmetry -> candidates,

round for the head, elliptical for the shoes. Colours recur in the scene (clay like skin, lines like
white shoes), so back-projection is weighted by how far a pixel is from the background; and a head
has the player's colours beneath it, a foot has them above it and not below. The cheapest path
through the candidates (see `viterbi`) gives the head, then the feet given the head. What is missing
is interpolated and told by `Track.trust`.

The unit of length is the standing height from head to mid-feet. Players crouch, lunge and jump, so
it is an upper envelope over time, divided by the camera's zoom, not the distance of the moment.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from scipy.ndimage import maximum_filter1d

from keyrecon.background import (
    BackgroundOptions,
    Scene,
    combine_plate,
    fill_plate,
    reduced_width,
    sample_frames,
)
from keyrecon.camera import warp_points
from keyrecon.colors import color_bins, foot_table, posterior_tables, to_lab
from keyrecon.errors import KeyreconError
from keyrecon.pictures import read_small, shrinking, side_by_side
from keyrecon.progress import Progress, silent
from keyrecon.records import CameraPath, Colors, Track
from keyrecon.tracking.feet import SHOE_RADIUS, foot_pairs, pair_costs
from keyrecon.tracking.scale import player_boxes, standing_height, zoom
from keyrecon.tracking.symmetry import ellipse, find_peaks, find_slope, radial_symmetry
from keyrecon.tracking.viterbi import Motion, cheapest_path
from keyrecon.video import Video

HEAD_RADIUS = 0.062
"""Player heights: .055 of stature, and head to feet is .9 of stature (Drillis and Contini)."""
RADII = (0.8, 1.0, 1.25)
"""Shares of a part's radius that are searched."""
SHOES = tuple(ellipse(2.0, np.deg2rad(angle)) for angle in (0, 45, -45))
"""Shoes from the side and pointing to or from the camera."""
STILL_WEIGHT = 0.2
"""Weight of colour where nothing differs from the background: a player may stand still."""
LEAST_CLEAR = 0.15
"""Share of the frames in which a place must lack the player's colours to be judged by those:
a racket or a shadow passes more rarely than that, even where the scene has the colours itself."""
HEADS, FEET = 8, 10
"""Candidates kept of each, per frame."""
PAIRS = 30
"""Pairs of feet kept, per frame."""
LEG_ENDS = 4
"""Ends of legs kept beside the shoes, per frame."""
LEG_ABOVE = 0.3
"""Least share of the player above the end of a leg."""
NO_SHOE = 2.0
"""Cost of an end of a leg without a shoe: that of a shoe with a twelfth of the best score."""
ONE_PLACE = 0.07
"""Candidates nearer to one another are parts of one shoe, player heights: half its length."""
KNEE_ROOM = 0.06
"""How far a leg may bend away from the straight line from hips to foot, player heights."""
FAIR = 0.15
"""Share of the best scores that is as good as half sure."""
LEAST_BODY = 0.05
"""Share of the player's colours beneath a head, at least; a trunk fills about a third."""
LEAST_FOUND = 0.4
"""Share of the frames in which a head must be found for a track to be believed."""


@dataclass(frozen=True)
class TrackOptions:
    """How the player is followed."""

    player: float = 96.0
    """Height of the player in the searched pictures, px; smaller is faster and less exact."""
    head_speed: float = 3.0
    """Usual speed of the head, player heights per second."""
    foot_speed: float = 5.0
    """Usual speed of the feet, player heights per second."""
    envelope: float = 5.0
    """The standing height may change over this time, seconds."""


@dataclass(frozen=True, eq=False)
class _Candidates:
    """What one frame offers."""

    heads: Float[np.ndarray, "m 2"]
    head_score: Float[np.ndarray, "m"]
    feet: Float[np.ndarray, "n 2"]
    foot_score: Float[np.ndarray, "n"]
    """NaN where only the end of a leg was seen, and no shoe."""


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Maps of one frame, 0-1."""

    head: Float[np.ndarray, "h w"]
    foot: Float[np.ndarray, "h w"]
    player: Float[np.ndarray, "h w"]
    """Any part of the player."""
    inside: Float[np.ndarray, "h1 w1"]
    """Integral of `player`."""


def track_player(
    video: Video,
    colors: Colors,
    camera: CameraPath,
    options: TrackOptions = TrackOptions(),
    progress: Progress = silent,
) -> Track:
    """Head, feet, standing height, box and trust in every frame.

    Raises KeyreconError where no head is found in most frames.
    """
    width = reduced_width(video, colors.height, BackgroundOptions(player=options.player))
    shrink = width / video.width
    parts = posterior_tables(colors)
    scene = _first_scene(video, camera, width, parts.max(axis=0))
    tall = colors.height * shrink
    head = parts[colors.names.index("head")]
    tables = np.stack([head, foot_table(colors), parts.max(axis=0)]).astype(np.float32)
    to_picture = np.linalg.inv(shrinking(shrink))

    def look(entry: tuple[int, UInt8[np.ndarray, "h w 3"]]) -> _Candidates:
        lab = to_lab(entry[1])
        foreground = scene.foreground(lab, entry[0], to_picture)
        return _search(_weigh(lab, tables, foreground, tall), tall)

    pictures = progress(read_small(video, width), "Following the player", len(video))
    found = list(side_by_side(look, enumerate(pictures)))
    return _connect(found, video, camera, (shrink, tall), options)


def _first_scene(
    video: Video, camera: CameraPath, width: int, player: Float[np.ndarray, "bins"]
) -> Scene:
    """A plate before the player is known: the median of what does not have their colours.

    Where everything has, the background does, and the median of all it is.
    """
    used = sample_frames(len(video), BackgroundOptions.samples)
    lab = [to_lab(p) for p in read_small(video, width, set(used.tolist()))]
    shrink = width / video.width
    paths = camera.to_reference[used]
    window = np.ones((3, 3), np.uint8)
    free = [cv2.dilate((player[color_bins(p)] > 0.5).astype(np.uint8), window) == 0 for p in lab]
    clear = combine_plate(lab, free, paths, shrink, least=LEAST_CLEAR)
    plain = combine_plate(lab, [np.ones_like(f) for f in free], paths, shrink)
    return Scene(fill_plate(clear, plain), camera)


def _weigh(
    lab: UInt8[np.ndarray, "h w 3"],
    tables: Float[np.ndarray, "3 bins"],
    foreground: Float[np.ndarray, "h w"],
    tall: float,
) -> _Evidence:
    """Back-projection weighted by foreground, low-passed at the size of each part."""
    bins = color_bins(lab)
    weight = (STILL_WEIGHT + (1 - STILL_WEIGHT) * foreground).astype(np.float32)
    head = tables[0][bins] * weight
    foot = tables[1][bins] * weight
    any_part = tables[2][bins] * foreground.astype(np.float32)
    return _Evidence(
        head=cv2.GaussianBlur(head, (0, 0), max(0.8, 0.25 * HEAD_RADIUS * tall)),
        foot=cv2.GaussianBlur(foot, (0, 0), max(0.8, 0.25 * SHOE_RADIUS * tall)),
        player=any_part,
        inside=cv2.integral(any_part),
    )


def _search(evidence: _Evidence, tall: float) -> _Candidates:
    """Round head-coloured and elliptical shoe-coloured places, scored with their neighbourhood."""
    radii = [max(1.0, r * HEAD_RADIUS * tall) for r in RADII]
    score = radial_symmetry(find_slope(evidence.head), radii)
    heads, strength = find_peaks(score, HEAD_RADIUS * tall, 3 * HEADS)
    body = _mean_inside(evidence, heads, (-0.15, 0.12, 0.15, 0.65), tall)
    strength = strength * (0.02 + body)
    order = np.argsort(-strength)[:HEADS]
    order = order[body[order] > LEAST_BODY]
    heads, strength = heads[order], strength[order]
    feet, foot_strength = _search_feet(evidence, heads[:4], tall)
    return _Candidates(heads, strength, feet, foot_strength)


def _search_feet(
    evidence: _Evidence, heads: Float[np.ndarray, "m 2"], tall: float
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n"]]:
    """Shoe-coloured ellipses with a leg above and nothing of the player below, and ends of legs."""
    below = np.zeros(evidence.foot.shape, bool)
    for x, y in heads:
        x0, x1 = max(0, round(x - 0.9 * tall)), max(0, round(x + 0.9 * tall))
        y0, y1 = max(0, round(y + 0.35 * tall)), max(0, round(y + 1.35 * tall))
        below[y0:y1, x0:x1] = True
    if not below.any():
        return np.zeros((0, 2)), np.zeros(0)
    rows, columns = np.flatnonzero(below.any(axis=1)), np.flatnonzero(below.any(axis=0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = np.array([columns[0], rows[0]])
    slope = find_slope(np.where(below, evidence.foot, 0)[window])
    radii = [max(1.0, r * SHOE_RADIUS * tall) for r in RADII]
    score = np.max([radial_symmetry(slope, radii, 1.0, form) for form in SHOES], axis=0)
    feet, strength = find_peaks(score, 0.8 * SHOE_RADIUS * tall, 3 * FEET, below[window])
    ends = _leg_ends(np.where(below, evidence.player, 0)[window], tall)
    feet = np.concatenate([feet, ends]) + corner
    strength = np.concatenate([strength, np.full(len(ends), np.nan)])
    leg = _mean_inside(evidence, feet, (-0.08, -0.2, 0.08, 0.0), tall)
    leg *= _leg_between(evidence, heads[0], feet, tall) ** 2
    under = _mean_inside(evidence, feet, (-0.05, 0.08, 0.05, 0.35), tall).clip(0, 1)
    strength = strength * (0.02 + leg) * (1.05 - under) ** 2
    shoes = np.argsort(-strength)[:FEET]
    shoes = shoes[np.isfinite(strength[shoes])]
    bare = np.flatnonzero(np.isnan(strength) & (leg > LEG_ABOVE) & (under < 0.2))[:LEG_ENDS]
    order = _apart(feet, np.concatenate([shoes, bare]), ONE_PLACE * tall)
    return feet[order], strength[order]


def _apart(
    places: Float[np.ndarray, "n 2"], order: Int[np.ndarray, "m"], least: float
) -> Int[np.ndarray, "k"]:
    """The places of an order, but those too near an earlier one: heel and toe of one shoe."""
    kept: list[int] = []
    for place in order:
        if not kept or np.linalg.norm(places[kept] - places[place], axis=1).min() >= least:
            kept.append(int(place))
    return np.array(kept, int)


def _leg_between(
    evidence: _Evidence,
    head: Float[np.ndarray, "2"],
    feet: Float[np.ndarray, "n 2"],
    tall: float,
) -> Float[np.ndarray, "n"]:
    """Share of the way from the hips to each foot that the player covers, knees bent or not."""
    x0, x1 = (round(head[0] + side * 0.4 * tall) for side in (-1, 1))
    y0, y1 = (round(head[1] + share * tall) for share in (0.35, 0.55))
    rows, columns = evidence.player.shape
    band = evidence.player[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)]
    weight = band.sum(axis=0)
    middle = (weight * np.arange(len(weight))).sum() / weight.sum() if weight.sum() > 0 else None
    hips = np.array([head[0] if middle is None else max(0, x0) + middle, (y0 + y1) / 2])
    share = np.linspace(0.2, 0.85, 10)[:, None, None]
    way = hips + share * (feet - hips)
    reach = max(1, round(KNEE_ROOM * tall))
    wide = cv2.blur(evidence.player, (2 * reach + 1, 2 * reach + 1))
    x = np.rint(way[..., 0]).astype(int).clip(0, columns - 1)
    y = np.rint(way[..., 1]).astype(int).clip(0, rows - 1)
    # A limb a third as wide as the window covers it; the widest gaps tell, not the mean.
    cover = np.sort(np.minimum(1.0, 3 * wide[y, x]), axis=0)
    return cover[:3].mean(axis=0)


def _leg_ends(player: Float[np.ndarray, "h w"], tall: float) -> Float[np.ndarray, "n 2"]:
    """Where the outline of the player reaches down farthest, lowest first."""
    filled = cv2.GaussianBlur(player, (0, 0), max(0.8, 0.01 * tall)) > 0.4
    low = np.where(filled.any(axis=0), filled.shape[0] - 1 - filled[::-1].argmax(axis=0), -1)
    reach = max(1, round(0.07 * tall))
    lowest = low == maximum_filter1d(low, 2 * reach + 1)
    x = np.flatnonzero(lowest & (low >= 0))
    # One place for each run of columns that reach equally far.
    starts = np.flatnonzero(np.diff(x, prepend=-9) > 1)
    ends = np.append(starts[1:], len(x)) - 1
    middle = (x[starts] + x[ends]) // 2 if len(x) else x
    order = np.argsort(-low[middle], kind="stable")
    # The ankle is about that far above the lowest skin.
    return np.stack([middle, low[middle] - 0.02 * tall], axis=1).astype(float)[order]


def _mean_inside(
    evidence: _Evidence,
    places: Float[np.ndarray, "m 2"],
    window: tuple[float, float, float, float],
    tall: float,
) -> Float[np.ndarray, "m"]:
    """Mean evidence for the player in a window (player heights) around each place."""
    rows, columns = np.array(evidence.inside.shape) - 1
    x = np.rint(places[:, :1] + tall * np.array(window[0::2])).astype(int).clip(0, columns)
    y = np.rint(places[:, 1:] + tall * np.array(window[1::2])).astype(int).clip(0, rows)
    total = evidence.inside
    inside = (
        total[y[:, 1], x[:, 1]] - total[y[:, 0], x[:, 1]]
        - total[y[:, 1], x[:, 0]] + total[y[:, 0], x[:, 0]]
    )  # fmt: skip
    area = tall * (window[2] - window[0]) * tall * (window[3] - window[1])
    return inside / area


def _connect(
    found: list[_Candidates],
    video: Video,
    camera: CameraPath,
    size: tuple[float, float],
    options: TrackOptions,
) -> Track:
    """The path of the head, then that of the feet, in pixels of the full picture."""
    shrink, tall = size
    height = tall / shrink
    back = (1 / shrink - 1) / 2
    to_full = lambda places: places / shrink + back  # noqa: E731
    heads = [to_full(c.heads) for c in found]
    feet = [to_full(c.feet) for c in found]
    head_cost = _costs([c.head_score for c in found])
    speed = height / video.fps
    stable = [_stabilise(h, camera, t)[:, None] for t, h in enumerate(heads)]
    chosen = cheapest_path(head_cost, stable, Motion(options.head_speed * speed))
    if (chosen >= 0).mean() < LEAST_FOUND:
        raise _lost(chosen)
    head = _fill(heads, chosen)
    foot_cost = _costs([c.foot_score for c in found])
    pairs, costs = [], []
    for t, places in enumerate(feet):
        every = foot_pairs(len(places))
        cost = pair_costs(foot_cost[t], every, places, head[t], height)
        best = np.argsort(cost)[:PAIRS]
        pairs.append(every[best])
        costs.append(cost[best])
    stable = [_stabilise(f, camera, t)[p] for t, (f, p) in enumerate(zip(feet, pairs, strict=True))]
    taken = cheapest_path(costs, stable, Motion(options.foot_speed * speed, gap=12, miss=7.0))
    both = _order(_fill([f[p].reshape(-1, 4) for f, p in zip(feet, pairs, strict=True)], taken))
    frames = round(options.envelope * video.fps)
    standing = standing_height(head, both.mean(axis=1), zoom(camera, video), frames)
    head_trust = np.array([_trust(c, int(s)) for c, s in zip(head_cost, chosen, strict=True)])
    feet_trust = np.array([_trust(c / 2, int(s)) for c, s in zip(costs, taken, strict=True)])
    trust = np.sqrt(head_trust * feet_trust)
    return Track(head, both, standing, player_boxes(head, both, standing), trust)


def _lost(chosen: Int[np.ndarray, "T"]) -> KeyreconError:
    """What to tell when there is no track."""
    seen = chosen >= 0
    gaps = np.flatnonzero(~seen)
    middle = int(gaps[len(gaps) // 2])
    return KeyreconError(
        f"The head was found in only {seen.sum()} of {len(seen)} frames; pick its colour again "
        f"on a frame where it was missed, for instance frame {middle}."
    )


def _costs(scores: list[Float[np.ndarray, "_"]]) -> list[Float[np.ndarray, "_"]]:
    """-log of each score against the best scores of the sequence."""
    best = [float(np.nanmax(s)) for s in scores if np.isfinite(s).any()]
    reference = max(float(np.percentile(best, 95)), 1e-12) if best else 1.0
    # Shoes differ in contrast; beyond a fair score more of it says little.
    costs = [-np.log((s + 0.001 * reference) / (s + FAIR * reference)) for s in scores]
    return [np.where(np.isnan(c), NO_SHOE, c) for c in costs]


def _trust(cost: Float[np.ndarray, "m"], state: int) -> float:
    """How good the state taken is, 0-1."""
    return 0.0 if state < 0 else float(np.exp(-max(0.0, cost[state])) ** 0.5)


def _stabilise(
    places: Float[np.ndarray, "m 2"], camera: CameraPath, frame: int
) -> Float[np.ndarray, "m 2"]:
    return warp_points(camera.to_reference[frame], places)


def _fill(
    places: list[Float[np.ndarray, "_ d"]], chosen: Int[np.ndarray, "T"]
) -> Float[np.ndarray, "T d"]:
    """The chosen places, linearly interpolated where none was."""
    seen = np.flatnonzero(chosen >= 0)
    if not len(seen):
        raise KeyreconError(
            "No feet were found below the head in any frame; pick the colour of the shoes again."
        )
    known = np.array([places[t][chosen[t]] for t in seen])
    if known.shape[1] == 4:
        known = _order(known).reshape(-1, 4)
    return np.stack(
        [np.interp(np.arange(len(chosen)), seen, column) for column in known.T], axis=1
    )


def _order(pairs: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "T 2 2"]:
    """Swap the members of each pair so that each stays near its predecessor."""
    both = pairs.reshape(-1, 2, 2).copy()
    for t in range(1, len(both)):
        direct = np.linalg.norm(both[t] - both[t - 1], axis=1).sum()
        if np.linalg.norm(both[t][::-1] - both[t - 1], axis=1).sum() < direct:
            both[t] = both[t][::-1]
    return both
