"""The one exception for what a user can mend, and words that its messages share."""

import json
import shlex
from pathlib import Path


class KeyreconError(Exception):
    """What was found, then what would help; the command line prints it as one line."""


def explain(fault: Exception) -> str:
    """What a reader stumbled over, in words for who has the file."""
    match fault:
        case KeyError():
            return f"no {fault}"
        case json.JSONDecodeError():
            return f"no JSON from line {fault.lineno}, column {fault.colno} on"
        case OSError() if fault.strerror:
            return fault.strerror
        case ValueError() if "allow_pickle" in str(fault):  # numpy's advice would be unsafe
            return "another format"
    return str(fault)


def quoted(path: Path) -> str:
    """A path as it is typed on a command line that a message proposes."""
    return shlex.quote(str(path))
