"""Faults of steps: failures that are injected into steps of a run, at a given attempt or time."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain

import planlang.failures as failures
from planlang.action_classes import ancestors_of
from planlang.designators import Action
from planlang.faults.kinds import Opportunity
from planlang.faults.named import ALWAYS, NamedFault, When, WrongFault, read_faults
from planlang.kernel import Scheduler, Task
from planlang.kernel.cancel import break_off
from planlang.kernel.core import here
from planlang.kernel.tree import Node
from planlang.plan_failure import PlanFailure
from planlang.records import dataclass
from planlang.spelling import guess

FAULT = "fault"
"""Event of a step that fails as it is stated to, after that of its start: a replay lets it fail there again."""
Raises = type[BaseException] | BaseException | Callable[[], BaseException]


def make_failure(failure: Raises) -> BaseException:
    """Make a new failure from a class, a function or an example, which is copied."""
    return copy.copy(failure) if isinstance(failure, BaseException) else failure()


@dataclass(frozen=True)
class Fault:
    """A failure that is injected into a step.

    ``step`` is a name in the task tree, ``parent/name``, or the class of a performed action; ``attempt`` counts its
    starts from 1, None means all of them. The step fails at its start, ``after`` seconds later, or ``at`` a plan time
    [s] if it runs then: its branches are evaporated, with their cleanups, and ``raises`` is raised where it waits. A
    step that has ended by then is not affected.
    """

    step: str
    raises: Raises
    attempt: int | None = None
    after: float | None = None
    at: float | None = None
    named: NamedFault | None = None
    """The stated fault that it is, if a text states it."""

    @staticmethod
    def read(text: str) -> tuple[Fault, ...]:
        """Read faults of steps such as ``step.grasp:fails=ObjectLost@2``. Raises WrongFault."""
        return tuple(fault for one in read_faults([text]) for fault in _of_steps(one))

    def __str__(self) -> str:
        if self.named is not None:
            return str(self.named)
        what = self.raises.__name__ if isinstance(self.raises, type) else repr(self.raises)
        which = "" if self.attempt is None else f", attempt {self.attempt}"
        when = f" at {self.at:g} s" if self.at is not None else ""
        when += f" after {self.after:g} s" if self.after is not None else ""
        return f"{what} in {self.step}{which}{when}"


def is_of_step(fault: NamedFault) -> bool:
    """Check whether a stated fault is one of a step, which fails by itself whatever the world is like."""
    return fault.kind.opportunity is Opportunity.STEP


def stated_failure(fault: NamedFault) -> type[PlanFailure]:
    """Look up the failure that a stated fault of a step names. Raises WrongFault."""
    if fault.of is None or fault.value is None:
        raise WrongFault(f"{fault}: name a step and its failure, such as step.grasp:fails=ObjectLost@2")
    raises = getattr(failures, fault.value, None)
    if not (isinstance(raises, type) and issubclass(raises, PlanFailure)):
        names = [name for name, one in vars(failures).items() if isinstance(one, type)]
        raise WrongFault(f"{fault}: there is no failure {fault.value}; {guess(fault.value, names)}")
    return raises


def _of_steps(fault: NamedFault) -> Iterator[Fault]:
    """Yield the faults of steps that a stated one means."""
    if not is_of_step(fault):
        example = "step.grasp:fails=ObjectLost@2"
        raise WrongFault(f"{fault}: a scripted robot has no world, so only steps fail; write for example {example}")
    raises = stated_failure(fault)
    assert fault.of is not None
    when = fault.when
    if when.since is not None and when.last == 1:
        yield Fault(fault.of, raises, at=when.since, named=fault)
    elif when.since is None and when.last is not None:
        for attempt in range(when.first, when.last + 1):
            yield Fault(fault.of, raises, attempt, named=fault)
    elif when == When.of(ALWAYS):
        yield Fault(fault.of, raises, named=fault)
    else:
        raise WrongFault(f"{fault}: of a step, state a number (@2, @2-4), one plan time (@3s), or @always")


class Injector:
    """Injector of the faults of one run."""

    def __init__(self, faults: Sequence[Fault | str], told: Callable[[Fault], object] = lambda fault: None) -> None:
        """A text states faults in the grammar of :mod:`planlang.faults.named`. Raises WrongFault.

        ``told`` is called with each fault that happens.
        """
        self._told = told
        read = (Fault.read(one) if isinstance(one, str) else (one,) for one in faults)
        self._faults = tuple(chain.from_iterable(read))
        self._starts = [0] * len(self._faults)
        """Number of starts of the step of each fault."""
        self._injected = [False] * len(self._faults)

    @property
    def unused(self) -> tuple[Fault, ...]:
        """Faults that were not injected."""
        return tuple(fault for fault, injected in zip(self._faults, self._injected, strict=True) if not injected)

    @property
    def unmatched(self) -> tuple[Fault, ...]:
        """Faults of steps that never started."""
        return tuple(fault for fault, starts in zip(self._faults, self._starts, strict=True) if not starts)

    def __call__(self, node: Node) -> None:
        """Inject the faults of a node that begins, in its task; raises a failure, or sets a timer for it."""
        matching = [number for number, fault in enumerate(self._faults) if _matches(node, fault.step)]
        for number in matching:
            self._starts[number] += 1
        for number in matching:
            fault = self._faults[number]
            if fault.attempt is None or fault.attempt == self._starts[number]:
                self._inject(number, fault, node)

    def _inject(self, number: int, fault: Fault, node: Node) -> None:
        """Raise the failure of a fault, or set a timer for it."""
        scheduler, task = here()
        delay = 0 if fault.after is None else scheduler.steps(fault.after)
        if fault.at is not None:
            at = scheduler.steps(fault.at)
            if at < scheduler.now:
                return
            delay = max(delay, at - scheduler.now)
        if delay:
            scheduler.alarm(task, delay, partial(self._break, number, node, task, scheduler))
        else:
            self._injected[number] = True
            self._told(fault)
            if fault.named is not None and scheduler.observer is not None:
                scheduler.observer.write(scheduler.now, FAULT, node, fault=str(fault.named))
            raise make_failure(fault.raises)

    def _break(self, number: int, node: Node, task: Task, scheduler: Scheduler) -> None:
        current: Node | None = None if task.dead else task.node
        while current is not None and current is not node:
            current = current.parent
        if current is not None and not task.cancelled:  # the node is still open
            self._injected[number] = True
            self._told(self._faults[number])
            break_off(scheduler, task, make_failure(self._faults[number].raises))


def _matches(node: Node, step: str) -> bool:
    """Check whether a fault refers to a node; a branch or state and its action of the same name count as one step."""
    parent, action = node.parent, getattr(node, "action", None)
    is_inside = parent is not None and parent.kind in ("branch", "state") and parent.base_name == node.base_name
    if isinstance(action, Action) and step in ancestors_of(action.type, lambda cls: (cls,)):
        return not (is_inside and step == node.base_name)
    if is_inside:
        return False
    current: Node | None = node
    for name in reversed(step.split("/")):
        if current is None or name not in (current.name, current.base_name):
            return False
        current = current.parent
    return True
