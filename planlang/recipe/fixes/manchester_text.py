"""Fixes as edits of Manchester syntax."""

from __future__ import annotations

import re
from itertools import islice
from typing import NamedTuple

from planlang.designators import local_part
from planlang.diagnostics import Span
from planlang.files import offset_of
from planlang.ontology.moved_names import canonical
from planlang.records import dataclass

_NAME = re.compile(r"<[^<>\s]*>|[^\s,(){}\[\]\"<>]+")
_BEFORE_FILLER = re.compile(
    r"(?<!\S)(?P<property><[^<>\s]*>|[^\s,(){}\[\]\"<>]+)\s+(?:some|value|(?:exactly|min)\s+\d+)\s+\(?\s*\Z"
)
_OPEN = re.compile(r"\(\s*\Z")
_CLOSE = re.compile(r"\s*\)")
_JOINED_BEFORE = re.compile(r"(?:\s*,|\s+and)\s*\Z")
_JOINED_AFTER = re.compile(r"\s*,\s*|\s+and\s+")
_KIND = re.compile(r"\s+(some|value)\s")
_FRAME = re.compile(r"^[ \t]*(?:[A-Z]\w+):(?=\s)", re.MULTILINE)
_HEADS = ("Class", "Individual", "ObjectProperty", "DataProperty", "AnnotationProperty", "Datatype", "Ontology",
          "DisjointClasses", "EquivalentClasses", "SameIndividual", "DifferentIndividuals")  # fmt: skip
_NEXT_FRAME = re.compile(rf"^[ \t]*(?:{'|'.join(_HEADS)}):(?=\s)", re.MULTILINE)
_PREFIX = re.compile(r"^[ \t]*Prefix:\s*([^\s:<>]*):\s*<([^<>\s]*)>", re.MULTILINE)
_LOCAL = re.compile(r"\w(?:[\w.-]*[\w-])?")
_LONGEST = 1000
"""Maximum distance of a property before its filler, in characters: only `some` or the like stands between them, and the
pattern is tried at each character."""


def line_end(text: str) -> str:
    """Line ending of a text, taken from its first line."""
    first = text.find("\n")
    return "\r\n" if first > 0 and text[first - 1] == "\r" else "\n"


class Edit(NamedTuple):
    """Replace the characters from ``start`` up to ``end`` (offsets) by ``text``."""

    start: int
    end: int
    text: str


class CannotEdit(Exception):
    """The text has a form that the edit does not support; the message states the obstacle."""


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


