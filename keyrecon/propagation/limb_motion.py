"""Cost of exchanging the identity of two limbs between two frames, by their motion.

Between two frames, each joint is predicted from all frames before by a Kalman filter with constant
velocity, and from all frames after by the same filter run backwards. The cost is how much better
the predictions agree without an exchange than with one, nats. It is high wherever the limbs are
apart, and low where they meet.

A foot does not move like that: it stands, and then it swings. Where the legs of a runner meet, one
foot stands and the other passes it; to a filter of constant velocity it is hardly dearer that the
foot which comes stops there and the one which stood leaves. So feet are filtered over the ground
by both motions at once, each as probable as the feet make it (interacting multiple models, Blom and
Bar-Shalom, IEEE Transactions on Automatic Control 1988): to exchange them there, both must change
from the one motion to the other in that very frame.

Optical flow was tried as well. Of the velocity that it tells of a foot, as a measurement for the
filter: 4.7 % of the frames of a runner had the legs exchanged with it, 3.3 % without; a swinging
foot is blurred, and flow has the ground beside it. What flow says in one step from leg to leg says
nothing where they meet.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Complex, Float

PLACE_SPREAD = 0.03
"""Error of a hypothesis's joint, player heights. The weights below and this were tried on six
rendered sequences with all of their marks (.12 % of limbs exchanged, .34 % without this stage), and
on five with a third of them (2.1 %, without 3.0): half and twice this gave 2.8 and 2.4 % there."""
MISFIT_TAIL = 8.0
"""Misfit of a joint's prediction, nats, from which on it grows like its logarithm only: hypotheses
jump, and a jump of one joint should not outweigh the others. A quarter more or less, others with
it: at most 1.2 points, 2.1 mm on nine clips."""
MOTION_WEIGHT = 0.5
"""Weight of what motion says: hypotheses of neighbouring frames err together. Half and twice this
gave 2.9 and 2.4 % with a third of the marks. A quarter more or less, others with it: at most 1.5
points, 2.1 mm on nine clips."""
STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
"""Place and velocity one frame later. Kinematics: there is nothing to tune."""
REVERSE = np.array([1.0, -1.0])
"""Place and velocity as seen backwards in time. Kinematics: there is nothing to tune."""
STANDING, SWINGING = 0, 1
"""The two motions of a foot."""
PHASE_SECONDS = 0.3
"""How long a foot stands, or swings: a tenth of a second in a sprint, half a second in a walk. With
.2 and .5 as many frames were exchanged, within a twentieth. A quarter more or less, others with it:
at most 1.2 points, 2.1 mm on nine clips."""
STANDING_DRIFT = 0.4
"""Random walk of a standing foot's ankle, player heights per second: the heel rises. Frames with
legs exchanged in twelve choices of marks of a real run (of 3408): 29 with this, 49 and 35 with half
and with one and a half times it. A quarter more or less, others with it: at most 1.5 points, 2.1 mm
on nine clips."""
SWINGING_SPEED = 3.0
"""Standard deviation of the speed of a foot that swings, player heights per second: 5 m/s. 2 or 5
gave as many, within a seventh."""
LEAST = 1e-12
"""Probability that counts as none. A quarter more or less, others with it: at most 1.2 points, 2.1
mm on nine clips."""


def exchange_cost(
    pair: Complex[np.ndarray, "T 2 j"], spread: Float[np.ndarray, "j"]
) -> Float[np.ndarray, "S"]:
    """Cost of exchanging two limbs between frames t and t + 1 by their motion, nats; S is T - 1.

    `spread` is the standard deviation of each joint's second difference.
    """
    both, ahead_spread = filter_motion(np.concatenate([pair, pair[::-1]], axis=1), spread)
    ahead, back = both[:, :, :2], both[::-1, :, 2:] * REVERSE[:, None, None]
    back_spread = ahead_spread[::-1] * np.outer(REVERSE, REVERSE)
    predicted = np.einsum("ab,tbpj->tapj", STEP, ahead[:-1])
    total = STEP @ ahead_spread[:-1] @ STEP.T + _process_noise(spread) + back_spread[1:]
    precision = np.linalg.inv(total)

    def misfit(gap: Complex[np.ndarray, "S 2 2 j"]) -> Float[np.ndarray, "S"]:
        square = np.einsum("tapj,tjab,tbpj->tpj", gap.conj(), precision, gap).real
        return MOTION_WEIGHT * _tail(square).sum(axis=(1, 2))

    straight = misfit(predicted - back[1:])
    return misfit(predicted - back[1:, :, ::-1]) - straight


def _tail(square: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Misfit by squared error in standard deviations, nats."""
    return MISFIT_TAIL * np.log1p(square / 2 / MISFIT_TAIL)


