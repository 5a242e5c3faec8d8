"""Detect the player: roughly, where head and feet are, and how tall they stand (Section 4.1).

In pictures reduced so that the player is about 96 px tall, a few frames a second are searched
whole:

    colour back-projection x foreground -> Gaussian low-pass -> radial symmetry -> candidates,

round for the head, elliptical for the shoes; where somebody told what the trunk looks like, a head
has it beneath it or aslant. The cheapest path through the candidates (see
`viterbi`) gives the head, then the feet given the head; between the searched frames both are
interpolated. Searched in every frame (`EVERY_FRAME`), this is the tracker that the paper prints.

What always has the player's colours is the scene, clay like skin, or a player who does not leave
his place: a golfer, or anybody in a shot of two seconds. It is first taken for the scene. Where the
track that comes of that is doubtful, it is looked for again with that part of the scene unknown,
and the surer track of the two is kept.

The unit of length is the standing height from head to mid-feet. Players crouch, lunge and jump, so
it is an upper envelope over time, divided by the camera's zoom, not the distance of the moment.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.io.frame_reader import read_small, shrinking, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.viterbi import TransitionModel, find_cheapest_track
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import CameraPath, Colors, Track, TrackAnchors
from keyrecon.segmentation.background_model import BackgroundOptions, reduced_width
from keyrecon.segmentation.color_model import foot_table, posterior_tables, to_lab
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.segmentation.part_evidence import Reader, background_hypotheses, evaluate_evidence
from keyrecon.tracking.anchors import (
    FollowedHeads,
    anchored_states,
    fixed_places,
    with_bridge_costs,
)
from keyrecon.tracking.candidates import PartCandidates, search_frame
from keyrecon.tracking.foot_pairs import (
    COLOR_PRIOR,
    FOOT_SKIP_COST,
    MAX_PAIRS,
    foot_pairs,
    foot_pose_cost,
)
from keyrecon.tracking.linking import MAX_GAP_SECONDS
from keyrecon.tracking.scale import SizeEvidence, with_standing_height
from keyrecon.tracking.smoothing import (
    fill_gaps,
    state_confidence,
    taken_states,
    to_reference_frame,
)

EVERY_FRAME = 1e4
"""A pace that no video has: every frame is searched. The end of the range of `FindOptions.pace`."""
MAX_CACHE_BYTES = 2**28
"""Pictures that take no more memory than this are kept rather than read twice."""
NO_SHOE_COST = 2.0
"""Cost of an end of a leg without a shoe: that of a shoe with a twelfth of the best score. Halved:
the same bits on one clip."""
MISSED = 0.3
"""Confidence that a place counts for, where two tracks are compared, that was not found or is less
sure: one is missed now and then by the better track too. Evidence: real clips and thirds of them
(`benchmarks/standing_still.py`), heads and feet off by .1034 player heights, .1048 with 0 to .2
and .1045 with .4; not counting missed places at all, .1053, takes a golfer's head to his
shoe for half a second in one clip."""
BEST_SCORE_PERCENTILE = 95
"""Of the best scores of all frames: a few may be of something that shines. Halved: at most 0.9
points, 1.0 mm on one clip."""
SCORE_SATURATION, SCORE_FLOOR = 0.15, 0.001
"""Shares of the best score: beyond the first, contrast says little; the second keeps costs finite.
Halved: at most 0.9 points, 1.0 mm on one clip."""


@dataclass(frozen=True)
class FindOptions:
    """How the player is detected."""

    player: Annotated[float, within(24, 600)] = 96.0
    """Height of the player in the searched pictures, px; smaller is faster and less exact.

    Halved, others with it: at most 0.8 points, 0.6 mm on one clip.
    """
    pace: Annotated[float, within(1, 10_000)] = 12.5
    """Pictures searched per second of the video; the player is interpolated between them. More
    for very fast motion; slower.

    Halved, others with it: at most 0.8 points, 0.6 mm on one clip.
    """
    head_speed: Annotated[float, within(0.1, 60)] = 3.0
    """Usual speed of the head, player heights per second; higher for wilder motion.

    Halved, others with it: at most 0.8 points, 0.6 mm on one clip.
    """
    foot_speed: Annotated[float, within(0.2, 100)] = 5.0
    """Usual speed of the feet, player heights per second; higher for wilder motion.

    Halved, others with it: at most 0.8 points, 0.6 mm on one clip.
    """
    envelope: Annotated[float, within(0.2, 100)] = 5.0
    """Seconds in which the player may come nearer or go away by much; less for a camera that zooms
    fast.

    Halved, others with it: at most 0.8 points, 0.6 mm on one clip.
    """
    detected: Annotated[float, within(0, 1)] = 0.4
    """Share of the searched frames in which a head must be found for a track to be believed; lower
    it for a player who is out of the picture most of the time.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips.
    """
    other_trunk: Annotated[float, within(0.01, 1)] = 0.25
    """Probability that little of the marked trunk shows beneath the player's head: a limb, a
    racket, the net or the side of a shirt that nobody marked hides it; 1 does not ask for it, as
    the paper."""
    doubtful: Annotated[float, within(0, 1)] = 0.75
    """Mean confidence of the feet, or of head and feet, below which a track is made again for a
    player who stands still, and the surer of the two kept; 0 never does, as the paper, 1 nearly
    always, which is slower.

    Only where they are not fixed. Evidence: `benchmarks/standing_still.py`; as good as always both
    in all but one of 98 cases, and 69 of them are made twice. Feet that stand are what the scene
    swallows first.
    """


def find_player(
    video: Video,
    colors: Colors,
    camera: CameraPath,
    anchors: TrackAnchors,
    options: FindOptions = FindOptions(),
    progress: Progress = silent,
) -> Track:
    """Head, feet, standing height, box and confidence in every frame, by colour and shape alone.

    The path passes through the heads and feet that a person marked. Raises KeyreconError where
    no head is found in most frames.
    """
    width = reduced_width(video, colors.height, BackgroundOptions(player=options.player))
    shrink = width / video.width
    parts = posterior_tables(colors)
    every = max(1, round(video.fps / options.pace))
    paced = np.append(np.arange(0, len(video), every), len(video) - 1)
    numbers = np.unique(np.concatenate([paced, anchors.frames[anchors.marked]]))
    pictures = _read_pictures(video, width, numbers, progress)
    backgrounds = background_hypotheses(pictures, numbers, camera, shrink, parts.max(axis=0))
    named = [parts[colors.names.index(name)] for name in ("head", "trunk") if name in colors.names]
    rows = [named[0], foot_table(colors), parts.max(axis=0), *named[1:]]
    tables = np.stack(rows).astype(np.float32)

    def detect(scene: ForegroundModel) -> tuple[Track, float]:
        shown = progress(pictures(numbers), "Detecting the player", len(numbers))
        candidates = _search(shown, numbers, scene, tables, colors.height * shrink, shrink)
        return _link(candidates, numbers, video, camera, colors.height, anchors, options)

    return surest_track(backgrounds, detect, options.doubtful)


def surest_track(
    backgrounds: Sequence[ForegroundModel],
    detect: Callable[[ForegroundModel], tuple[Track, float]],
    doubtful: float,
) -> Track:
    """The track before one of the backgrounds whose places are the surest in the mean.

    `detect` gives a track and how sure it is where nothing is fixed; no further one is made after
    one that is not `doubtful`. Raises KeyreconError, that of the first, where no track is found.
    """
    made: list[Track] = []
    missed: list[KeyreconError] = []
    for background in backgrounds:
        sure = 0.0
        try:
            track, sure = detect(background)
            made.append(track)
        except KeyreconError as error:
            missed.append(error)
        if sure >= doubtful:
            break
    if not made:
        raise missed[0]
    return max(made, key=lambda one: _mean(np.maximum(one.confidence, MISSED), 0.0))


def _mean(values: Float[np.ndarray, "n"], of_none: float) -> float:
    return float(values.mean()) if len(values) else of_none


def _search(
    pictures: Iterable[UInt8[np.ndarray, "h w 3"]],
    numbers: Int[np.ndarray, "n"],
    scene: ForegroundModel,
    tables: Float[np.ndarray, "P bins"],
    tall: float,
    shrink: float,
) -> list[PartCandidates]:
    """Candidates of some frames, in pixels of the full pictures."""
    to_picture = np.linalg.inv(shrinking(shrink))

    def search(entry: tuple[int, UInt8[np.ndarray, "h w 3"]]) -> PartCandidates:
        lab = to_lab(entry[1])
        foreground = scene.foreground(lab, entry[0], to_picture)
        return search_frame(evaluate_evidence(lab, tables, foreground, tall), tall)

    reduced = side_by_side(search, zip(numbers.tolist(), pictures, strict=True))
    return [_enlarge(c, shrink) for c in reduced]


def _read_pictures(
    video: Video, width: int, numbers: Int[np.ndarray, "n"], progress: Progress
) -> Reader:
    """Reduced pictures of some frames: kept if they take little memory, else read when wanted."""
    if 3 * len(numbers) * width * round(video.height * width / video.width) > MAX_CACHE_BYTES:
        return lambda wanted: read_small(video, width, set(wanted.tolist()))
    pictures = read_small(video, width, set(numbers.tolist()))
    pictures = progress(pictures, "Reading pictures of the player", len(numbers))
    kept = dict(zip(numbers.tolist(), pictures, strict=True))
    return lambda wanted: (kept[number] for number in wanted.tolist())


def _enlarge(candidates: PartCandidates, shrink: float) -> PartCandidates:
    """Candidates in pixels of the full picture."""
    back = (1 / shrink - 1) / 2
    heads, feet = (places / shrink + back for places in (candidates.heads, candidates.feet))
    return replace(candidates, heads=heads, feet=feet)


def _link(
    candidates: list[PartCandidates],
    numbers: Int[np.ndarray, "n"],
    video: Video,
    camera: CameraPath,
    height: float,
    anchors: TrackAnchors,
    options: FindOptions,
) -> tuple[Track, float]:
    """The path of the head, then that of the feet, and the lesser of the mean confidences of the
    feet and of all, in frames in which they are not fixed."""
    from_reference, searched = np.linalg.inv(camera.to_reference), camera.to_reference[numbers]
    apart = float(np.median(np.diff(numbers))) if len(numbers) > 1 else video.fps
    step, max_gap = height / video.fps * apart, round(MAX_GAP_SECONDS * video.fps / apart)
    fixed_head, fixed_feet = fixed_places(anchors, numbers, camera)
    head_cost = head_costs(candidates, options.other_trunk)
    stable = [h[:, None] for h in to_reference_frame([c.heads for c in candidates], searched)]
    head_cost = with_bridge_costs(stable, head_cost, fixed_head, options.head_speed * step)
    followed = FollowedHeads.of(anchors, numbers, camera, height)
    stable, head_cost = anchored_states(*followed.with_costs(stable, head_cost), fixed_head)
    chosen = find_cheapest_track(
        head_cost, stable, TransitionModel(options.head_speed * step, max_gap)
    )
    if not (chosen >= 0).any() or (chosen >= 0).mean() < options.detected:
        raise missed_head(chosen, numbers, anchors.frames[anchors.marked])
    head = fill_gaps(taken_states(stable, chosen), numbers, from_reference)[:, 0]
    pairs, costs = _pair(candidates, head[numbers], height)
    stable = to_reference_frame([c.feet for c in candidates], searched)
    stable = [f[p] for f, p in zip(stable, pairs, strict=True)]
    stable, costs = anchored_states(stable, costs, fixed_feet)
    model = TransitionModel(options.foot_speed * step, max_gap, skip_cost=FOOT_SKIP_COST)
    taken = find_cheapest_track(costs, stable, model)
    feet = fill_gaps(taken_states(stable, taken), numbers, from_reference)
    evidence = SizeEvidence.of(camera, video, anchors)
    of_head = state_confidence(head_cost, chosen)
    of_feet = state_confidence([c / 2 for c in costs], taken)
    of_both = np.sqrt(of_head * np.where(evidence.cut(head)[numbers], of_head, of_feet))
    confidence = np.interp(np.arange(len(head)), numbers, of_both)
    track = Track(
        head, feet, np.full(len(head), np.nan), np.full((len(head), 4), np.nan), confidence
    )
    # Places that were missed are on the way between those that were not, of head and feet each by
    # itself: a head that jumps to somebody else and feet that stay are no body.
    found = np.interp(np.arange(len(head)), numbers, (chosen >= 0) & (taken >= 0)) == 1
    track = with_standing_height(track, evidence, round(options.envelope * video.fps), found)
    free_head, free_feet = (np.isnan(m).any(axis=(1, 2)) for m in (fixed_head, fixed_feet))
    return track, min(_mean(of_feet[free_feet], 1.0), _mean(of_both[free_head | free_feet], 1.0))


def _pair(
    candidates: list[PartCandidates], head: Float[np.ndarray, "n 2"], height: float
) -> tuple[list[Int[np.ndarray, "_ 2"]], list[Float[np.ndarray, "_"]]]:
    """The best pairs of feet of every frame, and their costs."""
    foot_cost = _costs([c.foot_score for c in candidates])
    pairs, costs = [], []
    for t, frame in enumerate(candidates):
        every = foot_pairs(len(frame.feet))
        posture = foot_pose_cost(frame.feet[every], head[t], height, COLOR_PRIOR)
        cost = foot_cost[t][every].sum(axis=1) + posture
        best = np.argsort(cost)[:MAX_PAIRS]
        pairs.append(every[best])
        costs.append(cost[best])
    return pairs, costs


def head_costs(
    candidates: list[PartCandidates], other_trunk: float = FindOptions.other_trunk
) -> list[Float[np.ndarray, "_"]]:
    """Costs of the heads of every frame by what they look like and what is beneath them, nats.

    Others on the court have heads; the player's clothes they do not have, unless, with a
    probability of `other_trunk`, something hides them.
    """
    round_and_coloured = _costs([c.head_score for c in candidates])
    above_trunk = _trunk_costs([c.trunk for c in candidates], other_trunk)
    return [head + trunk for head, trunk in zip(round_and_coloured, above_trunk, strict=True)]


def missed_head(
    chosen: Int[np.ndarray, "n"], numbers: Int[np.ndarray, "n"], marked: Int[np.ndarray, "A"]
) -> KeyreconError:
    """The error that says where a head was missed; `marked` are the frames of marked bodies."""
    detected = chosen >= 0
    gaps = numbers[~detected]
    middle = int(gaps[len(gaps) // 2])
    listed = ", ".join(map(str, marked[:8].tolist())) + (" ..." if len(marked) > 8 else "")
    remedy = (
        f"look whether the marks on frame {listed} are the player's, and mark another body"
        if len(marked)
        else "pick its colour again"
    )
    return KeyreconError(
        f"The head was found in only {detected.sum()} of {len(detected)} frames; {remedy} on a "
        f"frame where it was missed, for instance frame {middle}. Where the player is out of the "
        "picture most of the time, lower --find.detected."
    )


def _costs(scores: list[Float[np.ndarray, "_"]]) -> list[Float[np.ndarray, "_"]]:
    """-log of each score against the best scores of the sequence."""
    best = [float(np.nanmax(s)) for s in scores if np.isfinite(s).any()]
    best_score = max(float(np.percentile(best, BEST_SCORE_PERCENTILE)), 1e-12) if best else 1.0
    # Shoes differ in contrast; beyond a fair score more of it says little.
    low, high = SCORE_FLOOR * best_score, SCORE_SATURATION * best_score
    costs = [-np.log((s + low) / (s + high)) for s in scores]
    return [np.where(np.isnan(c), NO_SHOE_COST, c) for c in costs]


def _trunk_costs(
    shares: list[Float[np.ndarray, "_"]], other: float
) -> list[Float[np.ndarray, "_"]]:
    """-log of the probability of so much trunk beneath the player's head; 0 where it is unknown."""
    best = [float(s.max()) for s in shares if len(s) and np.isfinite(s).all()]
    if not best:
        return [np.zeros(len(s)) for s in shares]
    usual = max(float(np.median(best)), 1e-12)
    return [-np.log(other + (1 - other) * np.minimum(s / usual, 1)) for s in shares]
