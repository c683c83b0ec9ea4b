"""Alternatives for a task that cannot be done: which entries would do it, and which needs each of them leaves unmet.

Alternatives of a need are those of its offers; of an offer, the combinations of those of its needs (k best derivations
of an AND/OR graph), found by rounds over all needs until nothing changes. What leads back to itself alone has none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from executive.enabling.search import Combination, Need, Offer
from planlang.records import dataclass

MOST_KEPT = 5
"""Alternatives of a need that are kept, the nearest to complete."""
MOST_ROUNDS = 50


@dataclass(frozen=True, slots=True)
class Alternative:
    """Entries (identifiers) that meet a need but for what is ``missing``: needs that nothing meets."""

    entries: tuple[str, ...]
    missing: tuple[Need, ...]


def alternatives(combination: Combination, root: Need) -> tuple[Alternative, ...]:
    """Return the ways to meet a need that nothing meets, those that lack least first, then as they were offered.

    Of ways that lack the same, the first. Where all ways lead in circles, one need in each counts as missing.
    """
    answers = combination.answers
    unmet = [need for need, answer in reversed(answers.items()) if not answer.is_met]
    known: dict[Need, tuple[Alternative, ...]] = dict.fromkeys(unmet, ())
    known.update((need, (Alternative((), (need,)),)) for need in unmet if not answers[need].considered)
    _spread(combination, unmet, known)
    while not known[root]:
        circular = next(need for need in unmet if not known[need])
        known[circular] = (Alternative((), (circular,)),)
        _spread(combination, unmet, known)
    return known[root]


def _spread(combination: Combination, unmet: Iterable[Need], known: dict[Need, tuple[Alternative, ...]]) -> None:
    """Complete what is known of needs with the alternatives of what these need."""
    for _ in range(MOST_ROUNDS):
        is_changed = False
        for need in unmet:
            ways = [way for one in combination.answers[need].considered for way in _ways(*one, known)]
            found = _nearest([*ways, *(known[need] if not ways else ())])
            is_changed |= found != known[need]
            known[need] = found
        if not is_changed:
            return


def _ways(offer: Offer, lacking: Iterable[Need], known: Mapping[Need, tuple[Alternative, ...]]) -> list[Alternative]:
    """Return the ways to take an offer."""
    found: tuple[Alternative, ...] = (Alternative((), ()),)
    for need in lacking:
        found = _nearest(_joined(one, other) for one in found for other in known[need])
    taken = Alternative(() if offer.is_own else (offer.uid,), ())
    return [_joined(one, taken) for one in found]


def _joined(one: Alternative, other: Alternative) -> Alternative:
    entries, missing = (*one.entries, *other.entries), (*one.missing, *other.missing)
    return Alternative(tuple(dict.fromkeys(entries)), tuple(dict.fromkeys(missing)))


def _nearest(ways: Iterable[Alternative]) -> tuple[Alternative, ...]:
    """Return the ways that lack least, the first of those that lack the same."""
    found: dict[frozenset[Need], Alternative] = {}
    for one in ways:
        found.setdefault(frozenset(one.missing), one)
    return tuple(sorted(found.values(), key=lambda one: len(one.missing))[:MOST_KEPT])
