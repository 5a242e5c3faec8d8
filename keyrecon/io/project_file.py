"""project.toml: the video, and the options that a person set.

    version = 1
    kind = "golf"                 # where the project is one of a golf swing

    [video]
    path = "../rally.mp4"
    fingerprint = "..."

    [[added]]                     # further files, one after the other
    path = "../second.mp4"
    fingerprint = "..."

    [options]
    keyframes.budget = 0.05

A person may write into it too: comments, tables of their own, options in any form that TOML has.
A change keeps all of that. It is read back before it is written: a text that would say anything
else than it should is not written at all.
"""

import re
import tomllib
from collections.abc import Callable, Collection, Mapping, MutableMapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keyrecon.errors import KeyreconError, quoted
from keyrecon.io.option_tables import flat_options, former_names, nested_tables, with_current_names
from keyrecon.reading import read_text, reading

if TYPE_CHECKING:
    from tomlkit import TOMLDocument

VERSION = 1
"""Of the file; one that tells none is of this version."""
VIDEO_FIELDS = {
    "path": (str,),
    "fingerprint": (str,),
    "start": (int,),
    "end": (int,),
    "slow_motion": (int, float),
}
"""What project.toml tells of the video; the first two must be there."""
KINDS = ("golf",)
"""What a project can be of, besides the general one that has no kind."""
OPTIONS_COMMENT = "Options that differ from the defaults."
REMEDY = "mend it, or make the project anew in another folder"
Project = dict[str, Any]


def read_project(path: Path) -> Project:
    """The file's tables; raises KeyreconError for one that is broken or of another version."""
    with reading(path, "a project file", REMEDY):
        return _checked(tomllib.loads(read_text(path)), path)


def _checked(project: Project, path: Path) -> Project:
    version = project.get("version", VERSION)
    if isinstance(version, int) and version > VERSION:
        raise KeyreconError(
            f"{path} is of version {version} and this keyrecon reads version {VERSION}; open the "
            "project with the keyrecon that made it."
        )
    if version is True or version != VERSION:
        raise ValueError(f"version cannot be {version!r}")
    added = project.get("added", [])
    if not isinstance(added, list):
        raise TypeError("added must be a list of tables")
    for table in (project["video"], *added):
        _check_video(table)
    if project.get("kind", KINDS[0]) not in KINDS:
        raise ValueError(f"kind cannot be {project['kind']!r}")
    if not isinstance(options := project.get("options", {}), dict):
        raise TypeError(f"options must be a table; found {options!r}")
    return project


def _check_video(table: Any) -> None:
    """Raise KeyError or TypeError where project.toml does not tell the video as we write it."""
    if not isinstance(table, dict):
        raise TypeError("video must be a table")
    for name, kinds in VIDEO_FIELDS.items():
        value = table[name] if name in ("path", "fingerprint") else table.get(name)
        if value is not None and type(value) not in kinds:
            raise TypeError(f"video.{name} cannot be {value!r}")
    if not 0 < table.get("slow_motion", 1) < float("inf"):
        raise ValueError(f"video.slow_motion cannot be {table['slow_motion']!r}")


def new_project(
    path: Path, video: Mapping[str, str | float | None], kind: str | None = None
) -> str:
    """The text of a new project's file; raises KeyreconError for a name that is no text."""
    import tomlkit

    project: Project = {"version": VERSION} | ({"kind": kind} if kind else {})
    project["video"] = {n: v for n, v in video.items() if v is not None}
    document = tomlkit.document()
    document.add(tomlkit.comment("A keyrecon project."))
    for name, value in project.items():
        document.add(name, value)
    return _proven(document.as_string(), project, path)


def with_video_path(path: Path, video_path: str, numbers: Collection[int]) -> str:
    """The file's text with another place of its video, number 0, or of those added, from 1 on."""
    document, project = _parse(path)
    for content in (document, project):
        for number in numbers:
            table: Any = content["added"][number - 1] if number else content["video"]
            table["path"] = video_path
    return _proven(document.as_string(), project, path)


def with_slow_motion(path: Path, factor: float) -> str:
    """The file's text with how many times slower than life its video plays."""
    document, project = _parse(path)
    for content in (document, project):
        table: Any = content["video"]
        table["slow_motion"] = factor
    return _proven(document.as_string(), project, path)


