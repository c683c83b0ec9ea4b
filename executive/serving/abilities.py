"""Abilities of robots: entries compared with the self-model that it sends along."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

from executive.modules.bundled import bundled_registry
from executive.robots import Availability, match
from executive.robots.matching import Matcher, Missing, Possessions, missing_in
from executive.robots.requirements import together
from executive.robots.robot import claims_of, parts_of, read_self_model
from executive.serving.uploads import load_upload
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Workers
from planlang.knowledge.entries import Entry, Kind
from planlang.knowledge.stores import Store
from planlang.ontology import Ontology
from planlang.recipe import Actions, read_recipe

_WORDS = {Availability.AVAILABLE: "yes", Availability.MISSING: "no", Availability.UNKNOWN: "unknown"}
ROBOTS_KEPT, JUDGEMENTS_KEPT = 16, 10_000


@dataclass(frozen=True, slots=True)
class Judgement:
    """The answer whether a robot can use an entry, and what it lacks or may lack for that."""

    state: Availability
    missing: tuple[Missing, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return what is added to an entry's record."""
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


class _Robot:
    """A self-model's text, compared by its digest."""

    def __init__(self, text: str, vocabulary: Vocabulary | None = None) -> None:
        self.text, self.vocabulary = text, vocabulary
        self.digest = hashlib.sha256(text.encode(errors="surrogatepass")).digest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Robot) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


class Abilities:
    """Judgements of entries of one store for robots; the latest are remembered. Threads may share it."""

    def __init__(self, store: Store, workers: Workers) -> None:
        self._store = store
        self._workers = workers
        self._judgement = lru_cache(JUDGEMENTS_KEPT)(self._judged)

    def of(self, self_model: str, entry: Entry) -> Judgement:
        """Compare an entry with a self-model (text). Raises BadInput if that is none, and Busy."""
        return self._judgement(_Robot(self_model), entry.uid, entry.kind, entry.about, entry.etag)

    def check(self, self_model: str) -> None:
        """Raise BadInput if a text is no self-model, and Busy."""
        self._workers.call(check_robot, self_model)

    def _judged(self, robot: _Robot, uid: str, kind: Kind, about: str, etag: str) -> Judgement:
        """Return the judgement of a revision, which its tag names."""
        return self._workers.call(judged, robot.text, uid, kind, about, self._store.content(uid))


def check_robot(self_model: str, vocabulary: Vocabulary) -> None:
    """Raise BadInput if a text is no self-model."""
    _possessions(_Robot(self_model, vocabulary))


def judged(self_model: str, uid: str, kind: Kind, about: str, data: bytes, vocabulary: Vocabulary) -> Judgement:
    """Compare a content with a self-model. Raises BadInput if one of them is none."""
    possessions = _possessions(_Robot(self_model, vocabulary))
    ontology = load_upload(uid.partition(".")[2], data, vocabulary)
    if kind is not Kind.RECIPE:
        return _by_classes(ontology, about, possessions)
    reading = read_recipe(Actions(ontology), about)
    if reading.recipes is None:  # it was taken when more was known, or by another version
        return Judgement(Availability.UNKNOWN)
    found = match(ontology, reading.recipes, possessions, performed=_performed())
    unknown = (Missing(one.iri or one.text, one.kind, one.state, (), one.reason) for one in found.unknown())
    return Judgement(found.tree.state, (*found.lacking(), *unknown))


@lru_cache(ROBOTS_KEPT)
def _possessions(robot: _Robot) -> Possessions:
    assert robot.vocabulary is not None
    model = read_self_model(load_upload("robot", robot.text.encode(), robot.vocabulary))
    return Possessions(model.name, parts_of(model), claims_of(model), model)


def _by_classes(ontology: Ontology, about: str, possessions: Possessions) -> Judgement:
    """Judge what is no recipe by what its classes require: a map of a robot's laser, a model of its camera."""
    matcher = Matcher(ontology, possessions)
    classes: Iterable[str] = (about,) if ontology.is_class(about) else ontology.types(about)
    trees = [matcher.action(cls) for cls in classes]
    return Judgement(together(one.state for one in trees), missing_in(trees))


@cache
def _performed() -> frozenset[str]:
    """Return the classes of actions that the bundled process modules perform."""
    registry = bundled_registry()
    registry.resolve([])
    return registry.actions
