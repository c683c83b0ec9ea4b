"""The executive, which grounds what plans describe, and its process modules: protocols, and a wrapper that records.

Whatever an executive answers goes through :class:`planlang.kernel.Recorded` in a run whose trace can be resumed or
replayed: there the answer is noted, or the recorded one is given. Questions are identified by their text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, cast

from planlang.designators import Action, Condition, Location
from planlang.kernel import PlanStructureError, Recorded
from planlang.kernel.core import here, serving
from planlang.kernel.primitives import record
from planlang.misuse import contrast
from planlang.runs.codec import Exact, Lost, dump, dump_failure
from planlang.runs.journal import Journal, locate_here

if TYPE_CHECKING:
    from planlang.protocols import Solution


class ProcessModule(Protocol):
    """Performs actions of some classes, one at a time, and raises typed failures.

    :class:`FullProcessModule` has what a module may say besides.
    """

    @property
    def name(self) -> str:
        """Shown in the trace."""

    @property
    def actions(self) -> Sequence[str]:
        """Action classes (local names of the vocabulary) that it performs, descendants included."""

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise; any other exception is a programming error."""

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return names of what the action needs exclusively: "base", "head", "torso", "right_arm", ..."""

    async def execute(self, action: Action) -> Any:
        """Perform the action; on evaporation stop the robot."""


class FullProcessModule(ProcessModule, Protocol):
    """A process module with the optional members, too; one that leaves them out means False, and all actions."""

    @property
    def physical(self) -> bool:
        """True if its motions pour and turn things over themselves: these effects are not applied to the true world."""

    @property
    def by_hand(self) -> bool:
        """True if its hand switches devices itself: this effect is not applied to the true world."""

    @property
    def once(self) -> bool:
        """True if what it does outside must not be done again when an interrupted run is repeated.

        Then its result is taken from the record. It moves nothing by itself; what it changes, the classes of its
        actions declare.
        """

    def performs(self, action: Action) -> bool:
        """Return True if it performs this action of its classes."""


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


def selects(module: object) -> bool:
    """Return True if a module, or a class of modules, decides which actions of its classes it performs."""
    if isinstance(module, WrappedModule):
        return module.selects
    return getattr(module, "performs", None) is not None


def performs(module: ProcessModule, action: Action) -> bool:
    """Return True if a module performs an action of its classes."""
    return not selects(module) or bool(cast(FullProcessModule, module).performs(action))


class WrappedModule:
    """Base of modules that add to another one: forwards all of :class:`FullProcessModule` to ``wrapped``."""

    def __init__(self, module: ProcessModule) -> None:
        self._module = module

    @property
    def wrapped(self) -> ProcessModule:
        """The module that this one adds to."""
        return self._module

    @property
    def name(self) -> str:
        """Shown in the trace."""
        return self.wrapped.name

    @property
    def actions(self) -> Sequence[str]:
        """Action classes that it performs."""
        return self.wrapped.actions

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise."""
        return self.wrapped.failures

    @property
    def physical(self) -> bool:
        """True if its motions pour and turn things over themselves."""
        return bool(getattr(self.wrapped, "physical", False))

    @property
    def by_hand(self) -> bool:
        """True if its hand switches devices itself."""
        return bool(getattr(self.wrapped, "by_hand", False))

    @property
    def once(self) -> bool:
        """True if what it does outside must not be done again when an interrupted run is repeated."""
        return bool(getattr(self.wrapped, "once", False))

    @property
    def selects(self) -> bool:
        """True if it decides which actions of its classes it performs."""
        return selects(self.wrapped)

    def performs(self, action: Action) -> bool:
        """Return True if it performs this action of its classes."""
        return performs(self.wrapped, action)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return what the action needs exclusively."""
        return tuple(self.wrapped.resources(action))

    async def execute(self, action: Action) -> Any:
        """Perform the action."""
        return await self.wrapped.execute(action)


class ModuleOnce(WrappedModule):
    """A process module whose result is taken from the record where it says that it must not be executed again."""

    async def execute(self, action: Action) -> Any:
        """Perform the action, or give what is recorded of it."""
        journal = here()[0].recorded
        if isinstance(journal, Journal) and self.once:
            return await journal.once(partial(self.wrapped.execute, action))
        return await super().execute(action)


class RecordedModule(WrappedModule):
    """A process module whose results are recorded."""

    def __init__(self, module: ProcessModule, recorded: Recorded) -> None:
        super().__init__(module)
        self._recorded = recorded

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return what the action needs exclusively."""
        question = f"resources of {self.name} for {action}"
        needs = super().resources
        return tuple(self._recorded.answer(question, lambda: needs(action)))

    def performs(self, action: Action) -> bool:
        """Return True if it performs this action of its classes; asked and recorded only if it selects actions."""
        if not self.selects:
            return True
        decide = super().performs
        return bool(self._recorded.answer(f"{self.name} performs {action}", lambda: decide(action)))

    async def execute(self, action: Action) -> Any:
        """Perform the action, and record its result or failure."""
        try:
            result = await super().execute(action)
        except Exception as error:
            locate_here(error)
            _record_outcome("failure", dump_failure, error)
            raise
        _record_outcome("value", dump, result)
        return result


def _record_outcome(key: str, dump: Callable[[Any], Any], outcome: object) -> None:
    try:
        details: dict[str, object] = {} if outcome is None else {key: Exact(dump(outcome))}
    except Lost as lost:
        details = {"lost": str(lost)}
    record("performed", **details)


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
