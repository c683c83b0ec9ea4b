"""Process modules: the protocol, the decorator by which planlang finds them, and wrappers of modules.

Attributes that a module leaves out have the defaults of the protocol.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol, TypeVar

from planlang.changes import Change, Poured, Switched, TurnedOver
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
        """Name of the module in the trace."""

    @property
    def actions(self) -> Sequence[str]:
        """Action classes (local names of the vocabulary) that the module performs, including their subclasses."""

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that the module may raise; any other exception is a programming error."""

    @property
    def once(self) -> bool:
        """True if an action with effects outside the world must not be executed again when a run is resumed.

        The recorded result is used then. Such a module moves nothing itself; the classes of its actions declare what
        they change.
        """
        return False

    def performs(self, action: Action) -> bool:
        """Check whether the module performs this action of its classes."""
        return True

    def resources(self, action: Action) -> tuple[str, ...]:
        """Names of the resources that the action needs exclusively: "base", "head", "torso", "right_arm", ..."""

    async def execute(self, action: Action) -> Any:
        """Perform the action; stop the robot on evaporation."""


NEEDED = ("name", "actions", "failures", "resources", "execute")
"""Attributes without defaults."""
LEFT_TO_MOTIONS: Mapping[str, tuple[type[Change], ...]] = {"physical": (Poured, TurnedOver), "by_hand": (Switched,)}
"""Attributes of earlier versions -> effects that a module with one leaves to its motions, whatever they have done."""
_MARK = "__planlang_process_module__"


def process_module(cls: type[M]) -> type[M]:
    """Mark a class as a process module, so that planlang finds it in its file or package.

    planlang calls the class with the robot's platform to create the module. Raises TypeError if an attribute of
    :class:`ProcessModule` is missing or malformed.
    """
    missing = [name for name in NEEDED if not hasattr(cls, name)]
    if missing:
        raise TypeError(f"process module {getattr(cls, '__name__', cls)} lacks {', '.join(missing)}")
    actions, failures = cls.actions, cls.failures  # type: ignore[attr-defined]
    if isinstance(actions, str) or not actions or not all(isinstance(name, str) for name in actions):
        raise TypeError(f'actions of {cls.__name__} has to be a tuple of class names, such as ("Pouring",)')
    if not all(isinstance(kind, type) and issubclass(kind, Exception) for kind in failures):
        raise TypeError(f"failures of {cls.__name__} has to be a tuple of failure classes")
    setattr(cls, _MARK, cls)
    return cls


def stated_as_before(module: object) -> tuple[str, ...]:
    """List the attributes of earlier versions, of :data:`LEFT_TO_MOTIONS`, that a module or its class has set."""
    return tuple(name for name in LEFT_TO_MOTIONS if getattr(module, name, False))


def is_marked(cls: object) -> bool:
    """Check whether a class itself, and not only a base class of it, is marked as a process module."""
    return isinstance(cls, type) and vars(cls).get(_MARK) is cls


def selects(module: object) -> bool:
    """Check whether a module, or a class of modules, has a ``performs`` of its own."""
    if isinstance(module, WrappedModule):
        return module.selects
    own = getattr(module if isinstance(module, type) else type(module), "performs", ProcessModule.performs)
    return own not in (None, ProcessModule.performs)


def performs(module: ProcessModule, action: Action) -> bool:
    """Check whether a module performs an action of its classes."""
    return not selects(module) or bool(module.performs(action))


class WrappedModule:
    """Base class of wrappers: states what ``wrapped`` states, and asks it for the rest of :class:`ProcessModule`."""

    def __init__(self, module: ProcessModule) -> None:
        self.wrapped = module
        self.name = module.name
        self.actions: Sequence[str] = module.actions
        self.failures: Sequence[type[Exception]] = module.failures
        self.selects = selects(module)
        """True if the module has a ``performs`` of its own."""

    @property
    def once(self) -> bool:
        """True if actions must not be executed again when a run is resumed."""
        return bool(getattr(self.wrapped, "once", False))

    def performs(self, action: Action) -> bool:
        """Check whether the module performs this action of its classes."""
        return performs(self.wrapped, action)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Names of the resources that the action needs exclusively."""
        return tuple(self.wrapped.resources(action))

    async def execute(self, action: Action) -> Any:
        """Perform the action."""
        return await self.wrapped.execute(action)


class ModuleOnce(WrappedModule):
    """Wrapper that uses the recorded results of a module with ``once`` in a resumed run."""

    async def execute(self, action: Action) -> Any:
        """Perform the action, or return its recorded result."""
        journal = here()[0].recorded
        if isinstance(journal, Journal) and self.once:
            return await journal.once(partial(self.wrapped.execute, action))
        return await super().execute(action)


class RecordedModule(WrappedModule):
    """Wrapper that records the answers and results of a module."""

    def __init__(self, module: ProcessModule, recorded: Recorded) -> None:
        super().__init__(module)
        self._recorded = recorded

    def resources(self, action: Action) -> tuple[str, ...]:
        """Names of the resources that the action needs exclusively."""
        question = f"resources of {self.name} for {action}"
        needs = super().resources
        return tuple(self._recorded.answer(question, lambda: needs(action)))

    def performs(self, action: Action) -> bool:
        """Check whether the module performs this action; recorded only if the module ``selects`` actions."""
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
