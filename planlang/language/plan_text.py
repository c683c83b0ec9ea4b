"""What the text of a plan says, as values: calls, classes, steps, functions, needs. PlanSource reads them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import NamedTuple

from planlang.language.branches import Branch
from planlang.records import dataclass

DESCRIPTIONS = frozenset(
    {"action", "action_class", "an_object", "a_person", "a_device", "a_location", "a_pose", "a_posture", "resting_on"}
    | {"a_situation", "partial"}
)
"""Functions that make descriptions, and do nothing."""
Performs = Callable[[str, Branch | None], bool]
"""Decides whether a process module performs an action of a class, rather than the plan given for it."""


class Keyword(NamedTuple):
    """Argument with a name, and where it is written; columns count from 1."""

    name: str | None
    """None for ``**others``."""
    line: int
    column: int


@dataclass(frozen=True, slots=True)
class CallText:
    """Call of a function."""

    function: str | None
    """Name of the function in planlang; None if the call names none."""
    line: int
    column: int
    keywords: tuple[Keyword, ...]
    written: str | None
    """Name of the function that gets the arguments, for ``partial`` the first of them, if the file does not bind it."""
    is_partial: bool
    given: int | None
    """Number of arguments without a name for it; None if there are ``*others`` or ``**others``."""
    cls: str | None
    """Local name of the class that the first argument names; None if only the running plan knows it."""
    literal: str | None
    """The first argument, if it is written as a string."""


@dataclass(frozen=True, slots=True)
class Step:
    """What a plan function does at one place: it performs an action, or calls a plan of its file, or passes it on."""

    function: str
    """The plan function around it."""
    line: int
    column: int
    what: str
    """Local name of the action's class, its expression if the class is not known, or name of the called plan."""
    is_call: bool
    """True if ``what`` is a plan."""
    name: str | None = None
    """Name of the step (``name=``)."""
    recoveries: tuple[str, ...] = ()
    """Recoveries of the step itself, as they are written."""
    described: str | None = field(default=None, compare=False)
    """The action, or the called plan as a ``partial``, as it is written; None where that does more than describe."""
    names: Mapping[str, str] = field(default_factory=dict, compare=False)
    """Descriptions that the function assigns to names."""


@dataclass(frozen=True, slots=True)
class FunctionText:
    """An async function; ``is_plan`` if it is a plan of the file, and not inside another function or class."""

    name: str
    line: int
    is_plan: bool
    parameters: tuple[str, ...]
    summary: str
    """First line of its docstring."""
    locations: tuple[int, ...]
    """Lines that name ``at_location``, in order."""


@dataclass(frozen=True, slots=True)
class Needs:
    """Action classes that a piece of plan performs, and its choices, of each of which one alternative suffices.

    ``modular`` are action classes that only process modules can perform: the plan has no other way.
    """

    actions: tuple[str, ...] = ()
    choices: tuple[tuple[Alternative, ...], ...] = ()
    modular: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Alternative:
    """Branch of a choice: the function that it calls, its line, and what it needs."""

    name: str
    line: int
    needs: Needs
