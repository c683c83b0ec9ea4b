"""Process modules: the protocol, the mark of classes that planlang finds, and modules around others.

What a module leaves out has the value that the protocol gives it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol, TypeVar

from planlang.designators import Action
from planlang.kernel import Recorded
from planlang.kernel.core import here
from planlang.kernel.primitives import record
from planlang.runs.codec import Exact, Lost, dump, dump_failure
from planlang.runs.journal import Journal, locate_here

M = TypeVar("M")


class ProcessModule(Protocol):
    """Performs actions of some classes, one at a time, and raises typed failures."""

    @property
    def name(self) -> str:
        """Shown in the trace."""

    @property
    def actions(self) -> Sequence[str]:
        """Action classes (local names of the vocabulary) that it performs, descendants included."""

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise; any other exception is a programming error."""

    @property
    def physical(self) -> bool:
        """True if its motions pour and turn things over themselves: these effects are not applied to the true world."""
        return False

    @property
    def by_hand(self) -> bool:
        """True if its hand switches devices itself: this effect is not applied to the true world."""
        return False

    @property
    def once(self) -> bool:
        """True if what it does outside must not be done again when an interrupted run is repeated.

        Then its result is taken from the record. It moves nothing by itself; what it changes, the classes of its
        actions declare.
        """
        return False

    def performs(self, action: Action) -> bool:
        """Return True if it performs this action of its classes; one that says so is asked before others."""
        return True

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return names of what the action needs exclusively: "base", "head", "torso", "right_arm", ..."""

    async def execute(self, action: Action) -> Any:
        """Perform the action; on evaporation stop the robot."""


NEEDED = ("name", "actions", "failures", "resources", "execute")
"""What every module has to say."""
_MARK = "__planlang_process_module__"


def process_module(cls: type[M]) -> type[M]:
    """Mark a class as a process module, so that planlang finds it in its file or package.

    The class is called with the robot's platform and gives a :class:`ProcessModule`. Raises TypeError, naming what is
    missing, for a class that cannot be one.
    """
    absent = [name for name in NEEDED if not hasattr(cls, name)]
    if absent:
        raise TypeError(f"process module {getattr(cls, '__name__', cls)} lacks {', '.join(absent)}")
    actions, failures = cls.actions, cls.failures  # type: ignore[attr-defined]
    if isinstance(actions, str) or not actions or not all(isinstance(name, str) for name in actions):
        raise TypeError(f'actions of {cls.__name__} has to be a tuple of class names, such as ("Pouring",)')
    if not all(isinstance(kind, type) and issubclass(kind, Exception) for kind in failures):
        raise TypeError(f"failures of {cls.__name__} has to be a tuple of failure classes")
    setattr(cls, _MARK, cls)
    return cls


def is_marked(cls: object) -> bool:
    """Return whether a class itself, not only one that it derives from, is a process module."""
    return isinstance(cls, type) and vars(cls).get(_MARK) is cls


def selects(module: object) -> bool:
    """Return True if a module, or a class of modules, decides which actions of its classes it performs."""
    if isinstance(module, WrappedModule):
        return module.selects
    own = getattr(module if isinstance(module, type) else type(module), "performs", ProcessModule.performs)
    return own not in (None, ProcessModule.performs)


def performs(module: ProcessModule, action: Action) -> bool:
    """Return True if a module performs an action of its classes."""
    return not selects(module) or bool(module.performs(action))


class WrappedModule(ProcessModule):
    """Base of modules that add to another one: forwards all of :class:`ProcessModule` to ``wrapped``."""

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
