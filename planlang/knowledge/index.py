"""In-memory index that answers class expressions over the descriptions of all entries.

The nodes of all descriptions, and those of the vocabulary that they link to, are numbered as rows. The index stores for
each label the rows that state it (a class also matches the labels of its subclasses), and for each property its links
as two columns. An expression is evaluated bottom-up; each step computes a mask over all rows.
"""

from __future__ import annotations

import threading
from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import reduce
from itertools import compress
from operator import and_, or_

import numpy as np
from numpy.typing import NDArray

from planlang.closure import reached
from planlang.knowledge.axioms import THING, Axioms, Concept, One
from planlang.knowledge.completion import Completion
from planlang.knowledge.descriptions import Description, Label, label_of
from planlang.knowledge.facts import LABEL, Facts, facts_of
from planlang.ontology.expressions import Expression

Mask = NDArray[np.bool_]


class CannotAnswer(Exception):
    """The index does not support a part of the expression; the text says which."""


class _Moved(Exception):
    """Entries were added or removed during an evaluation."""


def go_on() -> None:
    """Do nothing between two steps; a callback in its place may cancel the evaluation by raising."""


class Index:
    """Rows of all descriptions; safe for use by several threads.

    The rows of an entry are consecutive, its subject first. Rows of removed entries stay until they are half of all.
    """

    def __init__(self, vocabulary: Axioms) -> None:
        self._vocabulary = vocabulary
        self._completion = Completion(vocabulary)
        self._lock = threading.RLock()
        self._version = 0
        self._rows = 0
        self._numbers: dict[str, int] = {}
        self._names: list[str] = []
        self._labels = Postings()
        self._under: dict[Label, list[int]] = {}
        self._links: dict[str, tuple[array[int], array[int]]] = {}
        self._below: dict[str, list[str]] = {}
        self._shared: dict[int, int] = {}
        self._entries: dict[str, range] = {}
        self._uids: list[str] = []
        self._subjects = array("i")
        self._removed: list[range] = []

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def rows(self) -> int:
        """Number of rows in memory, including those of removed entries."""
        return self._rows

    def add(self, uid: str, description: Description) -> None:
        """Add an entry or replace its description; one without nodes matches nothing."""
        self.add_all({uid: facts_of(description)})

    def add_all(self, entries: Mapping[str, Facts]) -> None:
        """Add entries by the facts of their descriptions, replacing earlier ones."""
        with self._lock:
            self._version += 1
            for uid in entries:
                self.remove(uid)
            found = {uid: facts for uid, facts in entries.items() if facts.nodes}
            if found:
                self._add_facts(list(found.values()), self._add_subjects(found))

    def _add_subjects(self, entries: Mapping[str, Facts]) -> Numbers:
        """Allocate rows for entries; return the first row of each."""
        first = []
        for uid, facts in entries.items():
            first.append(self._rows)
            self._rows += facts.nodes
            self._entries[uid] = range(first[-1], self._rows)
            place = len(self._uids) if not self._uids or uid > self._uids[-1] else bisect_left(self._uids, uid)
            self._uids.insert(place, uid)
            self._subjects.insert(place, first[-1])
        return np.array(first, dtype=np.int32)

    def _add_facts(self, entries: Sequence[Facts], first: Numbers) -> None:
        names = np.array([self._number(name) for facts in entries for name in facts.names], dtype=np.int32)
        ends = np.cumsum([len(facts.names) for facts in entries], dtype=np.int32)
        each = np.repeat(np.arange(len(entries)), [len(facts.stated) for facts in entries])
        stated = np.concatenate([facts.stated for facts in entries])
        rows, start = stated[:, 0] + first[each], np.concatenate(([0], ends))[each]
        is_label = stated[:, 1] == LABEL
        self._labels.add(names[stated[is_label, 2] + start[is_label]], rows[is_label])
        prop, end, source = names[(stated[:, 1] + start)[~is_label]], stated[~is_label, 2], rows[~is_label]
        is_node = end >= 0
        target = end + first[each[~is_label]]
        target[~is_node] = self._shared_rows(names[start[~is_label][~is_node] - 1 - end[~is_node]])
        for number in np.unique(prop).tolist():
            some = prop == number
            self._link(self._names[number], source[some], target[some])

    def _number(self, name: Label) -> int:
        """Return the number of a label or property; a new one is registered with its superclasses."""
        number = self._numbers.get(name)
        if number is None:
            number = self._numbers[name] = len(self._names)
            self._names.append(name)
            if _concept(name) in self._vocabulary.above:
                for upper in _labels(self._completion, self._completion.number(_concept(name))):
                    if upper != name:
                        self._under.setdefault(upper, []).append(number)
        return number

    def remove(self, uid: str) -> None:
        """Remove an entry, if it is there."""
        with self._lock:
            rows = self._entries.pop(uid, None)
            if rows is not None:
                self._version += 1
                place = bisect_left(self._uids, uid)
                del self._uids[place], self._subjects[place]
                self._removed.append(rows)
                if 2 * sum(map(len, self._removed)) > self._rows:
                    self._compact()

    def _compact(self) -> None:
        """Drop the rows of removed entries and renumber the others from 0."""
        used = np.ones(self._rows, dtype=np.bool_)
        for rows in self._removed:
            used[rows.start : rows.stop] = False
        numbers = (np.cumsum(used, dtype=np.int32) - 1).astype(np.int32)

        def kept(rows: array[int], by: array[int]) -> array[int]:
            return array("i", numbers[of_array(rows)[used[of_array(by)]]].tobytes())

        self._labels.renumber(used, numbers)
        self._links = {prop: (kept(these, these), kept(those, these)) for prop, (these, those) in self._links.items()}
        self._shared = {node: int(numbers[row]) for node, row in self._shared.items()}
        first = {uid: int(numbers[rows.start]) for uid, rows in self._entries.items()}
        self._entries = {uid: range(first[uid], first[uid] + len(rows)) for uid, rows in self._entries.items()}
        self._subjects = array("i", (first[uid] for uid in self._uids))
        self._rows, self._removed = int(used.sum()), []

    def _shared_rows(self, names: Numbers) -> Numbers:
        """Return the rows of classes or individuals of the vocabulary, given by the numbers of their names."""
        wanted, each = np.unique(names, return_inverse=True)
        rows = [self._shared_row(self._names[name]) for name in wanted.tolist()]
        return np.array(rows, dtype=np.int32)[each]

    def _shared_row(self, label: Label) -> int:
        """Return the row of a class or individual of the vocabulary, after creating it and all rows it links to."""
        completion, shared = self._completion, self._shared
        wanted = completion.number(_concept(label))

        def linked(number: int) -> Iterator[int]:
            return (end for _, end in completion.nodes[number].links if end not in shared)

        new = [] if wanted in shared else list(reached((wanted,), linked))
        for number in new:
            shared[number], self._rows = self._rows, self._rows + 1
            labels = [self._number(label) for label in _labels(completion, number)]
            self._labels.add(np.array(labels, dtype=np.int32), np.full(len(labels), shared[number], dtype=np.int32))
        for number in new:
            for prop, end in completion.nodes[number].links:
                self._link(prop, np.array([shared[number]], np.int32), np.array([shared[end]], np.int32))
        return shared[wanted]

    def _link(self, prop: str, sources: Numbers, targets: Numbers) -> None:
        if prop not in self._links:
            self._links[prop] = (array("i"), array("i"))
            for upper in self._completion.above(prop):
                self._below.setdefault(upper, []).append(prop)
        for known, rows in zip(self._links[prop], (sources, targets), strict=True):
            known.frombytes(rows.astype(np.int32, copy=False).tobytes())

    def answers(self, expression: Expression, between: Callable[[], None] = go_on) -> tuple[str, ...]:
        """Return the identifiers of the entries that satisfy an expression, sorted. Raises CannotAnswer.

        Unlike in logic, a contradictory entry does not satisfy everything, only what was stated of it. ``between`` is
        called between the steps, each of which takes milliseconds; other threads may use the index meanwhile.
        """
        while True:
            with suppress(_Moved), self._lock:
                found = self._mask(expression, _Steps(self, between))[of_array(self._subjects)]
                return tuple(compress(self._uids, found.tolist()))

    def _mask(self, expression: Expression, steps: _Steps) -> Mask:
        steps.next()
        kind, parts = expression.kind, expression.parts
        if kind == "name":
            return self._members(str(expression.term))
        if kind == "or" and all(part.kind == "name" for part in parts):
            return self._members(*(str(part.term) for part in parts))
        if kind in ("and", "or"):
            return reduce(and_ if kind == "and" else or_, (self._mask(part, steps) for part in parts))
        if kind == "one of":
            return reduce(or_, (self._member(part, steps) for part in parts))
        if parts[0].kind == "inverse":
            raise CannotAnswer("inverse properties are not supported; write the expression with the property itself")
        if kind in ("some", "min", "value") and (kind != "min" or expression.number == 1):
            filler = parts[1] if len(parts) > 1 else None
            if filler is None:
                wanted = self._members(THING)
            else:
                wanted = self._member(filler, steps) if kind == "value" else self._mask(filler, steps)
            return self._linked(str(parts[0].term), wanted)
        raise CannotAnswer(f"{kind} is not supported; use classes, and, or, some, value and min 1")

    def _member(self, individual: Expression, steps: _Steps) -> Mask:
        steps.next()
        if not isinstance(individual.term, str):
            raise CannotAnswer("texts and numbers are not supported as values; use individuals")
        return self._members(f"{{{individual.term}}}")

    def _members(self, *labels: Label) -> Mask:
        if THING in labels:
            return np.ones(self._rows, dtype=np.bool_)
        mask = np.zeros(self._rows, dtype=np.bool_)
        numbers = {number for label in labels for number in (self._numbers.get(label), *self._under.get(label, ()))}
        mask[self._labels.of(sorted(numbers - {None}))] = True
        return mask

    def _linked(self, prop: str, wanted: Mask) -> Mask:
        """Return the rows with a link to a wanted row by a property or one of its subproperties."""
        mask = np.zeros(self._rows, dtype=np.bool_)
        for below in self._below.get(prop, ()):
            sources, targets = self._links[below]
            mask[of_array(sources)[wanted[of_array(targets)]]] = True
        return mask


