"""Search for a set of knowledge base entries that together leave no need of a task unmet.

After figure 7 of Waibel et al., RoboEarth (2011): search for missing components and their specialisations, then for the
dependencies of these, and take the first combination without an unmet dependency. Needs (one offer suffices) and offers
(all their needs have to be met) form an AND/OR graph. Forward chaining finds the needs that can be met in time linear
in its size (Dowling and Gallier, 1984), cycles included: no need is met by itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field

from planlang.closure import reached
from planlang.records import dataclass

Need = str
"""Name of a need, equal for equal needs."""


@dataclass(frozen=True, slots=True)
class Offer:
    """An entry that meets a need if its own ``needs`` are met. ``about`` is the IRI of its subject.

    Offers with the same ``uid`` have the same needs. An offer that ``is_own`` is the robot's and needs no download.
    """

    uid: str
    about: str
    needs: tuple[Need, ...] = ()
    is_own: bool = False


@dataclass(frozen=True, slots=True)
class Answer:
    """How a need is met, or why not.

    ``by`` is the reason why the robot meets it itself, ``offer`` the chosen offer; both are None if it is unmet.
    ``considered`` pairs each offer with its unmet needs.
    """

    need: Need
    by: str | None = None
    offer: Offer | None = None
    considered: tuple[tuple[Offer, tuple[Need, ...]], ...] = ()

    @property
    def is_met(self) -> bool:
        """True if the robot meets the need itself or an offer was chosen."""
        return self.by is not None or self.offer is not None


@dataclass(frozen=True, slots=True)
class Combination:
    """Answers to all explored needs; ``roots`` are the needs of the task itself."""

    roots: tuple[Need, ...]
    answers: dict[Need, Answer]

    @property
    def unmet(self) -> tuple[Need, ...]:
        """The task's needs that nothing meets."""
        return tuple(need for need in self.roots if not self.answers[need].is_met)

    def offers(self) -> Iterator[Offer]:
        """Yield the chosen offers, each once, dependencies first."""
        seen: set[str] = set()
        path: list[tuple[Offer | None, Iterator[Need]]] = [(None, iter(self.roots))]
        while path:
            offer, needs = path[-1]
            chosen = (self.answers[need].offer for need in needs)
            dependency = next((one for one in chosen if one is not None and one.uid not in seen), None)
            if dependency is not None:
                seen.add(dependency.uid)
                path.append((dependency, iter(dependency.needs)))
                continue
            path.pop()
            if offer is not None:
                yield offer


def combine(
    roots: Sequence[Need], has: Callable[[Need], str | None], offers: Callable[[Need], Iterable[Offer]]
) -> Combination:
    """Choose offers that meet the needs.

    ``has`` gives the reason why the robot meets a need itself, or None, and ``offers`` the offers for it, best first;
    both are called once for each need. All offers of a sequence are examined; of another iterable, whose offers are
    expensive, only as many as it takes to meet the need. Earlier offers are preferred, but none that would depend on
    itself, and none if an offer that is used anyway meets the need, too.
    """
    graph = _Graph(has, offers)
    graph.explore(roots)
    graph.prefer(roots)
    return Combination(tuple(dict.fromkeys(roots)), {need: graph.answer(need) for need in graph.offers})


@dataclass(slots=True)
class _Graph:
    has: Callable[[Need], str | None]
    find: Callable[[Need], Iterable[Offer]]
    offers: dict[Need, list[Offer]] = field(default_factory=dict)
    had: dict[Need, str] = field(default_factory=dict)
    met: dict[Need, int] = field(default_factory=dict)
    """Rank of each met need in the order of derivation."""
    waiting: dict[Need, list[Offer]] = field(default_factory=dict)
    """Offers that depend on a need that is not met yet."""
    meeting: dict[str, list[Need]] = field(default_factory=dict)
    """The needs that an offer meets, by its identifier."""
    open: dict[str, dict[Need, None]] = field(default_factory=dict)
    """The needs of an offer that are not met yet, by its identifier."""
    chosen: dict[Need, Offer] = field(default_factory=dict)

    def explore(self, roots: Sequence[Need]) -> None:
        """Collect needs and offers depth first: all dependencies of an offer before the next offer."""
        stack = [iter(roots)]
        while stack:
            need = next(stack[-1], None)
            if need is None:
                stack.pop()
            elif need not in self.offers:
                stack.append(self._expand(need))

    def _expand(self, need: Need) -> Iterator[Need]:
        """Collect the offers of a need and yield their needs."""
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
        """Mark needs as met, and all needs that follow (forward chaining)."""
        queue = list(needs)
        for need in queue:
            if need in self.met:
                continue
            self.met[need] = len(self.met)
            for offer in self.waiting.get(need, ()):
                self.open[offer.uid].pop(need, None)
                if not self.open[offer.uid]:
                    queue.extend(self.meeting[offer.uid])

    def prefer(self, roots: Iterable[Need]) -> None:
        """Choose an offer for each need: one derived before it, then an earlier one where that makes no cycle."""
        last = len(self.met)
        for need, at in self.met.items():
            derived = (one for one in self.offers[need] if all(self.met.get(n, last) < at for n in one.needs))
            if need not in self.had:
                self.chosen[need] = next(derived)

        def below(need: Need) -> Iterator[Need]:
            self._improve(need)
            return (one for one in self.chosen[need].needs if one in self.chosen)

        self._share(list(reached((need for need in roots if need in self.chosen), below)))

    def _share(self, needs: Sequence[Need]) -> None:
        """Let one offer meet several needs where it can, so that fewer entries are downloaded."""
        uses = Counter(self.chosen[need].uid for need in needs)
        for need in needs:
            mine = self.chosen[need]
            if mine.is_own or uses[mine.uid] > 1:
                continue
            shared = (one for one in self.offers[need] if uses[one.uid] and one.uid != mine.uid)
            for offer in shared:
                if all(one in self.met for one in offer.needs) and not self._depend_on(offer.needs, need):
                    self.chosen[need] = offer
                    uses.update({mine.uid: -1, offer.uid: 1})
                    break

    def _improve(self, need: Need) -> None:
        for offer in self.offers[need]:
            if offer == self.chosen[need]:
                return
            if all(one in self.met for one in offer.needs) and not self._depend_on(offer.needs, need):
                self.chosen[need] = offer
                return

    def _depend_on(self, needs: Iterable[Need], goal: Need) -> bool:
        """Check whether needs, met by the offers chosen so far, depend on another need."""
        return goal in reached(needs, lambda need: self.chosen[need].needs if need in self.chosen else ())

    def answer(self, need: Need) -> Answer:
        """Summarise the result for a need."""
        considered = tuple((one, tuple(n for n in one.needs if n not in self.met)) for one in self.offers[need])
        return Answer(need, self.had.get(need), self.chosen.get(need), considered)
