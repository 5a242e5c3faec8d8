"""Whether marks look like the marks of the same joints on other frames, each left out in turn.

Every mark is described as in `propagation.appearance`: colour and gradients around it, whitened by
their covariance over this player. What a joint looks like is told by its marks on the other frames
whose poses are most similar. Two things follow:

excess    how much more a place beside a mark looks like the joint than the marked place does. A
          click on the wrong thing has a better place near it, whatever the pose is.
likeness  how points along both arms and both legs look like their own side, and like the other
          side, on other frames. Where sleeves, shoes or the light differ, exchanged sides show.

Hidden joints look like what hides them, and have no excess.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32, Int, UInt8

from keyrecon.body import Skeleton
from keyrecon.io.evening import even_exposure
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.propagation.appearance import (
    COMPONENTS,
    SAMPLE_SPREAD,
    SAMPLES,
    PlayerFeatures,
    UprightCrop,
    describe_cells,
    describe_player,
)
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.marked_poses import distances_to
from keyrecon.records import Annotations, HalfName, Preparation

MOST_COMPARED = 40
"""Other marked frames that each is compared with, those most similar in pose."""
SEARCH_FROM, SEARCH_TO, SEARCH_STEP = 0.06, 0.3, 0.03
"""Places beside a mark that may look better, player heights: farther than two eyes mark the same
joint apart (.042 in the worst tenth), and no farther than a trunk is long."""
LIMBS: tuple[tuple[HalfName, tuple[str, str, str]], ...] = (
    ("upper", ("shoulder", "elbow", "wrist")),
    ("lower", ("hip", "knee", "ankle")),
)
"""Half of the body and joints of arms and of legs."""


@dataclass(frozen=True, eq=False)
class MarkAppearance:
    """What K marked frames say of the looks of each other's marks."""

    frames: Int[np.ndarray, "K"]
    excess: Float[np.ndarray, "K J"]
    """0-2; 0 where nothing is marked or seen, or on no other frame."""
    sources: Int[np.ndarray, "2 K S"]
    """Rows of the frames that each is compared with, for arms and for legs."""
    likeness: Float32[np.ndarray, "2 K S P 2 2"]
    """Of arms, then of legs: cosine of point P on one side here and on one side there, -1 to 1;
    NaN where one of them is not known."""


def describe_frames(
    preparation: Preparation,
    body_frame: BodyFrame,
    frames: Int[np.ndarray, "K"],
    described: PlayerFeatures | None = None,
) -> PlayerFeatures:
    """The pictures of some frames in player coordinates; what was `described` is not read again."""
    lacking = np.unique(frames) if described is None else np.setdiff1d(frames, described.frames)
    lacking = lacking[preparation.track.known[lacking]]
    if not len(lacking):
        return described or PlayerFeatures(lacking, np.zeros((0, 1, 1, 1), np.uint8))
    video = preparation.video
    part = video.part(lacking)
    own = BodyFrame(body_frame.origin[lacking], body_frame.height[lacking])
    cells = describe_player(part, own, np.arange(len(lacking))).cells
    if described is None:
        return PlayerFeatures(lacking, cells)
    order = np.argsort(both := np.concatenate([described.frames, lacking]))
    return PlayerFeatures(both[order], np.concatenate([described.cells, cells])[order])


class SeenFrames:
    """What `describe_frames` gives, of pictures that are read for something else as well."""

    def __init__(
        self, preparation: Preparation, body_frame: BodyFrame, frames: Int[np.ndarray, "K"]
    ) -> None:
        """Some frames."""
        self._video = preparation.video
        self._frames = np.unique(frames)[preparation.track.known[np.unique(frames)]]
        own = BodyFrame(body_frame.origin[self._frames], body_frame.height[self._frames])
        self._crop = UprightCrop.of(self._video, own) if len(self._frames) else None
        self._cells: dict[int, UInt8[np.ndarray, "n n C"]] = {}

    def see(self, frame: int, picture: UInt8[np.ndarray, "h w 3"]) -> None:
        """Describe a frame as it was filmed, if it is one of them."""
        row = int(np.searchsorted(self._frames, frame))
        if self._crop is None or frame not in self._frames[row : row + 1]:
            return
        exposure = self._video.exposure
        evened = picture if exposure is None else even_exposure(picture, float(exposure[frame]))
        small = reduce_picture(evened, self._crop.width)
        self._cells[frame] = describe_cells(self._crop.cut(row, small))

    @property
    def features(self) -> PlayerFeatures | None:
        """Of the frames that were seen; None where none was."""
        seen = sorted(self._cells)
        if not seen:
            return None
        return PlayerFeatures(np.array(seen), np.stack([self._cells[t] for t in seen]))


def compare_appearance(
    preparation: Preparation,
    body_frame: BodyFrame,
    annotations: Annotations,
    features: PlayerFeatures,
) -> MarkAppearance | None:
    """All marks against those of other frames; `features` are of the annotated frames, or of more.

    None where fewer than two frames are marked.
    """
    frames, skeleton = annotations.frames, annotations.skeleton
    places = body_frame.from_pixels(annotations.joints, frames[:, None])
    if np.isfinite(places).any(axis=1).sum() < 2:
        return None
    description = _learn_description(features, frames, places)
    sources = np.stack([_similar_frames(preparation, frames, half) for half, _ in LIMBS])
    likeness = [
        _compare_sides(description, frames, _limb_points(places, skeleton, parts), rows)
        for (_, parts), rows in zip(LIMBS, sources, strict=True)
    ]
    excess = _search_beside(description, annotations, places, sources)
    return MarkAppearance(frames, excess, sources, np.stack(likeness))


