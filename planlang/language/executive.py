"""The executive, which grounds the designators of a plan: its protocol, and a wrapper that records its answers.

In a run whose trace can be resumed or replayed, all answers of an executive pass through
:class:`planlang.kernel.Recorded`, which records them or supplies the recorded ones. Questions are identified by their
text.
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
    """Interface between plans and a robot with its belief state."""

    @property
    def modules(self) -> Sequence[ProcessModule]:
        """The registered process modules."""

    def ancestors(self, action_type: str) -> Sequence[str]:
        """The class itself and its superclasses, nearest first."""

    def revision(self) -> int:
        """Number of changes of the belief state."""

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield base poses for the present belief, best first; raises LocationUnresolvable with counts at the end.

        at_location asks anew when the revision has changed.
        """

    def move_to(self, solution: Solution) -> Action:
        """Action that drives the base to a solution."""

    def is_at(self, solution: Solution) -> bool:
        """Check whether the base is at the pose of a solution."""

    def holds(self, condition: Condition) -> bool:
        """Check whether a condition holds in the belief state."""

    def before_retry(self) -> Iterable[Action]:
        """Actions that bring the robot into a posture in which it can drive to another base pose."""

    def held(self) -> Sequence[str]:
        """Names of the objects that the robot holds."""

    def releases(self, action: Action) -> bool:
        """Check whether an action opens a hand, so that it must not be repeated before the object is delivered."""

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Set the function by which the executive writes its own events (changes of belief, solutions) to the trace."""


current: ContextVar[Executive | None] = ContextVar("executive", default=None)


def executive_for(construct: str) -> Executive:
    """Find the current executive; PlanStructureError if the plan runs without one."""
    executive = current.get()
    if executive is None:
        serving()  # raises the error for code outside a plan
        raise PlanStructureError(
            contrast(
                f"{construct} needs an executive: run(plan, host=..., executive=...)",
                "run(serve, host=host)",
                "run(serve, host=host, executive=executive)",
            )
        )
    return executive


class RecordedExecutive:
    """Wrapper of an :class:`Executive` that records its answers, or supplies recorded ones."""

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
        described = [
            [one.name, [*map(str, one.actions)], [f"{kind.__module__}.{kind.__qualname__}" for kind in one.failures]]
            for one in modules
        ]
        self._recorded.answer("modules", lambda: described)
        return modules

    def ancestors(self, action_type: str) -> Sequence[str]:
        """The class itself and its superclasses, nearest first."""
        question = f"ancestors of {action_type}"
        return tuple(self._recorded.answer(question, lambda: tuple(self._executive.ancestors(action_type))))

    def revision(self) -> int:
        """Number of changes of the belief state."""
        return int(self._recorded.answer("revision", lambda: self._executive.revision()))

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield base poses, best first."""
        return self._each(f"solutions of {location}", lambda: self._executive.solutions(location))

    def move_to(self, solution: Solution) -> Action:
        """Action that drives the base to a solution."""
        question = f"motion to {solution.base}"
        motion: Action = self._recorded.answer(question, lambda: self._executive.move_to(solution))
        return motion

    def is_at(self, solution: Solution) -> bool:
        """Check whether the base is at the pose of a solution."""
        return self._test(f"at {solution.base}", lambda: self._executive.is_at(solution))

    def holds(self, condition: Condition) -> bool:
        """Check whether a condition holds in the belief state."""
        return self._test(f"{condition} holds", lambda: self._executive.holds(condition))

    def before_retry(self) -> Iterable[Action]:
        """Yield actions that bring the robot into a posture in which it can drive to another base pose."""
        return self._each("before retrying", lambda: self._executive.before_retry())

    def held(self) -> Sequence[str]:
        """Names of the objects that the robot holds."""
        return tuple(self._recorded.answer("held", lambda: tuple(self._executive.held())))

    def releases(self, action: Action) -> bool:
        """Check whether an action opens a hand."""
        return self._test(f"{action} releases", lambda: self._executive.releases(action))

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Set the function by which the executive writes its own events to the trace."""
        self._executive.record(write)

    def _test(self, question: str, test: Callable[[], bool]) -> bool:
        return bool(self._recorded.answer(question, lambda: bool(test())))

    def _each(self, question: str, find: Callable[[], Iterable[Any]]) -> Iterator[Any]:
        """Yield answers one by one, computing each only when it is needed; None is recorded after the last."""
        answers: Iterator[Any] | None = None

        def following() -> Any:
            nonlocal answers
            answers = iter(find()) if answers is None else answers
            return next(answers, None)

        while (answer := self._recorded.next_answer(question, following)) is not None:
            yield answer
