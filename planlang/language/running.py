"""run: a plan, on a host, with an executive, to its end."""

from __future__ import annotations

import contextvars
import functools
from collections.abc import Awaitable, Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.kernel import Host, Scheduler, Trace
from planlang.kernel.choices import Schedule, described
from planlang.kernel.tree import Node, name_of
from planlang.language import context
from planlang.language.branches import check
from planlang.language.plans import Frame, frame

if TYPE_CHECKING:
    from planlang.protocols import Executive

V = TypeVar("V")


def run(
    plan: Callable[[], Awaitable[V]],
    *,
    host: Host,
    executive: Executive | None = None,
    seed: int = 0,
    schedule: Schedule = None,
    trace: Trace | None = None,
    max_steps: int | None = None,
    on_start: Callable[[Node], object] | None = None,
) -> V:
    """Run a plan and return its result.

    ``seed`` feeds :func:`planlang.rng`; ``schedule`` picks among tasks that can run: None is first come, first
    served, a number a stream of random choices, a list the choices themselves. The same plan, world, seed and
    schedule give the same trace, byte for byte. ``on_start`` is called in its task when a node of the tree begins;
    what it raises is what the node fails with.

    Raises what leaves the plan; DeadlockError, StepLimit, NoProgress or StuckTask when it cannot go on, with the
    tasks and lines; KeyboardInterrupt after Ctrl-C, when all cleanups have run.
    """
    check("run", (plan,))
    scheduler = Scheduler(host, seed=seed, schedule=schedule, trace=trace, max_steps=max_steps)
    scheduler.on_start = on_start
    if trace is not None:
        marked = plan
        while isinstance(marked, functools.partial):
            marked = marked.func
        known = {"plan": name_of(plan), "iri": getattr(marked, "iri", None), "rate": host.rate, "seed": seed}
        trace.begin(**known, schedule=described(schedule))
    return contextvars.copy_context().run(_run, scheduler, plan, executive)  # type: ignore[no-any-return]


def _run(scheduler: Scheduler, plan: Callable[[], Awaitable[Any]], executive: Executive | None) -> Any:
    context.current.set(executive)
    frame.set(Frame(None))
    if executive is not None:
        scheduler.revision = executive.revision

        def write(event: str, details: Mapping[str, Any]) -> None:
            if scheduler.trace is not None:
                scheduler.trace.write(scheduler.now, event, **details)

        executive.record(write)
    return scheduler.run(plan)
