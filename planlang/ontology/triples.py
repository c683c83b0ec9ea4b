"""Triples as columns of numbers, and what finds them: room for a million where objects would take all there is.

Every term has a number, which stands for it in the columns; a triple, its terms and its position become objects when
somebody asks for them. Five numbers a triple and what ``terms`` holds once each: 20 MB for the largest file that is
read, where triples with positions of their own would take 200. Indexes are made when they are first needed: for each
term the first row in which it stands, for each row the next one with the same term.
"""

from __future__ import annotations

import json
import sys
from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import overload

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.ontology.terms import OWL, BNode, Literal, Term, Triple
from planlang.records import dataclass

MOST_TRIPLES = 1_000_000
"""Triples of one file."""


@dataclass
class Parsed:
    """The content of a file: its triples in document order, the repairs made, the declared prefixes."""

    triples: Triples
    diagnostics: list[Diagnostic] = field(default_factory=list)
    prefixes: dict[str, str] = field(default_factory=dict)
    others: tuple[bytes, ...] = ()
    """Contents of further files on which the triples depend."""


def check_room(triples: Triples, line: int, column: int) -> None:
    """Raise BadInput if these are more than a file may have; the place is that of the last one."""
    if len(triples.subjects) > MOST_TRIPLES:
        message = f"the file has more than {MOST_TRIPLES:,} triples"
        raise BadInput([error("O003", message, Span(triples.file, line, column))])


def counted(shown: list[Diagnostic], more: int) -> list[Diagnostic]:
    """Return the diagnostics to show; the last states how many more there are, so that nothing is silent."""
    if more <= 0 or not shown:
        return shown
    return [*shown[:-1], replace(shown[-1], message=f"{shown[-1].message}; {more} more like this are not shown")]