class ManchesterText:
    """Text in Manchester syntax; spans are the first characters of fillers and names, for facts of the property.

    All methods raise CannotEdit rather than guess.
    """

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self._file = file

    def exchanged(self, first: Span, second: Span) -> list[Edit]:
        """Swap the properties of two restrictions, given the spans of their fillers."""
        (a_start, a_end), (b_start, b_end) = self._property(first), self._property(second)
        return [Edit(a_start, a_end, self.text[b_start:b_end]), Edit(b_start, b_end, self.text[a_start:a_end])]

    def renamed(self, where: Span, like: Span) -> list[Edit]:
        """Replace the name at one position by the name that stands at another."""
        start, end = self._name(where)
        new_start, new_end = self._name(like)
        return [Edit(start, end, self.text[new_start:new_end])]

    def replaced(self, where: Span, written: str, meant: str) -> list[Edit]:
        """Replace one name (IRI) by another at one position."""
        old = local_part(written)
        for match in islice(_NAME.finditer(self.text, self._offset(where)), 2):  # in a fact the name comes second
            name = match[0].removesuffix(">")
            if name.endswith(old) and name[: -len(old)][-1:] in ("", ":", "#", "/"):
                if written.removesuffix(old) == meant.removesuffix(local_part(meant)):
                    return [Edit(match.end() - len(match[0]) + len(name) - len(old), match.start() + len(name),
                                 local_part(meant))]  # fmt: skip
                return [Edit(match.start(), match.end(), self._written(meant))]
        raise CannotEdit(f"the name {old} is not written there")

    def without(self, filler: Span) -> list[Edit]:
        """Remove a restriction, given the span of its filler, from the class that states it."""
        start, end = self._property(filler)[0], self._name(filler)[1]
        while (before := _OPEN.search(self.text, 0, start)) and (after := _CLOSE.match(self.text, end)):
            start, end = before.start(), after.end()
        if before := _JOINED_BEFORE.search(self.text, 0, start):
            return [Edit(before.start(), end, "")]
        if after := _JOINED_AFTER.match(self.text, end):
            return [Edit(start, after.end(), "")]
        raise CannotEdit("it is not one of several in a list")

    def without_individual(self, where: Span, name: str) -> list[Edit]:
        """Remove the description of an individual (IRI) if all of it is in one place; otherwise make no edits."""
        frames = re.finditer(r"^[ \t]*Individual:\s*(<[^<>\s]*>|\S+)", self.text, re.MULTILINE)
        heads = [match for match in frames if match[1].removesuffix(">").endswith(local_part(name))]
        start, end = self._name(where)
        if len(heads) != 1 or heads[0].span(1) != (start, end):
            return []
        following = _NEXT_FRAME.search(self.text, end)
        return [Edit(heads[0].start(), following.start() if following else len(self.text), "")]

    def with_kind(self, filler: Span, kind: str) -> list[Edit]:
        """Change the kind of a restriction to "some" or "value"."""
        end = self._property(filler)[1]
        word = _KIND.match(self.text, end)
        if word is None:
            raise CannotEdit("expected some or value there")
        return [Edit(*word.span(1), kind)]

    def with_ordering(self, place: Place, before: Span, after: Span, suffix: str) -> list[Edit]:
        """Add an ordering constraint to a task, and its individual, named after the task with a suffix.

        ``before`` and ``after`` are the spans of the names of the two steps.
        """
        property_name = self._slice(self._property(place.sub_action))
        head, local, tail = property_name.rpartition(place.word)
        if not local or tail not in ("", ">"):
            raise CannotEdit(f"the property {property_name} is not written as {place.word}")
        first, second, task = (self._slice(self._name(span)) for span in (before, after, place.task))
        name = f"{task[:-1]}{suffix}>" if task.endswith(">") else task + suffix
        individual = [
            f"Individual: {name}",
            f"    Types: {head}PartialOrdering-Strict{tail}",
            f"    Facts: {head}occursBeforeInOrdering{tail} {first}, {head}occursAfterInOrdering{tail} {second}",
        ]
        return self._with_restriction(place, f"{head}orderingConstraints{tail} value {name}", individual)

    def with_sub_action(self, place: Place, step: Span, kind: str) -> list[Edit]:
        """Add a sub-action, whose head stands at ``step``, to a task, by a restriction of kind "some" or "value"."""
        property_name = self._slice(self._property(place.sub_action))
        return self._with_restriction(place, f"{property_name} {kind} {self._slice(self._name(step))}", [])

    def _with_restriction(self, place: Place, new: str, individual: list[str]) -> list[Edit]:
        """Add a restriction to a task, and the lines of the individual that it names.

        The restriction becomes an item in the list of the last one if there is a list; otherwise it gets a frame.
        """
        end = self._name(place.last)[1]
        rest = re.sub(r"\A(?:\s|#[^\n]*\n)+", "", self.text[end:])
        # an item of a list ends before a comma, another section, or the end
        is_item = place.is_flat and (not rest or rest.startswith(",") or _FRAME.match(rest) is not None)
        frame_of_task = [] if is_item else [f"Class: {self._slice(self._name(place.task))}", f"    SubClassOf: {new}"]
        frames = [frame for frame in (frame_of_task, individual) if frame]
        indent = self._indentation(self._property(place.last)[0])
        edits = [Edit(end, end, f",{line_end(self.text)}{indent}{new}" if indent else f", {new}")] if is_item else []
        return [*edits, self._frames(end, frames)] if frames else edits

    def _frames(self, position: int, frames: list[list[str]]) -> Edit:
        """Write frames, given by their lines, after the frame at a position."""
        following = _NEXT_FRAME.search(self.text, position)
        end = following.start() if following else len(self.text)
        lines = self.text[position:end].splitlines(keepends=True)
        while len(lines) > 1 and (not lines[-1].strip() or lines[-1].lstrip().startswith("#")):
            lines.pop()
        end = position + len("".join(lines).rstrip())
        return Edit(end, end, "".join(line_end(self.text).join(["", "", *frame]) for frame in frames))

    def _offset(self, span: Span) -> int:
        if span.file != self._file:
            raise CannotEdit("it is stated in several files")
        return offset_of(self.text, span)

    def _indentation(self, offset: int) -> str:
        """White space before a position if nothing else precedes it on its line, else an empty string."""
        before = self.text[self.text.rfind("\n", 0, offset) + 1 : offset]
        return before if not before.strip() else ""

    def _name(self, span: Span) -> tuple[int, int]:
        match = _NAME.match(self.text, self._offset(span))
        if match is None:
            raise CannotEdit("expected a name there")
        value = re.match(r"\s+", self.text[match.end() :])
        if re.search(r"occurs(?:Before|After)InOrdering>?\Z", match[0]) and value is not None:
            match = _NAME.match(self.text, match.end() + value.end())
            if match is None:
                raise CannotEdit("expected a name after the property")
        return match.start(), match.end()

    def _property(self, filler: Span) -> tuple[int, int]:
        offset = self._offset(filler)
        window = max(0, offset - _LONGEST)
        match = _BEFORE_FILLER.search(self.text[window:offset].replace("(", " "))
        if match is None or re.search(r"\binverse\s*\Z", self.text[window : window + match.start()]):
            raise CannotEdit("expected `property some filler` there")
        return window + match.start("property"), window + match.end("property")

    def _written(self, iri: str) -> str:
        """Name in the form that the file uses: with the prefix of its namespace, else as a full IRI."""
        local = local_part(iri)
        for prefix, namespace in _PREFIX.findall(self.text) if _LOCAL.fullmatch(local) else ():
            if canonical(namespace) == iri.removesuffix(local):
                return f"{prefix}:{local}".removeprefix(":")
        return f"<{iri}>"

    def _slice(self, place: tuple[int, int]) -> str:
        return self.text[place[0] : place[1]]
