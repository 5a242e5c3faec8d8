"""The one exception for what a user can mend, and words that its messages share."""

import json
import re
import shlex
from pathlib import Path
from zipfile import BadZipFile

MAX_WORDS = 160
"""Characters of a library's own message that are shown; some quote the file."""

_PYTHONS_WORDS = re.compile(r"object (is|does|has) n|indices must be|has no attribute|has no len")
"""In what Python says of a null, or of a list where a table belongs."""


class KeyreconError(Exception):
    """What was found, then what would help; the command line prints it as one line."""


def explain(fault: Exception) -> str:
    """What a reader stumbled over, in words for who has the file; always one line."""
    match fault:
        case KeyError():
            words = f"no {fault}"
        case json.JSONDecodeError():
            words = f"no JSON from line {fault.lineno}, column {fault.colno} on"
        case UnicodeDecodeError():
            words = f"byte {fault.start} is not {fault.encoding} text"
        case RecursionError():
            words = "nested too deeply"
        case MemoryError():
            words = "it asks for more memory than there is"
        case TypeError() | AttributeError() if _PYTHONS_WORDS.search(str(fault)):
            words = "a value is missing or of another kind than it has to be"
        case OSError() if fault.strerror:
            words = fault.strerror
        case ValueError() if "allow_pickle" in str(fault):  # numpy's advice would be unsafe
            words = "another format"
        case BadZipFile() if "not a zip" in str(fault):
            words = "another format"
        case _:
            words = str(fault) or type(fault).__name__
    line = " ".join(words.split())
    return line if len(line) <= MAX_WORDS else line[:MAX_WORDS] + " ..."


def quoted(path: Path) -> str:
    """A path as it is typed on a command line that a message proposes."""
    return shlex.quote(str(path))


def counted(number: int, what: str) -> str:
    """1 frame, 2 frames."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
