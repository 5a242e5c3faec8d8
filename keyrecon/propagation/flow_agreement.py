"""Which joints optical flow from the marks has, and which edges have."""

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.bone_bounds import bone_lengths, ends_too_long
from keyrecon.records import FlowTracks, JointTracks

FLOW_TOLERANCE = 0.05
"""Flow and edges that put a joint nearer together than this agree, player heights: edges are the
more exact; two eyes mark a joint .042 apart in the worst tenth. Halved or doubled: no change on one
clip."""
SURE_FLOW, SURE_EDGES = 0.8, 0.1
"""Flow that is surer than the first has a joint whatever edges say, and edges that are less sure
than the second leave it to flow that is at all sure (`MIN_FLOW_CONFIDENCE`). In an address of golf
edges took the arm in front for the one behind it, with a confidence of .7, for twenty frames that
flow joins to within a pixel: +2.8 points of PCK on that clip, +.5 to -.6 on four others, 0 to -.1
on three rendered sequences."""
MIN_FLOW_CONFIDENCE = 0.1


def with_flow(
    tracks: JointTracks,
    flow: FlowTracks,
    height: Float[np.ndarray, "T"],
    bounds: Float[np.ndarray, "J J"] | None = None,
) -> JointTracks:
    """Tracks with joints where flow from both sides meets, if it is surer and they are elsewhere.

    A joint that is followed from one mark alone is left to edges: of four that were sure and far
    from them, flow had stayed behind on an even shirt. Nor does flow have a joint where a bone
    would become longer than `bounds` (player heights) and than it is.
    """
    apart = np.linalg.norm(tracks.joints - flow.joints, axis=2) / height[:, None]
    elsewhere = ~(apart < FLOW_TOLERANCE) & np.isfinite(flow.joints).all(axis=2)
    doubted = ~(tracks.confidence > SURE_EDGES) & (flow.confidence > MIN_FLOW_CONFIDENCE)
    replaced = elsewhere & flow.joined & (doubted | (flow.confidence > SURE_FLOW))
    if bounds is not None:
        replaced &= ~_stretched(tracks.joints, flow.joints, replaced, height, bounds)
    return JointTracks(
        np.where(replaced[..., None], flow.joints, tracks.joints),
        np.where(replaced, flow.confidence, tracks.confidence),
        tracks.keyframe,
    )


def _stretched(
    joints: Float[np.ndarray, "T J 2"],
    others: Float[np.ndarray, "T J 2"],
    replaced: Bool[np.ndarray, "T J"],
    height: Float[np.ndarray, "T"],
    bounds: Float[np.ndarray, "J J"],
) -> Bool[np.ndarray, "T J"]:
    """Joints that end a bone which is too long with others in the place of those `replaced`."""
    bones = np.argwhere(np.triu(np.isfinite(bounds)))
    longest = bounds[bones[:, 0], bones[:, 1]]
    before = to_complex(joints) / height[:, None]
    after = np.where(replaced, to_complex(others) / height[:, None], before)
    longest = np.maximum(longest, bone_lengths(before, bones))
    return ends_too_long(after, bones, longest)
