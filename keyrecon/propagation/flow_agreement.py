"""Which joints edges have, which optical flow from the marks has, and which nothing has."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.propagation.bone_bounds import stretched_ends
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
"""Flow that is less sure says nothing. A quarter more or less, others with it: at most 1.5 points,
2.1 mm on nine clips."""


def with_flow(
    tracks: JointTracks,
    flow: FlowTracks | None,
    height: Float[np.ndarray, "T"],
    bounds: Float[np.ndarray, "J J"],
) -> JointTracks:
    """Tracks with joints where flow from both sides meets, if it is surer and they are elsewhere.

    A joint at the end of a bone that is longer than `bounds` (player heights) has no confidence. A
    joint that is followed from one mark alone is left to edges: of four that were sure and far
    from them, flow had stayed behind on an even shirt. Nor does flow have a joint where a bone
    would become longer than its bound and than it is.
    """
    stretched = stretched_ends(tracks.joints, height, bounds)
    tracks = replace(tracks, confidence=np.where(stretched, 0, tracks.confidence))
    if flow is None:
        return tracks
    apart = np.linalg.norm(tracks.joints - flow.joints, axis=2) / height[:, None]
    elsewhere = ~(apart < FLOW_TOLERANCE) & np.isfinite(flow.joints).all(axis=2)
    doubted = ~(tracks.confidence > SURE_EDGES) & (flow.confidence > MIN_FLOW_CONFIDENCE)
    replaced = elsewhere & flow.joined & (doubted | (flow.confidence > SURE_FLOW))
    places = np.where(replaced[..., None], flow.joints, tracks.joints)
    replaced &= ~stretched_ends(places, height, bounds, tracks.joints)
    elsewhere = tracks.elsewhere
    return replace(
        tracks,
        joints=np.where(replaced[..., None], flow.joints, tracks.joints),
        confidence=np.where(replaced, flow.confidence, tracks.confidence),
        elsewhere=None if elsewhere is None else np.where(replaced, 1 - flow.confidence, elsewhere),
    )
