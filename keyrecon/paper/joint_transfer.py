"""The paper's way to the joints of a frame (Section 5).

The keyframe assigned to the frame is aligned with it and corresponded with it edge element by edge
element (`keyrecon.keyframes.edge_distance.match_edges`). The elements in the vicinity of a joint
define its translation. Appearance and the keyframe's ratios of apparent limb lengths then refine
the estimates: around every estimate lies a grid of positions; a position is good where the picture
is like the keyframe around the joint and near the estimate; two positions are good together where
the limb between them has the keyframe's length times the common change of scale of all limbs. The
best choice for all joints of a tree is found exactly, from the leaves to the root (Felzenszwalb and
Huttenlocher, IJCV 61, 2005).

What the text leaves open here and what was chosen: `choices.md`, rows of Section 5. Lengths are in
player heights.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.io.video import Video
from keyrecon.keyframes.distance_matrix import HALVES
from keyrecon.keyframes.edge_distance import align_edges, match_edges
from keyrecon.numerics.geometry import cut_affine
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, Edges, HalfKeyframes, HalfName, JointTracks, Preparation

PIXELS_PER_HEIGHT = 125
"""Pixels per player height in the pictures compared: one pixel is one step of the grid."""
SEARCH_RADIUS = 7
"""Steps of the grid to each side: .056 player heights."""
PATCH_SIZE = 13
"""Side of a patch, px: a tenth of a player height, wider than a forearm."""
APPEARANCE_WEIGHT = 1.0
"""Weight of appearance."""
LENGTH_SPREAD = 0.12
"""Spread of the logarithm of a limb's relative length; twice that far from any keyframe."""
POSITION_SPREAD = (0.015, 0.06)
"""Least and largest spread of an estimate, player heights."""


@dataclass(frozen=True, eq=False)
class PatchSource:
    """A grey picture in which the player has roughly `PIXELS_PER_HEIGHT` pixels."""

    grey: UInt8[np.ndarray, "h w"]
    shrink: float
    """Pixels of it per pixel of the video."""
    height: float
    """Player height, px of the video."""
    origin: Float[np.ndarray, "2"]
    """Origin of player coordinates, px of the video."""

    @staticmethod
    def width_for(video: Video, height: Float[np.ndarray, "T"]) -> int:
        """Width to reduce the video to; never enlarged."""
        return min(
            video.width, round(video.width * 1.25 * PIXELS_PER_HEIGHT / float(np.median(height)))
        )

    def around(self, origin: Float[np.ndarray, "2"]) -> "PatchSource":
        """The same with another origin."""
        return PatchSource(self.grey, self.shrink, self.height, origin)

    def cut(
        self, center: Float[np.ndarray, "2"], size: int, turn: float = 0.0
    ) -> UInt8[np.ndarray, "s s"]:
        """Square of `size` px around a point in player coordinates, turned by `turn` rad."""
        scale = self.height * self.shrink / PIXELS_PER_HEIGHT
        middle = (self.origin + center * self.height + 0.5) * self.shrink - 0.5
        cosine, sine = scale * np.cos(turn), scale * np.sin(turn)
        matrix = np.array([[cosine, sine, 0], [-sine, cosine, 0]])
        matrix[:, 2] = middle - matrix[:, :2] @ np.full(2, (size - 1) / 2)
        return cut_affine(self.grey, matrix, (size, size))


