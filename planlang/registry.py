"""Registry of process modules: bundled, from installed packages, and from files that the user names.

A process module is a class marked with :func:`planlang.process_module`. Packages declare theirs as entry points of the
group ``planlang.modules``, each naming a class or a Python module with classes; users name files with
``planlang run --modules FILE.py``. An action goes to the module for its most specific class. If two modules perform the
same class, a user's file outranks an installed package, which outranks planlang; two of the same rank are an error.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator
from enum import IntEnum
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from pkgutil import resolve_name
from types import ModuleType
from typing import Any

from planlang.designators import Action
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note
from planlang.files import read_file
from planlang.language.loading import execute, new_module
from planlang.language.process_module import ProcessModule, WrappedModule, is_marked, selects, stated_as_before
from planlang.records import dataclass

GROUP = "planlang.modules"
"""Entry-point group of installed process modules."""
LARGEST = 10_000_000
"""Largest file of process modules that is read [bytes]."""
_ADVICE = "mark the class with @planlang.process_module"


@dataclass(frozen=True, slots=True)
class OnDemand:
    """A process module that is imported when it first has to act, since most runs need few of them."""

    place: str
    """The class, in the syntax of entry points: ``package.module:Class``."""
    name: str
    actions: tuple[str, ...]
    failures: tuple[type[Exception], ...] = ()
    performs: Callable[[Any, Action], bool] | None = None
    """Decides for a platform and an action whether to perform it; None performs every action of its classes."""

    def __call__(self, platform: Any) -> ProcessModule:
        """Make the module without importing its class yet."""
        return _Demanded(self, platform)


class _Demanded(WrappedModule):
    """A module that imports its class when more is needed than the statement of :class:`OnDemand`."""

    def __init__(self, what: OnDemand, platform: Any) -> None:
        self._what, self._platform = what, platform
        self.name, self.actions, self.failures = what.name, what.actions, what.failures
        self.selects = what.performs is not None

    @cached_property
    def wrapped(self) -> ProcessModule:  # type: ignore[override]  # made when it is first asked for
        # imported late: a plan performs few of the actions that there are modules for
        made: ProcessModule = resolve_name(self._what.place)(self._platform)
        return made

    def performs(self, action: Action) -> bool:
        return self._what.performs is None or self._what.performs(self._platform, action)


class Rank(IntEnum):
    """Origin of a process module; the higher rank wins."""

    BUNDLED = 0
    INSTALLED = 1
    NAMED = 2


@dataclass(frozen=True, slots=True)
class Registered:
    """A class of process modules and its origin."""

    factory: Callable[[Any], ProcessModule]
    actions: tuple[str, ...]
    origin: str
    rank: Rank
    selects: bool = False
    """True if it performs only some actions of its classes: it is asked first, and others perform the rest."""


class ModuleRegistry:
    """The process modules of a run; ``identity`` lists those that are not bundled, for the header of the trace."""

    def __init__(self) -> None:
        self._registered: list[Registered] = []
        self.identity: dict[str, str] = {}

    @property
    def actions(self) -> frozenset[str]:
        """Classes of actions that the registered modules perform without selecting among them."""
        return frozenset(name for one in self._registered if not one.selects for name in one.actions)

    def add(self, module: ModuleType, origin: str, rank: Rank) -> int:
        """Register the marked classes of a Python module or package; return their number."""
        found = list(marked(module))
        self._registered += [_registered(cls, origin, rank) for cls in found]
        return len(found)

    def add_on_demand(self, module: OnDemand, origin: str, rank: Rank) -> None:
        """Register a class that is imported on demand."""
        origin = f"{module.place.rpartition(':')[2]} of {origin}"
        selects = module.performs is not None
        self._registered.append(Registered(module, module.actions, origin, rank, selects))

    def add_file(self, path: Path) -> None:
        """Register the process modules of a user's file; raises BadInput, with the line, if it cannot be imported."""
        module = _imported(path)
        if not self.add(module, path.name, Rank.NAMED):
            raise BadInput([error("X011", "this file has no process module", Span(str(path)), _ADVICE)])
        self.identity[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()

    def add_installed(self) -> None:
        """Register the process modules of installed packages; raises BadInput if one cannot be imported."""
        for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.name, entry.value)):
            package = f"{entry.dist.name} {entry.dist.version}" if entry.dist is not None else "unknown"
            found = _loaded(entry, package)
            classes: list[Any] = [found] if isinstance(found, type) else list(marked(found))
            if not all(map(is_marked, classes)) or not classes:
                message = f"the entry point {entry.name} of {package} names no process module: {entry.value}"
                raise BadInput([error("X011", message, help=_ADVICE)])
            for cls in classes:
                self._registered.append(_registered(cls, package, Rank.INSTALLED))
            self.identity[f"{GROUP}: {entry.name}"] = package

    def resolve(self, found: list[Diagnostic]) -> tuple[Callable[[Any], ProcessModule], ...]:
        """Return the classes by rank, highest first; add a note to ``found`` where one outranks another.

        Raises BadInput if two of one rank perform the same action class.
        """
        ordered = sorted(self._registered, key=lambda one: (-one.rank, not one.selects))
        whole = [one for one in ordered if not one.selects]
        for one in ordered:
            if stated := stated_as_before(one.factory):
                message = f"{one.origin} sets {' and '.join(stated)}, which is no longer needed"
                advice = "leave it out: the simulated world knows what motions have done (docs/guides/modules.md)"
                found.append(note("X034", message, help=advice))
        problems = []
        for action in dict.fromkeys(name for one in whole for name in one.actions):
            first, *others = (one for one in whole if action in one.actions)
            if others and others[0].rank == first.rank:
                both = f"{first.origin} and {others[0].origin}"
                advice = "leave one out, or let one perform a more specific class"
                problems.append(error("X012", f"two process modules perform {action}: {both}", help=advice))
            elif others:
                found.append(note("X012", f"{action} is performed by {first.origin}, not by {others[0].origin}"))
        if problems:
            raise BadInput(problems)
        return tuple(one.factory for one in ordered)


