"""Fixes in the text of recipes: safe ones, and uncertain ones that the user has to accept.

General layout: ``proposals`` derives fixes from diagnostics; ``manchester_text`` and ``xml_text`` turn them into edits
of either syntax; ``fixing`` applies them one after the other and keeps those that help.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from planlang.diagnostics import Declaration, Span
from planlang.recipe.preconditions import Unmet
from planlang.records import dataclass
from planlang.words import Option, Text

SAFE = ("O012", "O013", "O016", "O042", "O043", "R010", "R011", "R013", "R014", "R020", "R024", "R030", "R033", "R038",
        "R046", "R049", "R050", "R051", "R057", "R058")  # fmt: skip
"""Codes of fixes that are applied by default: the recipe keeps its meaning, or has only one plausible meaning."""

ACCEPTABLE = ("O016", "R010", "R011", "R020", "R033", "R034", "R038", "R039", "R040", "R042", "R045", "R046", "R049",
              "R050", "R058")  # fmt: skip
"""Codes of uncertain fixes, which are applied only if accepted."""

WITHOUT = {
    "R001": "the file does not state the task",
    "R002": Text("`", Option("task"), "` chooses one"),
    "R003": "the file does not state their task",
    "R004": "the file does not state the steps",
    "R005": "other tools may depend on the words that the file uses",
    "R012": "any constraint of the cycle may be wrong",
    "R015": "any of the statements may be wrong",
    "R021": "the file does not state how to perform the action",
    "R022": "any step of the circle may be wrong",
    "R023": "any of the nested recipes may be the one to flatten",
    "R031": "the intended property is unknown, and another program may use this one",
    "R032": "the property, its filler and the class of the filler may each be wrong",
    "R035": "the file does not state which thing or number is meant",
    "R036": "the file does not state where the place is",
    "R037": "the intended number or unit is unknown",
    "R041": "the order follows from the base motion; once written, it would remain if the motion is removed",
    "R043": "the file does not state what the recovery should do",
    "R044": "the failure or the strategy may be wrong",
    "R047": "any order may be intended",
    "R048": "renaming a step would break other files that use the name",
    "R052": "the file does not state where the recipe begins or ends",
    "R053": "either transition may be wrong",
    "R054": "a transition may be missing, or the state superfluous",
    "R055": "the file does not state what comes next",
    "R056": "the file does not state what to do after a failure",
    "R059": "the statement may belong to another task, or be superfluous",
    "R060": "the property or its filler may be wrong",
    "R061": "the file does not state the target",
    "R062": "the file does not state the thing or place",
    "R063": "the intended slot is unknown",
    "R065": "the intended constraint is unknown",
    "R067": "any of the orderings may be wrong",
    "R068": "the file does not state the thing or place",
    "R069": "the file does not state which things there are",
    "R070": "the file does not state the other thing, or which one is superfluous",
}
"""Code -> why there is no fix: the file allows several corrections, or determines none."""


class Edit(NamedTuple):
    """Replace the characters from ``start`` up to ``end`` (offsets) by ``text``."""

    start: int
    end: int
    text: str


class CannotEdit(Exception):
    """The text has a form that the edit does not support; the message states the obstacle."""


class Worse(CannotEdit):
    """A fix would make the recipe worse; ``advice`` is what to write instead."""

    def __init__(self, why: str, advice: str) -> None:
        super().__init__(why)
        self.advice = advice


class Rehearsal(NamedTuple):
    """Problems when a scripted robot runs the plan of a recipe.

    ``unmet`` are actions that came before their preconditions held, ``failure`` is the failure that ended the run.
    """

    unmet: tuple[Unmet, ...]
    failure: str = ""


Rehearse = Callable[[Path], Rehearsal | None]
"""Function that compiles the recipe in a file and runs its plan; None if the recipe does not compile."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where to insert a new restriction of a task.

    ``task`` is the head of the task's class, ``sub_action`` and ``last`` are fillers of its restrictions: the new one
    goes after ``last``. ``word`` is the local name of the property that ``sub_action`` fills.
    """

    task: Span
    sub_action: Span
    word: str
    last: Span
    is_flat: bool


class Editable(ABC):
    """Text in a certain syntax; spans are those of its reader. All methods raise CannotEdit rather than guess."""

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self._file = file

    def check_file(self, span: Span) -> None:
        """Raise CannotEdit if the position is in another file."""
        if span.file != self._file:
            raise CannotEdit("it is stated in several files")

    def line_end(self) -> str:
        """Line ending of the text, taken from its first line."""
        first = self.text.find("\n")
        return "\r\n" if first > 0 and self.text[first - 1] == "\r" else "\n"

    def indentation(self, offset: int) -> str:
        """White space before a position if nothing else precedes it on its line, else an empty string."""
        before = self.text[self.text.rfind("\n", 0, offset) + 1 : offset]
        return before if not before.strip() else ""

    @abstractmethod
    def exchanged(self, first: Span, second: Span) -> list[Edit]:
        """Swap the properties of two restrictions, given the spans of their fillers."""

    @abstractmethod
    def renamed(self, where: Span, like: Span) -> list[Edit]:
        """Replace the name at one position by the name that stands at another."""

    @abstractmethod
    def replaced(self, where: Span, written: str, meant: str) -> list[Edit]:
        """Replace one name (IRI) by another at one position."""

    @abstractmethod
    def without(self, filler: Span) -> list[Edit]:
        """Remove a restriction, given the span of its filler, from the class that states it."""

    @abstractmethod
    def without_individual(self, where: Span, name: str) -> list[Edit]:
        """Remove the description of an individual (IRI) if all of it is in one place; otherwise make no edits."""

    @abstractmethod
    def with_kind(self, filler: Span, kind: str) -> list[Edit]:
        """Change the kind of a restriction to "some" or "value"."""

    @abstractmethod
    def with_ordering(self, place: Place, before: Span, after: Span, suffix: str) -> list[Edit]:
        """Add an ordering constraint to a task, and its individual, named after the task with a suffix.

        ``before`` and ``after`` are the spans of the names of the two steps.
        """

    @abstractmethod
    def with_sub_action(self, place: Place, step: Span, kind: str) -> list[Edit]:
        """Add a sub-action, whose head stands at ``step``, to a task, by a restriction of kind "some" or "value"."""

    def with_declarations(self, declarations: Sequence[Declaration]) -> list[Edit]:
        """Declare entities, which exist only in XML."""
        raise CannotEdit("only XML has entities")

    def with_right_terms(self) -> list[Edit]:
        """Move terms of RDFS and OWL to their correct namespace; Manchester syntax has keywords instead."""
        return []


@dataclass(frozen=True, slots=True)
class Fix:
    """A fix for diagnostics of ``code``: its effect in words, its position, and the edits that make it.

    A fix that is not safe is a guess at the intended meaning, which the user has to accept.
    """

    code: str
    message: str
    span: Span | None
    edit: Callable[[Editable], list[Edit]]
    is_safe: bool = True
