"""Which leg is the left one, and which arm: one inference for each pair over the whole clip.

Silhouettes do not tell left from right, but limbs do not jump: two limbs can only be exchanged
where they meet in the picture. Exchanging them between two frames has a cost, by what motion says
against it (`limb_motion`): high wherever the limbs are apart, and low where they meet; where
legs cross, a planted foot stays and a swinging one goes on.

First, exchanges of identity that raise the probability of the motion are made (`undo_exchanges`),
which leaves two smooth trajectories, not yet known as left or right. Then a hidden Markov model
over the whole clip decides which is which. Its states are which trajectory is the left limb; its
transitions have the costs of an exchange. Marks fix the state, so that what a crossing leaves open
is decided by the next mark. Between marks the log odds come from the most similar annotated poses,
from what the joints of either arm look like on the marked frames, and from a rule learnt from
captures, of arms by the pose of the whole body (`side_model`). A pose that no mark resembles can
mislead for as long as it lasts: so a second pair of states ignores the log odds at a cost per
second, and a run of frames counts no more than that. The posterior probability of the state is
small where nothing decides.

Marked joints that optical flow follows were tried as further evidence. A leg that passes the other
hands its flow over, so that one mistake counts in every frame that follows: 3.3 % of the limbs of a
rendered sequence were exchanged with it, in one run of 117 frames, and .75 % of another; none of
either without it. On four real clips it changed nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int, Shaped

from keyrecon.body import Skeleton
from keyrecon.body_models.side_model import SideModel, arm_log_odds
from keyrecon.numerics.viterbi import find_cheapest_path, state_probabilities
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.limb_motion import exchange_cost, foot_exchange_cost
from keyrecon.propagation.mark_sides import exchange_evidence
from keyrecon.propagation.trajectory_smoothing import ACCELERATION_SPREAD
from keyrecon.records import Shots

TEMPLATE_RATE = 8.0
"""What similar annotated poses tell within a second, nats. On three real clips the most similar
pose has the legs the right way in 45 of 46 frames marked by eye. Half and twice this gave 2.4 and
2.9 % with a third of the marks. A rate by how often the marks themselves agree with those most like
them was tried: no fewer exchanges."""
APPEARANCE_RATE = 720.0
"""What the looks of an arm's joints tell within a second, nats per unit of likeness. On five real
clips with three choices of marks each 3.2 % of the limbs were exchanged without looks, 2.0 % with
half of this, 1.5 % with this and 1.7 % with twice this: arms above all, of which motion tells
little in a stroke. Legs are dressed alike, and what looks like the left one is the one in front, as
it was on the mark: of a run marked by eye in every frame 1.6 % of the frames have the legs
exchanged with a tenth of this, .8 % without (in six choices of marks; with half of the marks 1.5
and .8 %). A quarter more or less, others with it: at most 1.2 points, 2.1 mm on nine clips."""
POSE_RATE = 20.0
"""What the poses of whole bodies say of the arms counts so many times within a second. On eighteen
real clips with two choices of marks each, in frames that nobody marked, 1.9 % of the pairs of arms
were exchanged without it, 1.8 with 5 and 10, 1.4 with 20 and 1.3 with 40."""
DISTINCTION = 0.1
"""Difference in distance at which a joint belongs to the one side for certain, player heights. A
quarter more or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
MIN_THREAD_SECONDS = 0.1
"""Exchanges nearer in time than this are not made in one go: each alters the cost of the other. A
quarter more or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
MAX_ROUNDS = 20
"""Times that exchanges are made at most; three or four usually leave none that pays. A quarter more
or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
DOUBT_COST, DOUBT_RATE = 4.0, 20.0
"""Cost of beginning or ceasing to doubt what likeness to marks says, nats, and of a second of
doubt. On eighteen real clips with two choices of marks each, in frames that nobody marked, 2.5 % of
the pairs of arms were exchanged where it was always believed and where it was not asked at all, 2.0
% with 2 to 6 nats and 10 to 40 a second, 2.5 % with 8 nats; legs are the same throughout."""
MARK_COST = 1e3
"""Cost of other sides than marked. A quarter more or less, others with it: at most 1.5 points, 2.1
mm on nine clips."""


def template_log_odds(
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    poses: Complex[np.ndarray, "T S J"],
    fps: float,
) -> Float[np.ndarray, "T"]:
    """Log odds of the sides as they are against the exchanged by similar annotated poses that were
    fitted to each frame, nats."""
    sides = np.concatenate(half.sides)
    direct = np.abs(joints[:, None, sides] - poses[..., sides])
    crossed = np.abs(joints[:, None, half.mirror[sides]] - poses[..., sides])
    log_odds = np.clip((crossed - direct) / DISTINCTION, -1, 1)
    return TEMPLATE_RATE / fps * log_odds.mean(axis=(1, 2))


