"""picks.json: {"picks": [{"frame", "part", "x", "y"}, ...]}, what a person clicked."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text, reading, real, whole
from keyrecon.records import Pick


def read_picks(path: Path | str) -> tuple[Pick, ...]:
    """Read clicks; raises KeyreconError for a file that does not hold them."""
    path = Path(path)
    with reading(path, "a file of picks", "mend it or move it away and pick again"):
        return tuple(_pick(row) for row in parse_json(read_text(path))["picks"])


def _pick(row: dict[str, Any]) -> Pick:
    part = row["part"]
    if not isinstance(part, str) or not part.strip():
        raise ValueError(f"{part!r} is not the name of a part")
    if (frame := whole(row["frame"])) < 0:
        raise ValueError(f"{frame} is not a frame")
    return Pick(frame, part, real(row["x"]), real(row["y"]))


def picks_text(picks: Sequence[Pick]) -> str:
    """Clicks as the text of a file, one to a line."""
    rows = [{"frame": p.frame, "part": p.part, "x": p.x, "y": p.y} for p in picks]
    body = ",\n  ".join(json.dumps(row) for row in rows)
    return f'{{"picks": [\n  {body}\n]}}\n'


def write_picks(path: Path, picks: Sequence[Pick]) -> None:
    """Write clicks durably."""
    write_durably(path, picks_text(picks))
