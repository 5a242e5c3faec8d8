"""The command line: finds the command that was typed, and turns faults into one line.

Exit codes: 0 success, 1 with one line on stderr for what a user can mend, 2 for bad usage,
130 when interrupted (finished stages are kept, the same command goes on from there), 141 when
whoever read the output has gone.

Only the module of the command that was typed is imported; the others show up in the help by the
first line of their docstrings, which is read from their source.
"""

import ast
import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.resources import files
from types import FrameType
from typing import Any, NamedTuple, NoReturn

from tyro.extras import SubcommandApp

from keyrecon.errors import KeyreconError

DESCRIPTION = "3D motion of an athlete from one ordinary camera and a few keyframes."
INTERRUPTED, READER_GONE = 130, 141


class Command(NamedTuple):
    """Where a command is."""

    package: str
    module: str
    name: str
    """Of the function, or of an app of commands of its own."""


COMMANDS = {
    "demo": Command("keyrecon.commands", "projects", "demo"),
    "new": Command("keyrecon.commands", "projects", "new"),
    "pick": Command("keyrecon.commands", "projects", "pick"),
    "keyframes": Command("keyrecon.commands", "reconstruction", "keyframes"),
    "annotate": Command("keyrecon.commands", "projects", "annotate"),
    "import": Command("keyrecon.commands", "projects", "import_"),
    "run": Command("keyrecon.commands", "reconstruction", "run"),
    "export": Command("keyrecon.commands", "exports", "export"),
    "evaluate": Command("keyrecon.commands", "projects", "evaluate"),
    "synth": Command("keyrecon.commands", "captures", "synth"),
    "court": Command("keyrecon.commands", "court", "court"),
    "relink": Command("keyrecon.commands", "projects", "relink"),
    "depths": Command("keyrecon.commands", "captures", "depths"),
    "golf": Command("keyrecon.app", "golf_commands", "golf"),
}
"""In the order of the help."""


def main() -> None:
    """Run the command line."""
    former = signal.signal(signal.SIGTERM, _stop)
    try:
        try:
            _run(sys.argv[1:])
        finally:
            sys.stdout.flush()
    except KeyreconError as fault:
        sys.stderr.write(f"keyrecon: {fault}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.stderr.write("\nkeyrecon: stopped; finished stages are kept, run it again to go on.\n")
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        # What is left in the buffer is written when Python ends, and would raise again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(READER_GONE)
    finally:
        signal.signal(signal.SIGTERM, former)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    """End as Ctrl-C does: files are whole, finished stages kept."""
    raise KeyboardInterrupt


def _run(words: Sequence[str]) -> None:
    typed = words[0] if words else ""
    whole = typed.startswith("--tyro")  # completions for a shell tell every option
    app = SubcommandApp()
    for name, command in COMMANDS.items():
        if whole or name == typed:
            handler = getattr(import_module(f"{command.package}.{command.module}"), command.name)
        else:
            handler = _stand_in(_first_line(command))
        if isinstance(handler, SubcommandApp):
            app.command(handler, name=name, help=_first_line(command))
        else:
            app.command(name=name)(handler)
    app.cli(prog="keyrecon", description=DESCRIPTION, args=list(words))


def _stand_in(summary: str) -> Callable[[], None]:
    """A command that only its name and summary are shown of."""

    def command() -> None:
        raise AssertionError("only the command that was typed is called")

    command.__doc__ = summary
    return command


def _first_line(command: Command) -> str:
    """The first line of a command's docstring; of an app of commands, of its module's."""
    source = (files(command.package) / f"{command.module}.py").read_text("utf-8")
    tree = ast.parse(source)
    functions = [n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == command.name]
    described: Any = functions[0] if functions else tree
    return (ast.get_docstring(described) or "").partition("\n")[0]


if __name__ == "__main__":
    main()
