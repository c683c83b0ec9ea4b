"""Names that queries may use, from the vocabulary and from entries; with suggestions for misspelt ones."""

from __future__ import annotations

import threading
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import chain

from planlang.closure import grouped
from planlang.designators import local_part
from planlang.ontology.terms import OWL
from planlang.spelling import similar

LONGEST_GUESSED = 80
"""Longest name for which suggestions are searched [characters]."""
MOST_COMPARED, MOST_LOOKED_AT = 20, 5_000
"""Limits for the names compared with a misspelt one, and for the index entries read to find them."""
MOST_SIMILAR = 3


class Names:
    """IRIs of the vocabulary and of entries by local name. Thread-safe for many readers and one writer."""

    def __init__(self, vocabulary: Mapping[str, Iterable[str]], own: Mapping[str, Iterable[str]] | None = None) -> None:
        """``own`` are names that entries define; a name defined by several entries means any of them."""
        self._vocabulary = {name: tuple(sorted(set(iris))) for name, iris in vocabulary.items()}
        self._own: dict[str, tuple[str, ...]] = {}
        self._all = list(self._vocabulary)
        self._folded = [name.casefold() for name in self._all]
        self._pairs: dict[str, array[int]] = {}
        self._indexed = 0
        self._indexing = threading.Lock()
        for iri in chain.from_iterable((own or {}).values()):
            self.add(iri)

    def add(self, iri: str) -> None:
        """Add a name defined by an entry, unless the vocabulary has it."""
        name = local_part(iri)
        known = self._own.get(name)
        if name in self._vocabulary or (known and iri in known):
            return
        if known is None:
            self._all.append(name)
            self._folded.append(name.casefold())
        self._own[name] = tuple(sorted((*(known or ()), iri)))

    def of(self, name: str) -> tuple[str, ...]:
        """Return the IRIs of a name, sorted; empty for an unknown name."""
        if name == local_part(OWL.Thing):  # a vocabulary may have a Thing of its own, but the bare name means all
            return (str(OWL.Thing),)
        return self._vocabulary.get(name) or self._own.get(name, ())

    def is_of_entries(self, name: str) -> bool:
        """Check whether only entries define a name."""
        return name not in self._vocabulary

    def knows(self, iri: str) -> bool:
        """Return False if the local name of an IRI is known, but with other IRIs."""
        name = local_part(iri)
        known = (*self._vocabulary.get(name, ()), *self._own.get(name, ()))
        return not known or iri in known or iri == OWL.Thing

    def like(self, text: str, most: int) -> tuple[str, ...]:
        """Return names that start with a text, then those that contain it; shortest first."""
        wanted = text.casefold()
        found = [number for number, name in enumerate(self._folded) if wanted in name]
        found.sort(key=lambda one: (not self._folded[one].startswith(wanted), len(self._all[one]), self._all[one]))
        return tuple(self._all[one] for one in found[:most])

    def similar(self, name: str) -> list[str]:
        """Find the names most similar to a misspelt one, best first; none for a very long name.

        To save time, only names that share the rarest letter pairs with it are compared.
        """
        if len(name) > LONGEST_GUESSED:
            return []
        with self._indexing:
            for number in range(self._indexed, len(self._folded)):
                for pair in _pairs(self._folded[number]):
                    self._pairs.setdefault(pair, array("i")).append(number)
            self._indexed = len(self._folded)
            found = [one for pair in _pairs(name.casefold()) if (one := self._pairs.get(pair)) is not None]
            shared, looked_at = Counter[int](), 0
            for numbers in sorted(found, key=len):
                shared.update(numbers[: MOST_LOOKED_AT - looked_at])
                looked_at += len(numbers)
                if looked_at >= MOST_LOOKED_AT:
                    break
        best = sorted(shared, key=lambda one: (-shared[one], abs(len(self._all[one]) - len(name)), self._all[one]))
        return similar(name, (self._all[one] for one in best[:MOST_COMPARED]), n=MOST_SIMILAR)


def _pairs(name: str) -> set[str]:
    """Pairs of adjacent letters in a name, with marks for its start and end."""
    marked = f"^{name}$"
    return {marked[place : place + 2] for place in range(len(marked) - 1)}


def names_in(iris: Iterable[str]) -> dict[str, list[str]]:
    """Group IRIs by local name."""
    return grouped((local_part(iri), iri) for iri in iris)
