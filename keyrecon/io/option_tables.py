"""Option records as the `[options]` table of project.toml, and back, checked by their types.

Only what differs from the defaults is kept. What a person typed into the file is held against the
type of the option: a name that does not exist, a word that is not among the choices or a truth
value where a number belongs is named in one line with what is allowed.
"""

import types
from collections.abc import Collection
from dataclasses import Field, fields, replace
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    runtime_checkable,
)

import msgspec

from keyrecon.errors import KeyreconError


@runtime_checkable
class OptionRecord(Protocol):
    """Any dataclass of options."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


Record = TypeVar("Record", bound=OptionRecord)
FORMER_NAMES = {
    "lift.flips": "lift.depth_signs",
    "lift.depth_signs.confirmed": "lift.depth_signs.annotated",
    "lift.depth_signs.limits": "lift.depth_signs.joint_limits",
    "lift.depth_signs.votes": "lift.depth_signs.exemplars",
    "lift.depth_signs.guide": "lift.depth_signs.initial_motion",
    "lift.depth_signs.usual": "lift.depth_signs.expected_depth",
    "lift.depth_signs.alike": "lift.depth_signs.exemplar_spread",
    "lift.depth_signs.jerk": "lift.depth_signs.acceleration",
    "lift.depth_signs.reach": "lift.depth_signs.max_jump_cost",
    "method": "golf.method",
    "observation": "golf.observation",
    "fit": "golf.fit",
    "windows": "golf.windows",
    "candidates": "golf.candidates",
    "guided_rounds": "golf.guided_rounds",
    "guided_detection": "golf.guided_detection",
    "events": "golf.events",
    "proportions": "golf.proportions",
}
"""Options that older project files set under another name, in the order in which they are read."""
NUMBERS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}


def changed_options(
    options: OptionRecord,
    defaults: OptionRecord,
    prefix: str = "",
    typed: Collection[str] = (),
) -> dict[str, Any]:
    """Dotted names and values of the options that differ from the defaults, or were `typed`.

    None among them, which no file can hold, is an option that has no value.
    """
    changed: dict[str, Any] = {}
    for field in fields(options):
        value, default = getattr(options, field.name), getattr(defaults, field.name)
        if isinstance(value, OptionRecord):
            changed |= changed_options(value, default, f"{prefix}{field.name}.", typed)
        elif value != default or prefix + field.name in typed:
            changed[prefix + field.name] = value
    return changed


def nested_tables(changes: dict[str, Any]) -> dict[str, Any]:
    """Tables within tables from names with dots, as TOML reads them."""
    tables: dict[str, Any] = {}
    for name, value in changes.items():
        *path, last = name.split(".")
        table = tables
        for part in path:
            table = table.setdefault(part, {})
        table[last] = value
    return tables


def flat_options(tables: object, prefix: str = "") -> dict[str, Any]:
    """Names with dots and values of tables within tables."""
    if not isinstance(tables, dict):
        return {}
    flat: dict[str, Any] = {}
    for name, value in tables.items():
        inside = isinstance(value, dict)
        flat |= flat_options(value, f"{prefix}{name}.") if inside else {prefix + name: value}
    return flat


def table_of(tables: object, section: str | None, sections: Collection[str]) -> object:
    """The options of a section, or of none of the `sections`; what is no table stays as it is."""
    if not isinstance(tables, dict):
        return tables
    if section is not None:
        return tables.get(section, {})
    return {name: value for name, value in tables.items() if name not in sections}


def former_names(name: str) -> list[str]:
    """Names under which older project files may set an option."""
    formers: list[str] = []
    for former, current in reversed(FORMER_NAMES.items()):
        for known in (name, *formers):
            if known == current or known.startswith(f"{current}."):
                formers.append(former + known.removeprefix(current))
    return formers


def with_current_names(changes: object) -> object:
    """Nested tables with the options of `FORMER_NAMES` under their present names."""
    if not isinstance(changes, dict):
        return changes
    tables = _copied(changes)
    for former, current in FORMER_NAMES.items():
        *path, last = former.split(".")
        table = _table_at(tables, path)
        if table is None or last not in table:
            continue
        value = table.pop(last)
        *path, last = current.split(".")
        table = tables
        for part in path:
            table = table.setdefault(part, {})
        present = table.get(last)
        both = isinstance(value, dict) and isinstance(present, dict)
        table[last] = value | present if both else value if present is None else present
    return tables


def _copied(tables: dict[str, Any]) -> dict[str, Any]:
    return {n: _copied(v) if isinstance(v, dict) else v for n, v in tables.items()}


def _table_at(tables: dict[str, Any], path: list[str]) -> dict[str, Any] | None:
    """The table under a path of names; None where there is none."""
    table: object = tables
    for part in path:
        table = table.get(part) if isinstance(table, dict) else None
    return table if isinstance(table, dict) else None


def with_changes(options: Record, changes: object, where: str = "options") -> Record:
    """Options with the fields of nested tables set; KeyreconError names key, value and choice."""
    if not isinstance(changes, dict):
        raise KeyreconError(f"project.toml: {where} must be a table; found {changes!r}.")
    known = {field.name for field in fields(options)}
    allowed = get_type_hints(type(options), include_extras=True)
    new: dict[str, Any] = {}
    for name, value in changes.items():
        if name not in known:
            raise KeyreconError(
                f"project.toml sets {where}.{name}, which does not exist; "
                f"{where} has {', '.join(sorted(known))}."
            )
        current = getattr(options, name)
        if isinstance(current, OptionRecord):
            new[name] = with_changes(current, value, f"{where}.{name}")
        else:
            new[name] = _checked(value, allowed[name], f"project.toml: {where}.{name}")
    return replace(options, **new)


def check_options(options: OptionRecord, prefix: str = "") -> None:
    """Raise KeyreconError that names an option with a value that it cannot have."""
    allowed = get_type_hints(type(options), include_extras=True)
    for field in fields(options):
        value, name = getattr(options, field.name), f"{prefix}{field.name}"
        if isinstance(value, OptionRecord):
            check_options(value, f"{name}.")
        elif isinstance(value, int | float | tuple):
            flag = name.replace("_", "-")
            _checked(value, allowed[field.name], flag if prefix == "--" else f"The option {name}")


def _checked(value: object, allowed: Any, where: str) -> Any:
    try:
        return msgspec.convert(value, type=allowed)
    except msgspec.ValidationError as fault:
        raise KeyreconError(f"{where} cannot be {value!r}; it is {_describe(allowed)}.") from fault


def _describe(allowed: Any) -> str:
    """A type in words."""
    origin, parts = get_origin(allowed), get_args(allowed)
    if origin is Annotated:
        kind, (span, *_) = parts[0], parts[1:]
        return f"{_describe(kind)} from {span.ge:g} to {span.le:g}"
    if origin is Literal:
        return "one of " + ", ".join(f"'{choice}'" for choice in parts)
    if origin in (Union, types.UnionType):
        return " or ".join(_describe(part) for part in parts if part is not type(None))
    if origin is tuple:
        return f"a list, each {_describe(parts[0])}"
    return NUMBERS.get(allowed, f"a {getattr(allowed, '__name__', allowed)}")