def appearance_log_odds(
    half: BodyHalf, unlikeness: Float[np.ndarray, "T 2 J"], fps: float
) -> Float[np.ndarray, "T"]:
    """The same log odds by whether joints look like marks of their own side or of the other.

    For arms alone (`APPEARANCE_RATE`).
    """
    sides = np.concatenate(half.sides)
    return APPEARANCE_RATE / fps * (unlikeness[:, 1, sides] - unlikeness[:, 0, sides]).mean(axis=1)


@dataclass(frozen=True, eq=False)
class LimbIdentity:
    """Left and right of one pair of limbs."""

    exchanged: Bool[np.ndarray, "T"]
    """Where what was taken for the one limb is the other."""
    probability: Float[np.ndarray, "T"]
    """Of these sides, 0-1."""
    exchange_evidence: Float[np.ndarray, "T"]
    """Log odds by the motion that left and right are exchanged in the marks of a frame, nats; 0
    without marks."""

    def apply(self, half: BodyHalf, values: Shaped[np.ndarray, "T J"]) -> Shaped[np.ndarray, "T J"]:
        """Values of joints, those of the sides exchanged where the sides are."""
        return exchange_sides(half, values, self.exchanged)


def exchange_sides(
    half: BodyHalf, values: Shaped[np.ndarray, "T J"], where: Bool[np.ndarray, "T"]
) -> Shaped[np.ndarray, "T J"]:
    """Values of joints, those of the sides exchanged in some frames."""
    mirror = np.arange(values.shape[1])
    mirror[np.concatenate(half.sides)] = half.mirror[np.concatenate(half.sides)]
    return np.where(where[:, None], values[:, mirror], values)


@dataclass(frozen=True, eq=False)
class ArmEvidence:
    """What the pose of the whole body says of its arms, by a model learnt from captures."""

    model: SideModel
    skeleton: Skeleton
    half: BodyHalf
    """The upper one."""
    others: Complex[np.ndarray, "T J"]
    """Joints of the other half, in the skeleton's order."""

    def part(self, frames: slice) -> "ArmEvidence":
        """Of some frames."""
        return replace(self, others=self.others[frames])

    def log_odds(self, joints: Complex[np.ndarray, "T j"], fps: float) -> Float[np.ndarray, "T"]:
        """Of the arms as they are against the exchanged, by these joints of the upper half and the
        others, nats."""
        body = self.others.copy()
        body[:, self.half.joints[self.half.free]] = joints[:, self.half.free]
        return POSE_RATE / fps * arm_log_odds(self.model, self.skeleton, body, fps)


@dataclass(frozen=True, eq=False)
class IdentityEvidence:
    """Evidence of which limb is the left one, other than motion and marks."""

    log_odds: Float[np.ndarray, "T"]
    """Of the sides as they are against the exchanged, by likeness to marks, nats."""
    ground: Complex[np.ndarray, "T"] | None = None
    """Path of the origin of the joints over the ground, for limbs that stand on it."""
    arms: ArmEvidence | None = None

    def part(self, frames: slice) -> "IdentityEvidence":
        """Of some frames."""
        ground = None if self.ground is None else self.ground[frames]
        return IdentityEvidence(self.log_odds[frames], ground, self.arms and self.arms.part(frames))


def identify_in_shots(
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    evidence: IdentityEvidence,
    marked: Int[np.ndarray, "K"],
    shots: Shots,
    fps: float,
) -> LimbIdentity:
    """Where the sides of one half of the body are exchanged, in every shot by itself."""
    identities = []
    for part in shots.parts:
        inside = marked[(marked >= part.start) & (marked < part.stop)] - part.start
        identities.append(identify_limbs(half, joints[part], evidence.part(part), inside, fps))
    return LimbIdentity(
        np.concatenate([one.exchanged for one in identities]),
        np.concatenate([one.probability for one in identities]),
        np.concatenate([one.exchange_evidence for one in identities]),
    )


