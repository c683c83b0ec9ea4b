"""The catalogue of a store: an index of all entries in memory, built from their descriptions.

It follows the store's news, so that the next query sees changes that other servers made in the same store.
"""

from __future__ import annotations

import logging
import threading
from bisect import bisect_right, insort
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice

import numpy as np

from executive.serving.uploads import describe, packed, unpacked
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Failed, Workers
from planlang.designators import local_name
from planlang.diagnostics import BadInput
from planlang.knowledge.answers import Links
from planlang.knowledge.descriptions import Description
from planlang.knowledge.entries import UNRATED, Change, Changed, Described, Kind, NoSuchEntry, Store
from planlang.knowledge.facts import LABEL, Facts, Unpacked
from planlang.knowledge.index import Index, go_on
from planlang.knowledge.names import Names
from planlang.knowledge.questions import parse_question, with_names
from planlang.ontology.expressions import Expression
from planlang.records import dataclass

MOST_LINKS = 200
"""Links listed for one subject."""
LONG = 500
"""Characters above which a worker parses a query: a long one takes up to 50 ms."""
AT_ONCE = 200
"""Entries compared between two points at which a search can be cancelled."""
_LOG = logging.getLogger(__name__)
_CONTENT = frozenset((Change.CREATED, Change.CHANGED))


@dataclass(frozen=True, slots=True)
class Listing:
    """Words and places by which an entry is found, apart from its classes; all texts are case-folded."""

    kind: Kind
    words: str
    """One per line."""
    place: Mapping[str, tuple[str, ...]]

    def fits(self, kind: Kind | None, part: str, place: Mapping[str, str]) -> bool:
        """Check an entry's kind, a part of its label or of a name in it, and its room, floor, building and so on."""
        return (
            kind in (None, self.kind)
            and part in self.words
            and all(text in self.place.get(level, ()) for level, text in place.items())
        )


