"""Messages in the words of the page.

The stages and the project folder say what would help as somebody at a command line does it
("run: keyrecon keyframes rally"). Somebody on the page has no command line: a command becomes the
step of the page that does the same, an option what it means.
"""

import re
from functools import partial

_NAME = r"(?:'[^']*'|[^\s',;]+?)(?=[\s,;.)]|$)"
PHRASES = (
    (r"the terminal that runs keyrecon annotate", "the terminal that this page was started in"),
    (r"keyrecon [\w ]+(?= \(process )", "A command in a terminal"),
    (rf"is working on {_NAME}(?=;)", "is working on this project"),
    (r"or stop that keyrecon annotate first", "or stop the program that serves it"),
    (r"mark (more )?joints with `keyrecon annotate`", r"mark \1joints (2 Keyframes)"),
    (rf"Mark them on the page of keyrecon annotate {_NAME}.*--partial", "Mark them (2 Keyframes)."),
    (rf"on the page of keyrecon annotate {_NAME}, and fit the swing there; or give --clicks FILE",
     "(1 Address)"),
    (r"\(say \"left_handed\": (?:true|false)\)", "(see to 'left-handed' in 1 Address)"),
    (r"give --slowmo if you know", "begin a new project with the slow motion it has if you know"),
    (rf" on the page of keyrecon annotate {_NAME}", " (1 Body)"),
    (r",? or with: keyrecon pick [^;]*(?=;)", ""),
    (rf"import them: keyrecon import {_NAME} FILE", "take them from a file (4 Files)"),
    (
        rf"(?:[Rr]un|for that): keyrecon keyframes {_NAME}(?: --method paper)?",
        "choose the keyframes (1 Body)",
    ),
    (r"[Mm]ake it again with `?keyrecon keyframes`?", "choose the keyframes (1 Body)"),
    (rf"make it with:? keyrecon run(?: {_NAME})?", "make the motion (3 Motion)"),
    (r"make the motion anew with keyrecon run", "make the motion anew (3 Motion)"),
    (rf"make one with: keyrecon new VIDEO --project {_NAME}", "start a new project"),
    (r"start a new project for it with: keyrecon new", "start a new project for it"),
    (rf"tell where it is now with: keyrecon relink {_NAME} VIDEO", "put it back there"),
    (r" with --end(?=,)", ""),
    (r"--budget [\d.]+ or more allows that", "a larger share of frames to mark allows that"),
    (r"--height is the athlete's height in metres; (\S+) cannot be",
     r"the player's height cannot be \1 m"),
    (rf": keyrecon ground {_NAME} --(?:vertical|horizon|fov) [^.;\n]*", "."),
    (rf": keyrecon run {_NAME} --fov DEGREES",
     "; type it in degrees as field of view, beside the height"),
    (r"--fov is", "The field of view is"),
    (rf"first with keyrecon run {_NAME} --height METRES", "first (3 Motion)."),
    (rf"(a report with the \w+): keyrecon run {_NAME}", r"\1, make the motion anew (3 Motion)."),
    (r"\(keyrecon run --height\)", "(3 Motion)"),
    (r"with --shots\.use or by a click in the strip of shots on the page",
     "by a click in the strip of shots (1 Body)"),
    (r"with --shots\.use or --shots\.skip and their numbers",
     "by a click in the strip of shots (1 Body)"),
    (r"--coverage", "the coverage"),
    (r"--reach", "the reach"),
    (r"--budget", "what is marked"),
)  # fmt: skip
"""What the terminal reads, and what the page says for it."""
OTHER = {
    "new": "start a new project",
    "relink": "put the video back where it was",
    "pick": "teach the colours by clicks (1 Body)",
    "keyframes": "choose the keyframes (1 Body)",
    "annotate": "mark joints (2 Keyframes)",
    "import": "take marks from a file (4 Files)",
    "run": "make the motion (3 Motion)",
    "court": "find the court (5 Court)",
    "ground": "find the ground (6 Ground)",
    "golf": "fit the swing (2 Swing)",
    "export": "write the files (4 Files)",
}
"""What the page calls the work of a command, in messages that nobody thought of here."""
FOR_TERMINALS = ("keyrecon ", "--", '"left_handed"')
"""What only messages to somebody at a command line, or at a file of clicks, have in them."""
_PHRASES = tuple((re.compile(said), read) for said, read in PHRASES)
_COMMAND = re.compile(rf"(?:\b(?:run|with): )?`?\bkeyrecon ({'|'.join(OTHER)})\b[^.;\n]*")
_NEXT = re.compile(r"^Next: .*\n?", re.MULTILINE)
_OPTION = re.compile(r"--[a-z][\w-]*(?:\.\w+)*")


def in_page_words(text: str) -> str:
    """A message without commands and options; one that names none is left as it is."""
    if not any(sign in text for sign in FOR_TERMINALS):
        return text
    words = _NEXT.sub("", text).rstrip()
    for said, read in _PHRASES:
        words = said.sub(partial(_in_sentence, read), words)
    words = _COMMAND.sub(lambda found: OTHER[found[1]], words)
    return _OPTION.sub(lambda found: f"the option '{found[0][2:].replace('.', ': ')}'", words)


def _in_sentence(read: str, match: re.Match[str]) -> str:
    """What is read for what was found, with a capital at the start of a sentence."""
    words = match.expand(read)
    before = match.string[: match.start()].rstrip(" ")
    starts = words[:1].strip() and (not before or before[-1] in ".\n")
    return words[0].upper() + words[1:] if starts else words
