"""Two swings side by side, aligned at address, top, hit and finish: one HTML file.

The first swing leads: wherever it stands, the second is shown in the same posture, and curves are
drawn over the first swing's frames. Numbers stand beside each other with their difference and its
doubt, so that nobody takes for progress what two fits of one swing would differ by.
"""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.golf.records import RecordedSwing
from keyrecon.io.durable import write_durably
from keyrecon.io.video import Video
from keyrecon.progress import Progress, silent
from keyrecon.report.drawing import CLUB, SEAM, draw_pose
from keyrecon.report.golf_charts import curve_charts
from keyrecon.report.golf_measures import KEY_NAMES, SwingMeasures, measure_swing
from keyrecon.report.golf_page import golf_page
from keyrecon.report.golf_player import cut_clip, find_window, player
from keyrecon.report.golf_tables import DOUBT_NOTE, comparison_table, warning
from keyrecon.report.markup import note, section, text
from keyrecon.report.pictures import jpeg_uri

NAMES = ("A", "B")
STILL_HEIGHT = 420
"""px"""


def write_comparison(
    path: Path,
    swings: tuple[RecordedSwing, RecordedSwing],
    videos: tuple[Video, Video],
    titles: tuple[str, str],
    progress: Progress = silent,
) -> None:
    """Write the page of two swings; numbers of a doubtful fit are not shown."""
    measures = [measure_swing(swing) for swing in swings]
    reasons = [
        f"{name}: {doubt}" for name, s in zip(NAMES, swings, strict=True) for doubt in s.doubts
    ]
    clips = [
        replace(cut_clip(video, swing, progress), name=title)
        for video, swing, title in zip(videos, swings, titles, strict=True)
    ]
    body = "".join((
        '<header><p class="kicker">keyrecon, two swings</p>'
        f"<h1>{text(titles[0])} and {text(titles[1])}</h1>"
        '<p class="lead">Aligned at address, top, hit and finish; A leads, B is shown in the same '
        f"posture.</p></header>{warning(reasons)}",
        section("swing", "Side by side", player(swings, clips)),
        "" if reasons else _numbers(measures),
        _postures(swings, videos),
        "" if reasons else section(
            "curves", "How the bodies moved",
            note("Over the frames of A, solid with the band of its usual error; B dashed."),
            *curve_charts(swings, measures, NAMES),
        ),
    ))  # fmt: skip
    write_durably(path, golf_page(" and ".join(titles), body))


def _numbers(measures: list[SwingMeasures]) -> str:
    about = note(
        "With one standard deviation of doubt. A difference within twice its doubt may be none."
    )
    more = f"<details><summary>Where the doubts come from</summary>{note(DOUBT_NOTE)}</details>"
    return section("numbers", "Numbers", about, comparison_table(measures, NAMES), more)


def _postures(swings: tuple[RecordedSwing, RecordedSwing], videos: tuple[Video, Video]) -> str:
    """Both players at every key posture, A above B."""
    rows = []
    for letter, swing, video in zip(NAMES, swings, videos, strict=True):
        for name, frame, picture in zip(KEY_NAMES, *_stills(swing, video), strict=True):
            about = f"{letter}, {name.lower()}"
            rows.append(
                f'<div class="still"><img style="aspect-ratio:auto" src="{jpeg_uri(picture)}" '
                f'alt="{text(about)}"><span>{text(about)} <small>frame {frame}</small></span></div>'
            )
    return section("keys", "Key postures", f'<div class="pairs">{"".join(rows)}</div>')


def _stills(
    swing: RecordedSwing, video: Video
) -> tuple[list[int], list[UInt8[np.ndarray, "y x 3"]]]:
    frames = np.clip(np.nan_to_num(swing.keys).round().astype(int), 0, len(video) - 1).tolist()
    wanted = set(frames)
    read = dict(zip(sorted(wanted), video.chosen_frames(wanted, max(wanted)), strict=True))
    part = find_window(video, swing).part
    scale = STILL_HEIGHT / (part[0].stop - part[0].start)
    drawn = [_draw(swing, frame, read[frame])[part] for frame in frames]
    return frames, [
        cv2.resize(p, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for p in drawn
    ]


def _draw(
    swing: RecordedSwing, frame: int, picture: UInt8[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Skeleton and club on a picture."""
    motion = swing.motion
    drawn = draw_pose(
        picture, motion.points2d[frame], motion.skeleton, motion.points3d[frame, :, 2]
    )
    ends: Float[np.ndarray, "2 2"] = np.clip(swing.club2d[frame], -9e3, 9e3).round()
    grip, head = ((int(x), int(y)) for x, y in ends.tolist())
    cv2.line(drawn, grip, head, SEAM, 4, cv2.LINE_AA)
    cv2.line(drawn, grip, head, CLUB, 2, cv2.LINE_AA)
    return drawn