class Catalogue:
    """Index of the entries of a store. Thread-safe."""

    def __init__(self, store: Store, vocabulary: Vocabulary) -> None:
        self._store = store
        self._vocabulary = vocabulary
        self._index = Index(vocabulary.axioms)
        self._listed: dict[str, Listing] = {}
        self._uids: dict[Kind | None, list[str]] = {kind: [] for kind in (None, *Kind)}
        self.names = Names(vocabulary.names)
        """Local names known in queries: those of the vocabulary, and those that entries define."""
        self._named: set[str] = set()
        self._stale: dict[str, None] = {}
        self._unread: set[str] = set()
        self._lock = threading.RLock()
        self._seen = store.last_news()
        self._ratings = dict(store.ratings())
        self._add_all(store.descriptions())

    def __len__(self) -> int:
        with self._lock:
            self._follow()
            return len(self._listed)

    def __contains__(self, uid: str) -> bool:
        with self._lock:
            self._follow()
            return uid in self._listed

    def question(self, text: str, workers: Workers | None = None) -> Expression:
        """Parse a class expression, a long one in ``workers``. Raises BadInput; Busy."""
        with self._lock:
            self._follow()
        is_long = workers is not None and len(text) > LONG
        parsed = workers.call(parse_in_worker, text) if workers is not None and is_long else parse_question(text)
        return with_names(parsed, self.names)

    def query_name(self, iri: str) -> str:
        """Name of a term in queries: its local name if that is unambiguous, else its IRI in angle brackets."""
        name = local_name(iri)
        return name if self.names.of(name) == (iri,) else f"<{iri}>"

    @property
    def stale(self) -> int:
        """Number of entries that :meth:`renew` has still to describe."""
        return len(self._stale)

    @property
    def unread(self) -> frozenset[str]:
        """Entries that are found only by the class of their subject, since their descriptions have another layout."""
        return frozenset(self._unread)

    @property
    def is_behind(self) -> bool:
        """True if :meth:`renew` has still to describe an unread entry; it begins with these."""
        return not self._unread.isdisjoint(self._stale)

    def uids(self, kind: Kind | None = None, after: str = "", limit: int = 100) -> tuple[str, ...]:
        """Sorted identifiers greater than ``after``, for paging."""
        with self._lock:
            self._follow()
            known = self._uids[kind]
            start = bisect_right(known, after)
            return tuple(known[start : start + limit])

    def count(self, kind: Kind) -> int:
        """Number of entries of a kind."""
        with self._lock:
            self._follow()
            return len(self._uids[kind])

    def names_like(self, text: str, most: int) -> tuple[str, ...]:
        """Complete a name: known names that begin with a text, or else contain it, the shortest first."""
        with self._lock:
            self._follow()
        return self.names.like(text, most)

    def find(
        self,
        expression: Expression | None,
        kind: Kind | None = None,
        label: str | None = None,
        place: Mapping[str, str] | None = None,
        between: Callable[[], None] = go_on,
    ) -> tuple[str, ...]:
        """Find the entries below a class expression that meet all other conditions, sorted. Raises CannotAnswer.

        ``label`` is a part of a label or name, ``place`` the number, label or name of the room, floor, building and so
        on. ``between`` is called between two steps of the search; an exception from it ends the search.
        """
        part = (label or "").casefold()
        places = {level: text.casefold() for level, text in (place or {}).items()}
        with self._lock:
            self._follow()
            uids = tuple(self._uids[None])
        if expression is not None:
            uids = self._index.answers(expression, between)
        if kind is None and not part and not places:
            return uids
        matches: list[str] = []
        for batch in batched(uids, AT_ONCE):
            between()
            with self._lock:
                listed = [(uid, self._listed.get(uid)) for uid in batch]  # None: deleted in the meantime
            matches += (uid for uid, one in listed if one is not None and one.fits(kind, part, places))
        return tuple(matches)

    def ranked(self, uids: Iterable[str]) -> tuple[str, ...]:
        """Sort identifiers by rating, best first; the sort is stable."""
        with self._lock:
            ratings = {uid: self._ratings.get(uid, UNRATED) for uid in uids}
        return tuple(sorted(ratings, key=lambda uid: -ratings[uid]))

    def links(self, uid: str) -> Links:
        """Links of an entry's subject (property, class), including those that its classes require.

        Empty if the entry does not exist.
        """
        with suppress(NoSuchEntry):
            kept, _ = unpacked(self._store.description(uid), self._vocabulary)
            return () if kept is None else tuple(_links(kept.description()))
        return ()

    def _follow(self) -> None:
        while news := self._store.news(self._seen):
            for uid in {one.uid: None for one in news if one.change in (Change.RATED, Change.DELETED)}:
                self._rate(uid)
            changed = {one.uid: one.change for one in news if one.change in (*_CONTENT, Change.DELETED)}
            for uid, change in changed.items():
                self._remove(uid)
                if change in _CONTENT:
                    with suppress(NoSuchEntry):  # deleted since; the news of that follow
                        entry = self._store.entry(uid)
                        stored = self._store.description(uid)
                        self._add_all([Described(uid, entry.kind, entry.about, entry.label, stored)])
            self._seen = news[-1].number

    def _rate(self, uid: str) -> None:
        self._ratings.pop(uid, None)
        with suppress(NoSuchEntry):
            rating = self._store.entry(uid).rating
            if rating is not None:
                self._ratings[uid] = rating

    def _add_all(self, entries: Iterable[Described]) -> None:
        facts: dict[str, Facts] = {}
        for one in entries:
            kept, is_stale = unpacked(one.description, self._vocabulary)
            if is_stale:
                self._stale[one.uid] = None
            if kept is None:
                self._unread.add(one.uid)
            facts[one.uid] = Facts([one.about], 1, np.array([[0, LABEL, 0]], np.int32)) if kept is None else kept.facts
            self._list(one, kept)
            self._add_names(facts[one.uid].names)
        self._index.add_all(facts)
        if not self._unread.isdisjoint(facts):
            self._stale = {uid: None for uid in self._stale if uid in self._unread} | self._stale

    def _list(self, entry: Described, kept: Unpacked | None) -> None:
        words, place = "", dict[str, tuple[str, ...]]()
        if kept is not None:
            words = "\n".join(kept.words).casefold()
            for level, text in kept.place:
                place[level] = (*place.get(level, ()), text.casefold())
        self._listed[entry.uid] = Listing(entry.kind, f"{entry.label.casefold()}\n{words}", place)
        for kind in (None, entry.kind):
            known = self._uids[kind]
            if known and known[-1] > entry.uid:
                insort(known, entry.uid)
            else:
                known.append(entry.uid)

    def _add_names(self, terms: Iterable[str]) -> None:
        for iri in terms:
            if iri not in self._named:
                self._named.add(iri)
                self.names.add(iri.strip("{}"))

    def _remove(self, uid: str) -> None:
        listed = self._listed.pop(uid, None)
        if listed is not None:
            self._index.remove(uid)
            self._unread.discard(uid)
            for kind in (None, listed.kind):
                self._uids[kind].remove(uid)

    def renew(self, workers: Workers) -> bool:
        """Describe one entry again that another version or vocabulary described; False if there is none.

        Exceptions of the store and the workers propagate; the entry is then moved to the end of the queue.
        """
        with self._lock:
            if not self._stale:
                return False
            uid = next(iter(self._stale))
            self._stale[uid] = self._stale.pop(uid)
        try:
            self._describe(uid, workers)
        except (NoSuchEntry, Changed, BadInput):  # the entry has changed, or keeps its old description
            pass
        except Failed as problem:
            _LOG.warning("%s keeps its old description: %s", uid, problem)
        with self._lock:
            self._stale.pop(uid, None)
        return True

    def _describe(self, uid: str, workers: Workers) -> None:
        entry = self._store.entry(uid)
        name, data = uid.partition(".")[2], self._store.content(uid, entry.revision.number)
        description = workers.call(describe, entry.about, name, data)
        with self._lock:
            stored = packed(description, self._vocabulary)
            self._store.describe(uid, stored, entry.etag)
            self._remove(uid)
            self._add_all([Described(uid, entry.kind, entry.about, entry.label, stored)])


def parse_in_worker(text: str, _: Vocabulary) -> Expression:
    """Parse a class expression without resolving its names. Raises BadInput."""
    return parse_question(text)


def batched(uids: Sequence[str], size: int) -> Iterator[Sequence[str]]:
    """Split a sequence into batches of ``size``; the last may be shorter."""
    return (uids[start : start + size] for start in range(0, len(uids), size))


def _links(description: Description) -> Iterator[tuple[str, str]]:
    root, *_ = description.nodes
    targets = ((prop, (one,) if isinstance(one, str) else description.nodes[one].labels) for prop, one in root.links)
    links = ((prop, label) for prop, labels in targets for label in labels)
    yield from islice(dict.fromkeys(one for one in links if not one[1].startswith("{")), MOST_LINKS)
