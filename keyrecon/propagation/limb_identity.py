"""Which leg is the left one, and which arm: one inference for each pair over the whole clip.

Silhouettes do not tell left from right, but limbs do not jump: two limbs can only be exchanged
where they meet in the picture. Between two frames, each joint is predicted from all frames before
by a Kalman filter with constant velocity, and from all frames after by the same filter run
backwards; what the predictions speak against exchanging the limbs there is the price of doing so.
It is high wherever the limbs are apart, and low where they meet; where they cross, a planted foot
stays and a swinging one goes on.

First, exchanges that are themselves against the laws of motion are undone, so that there are two
threads without a name. Then a chain of two states (the one thread is left, or the other) with these
prices is solved for the whole clip: marks fix the state, so that what a crossing leaves open is
decided by the next mark; in between, the annotated poses that are most like a frame say which is
which, and so does what the joints of either side look like on the marked frames. The probability
that the chain gives to its states is small where nothing decides.

Marked joints that optical flow follows were tried as further evidence. A leg that passes the other
hands its flow over, so that one mistake counts in every frame that follows: 3.3 % of the limbs of a
rendered sequence were exchanged with it, in one run of 117 frames, and .75 % of another; none of
either without it. On four real clips it changed nothing.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float, Int, Shaped

from keyrecon.numerics.viterbi import find_cheapest_path, state_probabilities
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.trajectory_smoothing import ACCELERATION_SPREAD
from keyrecon.records import Shots

PLACE_SPREAD = 0.03
"""Error of a hypothesis's joint, player heights. The weights below and this were tried on six
rendered sequences with all of their marks (.12 % of limbs exchanged, .34 % without this stage), and
on five with a third of them (2.1 %, without 3.0): half and twice this gave 2.8 and 2.4 % there."""
MISFIT_TAIL = 8.0
"""Misfit of a joint's prediction, nats, from which on it grows like its logarithm only: hypotheses
jump, and a jump of one joint should not outweigh the others."""
MOTION_WEIGHT = 0.5
"""Weight of what motion says: hypotheses of neighbouring frames err together. Half and twice this
gave 2.9 and 2.4 % with a third of the marks."""
TEMPLATE_RATE = 8.0
"""What similar annotated poses tell within a second, nats. On three real clips the most similar
pose has the legs the right way in 45 of 46 frames marked by eye. Half and twice this gave 2.4 and
2.9 % with a third of the marks. A rate by how often the marks themselves agree with those most like
them was tried: no fewer exchanges."""
APPEARANCE_RATE = 720.0
"""What the looks of joints tell within a second, nats per unit of likeness. On five real clips with
three choices of marks each 3.2 % of the limbs were exchanged without looks, 2.0 % with half of
this, 1.5 % with this and 1.7 % with twice this: arms above all, of which motion tells little in a
stroke."""
DISTINCTION = 0.1
"""Difference in distance at which a joint belongs to the one side for certain, player heights."""
MIN_THREAD_SECONDS = 0.1
"""Exchanges nearer in time than this are not made in one go: each spoils the price of the other."""
MAX_ROUNDS = 20
"""Times that exchanges are made at most; three or four usually leave none that pays."""
MARK_COST = 1e3
"""Cost of other sides than marked."""
STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
"""Place and velocity one frame later."""
REVERSE = np.array([1.0, -1.0])
"""Place and velocity as seen backwards in time."""


def template_gain(
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    poses: Complex[np.ndarray, "T S J"],
    fps: float,
) -> Float[np.ndarray, "T"]:
    """What similar annotated poses, fitted to each frame, say for the sides as they are and against
    the exchanged, nats."""
    sides = np.concatenate(half.sides)
    direct = np.abs(joints[:, None, sides] - poses[..., sides])
    crossed = np.abs(joints[:, None, half.mirror[sides]] - poses[..., sides])
    gain = np.clip((crossed - direct) / DISTINCTION, -1, 1)
    return TEMPLATE_RATE / fps * gain.mean(axis=(1, 2))


def appearance_gain(
    half: BodyHalf, unlikeness: Float[np.ndarray, "T 2 J"], fps: float
) -> Float[np.ndarray, "T"]:
    """What joints that look like marks of their own side, or of the other, say likewise."""
    sides = np.concatenate(half.sides)
    return APPEARANCE_RATE / fps * (unlikeness[:, 1, sides] - unlikeness[:, 0, sides]).mean(axis=1)


@dataclass(frozen=True, eq=False)
class LimbIdentity:
    """Left and right of one pair of limbs."""

    exchanged: Bool[np.ndarray, "T"]
    """Where what was taken for the one limb is the other."""
    probability: Float[np.ndarray, "T"]
    """Of these sides, 0-1."""

    def apply(self, half: BodyHalf, values: Shaped[np.ndarray, "T J"]) -> Shaped[np.ndarray, "T J"]:
        """Values of joints, those of the sides exchanged where the sides are."""
        mirror = np.arange(values.shape[1])
        mirror[np.concatenate(half.sides)] = half.mirror[np.concatenate(half.sides)]
        return np.where(self.exchanged[:, None], values[:, mirror], values)


def identify_in_shots(
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    gain: Float[np.ndarray, "T"],
    marked: Int[np.ndarray, "K"],
    shots: Shots,
    fps: float,
) -> LimbIdentity:
    """Where the sides of one half of the body are exchanged, in every shot by itself."""
    identities = []
    for part in shots.parts:
        inside = marked[(marked >= part.start) & (marked < part.stop)] - part.start
        identities.append(identify_limbs(half, joints[part], gain[part], inside, fps))
    return LimbIdentity(
        np.concatenate([one.exchanged for one in identities]),
        np.concatenate([one.probability for one in identities]),
    )


def identify_limbs(
    half: BodyHalf,
    joints: Complex[np.ndarray, "T J"],
    gain: Float[np.ndarray, "T"],
    marked: Int[np.ndarray, "K"],
    fps: float,
) -> LimbIdentity:
    """Where the sides of one half of the body are exchanged in one shot.

    In `marked` frames they are right. `gain` is what is known for the sides as they are and against
    the exchanged, nats.
    """
    sides = [list(side) for side in half.sides]
    pair = np.stack([joints[:, side] for side in sides], axis=1)
    spread = ACCELERATION_SPREAD * 2.0 ** half.depth[sides[0]] * (50 / fps) ** 2
    crossed, price = untangle_threads(pair, spread, round(MIN_THREAD_SECONDS * fps))
    frames = np.arange(len(pair))
    gain = np.where(np.isin(frames, marked), MARK_COST, gain)
    cost = np.zeros((len(pair), 2))
    cost[frames, crossed.astype(int)] = np.maximum(-gain, 0)
    cost[frames, 1 - crossed] = np.maximum(gain, 0)

    def transition(_: int, t: int) -> Float[np.ndarray, "2 2"]:
        return price[t - 1] * (1 - np.eye(2))

    probability = state_probabilities(list(cost), transition)
    state = find_cheapest_path(list(cost), transition)
    return LimbIdentity(state.astype(bool) ^ crossed, probability[frames, state])


def untangle_threads(
    pair: Complex[np.ndarray, "T 2 j"], spread: Float[np.ndarray, "j"], apart: int
) -> tuple[Bool[np.ndarray, "T"], Float[np.ndarray, "S"]]:
    """Where to exchange two limbs so that both move as limbs do, and the price of each further
    exchange between two frames, nats; S is T - 1.

    Exchanges that pay are made at once when they are at least `apart` frames from one another.
    """
    crossed = np.zeros(len(pair), dtype=bool)
    pair, price = pair.copy(), exchange_price(pair, spread)
    for _ in range(MAX_ROUNDS):
        taken = _separate_minima(price, apart)
        if not len(taken):
            break
        for gap in taken:
            crossed[gap + 1 :] ^= True
            pair[gap + 1 :] = pair[gap + 1 :, ::-1]
        price = exchange_price(pair, spread)
    return crossed, np.maximum(price, 0)


def _separate_minima(price: Float[np.ndarray, "S"], apart: int) -> list[int]:
    """Where a price is negative and lowest for some frames around."""
    taken: list[int] = []
    for gap in np.argsort(price, kind="stable").tolist():
        if price[gap] >= 0:
            break
        if all(abs(gap - other) > apart for other in taken):
            taken.append(gap)
    return taken


def exchange_price(
    pair: Complex[np.ndarray, "T 2 j"], spread: Float[np.ndarray, "j"]
) -> Float[np.ndarray, "S"]:
    """What motion says against exchanging two limbs between frames t and t + 1, nats.

    `spread` is the standard deviation of each joint's second difference.
    """
    ahead, ahead_spread = _filter_motion(pair, spread)
    back, back_spread = _filter_motion(pair[::-1], spread)
    back = back[::-1] * REVERSE[:, None, None]
    back_spread = back_spread[::-1] * np.outer(REVERSE, REVERSE)
    predicted = np.einsum("ab,tbpj->tapj", STEP, ahead[:-1])
    total = STEP @ ahead_spread[:-1] @ STEP.T + _process_noise(spread) + back_spread[1:]
    precision = np.linalg.inv(total)

    def misfit(gap: Complex[np.ndarray, "S 2 2 j"]) -> Float[np.ndarray, "S"]:
        square = np.einsum("tapj,tjab,tbpj->tpj", gap.conj(), precision, gap).real
        return MOTION_WEIGHT * MISFIT_TAIL * np.log1p(square / 2 / MISFIT_TAIL).sum(axis=(1, 2))

    straight = misfit(predicted - back[1:])
    return misfit(predicted - back[1:, :, ::-1]) - straight


def _process_noise(spread: Float[np.ndarray, "j"]) -> Float[np.ndarray, "j 2 2"]:
    """Of place and velocity, by an acceleration that changes from frame to frame."""
    return spread[:, None, None] ** 2 * np.array([[0.25, 0.5], [0.5, 1.0]])


def _filter_motion(
    places: Complex[np.ndarray, "T 2 j"], spread: Float[np.ndarray, "j"]
) -> tuple[Complex[np.ndarray, "T 2 2 j"], Float[np.ndarray, "T j 2 2"]]:
    """Place and velocity of every joint from all frames up to each, and their covariance."""
    noise = _process_noise(spread)
    state = np.zeros((2, *places.shape[1:]), dtype=complex)
    state[0] = places[0]
    covariance = np.zeros((len(spread), 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = PLACE_SPREAD**2, (6 * spread) ** 2
    states, covariances = [], []
    for t, place in enumerate(places):
        if t:
            state = np.stack([state[0] + state[1], state[1]])
            covariance = STEP @ covariance @ STEP.T + noise
        gain = covariance[:, :, 0] / (covariance[:, :1, 0] + PLACE_SPREAD**2)
        state = state + gain.T[:, None] * (place - state[0])
        covariance = covariance - gain[:, :, None] * covariance[:, :1]
        states.append(state)
        covariances.append(covariance)
    return np.stack(states), np.stack(covariances)
