"""What the page says: no command and no option of the command line."""

import ast
import re
from pathlib import Path

import pytest

import keyrecon
from keyrecon.annotate.server.page_words import in_page_words

PACKAGE = Path(keyrecon.__file__).parent
ELSEWHERE = (
    *("cli.py", "commands", "demo.py", "golf_demo.py"),
    *("golf_training.py", "golf_page.py", "depth_training.py", "model_file.py", "synthetic"),
    *("paper", "annotator.py", "page_words.py", "address.py", "security.py"),
)
"""Files and folders whose messages are for a terminal: nothing the page asks for ends there."""
COMMANDS = (
    "new",
    "golf",
    "pick",
    "keyframes",
    "annotate",
    "import",
    "run",
    "export",
    "evaluate",
    "relink",
    "court",
    "ground",
)
COMMAND_LINE = re.compile(rf"keyrecon ({'|'.join(COMMANDS)})\b|--[a-z]")


def texts(node):
    """Every text in a module that is no docstring, values in it replaced by a word."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
            continue
        if isinstance(child, ast.JoinedStr):
            yield "".join(p.value if isinstance(p, ast.Constant) else "rally" for p in child.values)
        elif isinstance(child, ast.Constant) and isinstance(child.value, str):
            yield child.value
        else:
            yield from texts(child)


def messages():
    for path in sorted(PACKAGE.rglob("*.py")):
        if {*path.relative_to(PACKAGE).parts} & {*ELSEWHERE}:
            continue
        for text in texts(ast.parse(path.read_text())):
            if " " in text.strip() and COMMAND_LINE.search(text):
                yield path.stem, text


def test_no_message_names_a_command_or_an_option_to_somebody_on_the_page():
    read = [(module, in_page_words(text)) for module, text in messages()]
    assert len(read) > 50
    assert [(module, text) for module, text in read if COMMAND_LINE.search(text)] == []


@pytest.mark.parametrize(
    ("said", "read"),
    [
        (
            "No keyframes have been chosen yet; run: keyrecon keyframes 'my rally'",
            "No keyframes have been chosen yet; choose the keyframes (1 Body)",
        ),
        (
            "There is no motion at p/motion.npz; make it with: keyrecon run /tmp/p",
            "There is no motion at p/motion.npz; make the motion (3 Motion)",
        ),
        (
            "--height is the athlete's height in metres; 188 cannot be.",
            "The player's height cannot be 188 m.",
        ),
        (
            "swing has no clicks yet. Click six joints of the address on the page of keyrecon "
            "annotate swing, and fit the swing there; or give --clicks FILE.",
            "swing has no clicks yet. Click six joints of the address (1 Address).",
        ),
        (
            'Either the player is left-handed (say "left_handed": true), or not.',
            "Either the player is left-handed (see to 'left-handed' in 1 Address), or not.",
        ),
        ("picks.json: 1 head.\nNext: keyrecon keyframes p", "picks.json: 1 head."),
        ("Frame 40 cannot be decoded.", "Frame 40 cannot be decoded."),
    ],
)
def test_a_command_is_read_as_the_step_of_the_page_that_does_it(said, read):
    assert in_page_words(said) == read
