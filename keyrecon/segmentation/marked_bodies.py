"""What a marked body tells of the player's colours: picks along its limbs.

A person who has marked the joints of a body in one frame has shown where head, shoes, clothes and
skin are. Points along the limbs of every marked body stand for clicks there: the centre of the
head, the shoes a little beyond the ankles, three points down the trunk, and the middles of the
limbs. Hidden joints and their limbs tell nothing of colours.
"""

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.records import Annotations, FlowTracks, Pick, TrackAnchors

SHOE_BEYOND_ANKLE = 0.18
"""The middle of a shoe lies beyond the ankle along the shank by this share of the shank: the ankle
is .039 of the stature above the floor, the shank .246 long (Drillis and Contini 1966)."""
HEAD_CENTRE = 0.55
"""The middle of the head on the way from the base of the neck to the top of the skull. A quarter
more or less, others with it: at most 0.6 points on two clips."""
LEG_JOINTS = ("right_knee", "left_knee", "right_ankle", "left_ankle")
SURE_FLOW = 0.7
"""Confidence from which joints followed by flow count as fixed points of the track. A quarter more
or less, others with it: at most 0.6 points on two clips."""
SURE_DRIFT, SURE_LIKENESS = 0.02, 0.4
"""Drift below which, player heights, and likeness from which they do too: one step that a turned
head has changed its looks by does not make all that follow doubtful. Evidence: one way from one or
four marked bodies of 18 real clips: necks and tops of heads are .12 off in 2 of 1706, ankles in 1
of 1516; with less likeness heads in 19 of 100."""
ONE_PLACE = 1 / 3
"""Ankles nearer than this share of a shank are followed to one place, where flow may have handed
one leg over to the other, which looks like it: they are not fixed for their looks. In a rendered
sequence both feet were on one shoe for 62 of 600 frames."""
EVEN_DRIFT = 0.3
"""Drift at which flow has a head as often as not, player heights. Evidence: necks and tops of heads
of 18 real clips with one or four marked bodies that have a likeness of .4 or more: .12 off in none
of 141 with a drift of .02 to .05, in 6 of 107 up to .15, in half of those beyond."""
LIKE_THE_MARK = 0.2, 0.5
"""Likeness up to which flow says nothing of a head and from which it counts in full. Evidence: of
the same with a drift up to .05, 14 of 100 are off with a likeness of .2 to .4, 33 with less."""
ALONG_TRUNK = 0.2, 0.45, 0.7
"""From neck to hips: the shirt, and not its collar or the belt. A quarter more or less, others with
it: at most 0.6 points on two clips."""
LIMB_PARTS = (
    ("upper arm", "shoulder", "elbow", (0.35, 0.6)),
    ("forearm", "elbow", "wrist", (0.4, 0.7)),
    ("thigh", "hip", "knee", (0.3, 0.55, 0.8)),
    ("shank", "knee", "ankle", (0.3, 0.5, 0.7)),
)
"""Name of the region, its ends, and where between them it is clicked. A quarter more or less,
others with it: at most 0.6 points on two clips."""


def picks_from_bodies(annotations: Annotations, size: tuple[int, int]) -> tuple[Pick, ...]:
    """Clicks that a person would make along the limbs of marked bodies, on pictures of a size."""
    picks: list[Pick] = []
    for row, frame in enumerate(annotations.frames.tolist()):
        body = _Body(annotations, annotations.joints[row], annotations.visible[row])
        picks += [
            Pick(frame, part, x, y)
            for part, x, y in body.points()
            if 0 <= x < size[0] and 0 <= y < size[1]
        ]
    return tuple(picks)


def anchors_from_bodies(annotations: Annotations, flow: FlowTracks | None = None) -> TrackAnchors:
    """Heads and shoes of every frame on which they are marked, hidden ones too.

    With `flow` also of the frames between in which it is sure of them.
    """
    names = annotations.skeleton.names
    if not {"neck", "head_top", *LEG_JOINTS} <= set(names):
        return TrackAnchors.none()
    marked = _marked(names, annotations.frames, annotations.joints)
    if flow is None:
        return marked
    between = _followed(names, flow)
    new = ~np.isin(between.frames, marked.frames)
    order = np.argsort(np.concatenate([marked.frames, between.frames[new]]), kind="stable")
    return TrackAnchors(
        *(
            np.concatenate([getattr(marked, f.name), getattr(between, f.name)[new]])[order]
            for f in fields(TrackAnchors)
        )
    )


