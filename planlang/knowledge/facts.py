"""Descriptions in the compact form for the index: names, and facts as rows of numbers."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planlang.knowledge.descriptions import Described, Description
from planlang.records import dataclass

Numbers = NDArray[np.int32]
LABEL = -1
"""Property number that marks a fact as a label."""
_STORED = np.dtype("<i4")


@dataclass(frozen=True, slots=True)
class Facts:
    """A description without its text: rows of ``stated`` are (node, property or LABEL, end).

    Properties and labels are indices of ``names``. The end of a label is the index of its name; that of a link is a
    node, or -1 minus the index of a name.
    """

    names: list[str]
    nodes: int
    stated: Numbers
    """Shape (facts, 3)."""


def facts_of(description: Description) -> Facts:
    """Convert a description to facts."""
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
    """Serialize a description: a line of JSON, then the numbers."""
    facts = facts_of(description)
    head = [facts.names, facts.nodes, description.words, description.place]
    text = json.dumps(head, ensure_ascii=False, separators=(",", ":"))
    return text.encode() + b"\n" + facts.stated.astype(_STORED).tobytes()


@dataclass(frozen=True, slots=True)
class Unpacked:
    """A deserialized description."""

    facts: Facts
    words: tuple[str, ...]
    place: tuple[tuple[str, str], ...]

    def description(self) -> Description:
        """Convert to a description with nodes. Raises ValueError or IndexError for damaged data."""
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
    """Deserialize the result of :func:`packed`. Raises ValueError or TypeError for anything else."""
    head, _, numbers = data.partition(b"\n")
    names, nodes, words, place = _head(json.loads(head))
    stated = np.frombuffer(numbers, dtype=_STORED).astype(np.int32, copy=False).reshape(-1, 3)
    return Unpacked(Facts(names, nodes, stated), tuple(words), tuple((level, text) for level, text in place))


def _head(stored: Any) -> tuple[list[str], int, list[str], list[list[str]]]:
    names, nodes, words, place = stored
    if not isinstance(names, list) or not isinstance(nodes, int):
        raise TypeError("not a description")
    return names, nodes, words, place
