"""The executive of a run whose trace can be replayed: it answers as the one behind it does, and notes the answers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from planlang.designators import Action, Condition, Location
from planlang.failures import PlanFailure
from planlang.kernel.core import here
from planlang.kernel.listing import locate
from planlang.kernel.observer import Recorded
from planlang.kernel.primitives import record
from planlang.runs.codec import Exact, Lost, dump, dump_failure

if TYPE_CHECKING:
    from planlang.language.executive import Executive, ProcessModule
    from planlang.protocols import Solution


class RecordingModule:
    """A process module whose results are noted."""

    def __init__(self, module: ProcessModule, recorded: Recorded) -> None:
        self._module = module
        self._recorded = recorded
        self.name = module.name

    @property
    def actions(self) -> Sequence[str]:
        """Action classes that it performs."""
        return self._module.actions

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise."""
        return self._module.failures

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return what the action needs exclusively."""
        question = f"resources of {self.name} for {action}"
        return tuple(self._recorded.answer(question, lambda: tuple(self._module.resources(action))))

    async def execute(self, action: Action) -> Any:
        """Perform the action."""
        try:
            result = await self._module.execute(action)
        except Exception as error:
            if isinstance(error, PlanFailure) and error.where is None:
                scheduler, task = here()
                locate(error, task.node, scheduler.revision)
            _performed(partial(_failed, error))
            raise
        _performed(lambda: {} if result is None else {"value": Exact(dump(result))})
        return result


def _failed(error: Exception) -> dict[str, Any]:
    return {"failure": Exact(dump_failure(error))}


def _performed(noted: Callable[[], dict[str, Any]]) -> None:
    try:
        record("performed", **noted())
    except Lost as lost:
        record("performed", lost=str(lost))


def _described(module: RecordingModule) -> list[Any]:
    failures = [f"{kind.__module__}.{kind.__qualname__}" for kind in module.failures]
    return [module.name, list(map(str, module.actions)), failures]


class RecordingExecutive:
    """Implements :class:`planlang.language.executive.Executive` by another one."""

    def __init__(self, executive: Executive, recorded: Recorded) -> None:
        self.executive = executive
        self._recorded = recorded
        self._modules: dict[int, RecordingModule] = {}
        self.modules  # noqa: B018 - the first answer of a run

    @property
    def modules(self) -> Sequence[RecordingModule]:
        """The registered process modules."""
        modules = [
            self._modules.setdefault(id(module), RecordingModule(module, self._recorded))
            for module in self.executive.modules
        ]
        self._recorded.answer("modules", lambda: list(map(_described, modules)))
        return modules

    def ancestors(self, action_type: str) -> Sequence[str]:
        """Return the class itself and its superclasses, nearest first."""
        find = self.executive.ancestors
        return tuple(self._recorded.answer(f"ancestors of {action_type}", lambda: tuple(find(action_type))))

    def revision(self) -> int:
        """Counts changes of the belief."""
        return int(self._recorded.answer("revision", self.executive.revision))

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Places for the base."""
        found = iter(self.executive.solutions(location))
        while (
            solution := self._recorded.next_answer(f"solutions of {location}", partial(next, found, None))
        ) is not None:
            yield solution

    def move_to(self, solution: Solution) -> Action:
        """Return the base motion that goes to a solution."""
        moving: Action = self._recorded.answer(f"motion to {solution.base}", lambda: self.executive.move_to(solution))
        return moving

    def is_at(self, solution: Solution) -> bool:
        """Return True while the base is where the solution put it."""
        return bool(self._recorded.answer(f"at {solution.base}", lambda: bool(self.executive.is_at(solution))))

    def holds(self, condition: Condition) -> bool:
        """Return whether the belief says so."""
        return bool(self._recorded.answer(f"{condition} holds", lambda: bool(self.executive.holds(condition))))

    def before_retry(self) -> Iterable[Action]:
        """Return what brings the robot into a posture from which another place can be tried."""
        found = iter(self.executive.before_retry())
        while (action := self._recorded.next_answer("before retrying", partial(next, found, None))) is not None:
            yield action

    def held(self) -> Sequence[str]:
        """Names of the objects that the robot holds."""
        return tuple(self._recorded.answer("held", lambda: tuple(self.executive.held())))

    def releases(self, action: Action) -> bool:
        """Return whether the action lets go of something."""
        return bool(self._recorded.answer(f"{action} releases", lambda: bool(self.executive.releases(action))))

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Give the executive a way to write its own events."""
        self.executive.record(write)
