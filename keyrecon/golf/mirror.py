"""Left-handed players: what was seen is mirrored for the right-handed model, the result back.

Mirroring a picture about the principal point mirrors space about the plane x = 0 of the camera, so
that nothing else of the camera changes.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.records import Camera, Capsules, Matches, Observations, Pose

ACROSS = np.array([-1.0, 1.0, 1.0])


def mirror_pixels(pixels: Float[np.ndarray, "*n 2"], camera: Camera) -> Float[np.ndarray, "*n 2"]:
    """Points of the picture with left and right exchanged."""
    mirrored = pixels.copy()
    mirrored[..., 0] = 2 * camera.principal[0] - pixels[..., 0]
    return mirrored


def mirror_clicks(
    clicked: Mapping[str, tuple[float, float]], camera: Camera
) -> dict[str, tuple[float, float]]:
    """Clicked joints of the mirrored player."""
    swap = {"left": "right", "right": "left"}
    mirrored = {}
    for name, place in clicked.items():
        side, _, joint = name.partition("_")
        other = f"{swap[side]}_{joint}" if side in swap else name
        x, y = mirror_pixels(np.array(place, float), camera)
        mirrored[other] = (float(x), float(y))
    return mirrored


def mirror_observations(observations: Observations) -> Observations:
    """What would have been seen of the mirrored player."""
    camera, matches = observations.camera, observations.matches
    if observations.away:
        raise ValueError("distance transforms are not mirrored; mirror before they are made")
    return replace(
        observations,
        joints=mirror_pixels(observations.joints[:, LSP14.mirror], camera),
        spread=observations.spread[:, LSP14.mirror],
        club=mirror_pixels(observations.club, camera),
        foreground=tuple(mirror_pixels(f, camera) for f in observations.foreground),
        matches=Matches(
            matches.frame, mirror_pixels(matches.start, camera), mirror_pixels(matches.end, camera)
        ),
    )


def mirror_pose(pose: Pose) -> Pose:
    """The pose in mirrored space; capsules must be mirrored with it."""
    flip = np.diag(ACROSS)
    return Pose(pose.origins * ACROSS, flip @ pose.rotations @ flip)


def mirror_capsules(capsules: Capsules) -> Capsules:
    """Capsules of the mirrored body, for a mirrored pose."""
    return replace(capsules, start=capsules.start * ACROSS, end=capsules.end * ACROSS)
