"""Answers to class expressions over the descriptions of all entries, in memory.

Each description's nodes, and the vocabulary's that they are linked to, are rows. A class has the rows that belong to
it, a property its links as two columns; an expression is answered from its parts outward, a mask over all rows at a
time.
"""

from __future__ import annotations

import threading
from array import array
from bisect import bisect_left
from collections.abc import Iterable
from functools import reduce
from itertools import compress
from operator import and_, or_

import numpy as np
from numpy.typing import NDArray

from planlang.knowledge.axioms import THING, Axioms, Concept, One
from planlang.knowledge.completion import Completion
from planlang.knowledge.descriptions import Description, Label, label_of
from planlang.ontology.expressions import Expression

Mask = NDArray[np.bool_]


class CannotAnswer(Exception):
    """An expression has a part that is no question to the index; the text says which."""


class Index:
    """The rows of all descriptions. Threads may share it.

    An entry has rows that follow each other, the first of which is its subject. Those of an entry that was removed stay
    until half of all are such.
    """

    def __init__(self, vocabulary: Axioms) -> None:
        self._vocabulary = vocabulary
        self._completion = Completion(vocabulary)
        self._lock = threading.RLock()
        self._rows = 0
        self._of_class: dict[Label, array[int]] = {}
        self._links: dict[str, tuple[array[int], array[int]]] = {}
        self._below: dict[str, list[str]] = {}
        self._shared: dict[int, int] = {}
        self._labels: dict[Label, tuple[Label, ...]] = {}
        self._entries: dict[str, range] = {}
        self._uids: list[str] = []
        self._subjects = array("i")
        self._removed: list[range] = []

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def rows(self) -> int:
        """Rows in memory, also of removed entries."""
        return self._rows

    def add(self, uid: str, description: Description) -> None:
        """Add an entry, in the place of an earlier description of it; one without nodes belongs to nothing."""
        with self._lock:
            self.remove(uid)
            if not description.nodes:
                return
            first = self._rows
            for one in description.nodes:
                self._row(one.labels)
            self._entries[uid] = range(first, self._rows)
            for row, one in enumerate(description.nodes, first):
                for prop, target in one.links:
                    self._link(row, prop, self._shared_row(target) if isinstance(target, str) else first + target)
            place = bisect_left(self._uids, uid)
            self._uids.insert(place, uid)
            self._subjects.insert(place, first)

    def remove(self, uid: str) -> None:
        """Forget an entry; nothing happens if there is none of that identifier."""
        with self._lock:
            rows = self._entries.pop(uid, None)
            if rows is not None:
                place = bisect_left(self._uids, uid)
                del self._uids[place], self._subjects[place]
                self._removed.append(rows)
                if 2 * sum(map(len, self._removed)) > self._rows:
                    self._compact()

    def _compact(self) -> None:
        """Give the rows that are used the numbers from 0 on."""
        used = np.ones(self._rows, dtype=np.bool_)
        for rows in self._removed:
            used[rows.start : rows.stop] = False
        numbers = (np.cumsum(used, dtype=np.int32) - 1).astype(np.int32)

        def kept(rows: array[int], by: array[int]) -> array[int]:
            return array("i", numbers[_numbers(rows)[used[_numbers(by)]]].tobytes())

        self._of_class = {label: found for label, rows in self._of_class.items() if (found := kept(rows, rows))}
        self._links = {prop: (kept(these, these), kept(those, these)) for prop, (these, those) in self._links.items()}
        self._shared = {node: int(numbers[row]) for node, row in self._shared.items()}
        first = {uid: int(numbers[rows.start]) for uid, rows in self._entries.items()}
        self._entries = {uid: range(first[uid], first[uid] + len(rows)) for uid, rows in self._entries.items()}
        self._subjects = array("i", (first[uid] for uid in self._uids))
        self._rows, self._removed = int(used.sum()), []

    def _row(self, labels: Iterable[Label]) -> int:
        row, self._rows = self._rows, self._rows + 1
        for label in dict.fromkeys(upper for one in labels for upper in self._above(one)):
            self._of_class.setdefault(label, array("i")).append(row)
        return row

    def _above(self, label: Label) -> tuple[Label, ...]:
        """Return a label and those that the vocabulary states above it."""
        if _concept(label) not in self._vocabulary.above:
            return (label,)
        found = self._labels.get(label)
        if found is None:
            found = self._labels[label] = _labels(self._completion, self._completion.number(_concept(label)))
        return found

    def _shared_row(self, label: Label) -> int:
        """Return the row of a class or individual of the vocabulary; makes all rows that it is linked to."""
        completion, shared = self._completion, self._shared
        wanted = completion.number(_concept(label))
        new = {} if wanted in shared else {wanted: None}
        queue = list(new)
        for number in queue:
            ends = (end for _, end in completion.nodes[number].links)
            fresh = dict.fromkeys(end for end in ends if end not in shared and end not in new)
            new |= fresh
            queue += fresh
        for number in queue:
            shared[number] = self._row(_labels(completion, number))
        for number in queue:
            for prop, end in completion.nodes[number].links:
                self._link(shared[number], prop, shared[end])
        return shared[wanted]

    def _link(self, source: int, prop: str, target: int) -> None:
        if prop not in self._links:
            self._links[prop] = (array("i"), array("i"))
            for upper in self._completion.above(prop):
                self._below.setdefault(upper, []).append(prop)
        sources, targets = self._links[prop]
        sources.append(source)
        targets.append(target)

    def answers(self, expression: Expression) -> tuple[str, ...]:
        """Return the identifiers of the entries that an expression includes, sorted. Raises CannotAnswer.

        What contradicts itself is no answer to everything, as in logic, but to what it was stated to be.
        """
        with self._lock:
            found = self._mask(expression)[_numbers(self._subjects)]
            return tuple(compress(self._uids, found.tolist()))

    def _mask(self, expression: Expression) -> Mask:
        kind, parts = expression.kind, expression.parts
        if kind == "name":
            return self._members(str(expression.term))
        if kind in ("and", "or"):
            return reduce(and_ if kind == "and" else or_, (self._mask(part) for part in parts))
        if kind == "one of":
            return reduce(or_, map(self._member, parts))
        if parts[0].kind == "inverse":
            raise CannotAnswer("an inverse property cannot be asked for; ask for what is linked by the property itself")
        if kind in ("some", "min", "value") and (kind != "min" or expression.number == 1):
            filler = parts[1] if len(parts) > 1 else None
            if filler is None:
                wanted = self._members(THING)
            else:
                wanted = self._member(filler) if kind == "value" else self._mask(filler)
            return self._linked(str(parts[0].term), wanted)
        raise CannotAnswer(f"{kind} cannot be asked for; classes, and, or, some, value and min 1 can")

    def _member(self, individual: Expression) -> Mask:
        if not isinstance(individual.term, str):
            raise CannotAnswer("a value that is a text or a number cannot be asked for; individuals can")
        return self._members(f"{{{individual.term}}}")

    def _members(self, label: Label) -> Mask:
        if label == THING:
            return np.ones(self._rows, dtype=np.bool_)
        mask = np.zeros(self._rows, dtype=np.bool_)
        rows = self._of_class.get(label)
        if rows:
            mask[_numbers(rows)] = True
        return mask

    def _linked(self, prop: str, wanted: Mask) -> Mask:
        """Return the rows with a link of a property, or of one below it, to a wanted row."""
        mask = np.zeros(self._rows, dtype=np.bool_)
        for below in self._below.get(prop, ()):
            sources, targets = self._links[below]
            mask[_numbers(sources)[wanted[_numbers(targets)]]] = True
        return mask


def _numbers(rows: array[int]) -> NDArray[np.int32]:
    return np.frombuffer(rows, dtype=np.int32)


def _labels(completion: Completion, node: int) -> tuple[Label, ...]:
    labels = map(label_of, completion.nodes[node].labels)
    return tuple(label for label in labels if label is not None and label != THING)


def _concept(label: Label) -> Concept:
    return One(label[1:-1]) if label.startswith("{") else label
