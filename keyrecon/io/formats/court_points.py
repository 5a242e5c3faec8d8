"""court_points.json: {"points": [{"name", "frame", "x", "y"}, ...]}.

Points of the court that a person clicked, px of the video.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text, reading, real, whole
from keyrecon.world.records import CourtClick


def read_court_points(path: Path) -> tuple[CourtClick, ...]:
    """Read clicks; raises KeyreconError for a file that does not hold them."""
    with reading(path, "a file of points of the court", "move it away and click them again"):
        return tuple(_click(row) for row in parse_json(read_text(path))["points"])


def _click(row: dict[str, Any]) -> CourtClick:
    if not isinstance(row["name"], str):
        raise ValueError(f"{row['name']!r} is not the name of a point")
    return CourtClick(row["name"], whole(row["frame"]), real(row["x"]), real(row["y"]))


def write_court_points(path: Path, clicks: Sequence[CourtClick]) -> None:
    """Write clicks durably, one to a line."""
    rows = [{"name": c.name, "frame": c.frame, "x": c.x, "y": c.y} for c in clicks]
    body = ",\n  ".join(json.dumps(row) for row in rows)
    write_durably(path, f'{{"points": [\n  {body}\n]}}\n')


def merge_clicks(old: Sequence[CourtClick], new: Sequence[CourtClick]) -> tuple[CourtClick, ...]:
    """Both, in one order; a click on the same point in the same frame takes the old one's place."""
    kept = {(click.frame, click.name): click for click in (*old, *new)}
    return tuple(kept[key] for key in sorted(kept))