class _Steps:
    """Steps of an evaluation. Between steps the lock is released; the index must not change."""

    def __init__(self, index: Index, between: Callable[[], None]) -> None:
        self._index, self._between, self._version = index, between, index._version

    def next(self) -> None:
        """Let other threads use the index. Raises _Moved if one changed it."""
        self._index._lock.release()
        try:
            self._between()
        finally:
            self._index._lock.acquire()
        if self._index._version != self._version:
            raise _Moved


def _labels(completion: Completion, node: int) -> tuple[Label, ...]:
    labels = map(label_of, completion.nodes[node].labels)
    return tuple(label for label in labels if label is not None and label != THING)


def _concept(label: Label) -> Concept:
    return One(label[1:-1]) if label.startswith("{") else label


Numbers = NDArray[np.int32]


class Postings:
    """Rows of each label; both are numbered from 0."""

    def __init__(self) -> None:
        self._first = np.zeros(1, dtype=np.int64)
        self._rows = np.zeros(0, dtype=np.int32)
        self._later: dict[int, array[int]] = {}

    def add(self, labels: Numbers, rows: Numbers) -> None:
        """Add rows; a single large call, especially the first, is cheapest."""
        if self._rows.size == 0 and len(rows) > len(self._later):
            labels = np.concatenate([labels, *(np.full(len(some), one) for one, some in self._later.items())])
            rows = np.concatenate([rows, *(of_array(some) for some in self._later.values())]).astype(np.int32)
            self._rows = rows[np.argsort(labels, kind="stable")]
            self._first = np.concatenate(([0], np.cumsum(np.bincount(labels))))
            self._later = {}
            return
        for label, row in zip(labels.tolist(), rows.tolist(), strict=True):
            self._later.setdefault(label, array("i")).append(row)

    def of(self, labels: Iterable[int]) -> Numbers:
        """Return the rows of all of some labels."""
        found = []
        for label in labels:
            if label + 1 < len(self._first):
                found.append(self._rows[self._first[label] : self._first[label + 1]])
            if label in self._later:
                found.append(of_array(self._later[label]))
        return np.concatenate(found) if found else np.zeros(0, dtype=np.int32)

    def renumber(self, used: NDArray[np.bool_], numbers: Numbers) -> None:
        """Drop the rows that are not used, and give the others their new numbers."""
        kept = used[self._rows]
        self._first = np.concatenate(([0], np.cumsum(kept)))[self._first]
        self._rows = numbers[self._rows[kept]]
        later = ((label, of_array(rows)) for label, rows in self._later.items())
        renumbered = ((label, numbers[rows[used[rows]]]) for label, rows in later)
        self._later = {label: array("i", rows.tobytes()) for label, rows in renumbered if rows.size}


def of_array(rows: array[int]) -> Numbers:
    """Return the same numbers for computing, as long as the array does not grow."""
    return np.frombuffer(rows, dtype=np.int32)
