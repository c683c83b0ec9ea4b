"""The search for what a robot lacks: which entries of a knowledge base, together, leave nothing unmet.

After figure 7 of Waibel et al., RoboEarth (2011): what is missing is looked for with its specialisations, what these
need in turn is looked for likewise, and the first combination without unmet dependency is taken. As a graph of needs
(one offer each suffices) and offers (all their needs have to be met), which needs can be met is found in time linear in
the graph (Dowling and Gallier, 1984), cycles included: nothing is met by itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field

from planlang.closure import reached
from planlang.records import dataclass

Need = str
"""A need as a class expression: the IRI of a class, or Manchester syntax."""


@dataclass(frozen=True, slots=True)
class Offer:
    """An entry that meets a need, if its own ``needs`` are met. ``about`` is the IRI of what it describes.

    Offers of one ``uid`` have the same needs. What ``is_own`` the robot has itself: nothing is taken for it.
    """

    uid: str
    about: str
    needs: tuple[Need, ...] = ()
    is_own: bool = False


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a need: how it is met, or why not.

    ``by`` is the reason why the robot meets it itself; ``offer`` what is taken for it; neither if nothing meets it.
    ``considered`` are all offers with the needs of theirs that nothing meets.
    """

    need: Need
    by: str | None = None
    offer: Offer | None = None
    considered: tuple[tuple[Offer, tuple[Need, ...]], ...] = ()

    @property
    def is_met(self) -> bool:
        """True if the robot has it or an offer is taken."""
        return self.by is not None or self.offer is not None


@dataclass(frozen=True, slots=True)
class Combination:
    """The answers to all needs that were looked at, by need; ``wanted`` are those of the task itself."""

    wanted: tuple[Need, ...]
    answers: dict[Need, Answer]

    @property
    def unmet(self) -> tuple[Need, ...]:
        """The task's needs that nothing meets."""
        return tuple(need for need in self.wanted if not self.answers[need].is_met)

    def offers(self) -> Iterator[Offer]:
        """Yield what is taken, each once, what it needs before it."""
        seen: set[str] = set()
        path: list[tuple[Offer | None, Iterator[Need]]] = [(None, iter(self.wanted))]
        while path:
            offer, needs = path[-1]
            taken = (self.answers[need].offer for need in needs)
            below = next((one for one in taken if one is not None and one.uid not in seen), None)
            if below is not None:
                seen.add(below.uid)
                path.append((below, iter(below.needs)))
                continue
            path.pop()
            if offer is not None:
                yield offer


def combine(
    wanted: Sequence[Need], has: Callable[[Need], str | None], offers: Callable[[Need], Iterable[Offer]]
) -> Combination:
    """Return how needs are met. ``has`` returns why the robot meets one, or None; ``offers`` what meets it, best first.

    Each is asked once for each need. Of a sequence all offers are looked at; of anything else, whose offers cost
    something to have, only as many as the need takes to be met. An earlier offer is taken before a later one, but none
    that would need itself, and none beside another that is taken anyway.
    """
    graph = _Graph(has, offers)
    graph.explore(wanted)
    graph.prefer(wanted)
    return Combination(tuple(dict.fromkeys(wanted)), {need: graph.answer(need) for need in graph.offers})


@dataclass(slots=True)
class _Graph:
    has: Callable[[Need], str | None]
    find: Callable[[Need], Iterable[Offer]]
    offers: dict[Need, list[Offer]] = field(default_factory=dict)
    had: dict[Need, str] = field(default_factory=dict)
    met: dict[Need, int] = field(default_factory=dict)
    """Needs that are met, with the order in which that was found."""
    waiting: dict[Need, list[Offer]] = field(default_factory=dict)
    meeting: dict[str, list[Need]] = field(default_factory=dict)
    """The needs that an offer meets, by its identifier."""
    open: dict[str, dict[Need, None]] = field(default_factory=dict)
    """The needs of an offer that are not met yet."""
    taken: dict[Need, Offer] = field(default_factory=dict)

    def explore(self, wanted: Sequence[Need]) -> None:
        """Collect the needs and offers that the wanted ones lead to, all below an offer before the next one."""
        below = [iter(wanted)]
        while below:
            need = next(below[-1], None)
            if need is None:
                below.pop()
            elif need not in self.offers:
                below.append(self._looked_at(need))

    def _looked_at(self, need: Need) -> Iterator[Need]:
        """Collect the offers of a need; yields what they need."""
        self.offers[need] = []
        reason = self.has(need)
        if reason is not None:
            self.had[need] = reason
            self._meet([need])
            return
        found = self.find(need)
        for offers in (found,) if isinstance(found, Sequence) else ((one,) for one in found):
            for offer in offers:
                self._add(need, offer)
            yield from (below for offer in offers for below in offer.needs)
            if need in self.met:
                return

    def _add(self, need: Need, offer: Offer) -> None:
        self.offers[need].append(offer)
        self.meeting.setdefault(offer.uid, []).append(need)
        if offer.uid not in self.open:
            self.open[offer.uid] = {below: None for below in offer.needs if below not in self.met}
            for below in self.open[offer.uid]:
                self.waiting.setdefault(below, []).append(offer)
        if not self.open[offer.uid]:
            self._meet([need])

    def _meet(self, needs: Iterable[Need]) -> None:
        """Find out which needs are met together with some."""
        queue = list(needs)
        for need in queue:
            if need in self.met:
                continue
            self.met[need] = len(self.met)
            for offer in self.waiting.get(need, ()):
                self.open[offer.uid].pop(need, None)
                if not self.open[offer.uid]:
                    queue.extend(self.meeting[offer.uid])

    def prefer(self, wanted: Iterable[Need]) -> None:
        """Choose offers: those that were free first, then earlier ones in their place where that makes no circle."""
        for need in self.met:
            free = (one for one in self.offers[need] if all(self._order(n) < self.met[need] for n in one.needs))
            if need not in self.had:
                self.taken[need] = next(free)

        def below(need: Need) -> Iterator[Need]:
            self._improve(need)
            return (one for one in self.taken[need].needs if one in self.taken)

        self._share(list(reached((need for need in wanted if need in self.taken), below)))

    def _share(self, needs: Sequence[Need]) -> None:
        """Let one offer meet several needs where it can, so that fewer are taken."""
        uses = Counter(self.taken[need].uid for need in needs)
        for need in needs:
            mine = self.taken[need]
            if mine.is_own or uses[mine.uid] > 1:
                continue
            shared = (one for one in self.offers[need] if uses[one.uid] and one.uid != mine.uid)
            for offer in shared:
                if all(one in self.met for one in offer.needs) and not self._leads(offer.needs, need):
                    self.taken[need] = offer
                    uses.update({mine.uid: -1, offer.uid: 1})
                    break

    def _order(self, need: Need) -> int:
        return self.met.get(need, len(self.met))

    def _improve(self, need: Need) -> None:
        for offer in self.offers[need]:
            if offer == self.taken[need]:
                return
            if all(one in self.met for one in offer.needs) and not self._leads(offer.needs, need):
                self.taken[need] = offer
                return

    def _leads(self, needs: Iterable[Need], goal: Need) -> bool:
        """Return whether needs, met as chosen so far, depend on another one."""
        return goal in reached(needs, lambda need: self.taken[need].needs if need in self.taken else ())

    def answer(self, need: Need) -> Answer:
        """Return the answer to a need."""
        considered = tuple((one, tuple(n for n in one.needs if n not in self.met)) for one in self.offers[need])
        return Answer(need, self.had.get(need), self.taken.get(need), considered)
