"""How stages are called: at once, or by someone who keeps their results."""

from collections.abc import Callable
from typing import ParamSpec, Protocol, TypeVar, runtime_checkable

from keyrecon.numerics.threads import one_order_of_sums

Inputs = ParamSpec("Inputs")
Result = TypeVar("Result")


@runtime_checkable
class Keep(Protocol):
    """Calls a stage, or gives what the same call gave before.

    The name is for those that store results. Arguments and result are typed as the stage's own.
    """

    def __call__(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The stage's result for these inputs."""
        ...


def call_stage(
    name: str,
    stage: Callable[Inputs, Result],
    /,
    *inputs: Inputs.args,
    **named: Inputs.kwargs,
) -> Result:
    """Call a stage; the simplest `Keep`."""
    with one_order_of_sums():
        return stage(*inputs, **named)
