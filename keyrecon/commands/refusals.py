"""What is told of a command line that cannot be: one line, with the nearest of what can."""

import re
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches

KINDS = {"FLOAT": "a number", "INT": "a whole number"}
"""What the help's words for values mean."""
_RULE = re.compile(r"╭|[\s│]*[─-]{4}")
"""A line between the parts of a frame; one where the terminal has no characters for frames."""
_FRAME = re.compile(r"^(?:│ | {2})| *│$")
_COLOR = re.compile(r"\x1b\[[\d;]*m")
_OPTION = re.compile(r"-{1,2}[A-Za-z][\w.-]*")


def no_such_command(words: Sequence[str], commands: Mapping[str, object]) -> str:
    """What is wrong with the name of a command; nothing if there is one, or help is asked for."""
    typed: list[str] = []
    known, table = "keyrecon", commands
    for word in [*words, ""]:
        if word.startswith("-"):
            return ""
        typed.append(word)
        if word not in table:
            break
        below = table[word]
        if not isinstance(below, Mapping):
            return ""
        known, table = f"{known} {word}", below
    listed = f"there are {', '.join(table)}. {known} --help tells what each does."
    if not word:
        return f"No command was named; {listed}"
    near = get_close_matches(word, table, 1)
    meant = f"the nearest is {' '.join([*typed[:-1], near[0]])}; " if near else ""
    return f"There is no command {' '.join(typed)}; {meant}{listed}"


def explain_refusal(command: str, words: Sequence[str], refusal: str, whole_help: str) -> str:
    """Why the words behind a command are refused, in one line.

    `refusal` is the frame of text that the parser printed, `whole_help` the help with every option.
    """
    options = known_options(whole_help)
    text = _first_paragraph(refusal)
    return f"{_reason(words, text, options)}; see {command} --help."


def known_options(whole_help: str) -> dict[str, str]:
    """The options that a help lists, with the kind of value that each takes."""
    found: dict[str, str] = {}
    for line in map(_bare, whole_help.splitlines()):
        if not line.lstrip().startswith("-"):
            continue
        names, *_ = re.split(r" {2,}", line.strip())
        kind = names.split()[-1]
        found |= {name: "" if kind.startswith("-") else kind for name in _OPTION.findall(names)}
    return found


def _reason(words: Sequence[str], refusal: Sequence[str], options: Mapping[str, str]) -> str:
    known = {name.replace("_", "-"): name for name in options}
    for word in words:
        name = word.partition("=")[0]
        if _OPTION.fullmatch(name) and name.replace("_", "-") not in known:
            near = _nearest(name, options)
            return f"There is no option {name}" + (f"; the nearest is {near}" if near else "")
    text = " ".join(" ".join(refusal).split())
    if match := re.match(r"Unrecognized options: ([^,]+)", text):
        return f"'{match[1]}' is one word too many"
    if match := re.match(r"Error parsing (?:-\w/)?([^:]+):", text):
        kind = options.get(match[1], "")
        return f"{match[1]} needs {KINDS.get(kind, kind)}{_got(match[1], words)}"
    if match := re.match(r"Missing value for argument '([^']+)'", text):
        kind = options.get(match[1], "a value")
        return f"{match[1]} needs {KINDS.get(kind, kind)} behind it"
    if re.match(r"Missing from ", text):
        needed = [line.strip() for line in refusal if re.match(r" {4}\S", line)]
        return f"What is missing: {', '.join(needed)}"
    if match := re.match(r"invalid choice '(.*)' for argument '(.+?)'. Expected one of (.+)", text):
        # The parser lists a set, in another order in every process: that of the help counts.
        listed = options.get(match[2], "")
        named = {choice for choice in re.findall(r"'([^']*)'", match[3]) if choice != "None"}
        choices = ", ".join(sorted(named, key=lambda choice: (listed.find(choice), choice)))
        return f"{match[2]} cannot be '{match[1]}'; it is one of {choices}"
    return text.rstrip(".")


def _nearest(name: str, options: Collection[str]) -> str:
    """The option that is most alike, rather one of a stage with the same word at its end."""
    last = name.lstrip("-").rpartition(".")[2]
    alike = [option for option in options if option.lstrip("-").rpartition(".")[2] == last]
    return next(
        iter(get_close_matches(name, alike, 1, 0.0) or get_close_matches(name, options)), ""
    )


def _got(option: str, words: Sequence[str]) -> str:
    """The value that was typed behind an option."""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        name, equals, value = word.partition("=")
        if name.replace("_", "-") == option.replace("_", "-"):
            return f"; got '{value if equals else following}'"
    return ""


def _first_paragraph(frame: str) -> list[str]:
    """The lines beneath the title of a frame, down to the next rule."""
    parts: list[list[str]] = [[]]
    for line in _COLOR.sub("", frame).splitlines():
        if _RULE.match(line):
            parts.append([])
        else:
            parts[-1].append(_bare(line))
    return parts[1] if len(parts) > 1 else parts[0]


def _bare(line: str) -> str:
    """A line without colours and without the frame around it."""
    return _FRAME.sub("", _COLOR.sub("", line).rstrip())
