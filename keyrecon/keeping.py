"""How stages are called: at once, or by someone who keeps their results or has workers."""

from collections.abc import Callable, Iterable, Iterator
from typing import ParamSpec, Protocol, TypeVar, runtime_checkable

from keyrecon.numerics.threads import one_order_of_sums
from keyrecon.parallel_map import ParallelMap, one_by_one

Item = TypeVar("Item")
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


@runtime_checkable
class KeepWithWorkers(Keep, Protocol):
    """One that may have stages run elsewhere, several at a time."""

    parallel_map: ParallelMap
    """Hands out pieces of one stage's work."""

    @property
    def has_workers(self) -> bool:
        """Whether there is anybody to hand it to."""
        ...

    @property
    def has_far_workers(self) -> bool:
        """Whether these are other machines."""
        ...

    def each(
        self, work: Callable[[Item], Result], items: Iterable[Item], large: bool = False
    ) -> Iterator[Result]:
        """`work`, which calls stages, done for every item, maybe side by side; in order.

        Of `large` items more than two may take more memory than there is.
        """
        ...


def work_on_each(
    keep: Keep, work: Callable[[Item], Result], items: Iterable[Item], large: bool = False
) -> Iterator[Result]:
    """`work`, which calls stages by `keep`, done for independent items; results in order."""
    if isinstance(keep, KeepWithWorkers):
        return keep.each(work, items, large)
    return map(work, items)


def parallel_map_of(keep: Keep) -> ParallelMap:
    """That of the workers, where there are any; else one piece after the other."""
    if isinstance(keep, KeepWithWorkers) and keep.has_workers:
        return keep.parallel_map
    return one_by_one


def parallel_map_elsewhere(keep: Keep, here: ParallelMap) -> ParallelMap:
    """That of the workers, where they are other machines; else `here`."""
    if isinstance(keep, KeepWithWorkers) and keep.has_far_workers:
        return keep.parallel_map
    return here


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
