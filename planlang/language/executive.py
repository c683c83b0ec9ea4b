"""The executive, which grounds what plans describe: its protocol, and a wrapper that records what it answers.

Whatever an executive answers goes through :class:`planlang.kernel.Recorded` in a run whose trace can be resumed or
replayed: there the answer is noted, or the recorded one is given. Questions are identified by their text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Protocol

from planlang.designators import Action, Condition, Location
from planlang.kernel import PlanStructureError, Recorded
from planlang.kernel.core import serving
from planlang.language.process_module import ProcessModule, RecordedModule
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.protocols import Solution


class Executive(Protocol):
    """Grounds what plans describe. One is current while a plan runs."""

    @property
    def modules(self) -> Sequence[ProcessModule]:
        """The registered process modules."""

    def ancestors(self, action_type: str) -> Sequence[str]:
        """Return the class itself and its superclasses, nearest first."""

    def revision(self) -> int:
        """Return how often the belief has changed."""

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield base poses, best first; raises LocationUnresolvable (with counts) when there are no more."""

    def move_to(self, solution: Solution) -> Action:
        """Return the base motion that goes to a solution."""

    def is_at(self, solution: Solution) -> bool:
        """Return True while the base is where the solution put it."""

    def holds(self, condition: Condition) -> bool:
        """Return True if the condition holds as far as the robot knows."""

    def before_retry(self) -> Iterable[Action]:
        """Return actions that bring the robot into a posture from which it can drive to another base pose."""

    def held(self) -> Sequence[str]:
        """Return the names of the objects that the robot holds."""

    def releases(self, action: Action) -> bool:
        """Return True if the action lets go of something: it is not repeated while that is still to be delivered."""

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Give the executive a way to write its own events (belief changes, solutions) into the trace."""


current: ContextVar[Executive | None] = ContextVar("executive", default=None)


def executive_for(construct: str) -> Executive:
    """Return the current executive; raises PlanStructureError when the plan runs without one."""
    executive = current.get()
    if executive is None:
        serving()  # without a plan there is more to say
        raise PlanStructureError(
            contrast(
                f"{construct} needs an executive: run(plan, host=..., executive=...)",
                "run(serve, host=host)",
                "run(serve, host=host, executive=executive)",
            )
        )
    return executive


class RecordedExecutive:
    """Implements :class:`Executive` by another one, asked through a record of its answers."""

    def __init__(self, executive: Executive, recorded: Recorded) -> None:
        self._executive = executive
        self._recorded = recorded
        self._modules: dict[int, RecordedModule] = {}

    @property
    def modules(self) -> Sequence[ProcessModule]:
        """The registered process modules."""
        modules = [
            self._modules.setdefault(id(module), RecordedModule(module, self._recorded))
            for module in self._executive.modules
        ]
        self._recorded.answer("modules", lambda: list(map(_described, modules)))
        return modules

    def ancestors(self, action_type: str) -> Sequence[str]:
        """Return the class itself and its superclasses, nearest first."""
        question = f"ancestors of {action_type}"
        return tuple(self._recorded.answer(question, lambda: tuple(self._executive.ancestors(action_type))))

    def revision(self) -> int:
        """Return how often the belief has changed."""
        return int(self._recorded.answer("revision", lambda: self._executive.revision()))

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield base poses, best first."""
        return self._each(f"solutions of {location}", lambda: self._executive.solutions(location))

    def move_to(self, solution: Solution) -> Action:
        """Return the base motion that goes to a solution."""
        question = f"motion to {solution.base}"
        moving: Action = self._recorded.answer(question, lambda: self._executive.move_to(solution))
        return moving

    def is_at(self, solution: Solution) -> bool:
        """Return True while the base is where the solution put it."""
        return self._test(f"at {solution.base}", lambda: self._executive.is_at(solution))

    def holds(self, condition: Condition) -> bool:
        """Return True if the condition holds as far as the robot knows."""
        return self._test(f"{condition} holds", lambda: self._executive.holds(condition))

    def before_retry(self) -> Iterable[Action]:
        """Yield actions that bring the robot into a posture from which it can drive to another base pose."""
        return self._each("before retrying", lambda: self._executive.before_retry())

    def held(self) -> Sequence[str]:
        """Return the names of the objects that the robot holds."""
        return tuple(self._recorded.answer("held", lambda: tuple(self._executive.held())))

    def releases(self, action: Action) -> bool:
        """Return True if the action lets go of something."""
        return self._test(f"{action} releases", lambda: self._executive.releases(action))

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Give the executive a way to write its own events."""
        self._executive.record(write)

    def _test(self, question: str, test: Callable[[], bool]) -> bool:
        return bool(self._recorded.answer(question, lambda: bool(test())))

    def _each(self, question: str, find: Callable[[], Iterable[Any]]) -> Iterator[Any]:
        """Yield answers one by one, each asked for when it is needed; None is recorded as their end."""
        found: Iterator[Any] | None = None

        def following() -> Any:
            nonlocal found
            found = iter(find()) if found is None else found
            return next(found, None)

        while (one := self._recorded.next_answer(question, following)) is not None:
            yield one


def _described(module: RecordedModule) -> list[Any]:
    failures = [f"{kind.__module__}.{kind.__qualname__}" for kind in module.failures]
    return [module.name, list(map(str, module.actions)), failures]