def crop_patches(picture: UInt8[np.ndarray, "h w 3"], width: int, height: float) -> PatchSource:
    """A reduced picture of a video `width` px wide, the player `height` px tall there."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    return PatchSource(grey, picture.shape[1] / width, height, np.zeros(2))


@dataclass(frozen=True, eq=False)
class JointSearch:
    """Joints in the keyframe and estimates in another frame, player coordinates of each."""

    model: Float[np.ndarray, "J 2"]
    estimate: Float[np.ndarray, "J 2"]
    """NaN where missing."""
    spread: Float[np.ndarray, "J"]
    represented: bool
    """Whether the keyframe shows the same pose."""


def refine_joints(
    keyframe: PatchSource,
    frame: PatchSource,
    search: JointSearch,
    bones: Int[np.ndarray, "B 2"],
    origin: Float[np.ndarray, "2"],
) -> Float[np.ndarray, "J 2"]:
    """Joints in px of the video; NaN where the estimate is missing."""
    frame = frame.around(origin)
    there = np.isfinite(search.estimate).all(axis=1)
    bones = bones[there[bones].all(axis=1)]
    if not there.any():
        return np.full(search.estimate.shape, np.nan)
    offsets = _grid()
    cost = {
        int(j): _position_cost(keyframe, frame, search, int(j), _turn(search, bones, int(j)))
        for j in np.flatnonzero(there)
    }
    best = _best_positions(cost, search, bones, offsets)
    refined = np.full(search.estimate.shape, np.nan)
    for j, place in best.items():
        refined[j] = search.estimate[j] + offsets[place]
    return origin + refined * frame.height


def _grid() -> Float[np.ndarray, "G 2"]:
    y, x = np.mgrid[-SEARCH_RADIUS : SEARCH_RADIUS + 1, -SEARCH_RADIUS : SEARCH_RADIUS + 1]
    return np.stack([x.ravel(), y.ravel()], axis=1) / PIXELS_PER_HEIGHT


def _turn(search: JointSearch, bones: Int[np.ndarray, "B 2"], joint: int) -> float:
    """Change of direction of the limb that ends at a joint, or else of one that starts there."""
    ending = bones[bones[:, 1] == joint]
    limbs = ending if len(ending) else bones[bones[:, 0] == joint]
    if not len(limbs):
        return 0.0
    parent, child = limbs[0]
    before, now = (p[child] - p[parent] for p in (search.model, search.estimate))
    return float(np.arctan2(now[1], now[0]) - np.arctan2(before[1], before[0]))


def _position_cost(
    keyframe: PatchSource, frame: PatchSource, search: JointSearch, joint: int, turn: float
) -> Float[np.ndarray, "G"]:
    """Cost of each position of the grid by appearance and by distance from the estimate."""
    patch = keyframe.cut(search.model[joint], PATCH_SIZE, turn)
    around = frame.cut(search.estimate[joint], PATCH_SIZE + 2 * SEARCH_RADIUS)
    alike = cv2.matchTemplate(around, patch, cv2.TM_CCOEFF_NORMED).ravel()
    alike = np.nan_to_num(np.clip(alike, -1, 1), posinf=0, neginf=0)
    spread = np.clip(search.spread[joint], *POSITION_SPREAD)
    return APPEARANCE_WEIGHT * (1 - alike) + (_grid() ** 2).sum(axis=1) / (2 * spread**2)


def _best_positions(
    cost: dict[int, Float[np.ndarray, "G"]],
    search: JointSearch,
    bones: Int[np.ndarray, "B 2"],
    offsets: Float[np.ndarray, "G 2"],
) -> dict[int, int]:
    """Cheapest position of every joint, exactly; `bones` lead outwards from the roots."""
    targets = _target_lengths(search, bones)
    spread = LENGTH_SPREAD * (1 if search.represented else 2)
    total, choice = dict(cost), {}
    for (parent, child), length in reversed(list(zip(bones.tolist(), targets, strict=True))):
        bone = search.estimate[child] - search.estimate[parent]
        ends = bone + offsets[None] - offsets[:, None]
        ratio = np.log(np.maximum((ends**2).sum(axis=2), 1e-8) / length**2) / 2
        sums = total[child] + ratio**2 / (2 * spread**2)
        choice[child] = sums.argmin(axis=1)
        total[parent] = total[parent] + sums.min(axis=1)
    children = set(bones[:, 1].tolist())
    best = {joint: int(total[joint].argmin()) for joint in cost if joint not in children}
    for parent, child in bones.tolist():
        best[child] = int(choice[child][best[parent]])
    return best


def _target_lengths(search: JointSearch, bones: Int[np.ndarray, "B 2"]) -> Float[np.ndarray, "B"]:
    """The keyframe's limb lengths times the median change of all of them."""
    if not len(bones):
        return np.zeros(0)
    before, now = (
        np.maximum(np.linalg.norm(p[bones[:, 1]] - p[bones[:, 0]], axis=1), 0.01)
        for p in (search.model, search.estimate)
    )
    return before * np.median(now / before)


VICINITY_RADIUS = 0.12
"""Elements this close to a joint define its translation, player heights: about a thigh's width."""
VICINITY_SPREAD = 0.06
"""Spread of the weight of elements around a joint, player heights."""
MIN_ELEMENTS, MIN_MATCHED_SHARE = 5, 0.3
"""Matched elements, and weighted share of the elements around, below which a joint is missing."""
WEISZFELD_ITERATIONS = 20
"""Of Weiszfeld's iteration, which has converged to a hundredth of the spread by then."""


@dataclass(frozen=True, eq=False)
class TransferModel:
    """An annotated keyframe of one half of the body, aligned by head or feet."""

    edges: Edges
    joints: Float[np.ndarray, "J 2"]
    """Player heights; NaN where missing or hidden."""
    picture: PatchSource


