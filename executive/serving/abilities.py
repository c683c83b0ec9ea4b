"""Compare entries with the self-models of robots: which entries a robot can use, and what it lacks for the others."""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections.abc import Iterable
from functools import cache
from typing import Any, Generic, TypeVar, cast

from executive.modules.bundled import bundled_registry
from executive.robots import Availability
from executive.robots.matching import Matcher, Missing, Possessions, missing_in
from executive.robots.requirements import together
from executive.robots.robot import claims_of, parts_of, read_self_model
from executive.robots.tasks import match
from executive.serving.uploads import load_upload
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Workers
from planlang.knowledge.entries import Entry, Kind, Store
from planlang.ontology import Ontology
from planlang.recipe import Actions, read_recipe
from planlang.records import dataclass

T = TypeVar("T")
OVERHEAD = 200
"""Bytes that a cached result takes in addition to its own size."""


class Cache(Generic[T]):
    """Least-recently-used cache with keys of fixed size. Thread-safe."""

    def __init__(self, most: int) -> None:
        """Limit the cache to ``most`` bytes."""
        self._most, self._bytes = most, 0
        self._known: dict[bytes, tuple[T, int]] = {}
        self._lock = threading.Lock()

    def get(self, key: bytes) -> T | None:
        """Look up a result; None if it is not in the cache."""
        with self._lock:
            if key not in self._known:
                return None
            result, _ = self._known[key] = self._known.pop(key)
            return result

    def keep(self, key: bytes, result: T, size: int) -> T:
        """Cache a result of ``size`` bytes and return it; one that exceeds the whole cache is dropped at once."""
        with self._lock:
            _, replaced = self._known.pop(key, (result, 0))
            self._known[key] = result, size + OVERHEAD
            self._bytes += size + OVERHEAD - replaced
            while self._bytes > self._most:
                _, freed = self._known.pop(next(iter(self._known)))
                self._bytes -= freed
        return result


def digest(parts: Iterable[str]) -> bytes:
    """SHA-256 of a sequence of texts; their boundaries count, since each is hashed first."""
    each = (hashlib.sha256(part.encode(errors="surrogatepass")).digest() for part in parts)
    return hashlib.sha256(b"".join(each)).digest()


_WORDS = {Availability.AVAILABLE: "yes", Availability.MISSING: "no", Availability.UNKNOWN: "unknown"}
MOST_JUDGED = 32_000_000
"""Size of the cache of judgements [bytes]."""
MOST_ROBOTS = 4_000_000
"""Size of a worker's cache of self-models, counted as text [bytes]."""
_ROBOTS = Cache[Possessions](MOST_ROBOTS)


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether a robot can use an entry, and the requirements that it lacks or may lack."""

    state: Availability
    missing: tuple[Missing, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """JSON data to add to an entry's record."""
        return {"can": _WORDS[self.state], "missing": [_missing_json(one) for one in self.missing]}


def _missing_json(one: Missing) -> dict[str, Any]:
    return {
        "kind": one.kind.value,
        "iri": one.iri,
        "name": one.name,
        "state": one.state.value,
        "reason": one.reason,
        "because": one.because,
    }


class Abilities:
    """Judgements of a store's entries for robots, with a cache. Thread-safe."""

    def __init__(self, store: Store, workers: Workers) -> None:
        self._store = store
        self._workers = workers
        self._judgements = Cache[bytes](MOST_JUDGED)

    def of(self, self_model: str, entry: Entry) -> Judgement:
        """Check an entry's requirements against a self-model (text). Raises BadInput if it is invalid; Busy."""
        key = digest((self_model, entry.uid, entry.kind, entry.about, entry.etag))
        known = self._judgements.get(key)
        if known is None:
            data = self._store.content(entry.uid)
            judgement = self._workers.call(judged, self_model, entry.uid, entry.kind, entry.about, data)
            known = pickle.dumps(judgement)
            self._judgements.keep(key, known, len(known))
        return cast(Judgement, pickle.loads(known))

    def check(self, self_model: str) -> None:
        """Check that a text is a self-model. Raises BadInput if it is not; Busy."""
        self._workers.call(check_robot, self_model)


def check_robot(self_model: str, vocabulary: Vocabulary) -> None:
    """Check that a text is a self-model. Raises BadInput if it is not."""
    _possessions(self_model, vocabulary)


def judged(self_model: str, uid: str, kind: Kind, about: str, data: bytes, vocabulary: Vocabulary) -> Judgement:
    """Check an entry's requirements against a robot's self-model. Raises BadInput if either is invalid."""
    possessions = _possessions(self_model, vocabulary)
    ontology = load_upload(uid.partition(".")[2], data, vocabulary)
    if kind is not Kind.RECIPE:
        return _by_classes(ontology, about, possessions)
    reading = read_recipe(Actions(ontology), about)
    if reading.recipes is None:  # it was accepted with other ontologies on the server, or by another version
        return Judgement(Availability.UNKNOWN)
    matched = match(ontology, reading.recipes, possessions, performed=_performed())
    unknown = (Missing(one.iri or one.text, one.kind, one.state, (), one.reason) for one in matched.unknown())
    return Judgement(matched.tree.state, (*matched.lacking(), *unknown))


def _possessions(self_model: str, vocabulary: Vocabulary) -> Possessions:
    key = digest((self_model,))
    known = _ROBOTS.get(key)
    if known is not None:
        return known
    model = read_self_model(load_upload("robot", self_model.encode(), vocabulary))
    return _ROBOTS.keep(key, Possessions(model.name, parts_of(model), claims_of(model), model), len(self_model))


def _by_classes(ontology: Ontology, about: str, possessions: Possessions) -> Judgement:
    """Judge an object or a map by what its classes require, such as the camera that a recognition model works with."""
    matcher = Matcher(ontology, possessions)
    classes: Iterable[str] = (about,) if ontology.is_class(about) else ontology.types(about)
    trees = [matcher.action(cls) for cls in classes]
    return Judgement(together(one.state for one in trees), missing_in(trees))


@cache
def _performed() -> frozenset[str]:
    """Action classes that the bundled process modules perform."""
    registry = bundled_registry()
    registry.resolve([])
    return registry.actions
