"""Answers to class expressions over the descriptions of all entries, in memory.

Each description's nodes, and the vocabulary's that they are linked to, are rows. A class has the rows that belong to
it, a property its links as two columns; an expression is answered from its parts outward, a mask over all rows at a
time.
"""

from __future__ import annotations

import threading
from array import array
from collections.abc import Iterable
from functools import reduce
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
    """The rows of all descriptions. Threads may share it."""

    def __init__(self, vocabulary: Axioms) -> None:
        self._vocabulary = vocabulary
        self._completion = Completion(vocabulary)
        self._lock = threading.RLock()
        self._rows = 0
        self._of_class: dict[Label, array[int]] = {}
        self._links: dict[str, tuple[array[int], array[int]]] = {}
        self._shared: dict[Label, int] = {}
        self._labels: dict[Label, tuple[Label, ...]] = {}
        self._entries: dict[str, int] = {}
        self._uids: dict[int, str] = {}

    def __len__(self) -> int:
        return len(self._entries)

    def add(self, uid: str, description: Description) -> None:
        """Add an entry, in the place of an earlier description of it."""
        with self._lock:
            self.remove(uid)
            rows = [self._row(one.labels) for one in description.nodes]
            for row, one in zip(rows, description.nodes, strict=True):
                for prop, target in one.links:
                    self._link(row, prop, self._shared_row(target) if isinstance(target, str) else rows[target])
            self._entries[uid] = rows[0]
            self._uids[rows[0]] = uid

    def remove(self, uid: str) -> None:
        """Forget an entry; nothing happens if there is none of that identifier."""
        with self._lock:
            row = self._entries.pop(uid, None)
            if row is not None:
                del self._uids[row]

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
            node = self._completion.nodes[self._completion.number(_concept(label))]
            listed = (label_of(concept) for concept in node.labels)
            found = self._labels[label] = tuple(one for one in listed if one is not None)
        return found

    def _shared_row(self, label: Label) -> int:
        """Return the row of a class or individual of the vocabulary, with everything that it is linked to."""
        row = self._shared.get(label)
        if row is None:
            node = self._completion.nodes[self._completion.number(_concept(label))]
            row = self._shared[label] = self._row(self._above(label))
            for prop, target in tuple(node.links):
                self._link(row, prop, self._row_of_node(target))
        return row

    def _row_of_node(self, number: int) -> int:
        node = self._completion.nodes[number]
        name = label_of(node.concept)
        if name is not None:
            return self._shared_row(name)
        key = f"{number}"  # no IRI: a nameless filler has the number of its node
        row = self._shared.get(key)
        if row is None:
            labels = (label_of(concept) for concept in node.labels)
            row = self._shared[key] = self._row(label for label in labels if label is not None)
            for prop, target in tuple(node.links):
                self._link(row, prop, self._row_of_node(target))
        return row

    def _link(self, source: int, prop: str, target: int) -> None:
        sources, targets = self._links.setdefault(prop, (array("i"), array("i")))
        sources.append(source)
        targets.append(target)

    def answers(self, expression: Expression) -> tuple[str, ...]:
        """Return the identifiers of the entries that an expression includes, sorted. Raises CannotAnswer."""
        with self._lock:
            rows = np.flatnonzero(self._mask(expression))
            return tuple(sorted(self._uids[row] for row in rows.tolist() if row in self._uids))

    def _mask(self, expression: Expression) -> Mask:
        kind, parts = expression.kind, expression.parts
        if kind == "name":
            return self._members(str(expression.term))
        if kind in ("and", "or"):
            return reduce(and_ if kind == "and" else or_, (self._mask(part) for part in parts))
        if kind == "one of":
            return reduce(or_, (self._members(f"{{{part.term}}}") for part in parts))
        if kind in ("some", "min", "value") and parts[0].kind == "name" and (kind != "min" or expression.number == 1):
            filler = parts[1] if len(parts) > 1 else None
            if filler is None:
                wanted = self._members(THING)
            else:
                wanted = self._members(f"{{{filler.term}}}") if kind == "value" else self._mask(filler)
            return self._linked(str(parts[0].term), wanted)
        raise CannotAnswer(f"{kind} cannot be asked for; classes, and, or, some, value and min 1 can")

    def _members(self, label: Label) -> Mask:
        if label == THING:
            return np.ones(self._rows, dtype=np.bool_)
        mask = np.zeros(self._rows, dtype=np.bool_)
        rows = self._of_class.get(label)
        if rows:
            mask[np.frombuffer(rows, dtype=np.int32)] = True
        return mask

    def _linked(self, prop: str, wanted: Mask) -> Mask:
        """Return the rows with a link of a property, or of one below it, to a wanted row."""
        mask = np.zeros(self._rows, dtype=np.bool_)
        for below, (sources, targets) in self._links.items():
            if prop in self._completion.above(below):
                linked = wanted[np.frombuffer(targets, dtype=np.int32)]
                mask[np.frombuffer(sources, dtype=np.int32)[linked]] = True
        return mask


def _concept(label: Label) -> Concept:
    return One(label[1:-1]) if label.startswith("{") else label
