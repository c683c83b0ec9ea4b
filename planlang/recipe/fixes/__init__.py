"""Fixes of recipes that are safe to make in their text, and some that a person has to accept.

General layout: ``proposals`` makes fixes of the diagnostics and their suggestions; ``manchester_text`` and ``xml_text``
make edits of those, each in its syntax; ``fixing`` tries them one after the other and keeps those that help.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from planlang.diagnostics import Declaration, Span
from planlang.recipe.preconditions import Unmet
from planlang.records import dataclass

SAFE = ("O012", "O013", "O016", "O042", "O043", "R010", "R011", "R013", "R014", "R020", "R024", "R030", "R033", "R038",
        "R046", "R049", "R050", "R051", "R057", "R058")  # fmt: skip
"""Codes of fixes that are made unasked: the recipe means the same after them, or nothing else can be meant."""

ACCEPTABLE = ("O016", "R010", "R011", "R020", "R033", "R034", "R038", "R039", "R040", "R042", "R045", "R046", "R049",
              "R050", "R058")  # fmt: skip
"""Codes of fixes that may be guesses, which are made only if they are accepted."""

WITHOUT = {
    "R001": "the file does not say what the task is",
    "R002": "`--task` chooses one",
    "R003": "the file does not say which task they belong to",
    "R004": "the file does not say what the steps are",
    "R005": "other tools may read the file by its own words",
    "R012": "any constraint of the cycle may be wrong",
    "R015": "any of the statements may be wrong",
    "R021": "the file does not say how the action is performed",
    "R022": "the file does not say which step is wrong",
    "R023": "the file does not say which recipe should be flatter",
    "R031": "the file does not say which property was meant, and it may be another program's",
    "R032": "the property, its filler and the class of the filler may each be wrong",
    "R035": "an expression has no name to write instead",
    "R036": "the file does not say where the place is",
    "R037": "the file does not say which number or unit was meant",
    "R041": "the order follows from the file; written down, it would stay when the base motion goes",
    "R043": "the file does not say what the recovery should do",
    "R044": "the failure or the strategy may be wrong",
    "R047": "any order may be intended",
    "R048": "renaming a step would break other files that use the name",
    "R052": "the file does not say where the recipe begins or ends",
    "R053": "either transition may be wrong",
    "R054": "a transition may be missing, or the state superfluous",
    "R055": "the file does not say what comes next",
    "R056": "the file does not say what should follow a failure",
    "R059": "the statement may belong to another task, or be superfluous",
    "R060": "the property or its filler may be wrong",
    "R061": "the file does not say where to",
    "R062": "the file does not say which thing or place",
    "R063": "the file does not say what is needed",
    "R065": "the file does not say which constraint was meant",
    "R067": "any of the orderings may be wrong",
    "R068": "the file does not say which thing or place",
}
"""Code -> why there is no fix: there is more than one right text, or none follows from the file."""


class Edit(NamedTuple):
    """Replace the characters from ``start`` up to ``end`` (offsets) by ``text``."""

    start: int
    end: int
    text: str


class CannotEdit(Exception):
    """The text is not written in a way that is understood there; the message says what is in the way."""


class Worse(CannotEdit):
    """A fix would make the recipe worse; ``advice`` says what to write instead."""

    def __init__(self, why: str, advice: str) -> None:
        super().__init__(why)
        self.advice = advice


class Rehearsal(NamedTuple):
    """What goes wrong when the plan of a recipe is run by a scripted robot.

    ``unmet`` are the actions that came before what they need was brought about, ``failure`` is how the run failed.
    """

    unmet: tuple[Unmet, ...]
    failure: str = ""


Rehearse = Callable[[Path], Rehearsal | None]
"""Compiles the recipe in a file and runs its plan; returns None if the recipe does not compile."""


@dataclass(frozen=True, slots=True)
class Place:
    """The place of a new restriction of a task.

    ``task`` is the head of the task's class, ``sub_action`` and ``last`` are fillers of restrictions of it (``last``
    the one behind which the new one goes). ``word`` is the local name of the property that ``sub_action`` fills.
    """

    task: Span
    sub_action: Span
    word: str
    last: Span
    is_flat: bool


class Editable(ABC):
    """A text that knows its syntax; spans are those of its reader. Every method raises CannotEdit rather than guess."""

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self._file = file

    def check_file(self, span: Span) -> None:
        """Raise CannotEdit for a position in another file."""
        if span.file != self._file:
            raise CannotEdit("it is stated in several files")

    def line_end(self) -> str:
        """Return the line ending of the text: that of its first line."""
        first = self.text.find("\n")
        return "\r\n" if first > 0 and self.text[first - 1] == "\r" else "\n"

    def indentation(self, offset: int) -> str:
        """Return the white space before a place if nothing else is before it on its line, else none."""
        before = self.text[self.text.rfind("\n", 0, offset) + 1 : offset]
        return before if not before.strip() else ""

    @abstractmethod
    def exchanged(self, first: Span, second: Span) -> list[Edit]:
        """Exchange the properties of two restrictions, whose fillers stand at the spans."""

    @abstractmethod
    def renamed(self, where: Span, like: Span) -> list[Edit]:
        """Write at one place the name that stands at another."""

    @abstractmethod
    def replaced(self, where: Span, written: str, meant: str) -> list[Edit]:
        """Write one name (IRI) for another at one place."""

    @abstractmethod
    def without(self, filler: Span) -> list[Edit]:
        """Take a restriction, whose filler stands at the span, out of the class that states it."""

    @abstractmethod
    def without_individual(self, where: Span, name: str) -> list[Edit]:
        """Take out the description of an individual (IRI) if that is all in one place; no edits if it is not."""

    @abstractmethod
    def with_kind(self, filler: Span, kind: str) -> list[Edit]:
        """Make a restriction one of another kind, "some" or "value"."""

    @abstractmethod
    def with_ordering(self, place: Place, before: Span, after: Span, suffix: str) -> list[Edit]:
        """Add an ordering constraint to a task, and the individual that it names: the task's name and a suffix.

        ``before`` and ``after`` are the names of the two steps.
        """

    @abstractmethod
    def with_sub_action(self, place: Place, step: Span, kind: str) -> list[Edit]:
        """Add a sub-action, whose head stands at ``step``, to a task, by a restriction of a kind, "some" or "value"."""

    def with_declarations(self, declarations: Sequence[Declaration]) -> list[Edit]:
        """Declare entities, which only XML has."""
        raise CannotEdit("only XML has entities")

    def with_right_terms(self) -> list[Edit]:
        """Put terms of RDFS and OWL into the namespace that has them; in Manchester syntax they are keywords."""
        return []


@dataclass(frozen=True, slots=True)
class Fix:
    """A fix that would silence diagnostics of ``code``: its effect in words, where, and how.

    A fix that is not safe is a guess at what was meant, which a person has to accept.
    """

    code: str
    message: str
    span: Span | None
    edit: Callable[[Editable], list[Edit]]
    is_safe: bool = True
