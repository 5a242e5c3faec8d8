"""Left-handed players: what was seen is mirrored for the right-handed model, the result back.

Exchanging left and right of a picture moves the principal point with it, and mirrors space about
the plane x = 0 of the camera.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.golf.records import Camera, Capsules, Matches, Observations, RootPose, SwingMarks

ACROSS = np.array([-1.0, 1.0, 1.0])


def mirror_pixels(pixels: Float[np.ndarray, "*n 2"], width: int) -> Float[np.ndarray, "*n 2"]:
    """Points of a picture of some width with left and right exchanged."""
    mirrored = pixels.copy()
    mirrored[..., 0] = width - 1 - pixels[..., 0]
    return mirrored


def mirror_clicks(
    clicked: Mapping[str, tuple[float, float]], width: int
) -> dict[str, tuple[float, float]]:
    """Clicked joints of the mirrored player."""
    swap = {"left": "right", "right": "left"}
    mirrored = {}
    for name, place in clicked.items():
        side, _, joint = name.partition("_")
        other = f"{swap[side]}_{joint}" if side in swap else name
        mirrored[other] = (width - 1 - place[0], place[1])
    return mirrored


def mirror_observations(observations: Observations, width: int) -> Observations:
    """What would have been seen of the mirrored player in pictures of some width."""
    camera, matches, marks = observations.camera, observations.matches, observations.marks
    if marks is not None:
        marks = SwingMarks(marks.frames, mirror_pixels(marks.joints[:, LSP14.mirror], width))
    return replace(
        observations,
        camera=Camera(camera.focal, mirror_pixels(camera.principal, width)),
        joints=mirror_pixels(observations.joints[:, LSP14.mirror], width),
        spread=observations.spread[:, LSP14.mirror],
        club=mirror_pixels(observations.club, width),
        foreground=tuple(mirror_pixels(f, width) for f in observations.foreground),
        away=tuple(distance[:, ::-1] for distance in observations.away),
        matches=Matches(
            matches.frame, mirror_pixels(matches.start, width), mirror_pixels(matches.end, width)
        ),
        marks=marks,
    )


def mirror_pose(pose: RootPose) -> RootPose:
    """The pose in mirrored space; capsules must be mirrored with it."""
    flip = np.diag(ACROSS)
    return RootPose(pose.origins * ACROSS, flip @ pose.rotations @ flip)


def mirror_capsules(capsules: Capsules) -> Capsules:
    """Capsules of the mirrored body, for a mirrored pose."""
    return replace(capsules, start=capsules.start * ACROSS, end=capsules.end * ACROSS)
