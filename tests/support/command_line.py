"""The command line, in the process of the test."""

import sys

from keyrecon import cli


def keyrecon(*words):
    """Run the command line in this process; returns its exit code."""
    before, sys.argv = sys.argv, ["keyrecon", *map(str, words)]
    try:
        cli.main()
    except SystemExit as stop:
        return stop.code or 0
    finally:
        sys.argv = before
    return 0
