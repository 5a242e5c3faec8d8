"""Choose the few frames that a person annotates (Section 4.3).

A keyframe represents the frames whose pose is within beta of its own. The number of keyframes
is limited (the annotation budget), so beta is what is searched for: the smallest with which so
many keyframes represent, or bridge by gaps of at most T frames, a share alpha of all frames
(Eq. 1). Upper and lower body are chosen apart.

A long video repeats itself, and a share of its frames would buy keyframes that nobody needs. Where
no budget is asked for, no more keyframes are chosen than reach the coverage at a distance that
is small enough (`sufficient_beta`).

method='paper' is the choice as printed: Eq. 2-4, distances smoothed with the same beta.
method='coverage' maximises the coverage of Eq. 1 itself, for a share alpha of the frames and of the
time measured in pose change (`pose_time`), reconsiders each keyframe, and at the end moves
keyframes to the middle of what they represent. It smooths with a beta of its own, the distance
between consecutive frames: two frames as alike as neighbours in time do show the same pose, which
is what justifies averaging, whereas the beta of a small budget is far larger.

Tried in its place, with as many labels: k-medoids of both halves together, beside the frames that
are marked first, for the least expected loss (of arms 5.5 % of the joints are lost with every .01
player heights of D beyond .02, of legs 2.5 %). In two or three draws of `benchmarks/draws.py` three
golf clips rose from 97.5, 98.1 and 97.6 % of the joints to 98.9, 99.1 and 98.1, a rally from 94.0
to 95.2, but a serve fell from 92.5 to 88.0 (a loss that grows with the square: 89.1): D is as large
before the serve, where little is lost, and coverage spreads its keyframes over the stroke.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float, Int

from keyrecon.annotation_budget import check_budget, least_labels, usual_budget
from keyrecon.errors import KeyreconError
from keyrecon.keyframes.absence import (
    absent_frames,
    restore_frames,
    select_frames,
    shot_numbers,
    shown_frames,
)
from keyrecon.keyframes.assignment import assign_frames, find_neighborhoods, represent_frames
from keyrecon.keyframes.coverage import TIME_UNIT, choose_greedily
from keyrecon.keyframes.mark_gains import order_by_gain
from keyrecon.keyframes.pose_time import elapsed_time
from keyrecon.keyframes.smoothing import smooth_distances
from keyrecon.keyframes.swaps import (
    CoverageGoal,
    add_medoids,
    drop_redundant,
    shrink_by_swaps,
    swap_for_coverage,
    swap_medoids,
)
from keyrecon.paper.keyframe_choice import choose_as_printed
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import HalfKeyframes, Keyframes, PoseDistances

BETA_PRECISION = 0.01
"""Beta is searched to one part in a hundred: less than one keyframe in a hundred."""
MIN_BETA = 1e-4
"""Beta is not made smaller, player heights: contours are never exact to a tenth of a pixel."""
BETA_FACTOR = 0.96
"""Factor on beta from one attempt of the swap search to the next. What it lacks to 1, or one of the
two above, a quarter more or less, others with it: at most 1.3 points, 2.2 mm on four clips."""
MAX_SWAP_SIZE = 100_000
"""Keyframes times candidates up to which keyframes are reconsidered one by one: 50 keyframes of
a 2000-frame video. Larger choices stay as the greedy choice has them, for the sake of time."""
SUFFICIENT_BETA = 0.02
"""Pose distance that is near enough, player heights. On eight rendered sequences of 36 s, joints
of two frames .018 to .022 apart lie .031 player heights apart in the median (the mean of the upper
body's joints; .021 of the lower body's), and 86 % (99 %) of them within a fifth of the trunk,
before anything is carried or fitted; at .026 to .030 it is .045 (.032) and 73 % (91 %), at .010
to .014 .020 (.012). With 1.5 % of their frames the same sequences reach .020 to .029 (.022 to
.037): what is asked of videos of up to 36 s stays as it was."""


@dataclass(frozen=True)
class KeyframeOptions:
    """How many frames a person is asked to annotate, and what they must stand for."""

    budget: Annotated[float, within(1e-06, 1)] | None = None
    """The same as --budget.

    Annotation cost: (upper + lower keyframes) / 2 per frame of the video; None takes as many as
    reach the coverage at `sufficient_beta`, no fewer than half a minute would, and no more
    than is usual for as many frames as show the player (`usual_budget`).
    """
    sufficient_beta: Annotated[float, within(0.001, 1)] = SUFFICIENT_BETA
    """Pose distance that is near enough, player heights: without a budget, keyframes that reach
    the coverage with it are not added to. Smaller asks for more keyframes."""
    coverage: Annotated[float, within(0.01, 1)] = 0.95
    """The same as --coverage.

    alpha of Eq. 1: share of frames that are represented, or bridged by interpolation; the paper's
    (4.3). Of what lacks to 1 a quarter more or less: at most 1.3 points, 2.2 mm, others with it.
    """
    reach: Annotated[int, within(1, 1000)] = 10
    """The same as --reach.

    T of Eq. 1: longest gap to interpolate, in frames at 50 frames per second; other rates get as
    much time; the paper's (4.3). A quarter more or less, others with it: at most .9 points, 2.2 mm.
    """
    beta_upper: Annotated[float, within(0, 10)] | None = None
    """How much the upper body may differ from the keyframe that stands for it, player heights. Set,
    it decides how many keyframes there are, instead of the budget.

    beta of Eq. 1; None finds the smallest that the budget allows.
    """
    beta_lower: Annotated[float, within(0, 10)] | None = None
    """The same for the lower body."""
    smoothing: Annotated[float, within(0, 1)] = 0.6
    """How strongly pose distances are smoothed over time, 0 to 1; 0 hardly smooths.

    Share of consecutive frames whose distance lies below the beta of smoothing. method='paper'
    smooths with the beta of the choice instead. A quarter more: one of four clips of 6 s is 3.2 mm
    better, which a hundredth of all numbers of the choice moves by 2.6, as other frames are marked.
    """
    pose_time: Annotated[float, within(0, 1)] = 0.2
    """How much fast motion counts for more than waiting, 0 to 1; 0 counts every frame alike, as the
    paper does.

    Share of time that is measured in pose change: a frame counts as 1 less this, and this times how
    much faster than on average its pose changes. So strokes are covered as well as waiting. A
    quarter less: 4.6 mm better on that clip; keyframes/pose_time.py has what was tried.
    """
    form: Literal["both", "mean"] = "both"
    """Smoothed distances: rows then columns averaged ('both'), or the mean of both averages."""
    method: Literal["coverage", "paper"] = "coverage"
    """'coverage' needs fewer keyframes for the same coverage; 'paper' is the printed form."""


@dataclass(frozen=True, eq=False)
class HalfDistances:
    """Pose distances of one half of the body, and the coverage that its keyframes must reach."""

    pose_distances: PoseDistances
    matched: Float[np.ndarray, "M M"]
    smoothed: Float[np.ndarray, "M M"]
    """D of method='coverage'."""
    first_beta: float
    """Where the search for beta starts: frames as alike as neighbours in time."""
    exemplar_distance: Float[np.ndarray, "T"]
    reach: int
    max_uncovered_frames: int
    elapsed: Int[np.ndarray, "ends"]
    """Measured time before each frame and at the end, hundredths of a frame."""
    options: KeyframeOptions

    def distances(self, beta: float) -> Float[np.ndarray, "M M"]:
        """D for a choice with `beta`."""
        if self.options.method == "paper":
            return smooth_distances(self.matched, beta, self.options.form)
        return self.smoothed

    @cached_property
    def sufficient_goal(self) -> CoverageGoal:
        """The coverage goal at `KeyframeOptions.sufficient_beta`."""
        return self.goal(self.options.sufficient_beta)

    def goal(self, beta: float) -> CoverageGoal:
        """The coverage goal of keyframes that represent frames within `beta`."""
        hoods = find_neighborhoods(
            self.distances(beta), self.pose_distances, self.exemplar_distance, beta
        )
        visibility_score = self.pose_distances.visibility_score[self.pose_distances.frames]
        elapsed = None if self.options.method == "paper" else self.elapsed
        shot = shot_numbers(self.pose_distances)
        return CoverageGoal(
            hoods, self.reach, self.max_uncovered_frames, visibility_score, elapsed, shot
        )


def count_labels(options: KeyframeOptions, n_frames: int, fps: float) -> int:
    """Half-body labels that the budget allows in a video of `n_frames`.

    Raises KeyreconError where it is less than one for each half, and for impossible options.
    """
    if not 0 < options.coverage <= 1:
        raise KeyreconError(
            f"--coverage is a share of the frames, 0.95 for 95 %, not {options.coverage:g}."
        )
    if options.reach < 0:
        raise KeyreconError(f"--reach is a number of frames, not {options.reach}.")
    budget = usual_budget(n_frames, fps) if options.budget is None else options.budget
    check_budget(budget)
    labels = int(2 * budget * n_frames + 1e-9)
    if labels < 2 and None in (options.beta_upper, options.beta_lower):
        raise KeyreconError(
            f"A budget of {budget:.2%} of {n_frames} frames is {labels or 'no'} half of the body, "
            f"and the upper and the lower half each need one; --budget {1 / n_frames:.3f} or more "
            "allows that."
        )
    return labels


def choose_keyframes(
    comparison: PoseDistances,
    fps: float,
    options: KeyframeOptions = KeyframeOptions(),
    progress: Progress = silent,
) -> Keyframes:
    """Keyframes of both halves of the body within the budget.

    None in stretches without the player, nor of the lower body where it is out of the picture.
    Raises KeyreconError where the options ask for what cannot be (`count_labels`).
    """
    frames = len(comparison.row)
    reach = max(1, round(options.reach * fps / 50))
    kept = np.flatnonzero(~absent_frames(comparison, reach))
    # A budget that is set is a share of all frames; what is usual, of those with the player.
    counted = len(kept) if options.budget is None else frames
    labels = count_labels(options, counted, fps)
    halves: list[HalfKeyframes] = []
    flexible = options.budget is None and options.method == "coverage"
    least = min(least_labels(fps), labels) if flexible else labels
    betas = options.beta_upper, options.beta_lower
    names = progress(("upper", "lower"), "Choosing keyframes", 2)
    for index, (name, beta) in enumerate(zip(names, betas, strict=True)):
        shown = shown_frames(comparison, kept, index)
        part = select_frames(comparison, shown)
        half = half_distances(part, getattr(part, name), index, reach, options)
        also = np.flatnonzero(np.isin(shown, halves[0].frames if halves else []))
        of_both = ((count + 1 - index) // 2 for count in (least, labels))
        # what is shown for a part of the time has that part of the marks
        few, many = (max(1, round(count * len(shown) / len(kept))) for count in of_both)
        chosen = _choose_half(half, few, many, beta, also)
        halves.append(restore_frames(chosen, shown, frames))
    upper, lower = halves
    return Keyframes(upper, lower, reach=reach, alpha=options.coverage, method=options.method)


def half_distances(
    comparison: PoseDistances,
    matched: Float[np.ndarray, "M M"],
    index: int,
    reach: int,
    options: KeyframeOptions,
) -> HalfDistances:
    """One half of the body, the upper one with `index` 0."""
    step = comparison.consecutive_distance[index]
    step = step[np.isfinite(step)]
    same_pose = float(np.quantile(step, options.smoothing)) if step.size else 0.0
    return HalfDistances(
        pose_distances=comparison,
        matched=matched,
        smoothed=smooth_distances(matched, same_pose, options.form),
        first_beta=max(same_pose, MIN_BETA),
        exemplar_distance=comparison.exemplar_distance[index],
        reach=reach,
        max_uncovered_frames=int((1 - options.coverage) * len(comparison.row) + 1e-9),
        elapsed=elapsed_time(comparison, index, reach, options.pose_time),
        options=options,
    )


def _choose_half(
    half: HalfDistances,
    least: int,
    most: int,
    beta: float | None,
    also: Int[np.ndarray, "K"],
) -> HalfKeyframes:
    """Keyframes of one half, `least` to `most` of them where no beta is given.

    `also` are frames that are annotated for the other half anyway.
    """
    if beta is None:
        count = _sufficient_count(half, least, most) if least < most else most
        beta, chosen = _smallest_beta(half, count)
    else:
        count, chosen = 0, _fewest(half, half.goal(beta), len(half.matched))
    goal = half.goal(beta)
    if half.options.method == "coverage":
        chosen = _move_to_medoids(half, goal, chosen, count, also)
    return record_half(half, goal, beta, half.pose_distances.frames[np.sort(chosen)])


def _sufficient_count(half: HalfDistances, least: int, most: int) -> int:
    """Keyframes that reach the coverage at the distance that is near enough, within bounds.

    Of hours of video one frame stands for its neighbours in the comparison, and where these are
    farther from it than that, no keyframe covers them: then the coverage is a share of the others.
    """
    goal = half.sufficient_goal
    uncoverable = goal.uncovered_time(goal.hoods.union(list(range(len(half.matched)))))
    if uncoverable > goal.max_uncovered_time:
        goal = goal.excluding(uncoverable, half.options.coverage)
    chosen = _fewest(half, goal, most)
    return max(least, len(chosen)) if goal.reached(chosen) else most


def _fewest(half: HalfDistances, goal: CoverageGoal, most: int) -> list[int]:
    """Keyframes that reach the goal, if `most` of them do."""
    chosen = _choose(half, goal, most)
    few = len(chosen) * len(half.matched) <= MAX_SWAP_SIZE
    if few and half.options.method == "coverage" and goal.reached(chosen):
        chosen = shrink_by_swaps(goal, chosen)
    return chosen


def _choose(half: HalfDistances, goal: CoverageGoal, max_keyframes: int) -> list[int]:
    """Keyframes by the selected method, at most `max_keyframes`; the goal may be left unreached."""
    if half.options.method == "paper":
        return choose_as_printed(
            goal.hoods, goal.reach, goal.max_uncovered_frames, max_keyframes, goal.shot
        )
    # What the greedy choice takes too many can often be dropped again.
    chosen = choose_greedily(
        goal.hoods,
        goal.reach,
        goal.max_uncovered_time,
        max_keyframes + max_keyframes // 5 + 1,
        goal.visibility_score,
        goal.elapsed,
        goal.shot,
    )
    return drop_redundant(goal, chosen)[:max_keyframes]


def _smallest_beta(half: HalfDistances, max_keyframes: int) -> tuple[float, list[int]]:
    """The smallest beta with which so many keyframes reach the coverage, and such keyframes."""
    low, high = 0.0, half.first_beta
    goal = half.goal(high)
    chosen = _choose(half, goal, max_keyframes)
    while not goal.reached(chosen):
        low, high = high, 1.5 * high
        goal = half.goal(high)
        chosen = _choose(half, goal, max_keyframes)
    while high - low > max(BETA_PRECISION * high, MIN_BETA):
        middle = (low + high) / 2
        goal = half.goal(middle)
        fewer = _choose(half, goal, max_keyframes)
        if goal.reached(fewer):
            high, chosen = middle, fewer
        else:
            low = middle
    if half.options.method == "paper" or max_keyframes * len(half.matched) > MAX_SWAP_SIZE:
        return high, chosen
    return _lower_beta(half, max_keyframes, high, chosen)


def _lower_beta(
    half: HalfDistances, max_keyframes: int, beta: float, chosen: list[int]
) -> tuple[float, list[int]]:
    """Swap keyframes to do with a smaller beta still."""
    while beta * BETA_FACTOR > MIN_BETA:
        goal = half.goal(beta * BETA_FACTOR)
        start = choose_greedily(
            goal.hoods,
            goal.reach,
            goal.max_uncovered_time,
            max_keyframes,
            goal.visibility_score,
            goal.elapsed,
            goal.shot,
        )
        swapped = swap_for_coverage(goal, start)
        if not goal.reached(swapped):
            break
        beta, chosen = beta * BETA_FACTOR, swapped
    return beta, chosen


def _move_to_medoids(
    half: HalfDistances,
    goal: CoverageGoal,
    chosen: list[int],
    max_keyframes: int,
    also: Int[np.ndarray, "K"],
) -> list[int]:
    """Move keyframes to the middle of what they represent, away from unclear frames.

    What the budget still allows is spent on keyframes that reduce the distance furthest. A frame
    that is annotated for the other half anyway costs the person one frame less to look at,
    which is worth half a percent of the distance.
    """
    unclear = 2 - goal.visibility_score - 0.005 * np.isin(half.pose_distances.frames, also)
    row, time = half.pose_distances.row, np.diff(half.elapsed) / TIME_UNIT
    members = np.bincount(row, time, minlength=len(goal.visibility_score))
    distance = half.smoothed * unclear[:, None].astype(half.smoothed.dtype)
    weight = members.astype(distance.dtype)
    chosen = add_medoids(chosen, max_keyframes, distance, weight)
    if len(chosen) * len(half.matched) > MAX_SWAP_SIZE:
        return chosen
    return swap_medoids(goal, chosen, distance, weight)


def record_half(
    half: HalfDistances, goal: CoverageGoal, beta: float, keyframes: Int[np.ndarray, "K"]
) -> HalfKeyframes:
    """What keyframes of one half stand for; `goal` is that of `beta`."""
    comparison, exemplar_distance = half.pose_distances, half.exemplar_distance
    nearest, distance = assign_frames(
        half.distances(beta), comparison, exemplar_distance, keyframes
    )
    represented = represent_frames(
        goal.hoods, comparison, exemplar_distance[keyframes] < beta, keyframes
    )
    most = len(comparison.frames)
    printed = choose_as_printed(goal.hoods, goal.reach, goal.max_uncovered_frames, most, goal.shot)
    enough, of_enough = beta, goal
    if half.options.method == "coverage":
        enough, of_enough = half.options.sufficient_beta, half.sufficient_goal
    return HalfKeyframes(
        frames=keyframes,
        nearest=nearest,
        represented=represented,
        coverage=1 - goal.uncovered_frames(represented) / len(represented),
        beta=beta,
        distance=distance,
        printed_count=len(printed),
        gains=order_by_gain(of_enough, enough, comparison, keyframes),
    )