def _followed(names: tuple[str, ...], flow: FlowTracks) -> TrackAnchors:
    """Anchors where flow is sure, and where it leads the head elsewhere."""
    # comparisons with NaN are false: where nothing is followed nothing is sure
    alike = (flow.drift < SURE_DRIFT) & (flow.likeness >= SURE_LIKENESS)
    legs = [names.index(name) for name in LEG_JOINTS]
    knees, ankles = flow.joints[:, legs[:2]], flow.joints[:, legs[2:]]
    shank = np.linalg.norm(ankles - knees, axis=2).mean(axis=1)
    apart = np.linalg.norm(ankles[:, 0] - ankles[:, 1], axis=1) > ONE_PLACE * shank
    alike[:, legs] &= apart[:, None]
    sure = (flow.confidence > SURE_FLOW) | alike
    head, feet = _head_and_feet(names, np.where(sure[..., None], flow.joints, np.nan))
    led, _ = _head_and_feet(names, flow.joints)
    ends = [names.index("neck"), names.index("head_top")]
    drift, likeness = flow.drift[:, ends].max(axis=1), flow.likeness[:, ends].min(axis=1)
    doubt = 1 - np.interp(likeness, LIKE_THE_MARK, (0, 1)) * EVEN_DRIFT / (drift + EVEN_DRIFT)
    leads = np.isnan(head).any(axis=1) & np.isfinite(led).all(axis=1) & (doubt < 1)
    frames, nobody = np.arange(len(leads)), np.zeros(len(leads), dtype=bool)
    led, doubt = np.where(leads[:, None], led, np.nan), np.where(leads, doubt, np.nan)
    every = TrackAnchors(
        frames, head, feet, nobody, np.full(len(leads), np.nan), nobody, led, doubt
    )
    return _some(every, leads | _any_place(head, feet))


def with_heights(
    anchors: TrackAnchors, frames: Int[np.ndarray, "K"], heights: Float[np.ndarray, "K"]
) -> TrackAnchors:
    """The same with how tall the bodies marked in `frames` (ascending) would stand, px."""
    row = np.searchsorted(frames, anchors.frames).clip(max=len(frames) - 1)
    matched = anchors.marked & (frames[row] == anchors.frames)
    return replace(anchors, height=np.where(matched, heights[row], anchors.height))


def _marked(
    names: tuple[str, ...], frames: Int[np.ndarray, "n"], joints: Float[np.ndarray, "n J 2"]
) -> TrackAnchors:
    """Anchors where head or feet are marked."""
    head, feet = _head_and_feet(names, joints)
    known = {name: np.isfinite(joints[:, n]).all(axis=1) for n, name in enumerate(names)}
    of_legs, of_feet = (
        np.any([known[name] for name in names if name.endswith(ends)], axis=0)
        for ends in (("_hip", "_knee"), "_ankle")
    )
    marked, unknown = np.ones(len(frames), dtype=bool), np.full(len(frames), np.nan)
    nowhere = np.full((len(frames), 2), np.nan)
    footless = of_legs & ~of_feet
    every = TrackAnchors(frames, head, feet, marked, unknown, footless, nowhere, unknown)
    return _some(every, _any_place(head, feet))


def _head_and_feet(
    names: tuple[str, ...], joints: Float[np.ndarray, "n J 2"]
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 2"]]:
    """Centre of the head and both shoes; NaN where an end of the head is unknown, or of a shank."""
    place = {name: joints[:, names.index(name)] for name in ("neck", "head_top", *LEG_JOINTS)}
    head = place["neck"] * (1 - HEAD_CENTRE) + place["head_top"] * HEAD_CENTRE
    shoes = [
        place[f"{side}_ankle"]
        + SHOE_BEYOND_ANKLE * (place[f"{side}_ankle"] - place[f"{side}_knee"])
        for side in ("right", "left")
    ]
    feet = np.stack(shoes, axis=1)
    feet[~np.isfinite(feet).all(axis=(1, 2))] = np.nan
    return head, feet


def _any_place(
    head: Float[np.ndarray, "n 2"], feet: Float[np.ndarray, "n 2 2"]
) -> Bool[np.ndarray, "n"]:
    return np.isfinite(head).all(axis=1) | np.isfinite(feet).all(axis=(1, 2))


def _some(anchors: TrackAnchors, rows: Bool[np.ndarray, "A"]) -> TrackAnchors:
    return TrackAnchors(*(getattr(anchors, f.name)[rows] for f in fields(TrackAnchors)))


class _Body:
    """The visible joints of one frame by name."""

    def __init__(
        self,
        annotations: Annotations,
        joints: Float[np.ndarray, "J 2"],
        visible: Bool[np.ndarray, "J"],
    ) -> None:
        names = annotations.skeleton.names
        placed = np.isfinite(joints).all(axis=1)
        # a neck behind a chin or a cap still tells where the head is
        known = placed & (visible | np.isin(names, ("neck", "head_top")))
        self._joint = {n: p for n, p, k in zip(names, joints, known, strict=True) if k}

    def points(self) -> Iterator[tuple[str, float, float]]:
        """Name of the part and a point on it, px."""
        yield from self._between("head", "neck", "head_top", (HEAD_CENTRE,))
        for side in ("right", "left"):
            yield from self._between(
                "foot", f"{side}_knee", f"{side}_ankle", (1 + SHOE_BEYOND_ANKLE,)
            )
            for part, start, stop, shares in LIMB_PARTS:
                yield from self._between(part, f"{side}_{start}", f"{side}_{stop}", shares)
        if {"right_hip", "left_hip", "neck"} <= self._joint.keys():
            hips = (self._joint["right_hip"] + self._joint["left_hip"]) / 2
            for share in ALONG_TRUNK:
                x, y = self._joint["neck"] * (1 - share) + hips * share
                yield "trunk", float(x), float(y)

    def _between(
        self, part: str, start: str, stop: str, shares: tuple[float, ...]
    ) -> Iterator[tuple[str, float, float]]:
        if start in self._joint and stop in self._joint:
            for share in shares:
                x, y = self._joint[start] * (1 - share) + self._joint[stop] * share
                yield part, float(x), float(y)
