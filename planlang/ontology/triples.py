"""Triple store: columns of term numbers with indexes, small enough for a million triples.

Each term is stored once and has a number, by which the columns refer to it; Triple, Term and Span objects are made on
access. That is five integers per triple: 20 MB for the largest file that is read, against 200 MB as Triple objects.
Indexes are built on first use, as chains: for each term its first row, for each row the next row with the same term.
"""

from __future__ import annotations

import json
import sys
from array import array
from bisect import bisect_right
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import chain
from types import NoneType
from typing import Any, overload

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.ontology.terms import OWL, BNode, Literal, Term, Triple
from planlang.records import dataclass

MOST_TRIPLES = 1_000_000
"""Greatest number of triples of one file; it bounds the memory that a hostile file can take."""


@dataclass
class Parsed:
    """Content of a file: its triples in document order, diagnostics of repairs, declared prefixes."""

    triples: Triples
    diagnostics: list[Diagnostic] = field(default_factory=list)
    prefixes: dict[str, str] = field(default_factory=dict)
    others: tuple[bytes, ...] = ()
    """Contents of other files that the triples depend on."""
    unread: list[Diagnostic] = field(default_factory=list)
    """Errors about things with a shape that the triples lack; they count where the file is read as a map."""
    is_alone: bool = False
    """True if the triples depend on nothing but the text, its base IRI and its label."""


def check_room(triples: Triples, line: int, column: int) -> None:
    """Raise BadInput if a file has too many triples; line and column are those of the last one."""
    if len(triples.subjects) > MOST_TRIPLES:
        message = f"the file has more than {MOST_TRIPLES:,} triples"
        raise BadInput([error("O003", message, Span(triples.file, line, column))])


def counted(shown: list[Diagnostic], more: int) -> list[Diagnostic]:
    """Append to the last diagnostic how many more of its kind are not shown, so that none is dropped silently."""
    if more <= 0 or not shown:
        return shown
    return [*shown[:-1], replace(shown[-1], message=f"{shown[-1].message}; {more} more like this are not shown")]


