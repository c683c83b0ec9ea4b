"""Edits of a file's text, and what a text must be able to do for fixes to be written into it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from planlang.diagnostics import Span


@dataclass(frozen=True, slots=True, order=True)
class Edit:
    """Replace the characters from ``start`` up to ``end`` (offsets) by ``text``."""

    start: int
    end: int
    text: str


class CannotEdit(Exception):
    """The text is not written in a way that is understood there; says what is in the way."""


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


@dataclass(frozen=True, slots=True)
class Anchors:
    """The places in a recipe's file that a new ordering refers to.

    ``before`` and ``after`` are the names of the two steps. ``suffix`` is what makes the constraint's name from the
    task's.
    """

    place: Place
    before: Span
    after: Span
    suffix: str


class Editable(Protocol):
    """A text that knows its syntax. Every method raises CannotEdit rather than guess."""

    def exchanged(self, first: Span, second: Span) -> list[Edit]:
        """Exchange the properties of two restrictions, whose fillers stand at the spans."""

    def renamed(self, where: Span, like: Span) -> list[Edit]:
        """Write at one place the name that stands at another."""

    def replaced(self, where: Span, written: str, meant: str) -> list[Edit]:
        """Write one name (IRI) for another at one place."""

    def without(self, filler: Span) -> list[Edit]:
        """Take a restriction, whose filler stands at the span, out of the class that states it."""

    def without_individual(self, where: Span, name: str) -> list[Edit]:
        """Take out what describes an individual (IRI) if that is all in one place; no edits if it is not."""

    def with_kind(self, filler: Span, kind: str) -> list[Edit]:
        """Make a restriction one of another kind, "some" or "value"."""

    def with_ordering(self, anchors: Anchors) -> list[Edit]:
        """Add an ordering constraint to a task, and the individual that it names."""

    def with_sub_action(self, place: Place, step: Span, kind: str) -> list[Edit]:
        """Add a sub-action, whose head stands at ``step``, to a task, by a restriction of a kind, "some" or "value"."""

    def with_right_terms(self) -> list[Edit]:
        """Put terms of RDFS and OWL into the namespace that has them."""


@dataclass(frozen=True, slots=True)
class Fix:
    """A fix that would silence diagnostics of ``code``: what it does, where, and how.

    What is not safe is a guess at what was meant, which a person has to accept.
    """

    code: str
    message: str
    span: Span | None
    edit: Callable[[Editable], list[Edit]]
    is_safe: bool = True


def applied(text: str, edits: Iterable[Edit]) -> str:
    """Return the text with all edits made. Raises CannotEdit if two of them touch the same characters."""
    parts: list[str] = []
    position = 0
    for edit in _ordered(edits):
        if edit.start < position:
            raise CannotEdit("two fixes touch the same place")
        parts += [text[position : edit.start], edit.text]
        position = edit.end
    return "".join([*parts, text[position:]])


def _ordered(edits: Iterable[Edit]) -> Sequence[Edit]:
    """Return the edits sorted by position; of insertions at one position the one given first comes first."""
    return sorted(dict.fromkeys(edits), key=lambda edit: (edit.start, edit.end))


def line_end(text: str) -> str:
    """Return the line ending of a text: that of its first line."""
    first = text.find("\n")
    return "\r\n" if first > 0 and text[first - 1] == "\r" else "\n"


def indentation(text: str, offset: int) -> str:
    """Return the white space before a place if nothing else is before it on its line, else none."""
    before = text[text.rfind("\n", 0, offset) + 1 : offset]
    return before if not before.strip() else ""