@dataclass(frozen=True, eq=False)
class _Description:
    """Whitened looks of places."""

    features: PlayerFeatures
    mean: Float32[np.ndarray, "D"]
    whitening: Float32[np.ndarray, "D C"]

    def of(
        self, frames: Int[np.ndarray, "P"], places: Complex[np.ndarray, "P"]
    ) -> Float32[np.ndarray, "P C"]:
        """Of length one; NaN where a place is not known."""
        known = np.isfinite(places)
        there = np.where(known, frames, self.features.frames[0])
        described = self.features.around(there, np.where(known, places, 0))
        white = (described - self.mean) @ self.whitening
        length = np.maximum(np.linalg.norm(white, axis=1, keepdims=True), 1e-9)
        return np.where(known[:, None], white / length, np.nan).astype(np.float32)


def _learn_description(
    features: PlayerFeatures, frames: Int[np.ndarray, "K"], places: Complex[np.ndarray, "K J"]
) -> _Description:
    """Whitening by places on the body and beside it, as `learn_appearance` does it."""
    random = np.random.default_rng(0)
    rows, joints = np.nonzero(np.isfinite(places))
    chosen = random.integers(0, len(rows), SAMPLES)
    beside = random.normal(0, SAMPLE_SPREAD, (2, SAMPLES))
    around = places[rows[chosen], joints[chosen]] + beside[0] + 1j * beside[1]
    sampled = features.around(frames[rows[chosen]], around)
    variance, axes = np.linalg.eigh(np.cov(sampled.T))
    kept = slice(-min(COMPONENTS, len(axes)), None)
    noise = np.sqrt(variance[kept] + variance[kept][0] + 1e-9)
    return _Description(features, sampled.mean(axis=0), (axes[:, kept] / noise).astype(np.float32))


def _similar_frames(
    preparation: Preparation, frames: Int[np.ndarray, "K"], half: HalfName
) -> Int[np.ndarray, "K S"]:
    """Rows of the other frames most similar in pose."""
    distance = distances_to(preparation.pose_distances, half, frames)[frames]
    np.fill_diagonal(distance, np.inf)
    return distance.argsort(axis=1, kind="stable")[:, : min(MOST_COMPARED, len(frames) - 1)]


def _limb_points(
    places: Complex[np.ndarray, "K J"], skeleton: Skeleton, parts: tuple[str, ...]
) -> Complex[np.ndarray, "K P 2"]:
    """Joints of a limb and the middles of its bones, right and left; NaN for what the skeleton
    lacks."""
    nowhere = np.full(len(places), np.nan + 0j)

    def joint(side: str, part: str) -> Complex[np.ndarray, "K"]:
        name = f"{side}_{part}"
        return places[:, skeleton.index(name)] if name in skeleton.names else nowhere

    joints = np.stack([[joint(side, part) for side in ("right", "left")] for part in parts])
    points = np.concatenate([joints, (joints[1:] + joints[:-1]) / 2])
    return points.transpose(2, 0, 1)


def _compare_sides(
    description: _Description,
    frames: Int[np.ndarray, "K"],
    points: Complex[np.ndarray, "K P 2"],
    sources: Int[np.ndarray, "K S"],
) -> Float32[np.ndarray, "K S P 2 2"]:
    """Cosines between points of a limb here and on other frames, each side with each."""
    each = np.repeat(frames, points[0].size)
    looks = description.of(each, points.ravel()).reshape(*points.shape, -1)
    return np.stack(
        [
            np.einsum("pac,spbc->spab", own, looks[rows])
            for own, rows in zip(looks, sources, strict=True)
        ]
    )


def _search_beside(
    description: _Description,
    annotations: Annotations,
    places: Complex[np.ndarray, "K J"],
    sources: Int[np.ndarray, "2 K S"],
) -> Float[np.ndarray, "K J"]:
    """How much more the best place beside each mark looks like the joint's other marks."""
    frames, skeleton = annotations.frames, annotations.skeleton
    seen: Bool[np.ndarray, "K J"] = np.isfinite(places) & annotations.visible
    around = np.concatenate([[0], _search_places()])
    excess = np.zeros(places.shape)
    for joint in range(places.shape[1]):
        rows = np.flatnonzero(seen[:, joint])
        looks = description.of(frames, np.where(seen[:, joint], places[:, joint], np.nan))
        for row in rows:
            others = sources[int(skeleton.is_lower[joint]), row]
            others = others[seen[others, joint]]
            if len(others):
                beside = description.of(
                    np.full(len(around), frames[row]), places[row, joint] + around
                )
                alike = (beside @ looks[others].T).max(axis=1)
                excess[row, joint] = max(0.0, float(alike[1:].max() - alike[0]))
    return excess


def _search_places() -> Complex[np.ndarray, "P"]:
    """A grid around 0, player heights."""
    reach = np.arange(-SEARCH_TO, SEARCH_TO + SEARCH_STEP / 2, SEARCH_STEP)
    grid = (reach + 1j * reach[:, None]).ravel()
    return grid[(np.abs(grid) >= SEARCH_FROM) & (np.abs(grid) <= SEARCH_TO)]
