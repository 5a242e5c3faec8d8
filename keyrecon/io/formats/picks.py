"""picks.json: {"picks": [{"frame", "part", "x", "y"}, ...]}, what a person clicked."""

import json
from collections.abc import Sequence
from pathlib import Path

from keyrecon.errors import KeyreconError, explain
from keyrecon.io.durable import write_durably
from keyrecon.records import Pick


def read_picks(path: Path) -> tuple[Pick, ...]:
    """Read clicks; raises KeyreconError for a file that does not hold them."""
    try:
        rows = json.loads(path.read_text())["picks"]
        return tuple(
            Pick(int(r["frame"]), str(r["part"]), float(r["x"]), float(r["y"])) for r in rows
        )
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise KeyreconError(
            f"{path} is not a file of picks ({explain(fault)}); mend it or move it away and pick "
            "again."
        ) from fault


def picks_text(picks: Sequence[Pick]) -> str:
    """Clicks as the text of a file, one to a line."""
    rows = [{"frame": p.frame, "part": p.part, "x": p.x, "y": p.y} for p in picks]
    body = ",\n  ".join(json.dumps(row) for row in rows)
    return f'{{"picks": [\n  {body}\n]}}\n'


def write_picks(path: Path, picks: Sequence[Pick]) -> None:
    """Write clicks durably."""
    write_durably(path, picks_text(picks))
