"""Names that may be asked for: of a vocabulary, and of what entries define; with names like a misspelt one."""

from __future__ import annotations

import threading
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from itertools import chain

from planlang.designators import local_name
from planlang.ontology.terms import OWL

LONGEST_GUESSED = 80
"""Characters of a name for which similar ones are looked for."""
MOST_COMPARED, MOST_LOOKED_AT = 20, 5_000
"""Names that are compared with a misspelt one, and entries of the index of pairs that are looked at to find them."""
MOST_SIMILAR = 3


class Names:
    """IRIs by local name, of the vocabulary and of entries. Threads may share it; one at a time may add to it."""

    def __init__(self, vocabulary: Mapping[str, Iterable[str]], own: Mapping[str, Iterable[str]] | None = None) -> None:
        """``own`` are names that entries define: if several entries do, any of them is meant."""
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
        """Add a name that an entry defines, unless the vocabulary has it."""
        name = local_name(iri)
        known = self._own.get(name)
        if name in self._vocabulary or (known and iri in known):
            return
        if known is None:
            self._all.append(name)
            self._folded.append(name.casefold())
        self._own[name] = tuple(sorted((*(known or ()), iri)))

    def of(self, name: str) -> tuple[str, ...]:
        """Return the IRIs that a name may mean, sorted; none for a name that is unknown."""
        if name == local_name(OWL.Thing):  # vocabularies may have things of their own; whoever says no more means all
            return (str(OWL.Thing),)
        return self._vocabulary.get(name) or self._own.get(name, ())

    def is_of_entries(self, name: str) -> bool:
        """Return True for a name that only entries define."""
        return name not in self._vocabulary

    def knows(self, iri: str) -> bool:
        """Return False for an IRI whose local name is known, and means something else."""
        name = local_name(iri)
        known = (*self._vocabulary.get(name, ()), *self._own.get(name, ()))
        return not known or iri in known or iri == OWL.Thing

    def like(self, text: str, most: int) -> tuple[str, ...]:
        """Return names that begin with a text, or else contain it, the shortest first."""
        wanted = text.casefold()
        found = [number for number, name in enumerate(self._folded) if wanted in name]
        found.sort(key=lambda one: (not self._folded[one].startswith(wanted), len(self._all[one]), self._all[one]))
        return tuple(self._all[one] for one in found[:most])

    def similar(self, name: str) -> list[str]:
        """Return the names most like a misspelt one, the best first; none for a very long one.

        Only names that share the rarest pairs of letters with it are compared: comparing takes long.
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
        return get_close_matches(name, [self._all[one] for one in best[:MOST_COMPARED]], n=MOST_SIMILAR)


def _pairs(name: str) -> set[str]:
    """Return the pairs of letters that follow each other in a name, its beginning and end included."""
    marked = f"^{name}$"
    return {marked[place : place + 2] for place in range(len(marked) - 1)}


def names_in(iris: Iterable[str]) -> dict[str, list[str]]:
    """Return the IRIs of each local name."""
    found: dict[str, list[str]] = {}
    for iri in iris:
        found.setdefault(local_name(iri), []).append(iri)
    return found