def identify_limbs(
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    evidence: IdentityEvidence,
    marked: Int[np.ndarray, "K"],
    fps: float,
) -> LimbIdentity:
    """Where the sides of one half of the body are exchanged in one shot.

    In `marked` frames they are right.
    """
    pair = np.stack([joints[:, list(side)] for side in half.sides], axis=1)

    def costs_of(pair: Complex[np.ndarray, "T 2 j"]) -> Float[np.ndarray, "S"]:
        return motion_cost(half, pair, fps, evidence.ground)

    crossed, exchange_costs = undo_exchanges(pair, costs_of, round(MIN_THREAD_SECONDS * fps))
    log_odds = evidence.log_odds
    if evidence.arms is not None:  # it sees frames around, which must be of one trajectory
        trajectories = exchange_sides(half, joints, crossed)
        log_odds = log_odds + np.where(crossed, -1, 1) * evidence.arms.log_odds(trajectories, fps)
    cost = _side_costs(crossed, log_odds, np.isin(np.arange(len(pair)), marked), fps)
    other_belief = DOUBT_COST * np.kron(1 - np.eye(2), np.ones((2, 2)))

    def transition(_: int, t: int) -> Float[np.ndarray, "4 4"]:
        return other_belief + np.tile(exchange_costs[t - 1] * (1 - np.eye(2)), (2, 2))

    chance = state_probabilities(list(cost), transition)
    side = find_cheapest_path(list(cost), transition) % 2
    probability = (chance[:, :2] + chance[:, 2:])[np.arange(len(pair)), side]
    return LimbIdentity(
        side.astype(bool) ^ crossed,
        probability,
        exchange_evidence(crossed, exchange_costs, marked),
    )


def _side_costs(
    crossed: Bool[np.ndarray, "T"],
    log_odds: Float[np.ndarray, "T"],
    marked: Bool[np.ndarray, "T"],
    fps: float,
) -> Float[np.ndarray, "T 4"]:
    """Unary costs of the four states: which trajectory is left, with log odds used and ignored."""
    frames = np.arange(len(crossed))
    log_odds = np.where(marked, MARK_COST, np.stack([log_odds, np.zeros(len(log_odds))]))
    cost = np.zeros((len(crossed), 2, 2))
    for belief in (0, 1):
        cost[frames, belief, crossed.astype(int)] = np.maximum(-log_odds[belief], 0)
        cost[frames, belief, 1 - crossed] = np.maximum(log_odds[belief], 0)
    cost[:, 1] += DOUBT_RATE / fps
    cost[0, 1] += DOUBT_COST
    return cost.reshape(-1, 4)


def motion_cost(
    half: BodyHalf,
    pair: Complex[np.ndarray, "T 2 j"],
    fps: float,
    ground: Complex[np.ndarray, "T"] | None,
) -> Float[np.ndarray, "S"]:
    """Cost of exchanging two limbs between frames t and t + 1 by their motion, nats; S is T - 1.

    Of legs that stand on the ground only knees and ankles are asked: a hypothesis has its hips on
    the sides of the annotated pose that it comes from, whichever legs it found, so that they speak
    against every exchange (93 frames of a real run, in twelve choices of marks, have the legs
    exchanged with the hips, 58 without, 29 with feet that stand), and toes go with the ankle.
    """
    spread = ACCELERATION_SPREAD * 2.0 ** half.depth[list(half.sides[0])] * (50 / fps) ** 2
    if ground is None or half.limb_bones(half.sides[0]) is None:
        return exchange_cost(pair, spread)
    ankles = pair[:, :, 2] + ground[:, None]
    knees = exchange_cost(pair[:, :, 1:2], spread[1:2])
    return knees + foot_exchange_cost(ankles, float(spread[2]), fps)


def undo_exchanges(
    pair: Complex[np.ndarray, "T 2 j"],
    costs_of: Callable[[Complex[np.ndarray, "T 2 j"]], Float[np.ndarray, "S"]],
    apart: int,
) -> tuple[Bool[np.ndarray, "T"], Float[np.ndarray, "S"]]:
    """Frames in which to exchange two limbs so that both move as limbs do, and the cost of a
    further exchange between two frames, nats; S is T - 1.

    Exchanges that pay are made at once when they are at least `apart` frames from one another.
    """
    crossed = np.zeros(len(pair), dtype=bool)
    pair, exchange_costs = pair.copy(), costs_of(pair)
    for _ in range(MAX_ROUNDS):
        taken = _separate_minima(exchange_costs, apart)
        if not len(taken):
            break
        for gap in taken:
            crossed[gap + 1 :] ^= True
            pair[gap + 1 :] = pair[gap + 1 :, ::-1]
        exchange_costs = costs_of(pair)
    return crossed, np.maximum(exchange_costs, 0)


def _separate_minima(exchange_costs: Float[np.ndarray, "S"], apart: int) -> list[int]:
    """Where the cost is negative and lowest for some frames around."""
    taken: list[int] = []
    for gap in np.argsort(exchange_costs, kind="stable").tolist():
        if exchange_costs[gap] >= 0:
            break
        if all(abs(gap - other) > apart for other in taken):
            taken.append(gap)
    return taken
