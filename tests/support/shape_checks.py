"""Shapes and types are checked at every function's door, for its first calls in a file of tests.

Whole jobs call some functions a hundred thousand times, and the hundredth call brings no kind of
array that the first ones did not.
"""

import sys
from collections.abc import Callable
from inspect import getattr_static
from typing import Any

from beartype import beartype

CALLS = 100
"""Checked of each function in a file of tests. All of them make test_shots_end_to_end.py take 1.7
times the processor's time that it takes without checks."""

_counts: dict[Callable[..., Any], int] = {}
_passed: list[Any] = []


def check_first_calls(template: Callable[..., Any]) -> Callable[..., Any]:
    """Beartype for jaxtyping, made when it is first needed; then the function is let pass."""
    checked: Callable[..., Any] | None = None

    def check(*args: Any, **kwargs: Any) -> Any:
        nonlocal checked
        checked = checked or beartype(template)
        _counts[template] = _counts.get(template, 0) + 1
        if _counts[template] == CALLS:
            _let_pass(template.__module__, template.__qualname__.split("."))
        return checked(*args, **kwargs)

    return check


def begin_file() -> None:
    """Count anew: whatever was let pass is checked again."""
    _counts.clear()
    for function in _passed:
        del function.__no_type_check__
    _passed.clear()


def _let_pass(module: str, path: list[str]) -> None:
    """Mark a function so that jaxtyping calls it at once; one within another is always checked."""
    found: Any = sys.modules[module]
    for name in path:
        found = getattr_static(found, name, None)
    inner = (getattr(found, name, None) for name in ("__func__", "fget", "func"))
    function = next((f for f in inner if f is not None), found)
    while function is not None:
        if callable(function) and not getattr(function, "__no_type_check__", False):
            function.__no_type_check__ = True
            _passed.append(function)
        function = getattr(function, "__wrapped__", None)