def _registered(cls: Any, origin: str, rank: Rank) -> Registered:
    return Registered(cls, tuple(cls.actions), f"{cls.__name__} of {origin}", rank, selects(cls))


def marked(module: ModuleType) -> Iterator[Any]:
    """Yield the marked classes that a Python module or package defines."""
    seen: dict[int, Any] = {}
    for value in vars(module).values():
        # a class that a file imports as a base of its own belongs to another module
        if is_marked(value) and value.__module__.startswith(module.__name__):
            seen.setdefault(id(value), value)
    yield from seen.values()


def _loaded(entry: EntryPoint, package: str) -> Any:
    try:
        return entry.load()
    except Exception as problem:
        reason = f"{type(problem).__name__}: {problem}"
        message = f"the process module {entry.value} of {package} cannot be imported: {reason}"
        advice = _renamed(problem) or f"pip uninstall {package.split()[0]} removes it"
        raise BadInput([error("X011", message, help=advice)]) from problem


def _imported(path: Path) -> ModuleType:
    """Import a file under a unique name; it stays in sys.modules, where failures are looked up by module name."""
    module = new_module(f"planlang_modules_{path.stem}", str(path))
    content = read_file(path, "X011", largest=LARGEST)
    sys.modules[module.__name__] = module  # dataclasses look their module up while the file is executed
    execute(module, content, "X011", "the process modules", _renamed)
    return module


def _renamed(problem: BaseException) -> str | None:
    """Suggest the import that replaces a renamed one, or that lets annotations name what is not imported."""
    if isinstance(problem, NameError):
        return "from __future__ import annotations    # if the name stands in an annotation alone"
    if not isinstance(problem, ImportError):
        return None
    if problem.name == "planlang.protocols" and "'World'" in problem.msg:
        return (
            "from planlang.protocols import RobotInterface    # it was World; holding and falling are the simulator's"
        )
    is_old = problem.name == "planlang.modules"
    return "from planlang import process_module    # planlang.modules is planlang.registry now" if is_old else None