class Triples(Sequence[Triple]):
    """The triples of a file, or of several, in their order.

    ``terms`` tells what a number stands for; None is a nameless node of the first file that nobody has asked for, whose
    label is ``label`` with its number. The columns ``subjects``, ``predicates``, ``objects``, ``lines`` and ``columns``
    are equally long; rows count from 0. Nothing may be added once an index has been used.
    """

    def __init__(self, file: str, label: str = "b") -> None:
        self.label = label
        self.terms: list[Term | None] = []
        self.numbers: dict[Term, int] = {}
        self.subjects, self.predicates, self.objects = array("i"), array("i"), array("i")
        self.lines, self.columns = array("I"), array("I")
        self.file = file
        """The file of these triples; the first of several."""
        self._files = [file]
        self._starts = [0]
        self._first_end = sys.maxsize
        """The row behind those of the first file."""

    @classmethod
    def of(cls, triples: Iterable[Triple], file: str = "") -> Triples:
        """Return the given triples, in their order, as triples of one file."""
        found = cls(file)
        for triple in triples:
            found.state(triple.subject, triple.predicate, triple.object, triple.span)
        return found

    # adding

    def number(self, term: Term) -> int:
        """Return the number of a term, a new one if it has none yet."""
        found = self.numbers.get(term)
        if found is None and type(term) is BNode:  # one that was made by ``fresh`` is not among the numbers
            found = self.find(term)
        if found is None:
            found = self.numbers[term] = len(self.terms)
            self.terms.append(term)
        return found

    def fresh(self) -> int:
        """Return the number of a new nameless node."""
        self.terms.append(None)
        return len(self.terms) - 1

    def add(self, subject: int, predicate: int, value: int, line: int, column: int) -> None:
        """Add a triple by the numbers of its terms."""
        self.subjects.append(subject)
        self.predicates.append(predicate)
        self.objects.append(value)
        self.lines.append(line)
        self.columns.append(column)

    def insert(self, row: int, subject: int, predicate: int, value: int, line: int, column: int) -> None:
        """Put a triple in front of a row."""
        self.subjects.insert(row, subject)
        self.predicates.insert(row, predicate)
        self.objects.insert(row, value)
        self.lines.insert(row, line)
        self.columns.insert(row, column)

    def state(self, subject: str | BNode, predicate: str, value: Term, span: Span) -> None:
        """Add a triple."""
        self.add(self.number(subject), self.number(predicate), self.number(value), span.line, span.column)

    def repeat(self, rows: Iterable[int], predicate: int, value: int) -> None:
        """Say this of its subject behind each of these rows, too, as if it stood there."""
        repeated = frozenset(rows)
        order = array("i", [row for row in range(len(self)) for _ in range(2 if row in repeated else 1)])
        for column in (*self._terms_of_rows(), self.lines, self.columns):
            column[:] = array(column.typecode, map(column.__getitem__, order))
        for row, before in enumerate(order[:-1], start=1):
            if order[row] == before:
                self.predicates[row], self.objects[row] = predicate, value

    def rename(self, names: Mapping[str, str]) -> None:
        """Let other names (IRIs) stand in the place of some, those of other triples among them."""
        same: dict[int, int] = {}
        for old, new in names.items():
            number = self.numbers.pop(old, None)
            if number is not None:
                self.terms[number] = new
                if self.numbers.setdefault(new, number) != number:
                    same[number] = self.numbers[new]
        if same:
            self.renumber(same)

    def renamed(self, names: Mapping[str, str]) -> Triples:
        """Return a copy in which some names (IRIs) are replaced. The triples are those of one file."""
        copy = Triples(self._files[0], self.label)
        copy.terms, copy.numbers = self.terms.copy(), self.numbers.copy()
        for column, own in zip(copy._terms_of_rows(), self._terms_of_rows(), strict=True):
            column.extend(own)
        copy.lines.extend(self.lines)
        copy.columns.extend(self.columns)
        copy.rename(names)
        return copy

    def renumber(self, changed: Mapping[int, int]) -> None:
        """Let other terms stand in the place of some."""
        for column in self._terms_of_rows():
            column[:] = array("i", [changed.get(number, number) for number in column])

    # terms and triples

    def find(self, term: Term) -> int | None:
        """Return the number of a term; None if no triple has it."""
        found = self.numbers.get(term)
        if found is None and isinstance(term, BNode):
            digits = term.label.removeprefix(self.label)
            if digits.isascii() and digits.isdecimal() and len(digits) < 10 and int(digits) < len(self.terms):
                number = int(digits)
                return number if self.term(number) == term else None
        return found

    def term(self, number: int) -> Term:
        """Return the term of a number."""
        found = self.terms[number]
        if found is None:
            found = self.terms[number] = BNode(f"{self.label}{number}")
        return found

    def name(self, number: int) -> str | None:
        """Return the IRI that a number stands for; None for a node or a value."""
        found = self.terms[number]
        return found if isinstance(found, str) else None

    def is_node(self, number: int) -> bool:
        """Return True for a nameless node."""
        found = self.terms[number]
        return found is None or isinstance(found, BNode)

    def span(self, row: int) -> Span:
        """Return the position of a triple."""
        file = self.file if row < self._first_end else self._files[bisect_right(self._starts, row) - 1]
        return Span(file, self.lines[row], self.columns[row])

    def triple(self, row: int) -> Triple:
        """Return the triple of a row."""
        terms = self.terms
        subject, value = self.subjects[row], self.objects[row]
        return Triple(
            terms[subject] or self.term(subject),  # type: ignore[arg-type]
            terms[self.predicates[row]],  # type: ignore[arg-type]
            terms[value] or self.term(value),
            self.span(row),
        )

    def __len__(self) -> int:
        return len(self.subjects)

    @overload
    def __getitem__(self, index: int) -> Triple: ...
    @overload
    def __getitem__(self, index: slice) -> list[Triple]: ...
    def __getitem__(self, index: int | slice) -> Triple | list[Triple]:
        rows = range(len(self))[index]
        return self.triple(rows) if isinstance(rows, int) else [self.triple(row) for row in rows]

    def __iter__(self) -> Iterator[Triple]:
        return map(self.triple, range(len(self)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    # bytes

    def packed(self) -> bytes:
        """Return the triples of one file as bytes, from which :meth:`unpacked` makes them again."""
        columns = (*self._terms_of_rows(), self.lines, self.columns)
        return json.dumps(
            [self.label, list(map(_packed_term, self.terms)), *(column.tolist() for column in columns)],
            ensure_ascii=False,
            separators=(",", ":"),
        ).encode()

    @classmethod
    def unpacked(cls, packed: bytes, file: str) -> Triples:
        """Return the triples that were packed, with their positions in ``file``."""
        label, terms, *columns = json.loads(packed)
        found = cls(file, label)
        found.terms = [
            term if term is None or isinstance(term, str) else BNode(*term) if len(term) == 1 else Literal(*term)
            for term in terms
        ]
        found.numbers = {term: number for number, term in enumerate(found.terms) if term is not None}
        for column, numbers in zip((*found._terms_of_rows(), found.lines, found.columns), columns, strict=True):
            column.extend(numbers)
        return found

    # several files

    @property
    def ranges(self) -> list[range]:
        """The rows of each file."""
        return [range(start, end) for start, end in zip(self._starts, [*self._starts[1:], len(self)], strict=True)]

    @classmethod
    def joined(cls, parts: Sequence[Triples]) -> Triples:
        """Join the triples of several files, one after the other; each part is of one file and stays as it is."""
        first = parts[0]
        whole = cls(first._files[0], first.label)
        whole.terms, whole.numbers = first.terms.copy(), first.numbers.copy()
        whole._files = [part._files[0] for part in parts]
        whole._starts = []
        by_predicate: dict[int, array[int]] = {}
        for part in parts:
            start = len(whole)
            whole._starts.append(start)
            into = None if part is first else whole._numbers_of(part)
            for number, rows in part._by_predicate.items():
                found = by_predicate.setdefault(number if into is None else into[number], array("i"))
                found.extend(rows if part is first else [row + start for row in rows])
            for column, more in zip(whole._terms_of_rows(), part._terms_of_rows(), strict=True):
                column.extend(more if into is None else map(into.__getitem__, more))
            whole._first_end = min(whole._first_end, len(whole))
            whole.lines.extend(part.lines)
            whole.columns.extend(part.columns)
        whole._by_predicate = by_predicate
        return whole

    def _numbers_of(self, part: Triples) -> list[int]:
        """Return the numbers here of all terms of another, new ones of those that have none yet."""
        known = map(self.numbers.get, part.terms)  # type: ignore[arg-type]  # no term: not among the numbers
        return [self.number(part.term(k)) if found is None else found for k, found in enumerate(known)]

    def _terms_of_rows(self) -> tuple[array[int], array[int], array[int]]:
        return self.subjects, self.predicates, self.objects

    # finding

    def about(self, subject: int) -> Sequence[int]:
        """Return the rows with a subject."""
        first, following = self.by_subject
        row = first[subject]
        found = []
        while row >= 0:
            found.append(row)
            row = following[row]
        return found

    def with_object(self, value: int) -> Sequence[int]:
        """Return the rows with an object."""
        first, following = self.by_object
        row = first[value]
        found = []
        while row >= 0:
            found.append(row)
            row = following[row]
        return found

    def first_about(self, subject: int) -> int:
        """Return the first row with a subject; -1 if there is none."""
        return self.by_subject[0][subject]

    def by(self, *predicates: str) -> Sequence[int]:
        """Return the rows with one of these predicates (IRIs)."""
        numbers = (self.numbers.get(predicate, -1) for predicate in predicates)
        found = [rows for number in numbers if (rows := self._by_predicate.get(number)) is not None]
        return found[0] if len(found) == 1 else sorted(row for rows in found for row in rows)

    @property
    def used(self) -> Iterable[int]:
        """The predicates of all triples, in the order of their first use."""
        return self._by_predicate.keys()

    @cached_property
    def intersections(self) -> dict[int, int]:
        """Return the list of members of each nameless node that is an intersection of classes."""
        rows = reversed(self.by(OWL.intersectionOf))
        return {self.subjects[row]: self.objects[row] for row in rows if self.is_node(self.subjects[row])}

    @cached_property
    def by_subject(self) -> tuple[array[int], array[int]]:
        """Return for each term (number) its first row as subject, for each row the next with the same; -1: none.

        :meth:`about` tells the same of one term; this is for loops over all.
        """
        return self._chains(self.subjects)

    @cached_property
    def by_object(self) -> tuple[array[int], array[int]]:
        """The same for objects."""
        return self._chains(self.objects)

    def _chains(self, column: array[int]) -> tuple[array[int], array[int]]:
        first = array("i", (-1,)) * len(self.terms)
        following = array("i", column)
        for row, number in zip(range(len(column) - 1, -1, -1), reversed(column), strict=True):
            following[row] = first[number]
            first[number] = row
        return first, following

    @cached_property
    def _by_predicate(self) -> dict[int, array[int]]:
        found: dict[int, array[int]] = {number: array("i") for number in dict.fromkeys(self.predicates)}
        add = {number: rows.append for number, rows in found.items()}
        for row, number in enumerate(self.predicates):
            add[number](row)
        return found


def _packed_term(term: Term | None) -> str | list[str | None] | None:
    match term:
        case BNode(label):
            return [label]
        case Literal(value, datatype, language):
            return [value, datatype, language]
        case _:
            return term
