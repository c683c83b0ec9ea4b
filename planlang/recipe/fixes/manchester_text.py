"""Fixes as edits of Manchester syntax."""

from __future__ import annotations

import re
from itertools import islice

from planlang.designators import local_part
from planlang.diagnostics import Span
from planlang.files import offset_of
from planlang.ontology.moved_names import canonical
from planlang.recipe.fixes import CannotEdit, Edit, Editable, Place

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


class ManchesterText(Editable):
    """File in Manchester syntax; spans are the first characters of fillers and names, for facts of the property."""

    def exchanged(self, first: Span, second: Span) -> list[Edit]:
        (a_start, a_end), (b_start, b_end) = self._property(first), self._property(second)
        return [Edit(a_start, a_end, self.text[b_start:b_end]), Edit(b_start, b_end, self.text[a_start:a_end])]

    def renamed(self, where: Span, like: Span) -> list[Edit]:
        start, end = self._name(where)
        new_start, new_end = self._name(like)
        return [Edit(start, end, self.text[new_start:new_end])]

    def replaced(self, where: Span, written: str, meant: str) -> list[Edit]:
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
        start, end = self._property(filler)[0], self._name(filler)[1]
        while (before := _OPEN.search(self.text, 0, start)) and (after := _CLOSE.match(self.text, end)):
            start, end = before.start(), after.end()
        if before := _JOINED_BEFORE.search(self.text, 0, start):
            return [Edit(before.start(), end, "")]
        if after := _JOINED_AFTER.match(self.text, end):
            return [Edit(start, after.end(), "")]
        raise CannotEdit("it is not one of several in a list")

    def without_individual(self, where: Span, name: str) -> list[Edit]:
        frames = re.finditer(r"^[ \t]*Individual:\s*(<[^<>\s]*>|\S+)", self.text, re.MULTILINE)
        heads = [match for match in frames if match[1].removesuffix(">").endswith(local_part(name))]
        start, end = self._name(where)
        if len(heads) != 1 or heads[0].span(1) != (start, end):
            return []
        following = _NEXT_FRAME.search(self.text, end)
        return [Edit(heads[0].start(), following.start() if following else len(self.text), "")]

    def with_kind(self, filler: Span, kind: str) -> list[Edit]:
        end = self._property(filler)[1]
        word = _KIND.match(self.text, end)
        if word is None:
            raise CannotEdit("expected some or value there")
        return [Edit(*word.span(1), kind)]

    def with_ordering(self, place: Place, before: Span, after: Span, suffix: str) -> list[Edit]:
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
        indent = self.indentation(self._property(place.last)[0])
        edits = [Edit(end, end, f",{self.line_end()}{indent}{new}" if indent else f", {new}")] if is_item else []
        return [*edits, self._frames(end, frames)] if frames else edits

    def _frames(self, position: int, frames: list[list[str]]) -> Edit:
        """Write frames, given by their lines, after the frame at a position."""
        following = _NEXT_FRAME.search(self.text, position)
        end = following.start() if following else len(self.text)
        lines = self.text[position:end].splitlines(keepends=True)
        while len(lines) > 1 and (not lines[-1].strip() or lines[-1].lstrip().startswith("#")):
            lines.pop()
        end = position + len("".join(lines).rstrip())
        return Edit(end, end, "".join(self.line_end().join(["", "", *frame]) for frame in frames))

    def _offset(self, span: Span) -> int:
        self.check_file(span)
        return offset_of(self.text, span)

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
