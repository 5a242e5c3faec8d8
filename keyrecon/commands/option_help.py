"""What the help says of options: the first paragraph of the docstring under each.

The paragraphs after it hold the evidence for a value and what a reader of the code needs. A help
that is asked for with `--help` leaves out what belongs to one stage alone, the options with a dot
in their names; `--help-all` shows them too.
"""

import ast
import inspect
import textwrap
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import NoneType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from tyro.conf import Suppress, arg
from tyro.constructors import (
    ConstructorRegistry,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

OF_EVERY_STAGE = "keyrecon.pipeline"
"""Where the record is whose fields are the options of the stages."""


def described_options(with_stages: bool) -> ConstructorRegistry:
    """How option records become flags; those of single stages are shown where asked for."""
    registry = ConstructorRegistry()

    @registry.struct_rule
    def record(info: StructTypeInfo) -> StructConstructorSpec | None:
        if not (is_dataclass(info.type) and info.type.__module__.startswith("keyrecon.")):
            return None
        hints = get_type_hints(info.type, include_extras=True)
        hidden = not with_stages and info.type.__module__ == OF_EVERY_STAGE
        options = []
        for field in fields(info.type):
            default = _default(field, info.default)
            kind = hints[field.name]
            if is_dataclass(default) and hidden:
                kind = Annotated[kind, Suppress]
            text = explained(info.type).get(field.name)
            options.append(StructFieldSpec(field.name, _plain(kind), default, text))
        return StructConstructorSpec(info.type, tuple(options))

    return registry


@cache
def explained(record: type) -> dict[str, str]:
    """The first paragraph of the docstring under each field of a dataclass."""
    body = ast.parse(textwrap.dedent(inspect.getsource(record))).body[0]
    texts = {}
    if isinstance(body, ast.ClassDef):
        for line, below in zip(body.body, body.body[1:], strict=False):
            match line, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    texts[name] = " ".join(text.strip().partition("\n\n")[0].split())
    return texts


def _default(field: Field[Any], whole: Any) -> Any:
    if is_dataclass(whole):
        return getattr(whole, field.name)
    return field.default if field.default_factory is MISSING else field.default_factory()


def _plain(kind: Any) -> Any:
    """An option that may be left unset is shown by what it takes: FLOAT, not {None}|FLOAT."""
    inner = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    choices = get_args(inner)
    if NoneType not in choices:
        return kind
    taken = next(choice for choice in choices if choice is not NoneType)
    name = get_args(taken)[0] if get_origin(taken) is Annotated else taken
    return Annotated[kind, arg(metavar=name.__name__.upper(), help_behavior_hint="")]
