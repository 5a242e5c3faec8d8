"""A tennis court in one picture: found from its lines alone, or not.

Lines of the picture give guesses, each guess is fitted to the picture, and the camera that most of
the model's lines speak for is taken. Whether there is a court at all is decided by how much of the
model's lines is seen where the model has them, against what a wrong camera reaches, and by the next
best camera that puts the court elsewhere.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.io.frame_reader import reduce_picture
from keyrecon.world.clicked_points import TOLERANCE, point_errors
from keyrecon.world.court import CourtModel
from keyrecon.world.court_hypotheses import guess_cameras, views_differ
from keyrecon.world.line_fit import LineFit, evaluate, fit_lines
from keyrecon.world.line_pixels import find_line_pixels, find_lines
from keyrecon.world.pinhole import Pinhole

DETECTION_WIDTH = 960
"""Width of the picture in which lines are first looked for, px."""
MOST_LINES, MOST_GUESSES = 20, 10
"""Straight lines that are tried, and cameras that are fitted to the picture."""
MIN_SUPPORT, MIN_EVIDENCE = 0.6, 50.0
"""What the lines must bear out before a court is believed in: share of the model's lines in the
picture, and log likelihood ratio."""
MIN_LINES = 5
"""Lines that are seen: four fit any two pairs, with one number to spare."""
MIN_NET, FEWEST_OF_NET = 0.15, 12
"""Share of the net's tape that is seen where it is in the picture, and samples from which on it is:
.28 to 1 on three real clips and seven rendered ones, 0 to .05 where badminton and pickleball courts
passed for tennis courts."""
MAX_RIVAL = 0.75
"""Evidence of the next best camera that puts the court elsewhere, as a share of the best one's."""
LOWEST = 0.2
"""Metres above the ground at which a camera is at least."""
ASK = (
    "click points of the court that can be seen, four or more and not all on one line, with "
    "--point NAME:FRAME:X,Y "
    "(names: near-left, near-right, net-middle, near-service, ...)."
)
NO_COURT = f"No tennis court was found; if one can be seen, {ASK}"


@dataclass(frozen=True, eq=False)
class CourtView:
    """The camera of one frame, found from its lines or from clicks."""

    frame: int
    fit: LineFit | None
    """None where there was nothing to fit."""
    doubt: str = ""
    """Why it is not believed; empty where it is."""

    @property
    def camera(self) -> Pinhole:
        """The camera of a view that has one."""
        if self.fit is None:
            raise ValueError("this view has no camera")
        return self.fit.camera


@dataclass(frozen=True, eq=False)
class ClickedPixels:
    """Named points of the court in one picture."""

    names: tuple[str, ...]
    pixels: Float[np.ndarray, "n 2"]


def find_in_picture(
    grey: UInt8[np.ndarray, "h w"],
    court: CourtModel,
    frame: int = 0,
    clicks: ClickedPixels | None = None,
) -> CourtView:
    """The court in one picture, from its lines; a view in doubt says why.

    Clicks rule out cameras that do not see their points there.
    """
    small = reduce_picture(grey, min(DETECTION_WIDTH, grey.shape[1]))
    scale = grey.shape[1] / small.shape[1]
    pixels = find_line_pixels(small)
    lines = find_lines(pixels, small.shape, MOST_LINES)
    guesses = guess_cameras(lines, pixels, court, small.shape, MOST_GUESSES)
    fits = [fit_lines(grey, guess.camera.resized(scale), court) for guess in guesses]
    fits = [fit for fit in fits if fit.camera.centre[2] > LOWEST and len(fit.residual)]
    if clicks is not None:
        limit = TOLERANCE * grey.shape[1]
        fits = [fit for fit in fits if click_error(fit.camera, clicks).max() <= limit]
    if not fits:
        return CourtView(frame, None, NO_COURT)
    fits.sort(key=lambda fit: -fit.evidence)
    best = fits[0]
    rivals = [f for f in fits[1:] if views_differ(best.camera, f.camera, grey.shape)]
    rival = max((fit.evidence for fit in rivals), default=-np.inf)
    best = evaluate(grey, from_near_half(best.camera), court)
    return CourtView(frame, best, _doubt(best, rival, court))


def _doubt(best: LineFit, rival: float, court: CourtModel) -> str:
    """Why a camera is not believed; empty where it is."""
    seen = best.lines_seen(court)
    if best.support < MIN_SUPPORT or best.evidence < MIN_EVIDENCE:
        return NO_COURT
    if len(seen) < MIN_LINES:
        return (
            f"Only {len(seen)} lines of a tennis court can be made out ({', '.join(seen)}), which "
            f"leaves the camera open; {ASK}"
        )
    if not _has_net(best, court):
        return (
            "The lines would fit a tennis court, but no net is where its net would be; if this is "
            f"not another sport's court, {ASK}"
        )
    if rival > MAX_RIVAL * best.evidence:
        return f"The lines fit a tennis court in two places; {ASK}"
    return ""


def _has_net(fit: LineFit, court: CourtModel) -> bool:
    """Whether the net's tape is seen, or is not in the picture."""
    raised = court.ends[fit.samples.line][:, 0, 2] > 0
    return raised.sum() < FEWEST_OF_NET or float(fit.hit[raised].mean()) >= MIN_NET


def from_near_half(camera: Pinhole) -> Pinhole:
    """The same view with the camera on the near half: the court looks alike from both ends."""
    if camera.centre[1] <= 0:
        return camera
    half_turn = np.diag([-1.0, -1.0, 1.0])
    return replace(camera, rotation=camera.rotation @ half_turn, centre=half_turn @ camera.centre)


def click_error(camera: Pinhole, clicks: ClickedPixels) -> Float[np.ndarray, "n"]:
    """How far each click lies from its point, px; their names may be those from the other half."""
    half_turn = np.diag([-1.0, -1.0, 1.0])
    turned = replace(camera, rotation=camera.rotation @ half_turn, centre=half_turn @ camera.centre)
    here, there = (point_errors(c, clicks.names, clicks.pixels) for c in (camera, turned))
    return here if here.max() <= there.max() else there
