"""Frames in which left and right of arms or legs look exchanged.

Three things tell, each positive where sides are as they should be: the poses of similar marked
frames fit the marks better as they are than exchanged (`neighbours`), the limbs look more like
their own side on other frames than like the other (`mark_appearance`), and shoulders and hips face
the same way. Each may be against an exchange as well as for it; they are added. Once there is a
motion it tells besides whether limbs had to pass through one another on the way from the marks
before to those after (`propagation.mark_sides`); it is independent of them, so the odds multiply.

Frames only say of one another whether they agree. Which of them is wrong is decided by the
majority: the limb whose exchange ends most disagreement is taken to be exchanged, and again, until
none is left worth it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.annotate.assist.mark_appearance import MarkAppearance
from keyrecon.annotate.assist.neighbours import Neighbours
from keyrecon.annotate.assist.suspicion import LEAST_EVIDENCE, MIN_SUSPICION, Check, suspicion
from keyrecon.body import Skeleton
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.records import Annotations, Motion

MAX_JOINT_DISTANCE = 0.15
"""Distance at which a joint counts as elsewhere, player heights: half a thigh."""
POOR_FIT_DISTANCE = 0.06
"""Mean distance of a fitted pose's joints, left and right as they agree better, at which it says
half as much about left and right, player heights."""
SEEN_BREADTH = 0.08
"""Length in the picture from which shoulders or hips tell which way they face, body heights."""
EVEN_DISAGREEMENT = 1.75
"""Frames that speak for an exchange, less those against it, at which it is as likely as not. With
the next two chosen on nine real clips (benchmarks/checks.py): see `checks.EVEN_UNLIKE`."""
EVEN_LIKENESS = 0.038
"""The same for looks: how much more a limb looks like the other side, times how much more limbs
look like their own side in the median of the frames. Where both sides look the same they say
nothing."""
EVEN_OPPOSITE = 0.86
"""How opposite shoulders and hips are when they are as likely wrong as not, 0-1."""
SAME_PX = 0.01
"""A mark that a motion has nearer than this is the one that it was made from."""
BY_CHANCE = 3.0
"""Nats for an exchange that are said of right marks, too: up to .5 of 170 right ones of four real
clips and a rendered one, 2 of one in whose neighbourhood another mark was moved."""
MOST_NATS = 40.0
"""What a motion says is counted up to this."""
LEAST_TOTAL = 0.3
"""What the three say is not believed more than this against an exchange: odds of 1 to 120, which a
motion alone may outweigh."""
LIMBS = ("arms", "legs")


@dataclass(frozen=True, eq=False)
class SideEvidence:
    """What speaks for an exchange in K frames, in units at which it is as likely as not."""

    poses: Float[np.ndarray, "2 K"]
    """Of arms, then of legs."""
    looks: Float[np.ndarray, "2 K"]
    opposite: Float[np.ndarray, "K"]
    """Shoulders against hips."""
    motion: Float[np.ndarray, "2 K"]
    """Of limbs between the frames, nats; 0 where it is not known."""

    @property
    def still(self) -> Float[np.ndarray, "2 K"]:
        """What the frames by themselves say."""
        return self.poses + self.looks + self.opposite

    @property
    def total(self) -> Float[np.ndarray, "2 K"]:
        """All together: odds are the fourth power of a residual (`suspicion`)."""
        alone = np.where(self.motion == 0, self.still, np.maximum(self.still, LEAST_TOTAL))
        return alone * np.exp(np.clip(self.motion, -MOST_NATS, MOST_NATS) / 4)


def find_exchanges(
    annotations: Annotations,
    size: BodySize,
    neighbours: tuple[Neighbours, ...],
    appearance: MarkAppearance | None,
    motion: Float[np.ndarray, "K 2"] | None = None,
) -> Iterator[Check]:
    """The most suspicious first; `motion` as in `JointTracks.exchange_evidence`."""
    if not len(annotations.frames):
        return
    facing = measure_facing(annotations, size)
    if motion is None:
        motion = np.zeros((len(annotations.frames), 2))
    exchanged = np.zeros((2, len(annotations.frames)), dtype=bool)
    while True:
        evidence = _weigh(annotations, neighbours, appearance, facing, exchanged)
        evidence = replace(evidence, motion=motion.T[::-1])
        total = np.where(exchanged, -np.inf, evidence.total)
        limb, row = np.unravel_index(int(total.argmax()), total.shape)
        doubt = suspicion(float(total[limb, row]))
        if doubt < LEAST_EVIDENCE:
            return
        exchanged[limb, row] = True
        yield _describe(annotations, int(limb), int(row), doubt, evidence, neighbours)


def evidence_of_motion(
    annotations: Annotations, motion: Motion | None
) -> Float[np.ndarray, "K 2"] | None:
    """What a motion says for exchanged sides of the marks that it was made from, nats, beyond what
    it says of right marks now and then (`BY_CHANCE`).

    0 for halves of the body that were marked anew since, and where no joint beyond shoulders or
    hips is marked on both sides: what was filled in for one limb is no mark that could be
    exchanged. None without a motion that tells.
    """
    if motion is None or motion.exchange_evidence is None:
        return None
    if len(annotations.frames) and annotations.frames[-1] >= len(motion.time):
        return None
    moved = np.abs(motion.points2d_propagated[annotations.frames] - annotations.joints).max(axis=2)
    same = ~(moved > SAME_PX) & np.isfinite(motion.points2d_propagated[annotations.frames, :, 0])
    lower = annotations.skeleton.is_lower
    kept = np.stack([same[:, half].all(axis=1) for half in (lower, ~lower)], axis=1)
    kept &= _both_sides_marked(annotations)
    said = np.where(kept, motion.exchange_evidence[annotations.frames], 0.0)
    return np.minimum(said, 0.0) + np.maximum(said - BY_CHANCE, 0.0)


def _both_sides_marked(annotations: Annotations) -> Bool[np.ndarray, "K 2"]:
    """Whether legs, and arms, have a joint beyond hips and shoulders that is marked on both
    sides."""
    skeleton, marked = annotations.skeleton, np.isfinite(annotations.joints[:, :, 0])
    outer = np.array([name.split("_")[-1] not in ("hip", "shoulder") for name in skeleton.names])
    paired = (skeleton.mirror != np.arange(len(outer))) & outer
    both = marked & marked[:, skeleton.mirror] & paired
    halves = (skeleton.is_lower, ~skeleton.is_lower)
    return np.stack([both[:, half].any(axis=1) for half in halves], axis=1)


def measure_facing(annotations: Annotations, size: BodySize) -> Float[np.ndarray, "K"]:
    """Whether shoulders and hips of each frame point the same way from right to left, -1 to 1.

    A trunk twists by less than a right angle. Near 0 where they are seen end on, 0 where they are
    not marked.
    """
    names = annotations.skeleton.names
    corners = [f"{side}_{part}" for part in ("shoulder", "hip") for side in ("right", "left")]
    if not {*corners} <= {*names}:
        return np.zeros(len(annotations.frames))
    right_shoulder, left_shoulder, right_hip, left_hip = (
        annotations.joints[:, names.index(corner)] for corner in corners
    )
    across = np.stack([left_shoulder - right_shoulder, left_hip - right_hip])
    across /= size.scale[annotations.frames][:, None]
    length = np.linalg.norm(across, axis=2)
    alike = (across[0] * across[1]).sum(axis=1) / np.maximum(length[0] * length[1], 1e-9)
    return np.nan_to_num(alike * np.minimum(length.min(axis=0) / SEEN_BREADTH, 1.0))


def _weigh(
    annotations: Annotations,
    neighbours: tuple[Neighbours, ...],
    appearance: MarkAppearance | None,
    facing: Float[np.ndarray, "K"],
    exchanged: Bool[np.ndarray, "2 K"],
) -> SideEvidence:
    """Evidence while some limbs are taken to be exchanged."""
    skeleton, poses = annotations.skeleton, np.zeros(exchanged.shape)
    for half in neighbours:
        limb = int(skeleton.is_lower[half.members].all())
        rows = np.searchsorted(annotations.frames, half.frames)
        poses[limb, rows] = _disagreement(half, skeleton, exchanged[limb, rows])
    looks = np.zeros(exchanged.shape)
    if appearance is not None:
        looks = np.stack([_unlikeness(appearance, limb, exchanged[limb]) for limb in range(2)])
    turned = np.where(exchanged[0] ^ exchanged[1], -facing, facing)
    return SideEvidence(
        poses / EVEN_DISAGREEMENT,
        looks / EVEN_LIKENESS,
        -turned / EVEN_OPPOSITE,
        np.zeros(exchanged.shape),
    )


def _disagreement(
    half: Neighbours, skeleton: Skeleton, exchanged: Bool[np.ndarray, "K"]
) -> Float[np.ndarray, "K"]:
    """Frames that speak for an exchange less those against it: those whose poses were fitted to a
    frame, and those that its pose was fitted to."""
    gain = _swap_gain(half, skeleton)
    evidence = np.where(exchanged[:, None] == exchanged[half.sources], gain, -gain)
    total = evidence.sum(axis=1)
    np.add.at(total, half.sources, evidence)
    return total


def _swap_gain(half: Neighbours, skeleton: Skeleton) -> Float[np.ndarray, "K S"]:
    """How much nearer the joints of a limb are to those of the other side, -1 to 1."""
    paired = np.flatnonzero(skeleton.mirror[half.members] != half.members)
    twin = np.array([list(half.members).index(skeleton.mirror[j]) for j in half.members[paired]])
    straight = np.minimum(half.distance[:, :, paired, paired], MAX_JOINT_DISTANCE)
    crossed = np.minimum(half.distance[:, :, paired, twin], MAX_JOINT_DISTANCE)
    known = np.isfinite(straight) & np.isfinite(crossed)
    count = np.maximum(known.sum(axis=2), 1)
    straight, crossed = (np.where(known, a, 0).sum(axis=2) / count for a in (straight, crossed))
    return (
        (straight - crossed)
        / MAX_JOINT_DISTANCE
        / (1 + (np.minimum(straight, crossed) / POOR_FIT_DISTANCE) ** 2)
    )


def _unlikeness(
    appearance: MarkAppearance, limb: int, exchanged: Bool[np.ndarray, "K"]
) -> Float[np.ndarray, "K"]:
    """How much more a limb looks like the other side on other frames than like its own, times how
    much more limbs look like their own in the median."""
    likeness, sources = appearance.likeness[limb], appearance.sources[limb]
    here = np.where(exchanged[:, None, None, None, None], likeness[..., ::-1, :], likeness)
    there = exchanged[sources][:, :, None, None, None]
    alike = np.where(there, here[..., ::-1], here)
    best = np.where(np.isfinite(alike), alike, -np.inf).max(axis=1, initial=-np.inf)
    known = np.isfinite(best).all(axis=(2, 3))
    best = np.where(known[..., None, None], best, 0)
    own = best[..., [0, 1], [0, 1]] - best[..., [0, 1], [1, 0]]
    count = known.sum(axis=1)
    gain = own.mean(axis=2).sum(axis=1) / np.maximum(count, 1)
    if not count.any():
        return gain
    return -gain * max(0.0, float(np.median(gain[count > 0])))


def _describe(
    annotations: Annotations,
    limb: int,
    row: int,
    doubt: float,
    evidence: SideEvidence,
    neighbours: tuple[Neighbours, ...],
) -> Check:
    """An exchange in a sentence."""
    skeleton = annotations.skeleton
    frame = int(annotations.frames[row])
    paired = [j for j in range(len(skeleton.names)) if skeleton.mirror[j] != j]
    own = evidence.poses[limb, row] + evidence.looks[limb, row]
    by_motion = suspicion(float(evidence.still[limb, row])) < MIN_SUSPICION
    if not by_motion and own < evidence.opposite[row]:
        text = "Shoulders and hips face opposite ways; left and right of arms or legs are swapped."
        names = tuple(skeleton.names[j] for j in paired)
        return Check(frame, "left_hip", "crossed", doubt, text, names)
    names = tuple(skeleton.names[j] for j in paired if skeleton.is_lower[j] == bool(limb))
    if by_motion:
        text = (
            f"Left and right of the {LIMBS[limb]} look swapped: else they passed through one "
            "another on the way from the marks before to those after."
        )
        return Check(frame, names[-1], "crossed", doubt, text, names)
    similar = [
        np.unique(half.frames[half.sources[half.frames == frame]])[:3]
        for half in neighbours
        if skeleton.is_lower[half.members].all() == bool(limb)
    ]
    named = ", ".join(str(other) for others in similar for other in others)
    beside = f"frames {named}" if named else "other frames"
    text = (
        f"Left and right of the {LIMBS[limb]} look swapped beside {beside}, unless the player "
        "faces the other way in those."
    )
    return Check(frame, names[-1], "crossed", doubt, text, names)