class Triples(Sequence[Triple]):
    """Triples of one or several files, in document order.

    ``terms`` maps numbers to terms; None is a blank node of the first file that has not been accessed yet, labelled
    ``label`` plus its number. The columns ``subjects``, ``predicates``, ``objects``, ``lines`` and ``columns`` have
    equal length; rows count from 0. Nothing may be added once an index has been used.
    """

    def __init__(self, file: str, label: str = "b") -> None:
        self.label = label
        self.terms: list[Term | None] = []
        self.numbers: dict[Term, int] = {}
        self.subjects, self.predicates, self.objects = array("i"), array("i"), array("i")
        self.lines, self.columns = array("I"), array("I")
        self.file = file
        """File of these triples; the first of several."""
        self._files = [file]
        self._starts = [0]
        self._first_end = sys.maxsize
        """First row after those of the first file."""

    @classmethod
    def of(cls, triples: Iterable[Triple], file: str = "") -> Triples:
        """Store triples of one file in the given order."""
        store = cls(file)
        for triple in triples:
            store.state(triple.subject, triple.predicate, triple.object, triple.span)
        return store

    # adding

    def number(self, term: Term) -> int:
        """Number of a term; a new term is added."""
        number = self.numbers.get(term)
        if number is None and type(term) is BNode:  # nodes made by ``fresh`` are not in ``numbers``
            number = self.find(term)
        if number is None:
            number = self.numbers[term] = len(self.terms)
            self.terms.append(term)
        return number

    def fresh(self) -> int:
        """Add a new blank node and return its number."""
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
        """Insert a triple before a row."""
        self.subjects.insert(row, subject)
        self.predicates.insert(row, predicate)
        self.objects.insert(row, value)
        self.lines.insert(row, line)
        self.columns.insert(row, column)

    def state(self, subject: str | BNode, predicate: str, value: Term, span: Span) -> None:
        """Add a triple by its terms."""
        self.add(self.number(subject), self.number(predicate), self.number(value), span.line, span.column)

    def repeat(self, rows: Iterable[int], predicate: int, value: int) -> None:
        """Insert after each of these rows a triple with the same subject and position."""
        repeated = frozenset(rows)
        order = array("i", [row for row in range(len(self)) for _ in range(2 if row in repeated else 1)])
        for column in (*self._terms_of_rows(), self.lines, self.columns):
            column[:] = array(column.typecode, map(column.__getitem__, order))
        for row, before in enumerate(order[:-1], start=1):
            if order[row] == before:
                self.predicates[row], self.objects[row] = predicate, value

    def change(self, removed: Container[int], added: Mapping[int, tuple[int, int, int]]) -> None:
        """Remove rows, and replace some of these by other triples (row -> numbers of its terms) at their position."""
        keep = [row for row in range(len(self)) if row in added or row not in removed]
        places = {place: added[row] for place, row in enumerate(keep) if row in added}
        for index, column in enumerate((*self._terms_of_rows(), self.lines, self.columns)):
            column[:] = array(column.typecode, map(column.__getitem__, keep))
            if index < 3:
                for place, terms in places.items():
                    column[place] = terms[index]

    def rename(self, names: Mapping[str, str]) -> None:
        """Replace IRIs (old -> new) in all triples; a new one may already occur in other triples."""
        merged: dict[int, int] = {}
        for old, new in names.items():
            number = self.numbers.pop(old, None)
            if number is not None:
                self.terms[number] = new
                if self.numbers.setdefault(new, number) != number:
                    merged[number] = self.numbers[new]
        if merged:
            self.renumber(merged)

    def renamed(self, names: Mapping[str, str]) -> Triples:
        """Copy triples of one file with some IRIs replaced (old -> new)."""
        copy = Triples(self._files[0], self.label)
        copy.terms, copy.numbers = self.terms.copy(), self.numbers.copy()
        for column, own in zip(copy._terms_of_rows(), self._terms_of_rows(), strict=True):
            column.extend(own)
        copy.lines.extend(self.lines)
        copy.columns.extend(self.columns)
        copy.rename(names)
        return copy

    def renumber(self, changed: Mapping[int, int]) -> None:
        """Replace terms (old number -> new number) in all triples."""
        for column in self._terms_of_rows():
            column[:] = array("i", [changed.get(number, number) for number in column])

    # terms and triples

    def find(self, term: Term) -> int | None:
        """Number of a term; None if it is unknown."""
        number = self.numbers.get(term)
        if number is None and isinstance(term, BNode):
            digits = term.label.removeprefix(self.label)
            if digits.isascii() and digits.isdecimal() and len(digits) < 10 and int(digits) < len(self.terms):
                fresh = int(digits)
                return fresh if self.term(fresh) == term else None
        return number

    def term(self, number: int) -> Term:
        """Term of a number."""
        term = self.terms[number]
        if term is None:
            term = self.terms[number] = BNode(f"{self.label}{number}")
        return term

    def name(self, number: int) -> str | None:
        """IRI of a number; None for a blank node or a literal."""
        term = self.terms[number]
        return term if isinstance(term, str) else None

    def is_node(self, number: int) -> bool:
        """Check whether a number is that of a blank node."""
        term = self.terms[number]
        return term is None or isinstance(term, BNode)

    def span(self, row: int) -> Span:
        """Position of the triple in a row."""
        file = self.file if row < self._first_end else self._files[bisect_right(self._starts, row) - 1]
        return Span(file, self.lines[row], self.columns[row])

    def triple(self, row: int) -> Triple:
        """Triple in a row."""
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
        """Serialize the triples of one file for :meth:`unpacked`."""
        columns = (*self._terms_of_rows(), self.lines, self.columns)
        return json.dumps(
            [self.label, list(map(_packed_term, self.terms)), *(column.tolist() for column in columns)],
            ensure_ascii=False,
            separators=(",", ":"),
        ).encode()

    @classmethod
    def unpacked(cls, packed: bytes, file: str) -> Triples:
        """Restore triples from :meth:`packed`, with positions in ``file``. Raises ValueError for anything else."""
        try:
            label, terms, *columns = json.loads(packed)
            store = cls(file, label)
            composed = [term for term in terms if type(term) is list]
            if not {*map(type, terms)} <= {str, list, NoneType} or not _are_terms(composed):
                raise ValueError("no packed triples: their terms")
            store.terms = [
                (Literal(*term) if len(term) == 3 else BNode(*term)) if type(term) is list else term for term in terms
            ]
            store.numbers = {term: number for number, term in enumerate(store.terms) if term is not None}
            for column, numbers in zip((*store._terms_of_rows(), store.lines, store.columns), columns, strict=True):
                column.extend(numbers)
        except (TypeError, OverflowError, RecursionError) as problem:
            raise ValueError(f"no packed triples: {problem}") from None
        count, rows = len(store.terms), {len(column) for column in columns}
        if not isinstance(label, str) or len(rows) != 1 or len(store.subjects) > MOST_TRIPLES:
            raise ValueError("no packed triples: their label or columns")
        if any(column and not 0 <= min(column) <= max(column) < count for column in store._terms_of_rows()):
            raise ValueError("no packed triples: a term that is not there")
        return store

    # several files

    @property
    def ranges(self) -> list[range]:
        """Rows of each file."""
        return [range(start, end) for start, end in zip(self._starts, [*self._starts[1:], len(self)], strict=True)]

    @classmethod
    def joined(cls, parts: Sequence[Triples]) -> Triples:
        """Concatenate the triples of several files; the parts, each of one file, are not changed."""
        first = parts[0]
        whole = cls(first._files[0], first.label)
        whole.terms, whole.numbers = first.terms.copy(), first.numbers.copy()
        whole._files = [part._files[0] for part in parts]
        whole._starts = []
        by_predicate: dict[int, array[int]] = {}
        for part in parts:
            start = len(whole)
            whole._starts.append(start)
            renumbered = None if part is first else whole._numbers_of(part)
            for number, rows in part._by_predicate.items():
                merged = by_predicate.setdefault(number if renumbered is None else renumbered[number], array("i"))
                merged.extend(rows if part is first else [row + start for row in rows])
            for column, more in zip(whole._terms_of_rows(), part._terms_of_rows(), strict=True):
                column.extend(more if renumbered is None else map(renumbered.__getitem__, more))
            whole._first_end = min(whole._first_end, len(whole))
            whole.lines.extend(part.lines)
            whole.columns.extend(part.columns)
        whole._by_predicate = by_predicate
        return whole

    def _numbers_of(self, part: Triples) -> list[int]:
        """Map the term numbers of another store to numbers here; new terms are added."""
        known = map(self.numbers.get, part.terms)  # type: ignore[arg-type]  # None, a blank node, is never a key
        return [self.number(part.term(k)) if number is None else number for k, number in enumerate(known)]

    def _terms_of_rows(self) -> tuple[array[int], array[int], array[int]]:
        return self.subjects, self.predicates, self.objects

    # finding

    def about(self, subject: int) -> Sequence[int]:
        """Rows with a subject, in document order."""
        first, following = self.by_subject
        return _chain(first[subject], following)

    def with_object(self, value: int) -> Sequence[int]:
        """Rows with an object, in document order."""
        first, following = self.by_object
        return _chain(first[value], following)

    def first_about(self, subject: int) -> int:
        """First row with a subject; -1 if there is none."""
        return self.by_subject[0][subject]

    def by(self, *predicates: str) -> Sequence[int]:
        """Rows with one of these predicates (IRIs), in document order."""
        numbers = (self.numbers.get(predicate, -1) for predicate in predicates)
        groups = [rows for number in numbers if (rows := self._by_predicate.get(number)) is not None]
        return groups[0] if len(groups) == 1 else sorted(row for rows in groups for row in rows)

    @property
    def used(self) -> Iterable[int]:
        """Predicates of all triples, in order of first use."""
        return self._by_predicate.keys()

    @cached_property
    def intersections(self) -> dict[int, int]:
        """List of members of each blank node that is an intersection of classes."""
        rows = reversed(self.by(OWL.intersectionOf))
        return {self.subjects[row]: self.objects[row] for row in rows if self.is_node(self.subjects[row])}

    @cached_property
    def by_subject(self) -> tuple[array[int], array[int]]:
        """First row of each term as subject, and for each row the next with the same subject; -1: none.

        For inner loops; :meth:`about` collects the rows of one term.
        """
        return self._chains(self.subjects)

    @cached_property
    def by_object(self) -> tuple[array[int], array[int]]:
        """Like :attr:`by_subject`, for objects."""
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
        rows_of: dict[int, array[int]] = {number: array("i") for number in dict.fromkeys(self.predicates)}
        add = {number: rows.append for number, rows in rows_of.items()}
        for row, number in enumerate(self.predicates):
            add[number](row)
        return rows_of


def _chain(row: int, following: array[int]) -> list[int]:
    rows = []
    while row >= 0:
        rows.append(row)
        row = following[row]
    return rows


def _are_terms(composed: list[list[Any]]) -> bool:
    """Check whether lists are results of :func:`_packed_term`; in C, as every command reads 20,000 of them."""
    is_long = {*map(len, composed)} <= {1, 3}
    return is_long and {type(one[0]) for one in composed} <= {str} and {*map(type, chain(*composed))} <= {str, NoneType}


def _packed_term(term: Term | None) -> str | list[str | None] | None:
    match term:
        case BNode(label):
            return [label]
        case Literal(value, datatype, language):
            return [value, datatype, language]
        case _:
            return term
