"""A tennis court in one picture: found from its lines alone, or not.

Lines of the picture give guesses, each guess is fitted to the picture, and the camera that most of
the model's lines speak for is taken. Whether there is a court at all is decided by how much of the
model's lines is seen where the model has them, against what a wrong camera reaches, and by the next
best camera that puts the court elsewhere.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.io.frame_reader import reduce_picture
from keyrecon.world.clicked_points import TOLERANCE, point_errors
from keyrecon.world.court import HALF_DOUBLES, HALF_LENGTH, CourtModel
from keyrecon.world.court_hypotheses import find_camera_hypotheses, views_differ
from keyrecon.world.line_fit import LineFit, evaluate, fit_lines
from keyrecon.world.line_measurement import measure_offsets
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
MIN_OF_LINE, FEWEST_OF_LINE = 0.25, 12
"""Share of a painted line that is seen along one straight line near its place, and samples from
which on that is asked: .47 to 1 on five real clips, whole and cut to a part, and on painted views;
0 to .11 (one of .24) of lines that courts of other sports lack where they pass for tennis courts.
"""
BESIDE = 10.0
"""px to both sides in which such a line is looked for: lines of a picture that was cut out of a
wider one, or bent by a lens, lie beside the model's."""
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
    guesses = find_camera_hypotheses(lines, pixels, court, small.shape, MOST_GUESSES)
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
    doubt = _doubt(best, rival, court, grey.shape) or _missing(best, grey, court)
    return CourtView(frame, best, doubt)


def _doubt(best: LineFit, rival: float, court: CourtModel, shape: tuple[int, ...]) -> str:
    """Why a camera is not believed; empty where it is."""
    seen = best.lines_seen(court)
    if best.support < MIN_SUPPORT or best.evidence < MIN_EVIDENCE:
        return NO_COURT
    if len(seen) < MIN_LINES:
        return (
            f"Only {len(seen)} lines of a tennis court can be made out ({', '.join(seen)}), which "
            f"leaves the camera open; {ASK}"
        )
    if not _has_net(best, court, shape):
        return (
            "The lines would fit a tennis court, but no net is where its net would be; if this is "
            f"not another sport's court, {ASK}"
        )
    if rival > MAX_RIVAL * best.evidence:
        return f"The lines fit a tennis court in two places; {ASK}"
    return ""


def _has_net(fit: LineFit, court: CourtModel, shape: tuple[int, ...]) -> bool:
    """Whether the net's tape is seen; where it is not in the picture, whether that can be.

    A tape so near that it is too wide to be measured is in the picture and not seen. Nobody films
    from the court itself; of a camera there the whole net must be seen.
    """
    x, y = np.abs(fit.camera.centre[:2])
    if x < HALF_DOUBLES and y < HALF_LENGTH:
        return {name for name in court.names if "net" in name} <= set(fit.lines_seen(court))
    raised = court.ends[fit.samples.line][:, 0, 2] > 0
    if raised.sum() >= FEWEST_OF_NET:
        return float(fit.hit[raised].mean()) >= MIN_NET
    net = fit.camera.project(court.points[court.points[:, 2] > 0])
    shown = ((net > 0) & (net < np.array(shape[1::-1]) - 1)).all(axis=1)
    return bool(shown.sum() < FEWEST_OF_NET)


def _missing(fit: LineFit, grey: UInt8[np.ndarray, "h w"], court: CourtModel) -> str:
    """What a tennis court has and this picture lacks; empty where it lacks nothing."""
    support, count = fit.line_support(court)
    on_ground = (court.ends[..., 2] == 0).all(axis=1)
    asked = on_ground & (count >= FEWEST_OF_LINE) & (support < MIN_OF_LINE)
    if not asked.any():
        return ""
    offsets = measure_offsets(grey, fit.samples, BESIDE)
    lacking = [
        court.names[k]
        for k in np.flatnonzero(asked)
        if _share_in_line(offsets.offset, offsets.seen, fit.samples.line == k) < MIN_OF_LINE
    ]
    if not lacking:
        return ""
    return (
        f"The lines would fit a tennis court, but its {lacking[0]} is not to be seen where it "
        f"would be; if this is not another sport's court, {ASK}"
    )


def _share_in_line(
    offset: Float[np.ndarray, "M"], seen: Bool[np.ndarray, "M"], line: Bool[np.ndarray, "M"]
) -> float:
    """Largest share of a line's samples whose stripes lie on one straight line in the picture."""
    along = np.linspace(-1, 1, line.sum())[seen[line]]
    shift = np.arange(-BESIDE, BESIDE + 1)
    tried = shift[:, None, None] + shift[None, :, None] * along
    on_it = (np.abs(tried - offset[line & seen]) < 1).sum(axis=2)
    return float(on_it.max()) / float(line.sum())


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