def transfer_joints(
    preparation: Preparation, annotations: Annotations, progress: Progress = silent
) -> JointTracks:
    """Joints from the assigned keyframe of each half; NaN where missing.

    Confidence falls with the pose distance to the keyframe and with the share of elements around
    the joint that find no match.
    """
    models = _gather_models(preparation, annotations)
    shape = (len(preparation.track.height), len(annotations.skeleton.names))
    joints, confidence = np.full((*shape, 2), np.nan), np.zeros(shape)
    bones, is_lower = annotations.skeleton.bones, annotations.skeleton.is_lower
    frames = progress(_grey_pictures(preparation), "Propagating joints", shape[0])
    halves: tuple[tuple[HalfName, np.ndarray], ...] = (("upper", ~is_lower), ("lower", is_lower))
    for t, picture in enumerate(frames):
        for name, members in halves:
            keyframes = getattr(preparation.keyframes, name)
            model = models.get((name, int(keyframes.nearest[t])))
            if model is None:
                continue
            edges = align_edges(preparation.edges[t], preparation.track, t, name)
            search, share = _shift_joints(model, edges, bool(keyframes.represented[t]))
            refined = refine_joints(
                model.picture, picture, search, bones, _anchor(preparation, t, name)
            )
            joints[t, members] = refined[members]
            likeness = np.exp(-keyframes.distance[t] / keyframes.beta)
            confidence[t, members] = np.where(np.isnan(refined[:, 0]), 0, share * likeness)[members]
    return JointTracks(joints, confidence)


def _anchor(preparation: Preparation, frame: int, name: HalfName) -> Float[np.ndarray, "2"]:
    """Where aligned coordinates have their origin, px."""
    return (preparation.track.head if name == "upper" else preparation.track.mid_feet)[frame]


def _grey_pictures(preparation: Preparation) -> Iterator[PatchSource]:
    """Grey pictures of all frames in one size of the player."""
    video = preparation.video
    width = PatchSource.width_for(video, preparation.track.height)
    for t, picture in enumerate(video.frames(width=width)):
        yield crop_patches(picture, video.width, float(preparation.track.height[t]))


def _gather_models(
    preparation: Preparation, annotations: Annotations
) -> dict[tuple[HalfName, int], TransferModel]:
    """Annotated keyframes by half and frame number."""
    models: dict[tuple[HalfName, int], TransferModel] = {}
    video = preparation.video
    width = PatchSource.width_for(video, preparation.track.height)
    seen = np.where(annotations.visible[..., None], annotations.joints, np.nan)
    rows = dict(zip(annotations.frames.tolist(), range(len(seen)), strict=True))
    for name in HALVES:
        half: HalfKeyframes = getattr(preparation.keyframes, name)
        members = annotations.skeleton.is_lower == (name == "lower")
        for frame in half.frames.tolist():
            if frame not in rows:
                continue
            height = float(preparation.track.height[frame])
            picture = crop_patches(video.frame(frame, width), video.width, height)
            origin = _anchor(preparation, frame, name)
            edges = align_edges(preparation.edges[frame], preparation.track, frame, name)
            joints = np.where(members[:, None], (seen[rows[frame]] - origin) / height, np.nan)
            models[name, frame] = TransferModel(edges, joints, picture.around(origin))
    return models


def _shift_joints(
    model: TransferModel, edges: Edges, represented: bool
) -> tuple[JointSearch, Float[np.ndarray, "J"]]:
    """(estimates from local translation, share of the elements around that are matched)."""
    match, _ = match_edges(model.edges, edges)
    matched = match >= 0
    moved = edges.points[match] - model.edges.points if len(edges.points) else np.zeros((0, 2))
    joints = np.full(model.joints.shape, np.nan)
    spread, share = np.full(len(joints), VICINITY_SPREAD), np.zeros(len(joints))
    for j in np.flatnonzero(np.isfinite(model.joints[:, 0])):
        away = np.linalg.norm(model.edges.points - model.joints[j], axis=1)
        weight = np.where(away < VICINITY_RADIUS, np.exp(-0.5 * (away / VICINITY_SPREAD) ** 2), 0)
        share[j] = weight[matched].sum() / max(weight.sum(), 1e-9)
        nearby = matched & (weight > 0)
        if nearby.sum() < MIN_ELEMENTS or share[j] < MIN_MATCHED_SHARE:
            share[j] = 0
            continue
        shift = geometric_median(moved[nearby], weight[nearby])
        joints[j] = model.joints[j] + shift
        away = np.linalg.norm(moved[nearby] - shift, axis=1)
        spread[j] = np.average(away, weights=weight[nearby])
    return JointSearch(model.joints, joints, spread, represented), share


def geometric_median(
    points: Float[np.ndarray, "N 2"], weight: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "2"]:
    """Point with the least weighted sum of distances (Weiszfeld 1937)."""
    center = np.average(points, axis=0, weights=weight)
    for _ in range(WEISZFELD_ITERATIONS):
        near = weight / np.maximum(np.linalg.norm(points - center, axis=1), 1e-4)
        center = near @ points / near.sum()
    return center