def _process_noise(spread: Float[np.ndarray, "j"]) -> Float[np.ndarray, "j 2 2"]:
    """Of place and velocity, by an acceleration that changes from frame to frame."""
    return spread[:, None, None] ** 2 * np.array([[0.25, 0.5], [0.5, 1.0]])


def filter_motion(
    places: Complex[np.ndarray, "T n j"], spread: Float[np.ndarray, "j"]
) -> tuple[Complex[np.ndarray, "T 2 n j"], Float[np.ndarray, "T j 2 2"]]:
    """Place and velocity of every joint from all frames up to each, and their covariance, which is
    that of any places."""
    gains, covariances = _filter_gains(len(places), tuple(spread.tolist()))
    states = np.zeros((len(places), 2, *places.shape[1:]), dtype=complex)
    place, velocity = places[0], np.zeros(places.shape[1:], dtype=complex)
    for t, seen in enumerate(places):
        if t:
            place = place + velocity
        gap = seen - place
        place, velocity = place + gains[t, 0] * gap, velocity + gains[t, 1] * gap
        states[t, 0], states[t, 1] = place, velocity
    return states, covariances


@lru_cache(maxsize=4)
def _filter_gains(
    frames: int, spread: tuple[float, ...]
) -> tuple[Float[np.ndarray, "T 2 j"], Float[np.ndarray, "T j 2 2"]]:
    """Kalman gains of place and velocity, and covariances: any places have the same, and limbs are
    filtered again and again while exchanges are tried."""
    deviation = np.array(spread)
    noise = _process_noise(deviation)
    gains, covariances = np.zeros((frames, 2, len(spread))), np.zeros((frames, len(spread), 2, 2))
    covariance = np.zeros((len(spread), 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = PLACE_SPREAD**2, (6 * deviation) ** 2
    for t in range(frames):
        if t:
            covariance = STEP @ covariance @ STEP.T + noise
        gain = covariance[:, :, 0] / (covariance[:, :1, 0] + PLACE_SPREAD**2)
        covariance = covariance - gain[:, :, None] * covariance[:, :1]
        gains[t], covariances[t] = gain.T, covariance
    for kept in (gains, covariances):
        kept.flags.writeable = False
    return gains, covariances


@dataclass(frozen=True, eq=False)
class _FootMotion:
    """How feet move from one frame to the next."""

    transition: Float[np.ndarray, "2 2"]
    """Probability of each motion (second axis) after each (first axis)."""
    noise: Float[np.ndarray, "2 2 2"]
    """Of place and velocity in a step of each motion."""
    speed: float
    """Standard deviation of the speed of a foot that swings, player heights per frame."""

    @classmethod
    def of(cls, spread: float, fps: float) -> "_FootMotion":
        """`spread` is the standard deviation of the second difference of a swinging foot."""
        transition = min(1 / (PHASE_SECONDS * fps), 0.5)
        standing = np.diag([(STANDING_DRIFT / fps) ** 2, 0.0])
        swinging = _process_noise(np.array([spread]))[0]
        return cls(
            np.array([[1 - transition, transition], [transition, 1 - transition]]),
            np.stack([standing, swinging]),
            SWINGING_SPEED / fps,
        )

    def predict(
        self, state: Complex[np.ndarray, "*n 2 2"], covariance: Float[np.ndarray, "*n 2 2 2"]
    ) -> tuple[Complex[np.ndarray, "*n 2 2 2"], Float[np.ndarray, "*n 2 2 2 2"]]:
        """The same feet one frame later by each motion (first) that follows on each (second).

        A foot that stands has no velocity, and one that begins to swing may have any.
        """
        state = np.stack([state, state], axis=-3)
        covariance = np.stack([covariance, covariance], axis=-4)
        state[..., STANDING, :, 1] = 0
        covariance[..., STANDING, :, 1, :] = covariance[..., STANDING, :, :, 1] = 0
        covariance[..., SWINGING, STANDING, 1, 1] = self.speed**2
        return state @ STEP.T, STEP @ covariance @ STEP.T + self.noise[:, None]


@dataclass(frozen=True, eq=False)
class _FootEstimate:
    """Place and velocity of feet by either motion, and how probable that motion is."""

    state: Complex[np.ndarray, "*n 2 2"]
    covariance: Float[np.ndarray, "*n 2 2 2"]
    probability: Float[np.ndarray, "*n 2"]


def foot_exchange_cost(
    feet: Complex[np.ndarray, "T 2"], spread: float, fps: float
) -> Float[np.ndarray, "S"]:
    """Cost of exchanging two feet between frames t and t + 1 by their motion, nats; S is T - 1.

    `feet` are places on the ground as the camera sees it, player heights: a foot that stands stays
    where it is. `spread` is the standard deviation of the second difference of a swinging foot.
    """
    motion = _FootMotion.of(spread, fps)
    both = _filter_feet(np.concatenate([feet, feet[::-1]], axis=1), motion)
    ahead = motion.predict(both.state[:-1, :2], both.covariance[:-1, :2])
    back = both.state[::-1, 2:][1:] * REVERSE
    back_spread = both.covariance[::-1, 2:][1:] * np.outer(REVERSE, REVERSE)
    # of a foot that stands afterwards, the velocity before is not asked
    back_spread[..., STANDING, 1, 1] += motion.speed**2
    # axes: gap, foot before, foot after, motion after, motion before
    gap = ahead[0][:, :, None] - back[:, None, :, :, None]
    total = ahead[1][:, :, None] + back_spread[:, None, :, :, None]
    one, other = both.probability[:-1, :2], both.probability[::-1, 2:][1:]
    chance = one[:, :, None, None] * motion.transition.T * other[:, None, :, :, None]
    square = np.einsum("...a,...ab,...b->...", gap.conj(), np.linalg.inv(total), gap).real
    fit = np.log(np.maximum(chance, LEAST)) - _tail(square) - np.log(np.linalg.det(total))
    likely = np.logaddexp.reduce(fit, axis=(3, 4))
    straight, crossed = likely[:, 0, 0] + likely[:, 1, 1], likely[:, 0, 1] + likely[:, 1, 0]
    return MOTION_WEIGHT * (straight - crossed)


def _filter_feet(feet: Complex[np.ndarray, "T f"], motion: _FootMotion) -> _FootEstimate:
    """What all frames up to each say of every foot, by interacting multiple models."""
    count = feet.shape[1]
    state = np.zeros((count, 2, 2), complex)
    state[..., 0] = feet[0][:, None]
    covariance = np.zeros((count, 2, 2, 2))
    covariance[..., 0, 0], covariance[:, SWINGING, 1, 1] = PLACE_SPREAD**2, motion.speed**2
    probability = np.full((count, 2), 0.5)
    estimates = [(state, covariance, probability)]
    for places in feet[1:]:
        before = probability[:, None] * motion.transition.T
        probability = before.sum(axis=2)
        share = (before / probability[..., None])[..., None]
        states, covariances = motion.predict(state, covariance)
        state = (share * states).sum(axis=2)
        apart = states - state[:, :, None]
        covariances += (apart[..., None] * apart[..., None, :].conj()).real
        covariance = (share[..., None] * covariances).sum(axis=2)
        # as in any Kalman filter, by either motion
        variance = covariance[..., 0, 0] + PLACE_SPREAD**2
        gain, gap = covariance[..., 0] / variance[..., None], places[:, None] - state[..., 0]
        state = state + gain * gap[..., None]
        covariance = covariance - gain[..., None] * covariance[..., :1, :]
        fit = np.log(probability) - _tail(np.abs(gap) ** 2 / variance) - np.log(variance)
        probability = np.exp(fit - np.logaddexp.reduce(fit, axis=1)[:, None])
        estimates.append((state, covariance, np.maximum(probability, LEAST)))
    return _FootEstimate(*(np.stack(parts) for parts in zip(*estimates, strict=True)))
