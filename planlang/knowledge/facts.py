"""Descriptions as an index reads them: names, and facts as rows of numbers, many entries at a time."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planlang.knowledge.descriptions import Described, Description
from planlang.records import dataclass

Numbers = NDArray[np.int32]
LABEL = -1
"""The number in the place of a property where the fact is a label."""
_STORED = np.dtype("<i4")


@dataclass(frozen=True, slots=True)
class Facts:
    """A description without its text: ``stated`` has rows (node, number of a property's name or LABEL, end).

    The end of a label is the number of its name; that of a link a node, or -1 - the number of a name.
    """

    names: list[str]
    nodes: int
    stated: Numbers
    """Shape (facts, 3)."""


def facts_of(description: Description) -> Facts:
    """Return the facts of a description."""
    names: dict[str, int] = {}
    stated: list[tuple[int, int, int]] = []
    for node, one in enumerate(description.nodes):
        stated += ((node, LABEL, names.setdefault(label, len(names))) for label in one.labels)
        for prop, target in one.links:
            number = names.setdefault(prop, len(names))
            end = -1 - names.setdefault(target, len(names)) if isinstance(target, str) else target
            stated.append((node, number, end))
    return Facts(list(names), len(description.nodes), np.array(stated, dtype=np.int32).reshape(-1, 3))


def packed(description: Description) -> bytes:
    """Return a description as bytes: a line of JSON, then the numbers."""
    facts = facts_of(description)
    head = [facts.names, facts.nodes, description.words, description.place]
    text = json.dumps(head, ensure_ascii=False, separators=(",", ":"))
    return text.encode() + b"\n" + facts.stated.astype(_STORED).tobytes()


@dataclass(frozen=True, slots=True)
class Unpacked:
    """A description as :func:`packed` wrote it."""

    facts: Facts
    words: tuple[str, ...]
    place: tuple[tuple[str, str], ...]

    def description(self) -> Description:
        """Return it as nodes. Raises ValueError or IndexError for what is damaged."""
        labels: list[list[str]] = [[] for _ in range(self.facts.nodes)]
        links: list[list[tuple[str, int | str]]] = [[] for _ in range(self.facts.nodes)]
        names = self.facts.names
        for node, prop, end in self.facts.stated.tolist():
            if prop == LABEL:
                labels[node].append(names[end])
            else:
                links[node].append((names[prop], end if end >= 0 else names[-1 - end]))
        nodes = (Described(tuple(some), tuple(others)) for some, others in zip(labels, links, strict=True))
        return Description(tuple(nodes), self.words, self.place)


def unpacked(data: bytes) -> Unpacked:
    """Return what :func:`packed` wrote. Raises ValueError or TypeError for anything else."""
    head, _, numbers = data.partition(b"\n")
    names, nodes, words, place = _head(json.loads(head))
    stated = np.frombuffer(numbers, dtype=_STORED).astype(np.int32, copy=False).reshape(-1, 3)
    return Unpacked(Facts(names, nodes, stated), tuple(words), tuple((level, text) for level, text in place))


def _head(stored: Any) -> tuple[list[str], int, list[str], list[list[str]]]:
    names, nodes, words, place = stored
    if not isinstance(names, list) or not isinstance(nodes, int):
        raise TypeError("this is no description")
    return names, nodes, words, place