def with_added_video(path: Path, video: Mapping[str, str | float | None]) -> str:
    """The file's text with one more video."""
    import tomlkit

    document, project = _parse(path)
    added_video = {n: v for n, v in video.items() if v is not None}
    table = tomlkit.table()
    table.update(added_video)
    if "added" not in document:
        document.add("added", tomlkit.aot())
    added: Any = document["added"]
    added.append(table)
    return _proven(
        document.as_string(), {**project, "added": [*project.get("added", []), added_video]}, path
    )


def with_kind(path: Path, kind: str) -> str:
    """The file's text of a project that becomes one of a kind as well."""
    _, project = _parse(path)
    text = read_text(path)
    first_table = re.search(r"^[ \t]*\[", text, re.MULTILINE)
    at = first_table.start() if first_table else len(text)
    return _proven(f'{text[:at]}kind = "{kind}"\n\n{text[at:]}', {**project, "kind": kind}, path)


def with_options(path: Path, options: Mapping[str, Any]) -> str:
    """The file's text with these options, by dotted names, and no others; the rest as it is."""
    document, project = _parse(path)
    before = flat_options(with_current_names(project.get("options", {})))
    wanted = {name: _plain(value) for name, value in options.items()}
    if before == wanted:
        return read_text(path)
    if "options" not in document:
        import tomlkit

        document.add(tomlkit.nl())
        document.add(tomlkit.comment(OPTIONS_COMMENT))
        document.add("options", tomlkit.table())
    removed = [
        spelling
        for name in before.keys() - wanted.keys()
        for spelling in (name, *former_names(name))
    ]
    changed = {n: v for n, v in wanted.items() if n not in before or before[n] != v}
    expected = {**project, "options": nested_tables(wanted)}
    with reading(path, "a project file that can be changed", "write its options under [options]"):
        for name in removed:
            _remove(document["options"], name.split("."))
        for name, value in changed.items():
            _set(document["options"], name.split("."), value)
        text = document.as_string()
    return _proven(text, expected, path, with_current_names)


def _parse(path: Path) -> "tuple[TOMLDocument, Project]":
    """The file as TOML that can be changed, and as plain values."""
    import tomlkit

    with reading(path, "a project file", REMEDY):
        text = read_text(path)
        return tomlkit.parse(text), _checked(tomllib.loads(text), path)


def _plain(value: Any) -> Any:
    """An option's value as TOML gives it back."""
    return [_plain(part) for part in value] if isinstance(value, tuple | list) else value


def _remove(table: Any, path: list[str]) -> None:
    """Take an option away, where it is; tables that are empty then go too."""
    first, *deeper = path
    if first not in table:
        return
    if not deeper:
        del table[first]
    elif isinstance(table[first], MutableMapping):
        _remove(table[first], deeper)
        if not table[first]:
            del table[first]


def _set(table: Any, path: list[str], value: Any) -> None:
    """Give an option a value where it stands, or beside what is there."""
    import tomlkit

    first, *deeper = path
    if deeper and isinstance(table.get(first), MutableMapping):
        _set(table[first], deeper, value)
    elif deeper and isinstance(table, tomlkit.items.Table):
        table.append(tomlkit.key(path), value)
    elif deeper:  # in a table that is written in pieces or in one line, dotted names go wrong
        table[first] = nested_tables({".".join(deeper): value})
    else:
        table[first] = value


def _proven(
    text: str, expected: Project, path: Path, seen: Callable[[Any], Any] = lambda options: options
) -> str:
    """The text, if it says what is expected; `seen` is how its options are read."""
    try:
        said = tomllib.loads(text.encode().decode())
    except UnicodeEncodeError as fault:
        raise KeyreconError(
            f"{path} cannot hold the name {expected['video']['path']!r}, which is no text in "
            "UTF-8; rename the video or its folder."
        ) from fault
    except tomllib.TOMLDecodeError:
        said = {}
    if "options" in expected:
        said["options"] = seen(said.get("options", {}))
    if said != expected:
        raise KeyreconError(
            f"{path} is written in a way that keyrecon cannot change; set the options there by "
            "hand, or under one [options] heading."
        )
    return text


def no_project(folder: Path) -> KeyreconError:
    """What to do where there is no project.toml."""
    if folder.is_file():
        place = folder.with_suffix("") if folder.suffix else folder.with_name(f"{folder.name}-1")
        return KeyreconError(
            f"{folder} is a file, not a project folder; a project for a video is made with: "
            f"keyrecon new {quoted(folder)} --project {quoted(place)}"
        )
    return KeyreconError(
        f"{folder} is not a keyrecon project (no project.toml); "
        f"make one with: keyrecon new VIDEO --project {quoted(folder)}"
    )
