"""The command line: finds the command that was typed, and turns faults into one line.

Exit codes: 0 success, 1 with one line on stderr for what a user can mend, 2 with one for bad usage,
130 when interrupted (finished stages are kept, the same command goes on from there), 141 when
whoever read the output has gone.

Only the module of the command that was typed is imported; the others show up in the help by the
first line of their docstrings, which is read from their source. `--help` shows what is used
daily, `--help-all` the options of every stage too.
"""

import ast
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partial, wraps
from importlib import import_module
from importlib.resources import files
from io import StringIO
from types import FrameType
from typing import Any, NamedTuple, NoReturn

from tyro.extras import SubcommandApp

from keyrecon import __version__
from keyrecon.commands.option_help import described_options
from keyrecon.commands.refusals import explain_refusal, no_such_command
from keyrecon.errors import KeyreconError

DESCRIPTION = "3D motion of an athlete from one ordinary camera and a few keyframes."
BAD_USAGE, INTERRUPTED, READER_GONE = 2, 130, 141


class Command(NamedTuple):
    """Where a command is."""

    package: str
    module: str
    name: str
    """Of the function."""


COMMANDS: dict[str, Command | dict[str, Command]] = {
    "demo": Command("keyrecon.commands", "projects", "demo"),
    "new": Command("keyrecon.commands", "projects", "new"),
    "add": Command("keyrecon.commands", "projects", "add"),
    "pick": Command("keyrecon.commands", "projects", "pick"),
    "keyframes": Command("keyrecon.commands", "reconstruction", "keyframes"),
    "annotate": Command("keyrecon.commands", "projects", "annotate"),
    "import": Command("keyrecon.commands", "projects", "import_"),
    "run": Command("keyrecon.commands", "reconstruction", "run"),
    "export": Command("keyrecon.commands", "exports", "export"),
    "evaluate": Command("keyrecon.commands", "projects", "evaluate"),
    "synth": Command("keyrecon.commands", "captures", "synth"),
    "court": Command("keyrecon.commands", "court", "court"),
    "ground": Command("keyrecon.commands", "ground", "ground"),
    "relink": Command("keyrecon.commands", "projects", "relink"),
    "depths": Command("keyrecon.commands", "captures", "depths"),
    "sides": Command("keyrecon.commands", "captures", "sides"),
    "golf": {
        "fit": Command("keyrecon.commands", "golf", "fit"),
        "compare": Command("keyrecon.commands", "golf", "compare"),
        "train": Command("keyrecon.commands", "golf", "train"),
    },
}
"""In the order of the help; a table of commands has a name in front of theirs."""
SUMMARIES = {"golf": "A model of whole golf swings: fit it to a video, compare, train it."}
"""Of tables of commands."""
HELP, HELP_ALL, VERSION = ("-h", "--help"), "--help-all", "--version"


def main() -> None:
    """Run the command line."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # read with numpy, by a command: numerics.threads
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
    if [*words] == [VERSION]:
        sys.stdout.write(f"keyrecon {__version__}\n")
    elif fault := no_such_command(words, COMMANDS):
        _refuse(fault)
    else:
        _parse(words)()


def _parse(words: Sequence[str]) -> Callable[[], None]:
    """The command that was typed, with its arguments; ends the program where it cannot be."""
    all_options = HELP_ALL in words or not {*HELP} & {*words}
    words = ["--help" if word == HELP_ALL else word for word in words]
    refusal = StringIO()
    try:
        with redirect_stderr(refusal):
            typed: Callable[[], None] = _read(words, all_options)
    except SystemExit as stop:
        if stop.code == BAD_USAGE:
            name = _name(words)
            whole_help = _whole_help(name)
            command = " ".join(["keyrecon", *name])
            _refuse(explain_refusal(command, words[len(name) :], refusal.getvalue(), whole_help))
        raise
    return typed


def _refuse(fault: str) -> NoReturn:
    sys.stderr.write(f"keyrecon: {fault}\n")
    sys.exit(BAD_USAGE)


def _name(words: Sequence[str]) -> list[str]:
    """The words of a command's name."""
    names = [*words[: 2 if words and isinstance(COMMANDS.get(words[0]), dict) else 1]]
    return [name for name in names if not name.startswith("-")]


def _whole_help(name: Sequence[str]) -> str:
    shown = StringIO()
    with redirect_stdout(shown), suppress(SystemExit):
        _read([*name, "--help"], all_options=True)
    return shown.getvalue()


def _read(words: Sequence[str], all_options: bool) -> Any:
    """What words mean; prints a help, or why there is no meaning, and raises SystemExit."""
    return _app(COMMANDS, words).cli(
        prog="keyrecon",
        description=DESCRIPTION,
        args=words,
        registry=described_options(all_options),
    )


def _app(commands: Mapping[str, Any], words: Sequence[str]) -> SubcommandApp:
    """Commands of which the one that was typed is there, the others by their summaries."""
    typed = words[0] if words else ""
    whole = typed.startswith("--tyro")  # completions for a shell tell every option
    app = SubcommandApp()
    for name, command in commands.items():
        named = whole or name == typed
        if isinstance(command, Command):
            registered = (
                _kept_for_later(_function(command)) if named else _stand_in(_first_line(command))
            )
            app.command(name=name)(registered)
        elif named:
            below = words if whole else words[1:]
            app.command(_app(command, below), name=name, help=SUMMARIES[name])
        else:
            app.command(name=name)(_stand_in(SUMMARIES[name]))
    return app


def _function(command: Command) -> Callable[..., None]:
    found: Callable[..., None] = getattr(
        import_module(f"{command.package}.{command.module}"), command.name
    )
    return found


def _kept_for_later(function: Callable[..., None]) -> Callable[..., Callable[[], None]]:
    """The same arguments, but a call that is still to be made."""

    @wraps(function)
    def keep(*arguments: Any, **named: Any) -> Callable[[], None]:
        return partial(function, *arguments, **named)

    return keep


def _stand_in(summary: str) -> Callable[[], None]:
    """A command that only its name and summary are shown of."""

    def command() -> None:
        raise AssertionError("only the command that was typed is called")

    command.__doc__ = summary
    return command


def _first_line(command: Command) -> str:
    """The first line of a command's docstring."""
    source = (files(command.package) / f"{command.module}.py").read_text("utf-8")
    functions = (n for n in ast.parse(source).body if isinstance(n, ast.FunctionDef))
    described = next(n for n in functions if n.name == command.name)
    return (ast.get_docstring(described) or "").partition("\n")[0]


if __name__ == "__main__":
    main()
