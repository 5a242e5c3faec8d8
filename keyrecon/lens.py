"""The focal length of a project's video, as far as it is known without its pictures."""

from pathlib import Path

import numpy as np

from keyrecon.errors import quoted
from keyrecon.io.formats.camera_file import read_camera
from keyrecon.io.lens_metadata import lens_focal
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, with_field_of_view
from keyrecon.records import Motion
from keyrecon.uncertainty import player_height
from keyrecon.world.ground_calibration import USUAL_FOCAL, FieldOfView

TYPED_ERROR, LENS_ERROR = 0.05, 0.12
"""Spread of the logarithm of a focal length by a field of view that was typed, and by the lens that
the file names: phones crop up to 10 % of the width where they stabilise (our estimate)."""
OPEN_FOCAL = 0.2
"""Spread from which on the focal length counts as open."""
NEAR_SHARE = 1 / 3
"""Stature in the picture's longer side from which on a player counts as near: with the usual lens
that is three body heights. PA-MPJPE with the lens told is a sixth less at two body heights (four
views of one man), a twentieth less at six to seven (`benchmarks/projected.py --lens 1`)."""

USUAL_DEGREES = "phones 60 to 75, held upright 35 to 45"
"""Across the picture."""


def known_focal(video: Video, degrees: float | None) -> FieldOfView | None:
    """The focal length by a field of view that was given, else by the lens that the file names."""
    if degrees is not None:
        focal = video.width / 2 / np.tan(np.radians(degrees) / 2)
        return FieldOfView(float(focal), TYPED_ERROR, f"the field of view of {degrees:g} degrees")
    if video.file_starts:  # several files, perhaps of several lenses
        return None
    lens = lens_focal(video.path, (video.width, video.height))
    return None if lens is None else FieldOfView(lens, LENS_ERROR, "the lens that the file names")


def known_lens(workspace: Workspace, video: Video) -> FieldOfView | None:
    """The focal length by `keyrecon ground`, by the file, or by a calibrated camera; None where
    none of them has it."""
    known = known_focal(video, workspace.ground_marks().field_of_view)
    return _calibrated_lens(workspace) if known is None else known


def with_known_lens(options: Options, workspace: Workspace, video: Video) -> Options:
    """The options of a run with what is known of the lens, where they do not tell it."""
    if options.lift.field_of_view is not None:
        return options
    lens = known_lens(workspace, video)
    return options if lens is None else with_field_of_view(options, degrees_across(lens, video))


def degrees_across(lens: FieldOfView, video: Video) -> float:
    """The angle across the picture, degrees."""
    return float(np.degrees(2 * np.arctan(video.width / 2 / lens.focal)))


def lens_advice(folder: Path, nearness: str) -> str:
    """What would help whose player was filmed from near, as a command."""
    return (
        f"{nearness} Depths come out better if it is told what the camera sees across the picture: "
        f"keyrecon run {quoted(folder)} --fov DEGREES ({USUAL_DEGREES})."
    )


def lens_caveat(nearness: str) -> str:
    """What would help, for who reads the report."""
    return (
        f"{nearness} Depths come out better where the motion is made with the field of view: the "
        f"degrees that the camera sees across the picture ({USUAL_DEGREES})."
    )


def describe_nearness(motion: Motion, video: Video) -> str | None:
    """That the camera may have stood near a player who is large in a picture of an unknown lens."""
    share = float(np.nanmedian(player_height(motion))) / max(video.width, video.height)
    if share < NEAR_SHARE:
        return None
    return (
        f"The player is {share:.0%} of the picture's longer side tall: unless the camera zoomed in "
        f"it stood within {USUAL_FOCAL / share:.1f} body heights, where limbs that are nearer look "
        "longer."
    )


def _calibrated_lens(workspace: Workspace) -> FieldOfView | None:
    """The median of all frames; None where no camera is known well enough."""
    if not workspace.camera_file.is_file():
        return None
    camera = read_camera(workspace.camera_file)
    focal = camera.focal[camera.found]
    if not len(focal):
        return None
    spread = float(np.median(camera.sd_focal[camera.found] / focal))
    if not spread <= OPEN_FOCAL:
        return None
    return FieldOfView(float(np.median(focal)), spread, f"the camera that the {camera.origin} told")
