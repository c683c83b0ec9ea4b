"""Decisions after which later steps have a way: of the candidates, those that leave one come first.

What a candidate leads to is a state, and what later steps need is asked of it: whether the base gets away, whether a
hand reaches in. The questions are counted, those of a decision and those of a run, so that equal runs ask the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

from executive.ahead.leaving import gets_away
from executive.ahead.spent import Share, Spent
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_part import Kept
from executive.locations import Resolver
from planlang.designators import Location
from planlang.failures import DesignatorFailure, LocationUnresolvable
from planlang.state import WorldState

T = TypeVar("T")

MOST_QUESTIONS = 6
"""Candidates of one decision about which is asked; more differ little."""
MOST_SEARCHES, MOST_CHECKS = 100, 10_000
"""Searches and exact checks with which a run looks ahead; then it takes candidates as they come."""
MOST_LEARNT = 64
"""Answers that are kept."""


class Foresight:
    """Looks ahead for the decisions of a run, within its budget; what was learnt is kept for the run."""

    def __init__(self, scene: PlanningScene, resolver: Resolver) -> None:
        self._scene, self._resolver = scene, resolver
        self._spent = Spent()
        self._shares: dict[str, Share] = {}
        self._learnt: Kept[bool] = Kept(MOST_LEARNT)

    def first(self, decision: str, candidates: Iterable[T], leaves_a_way: Callable[[T], bool]) -> Iterator[T]:
        """Yield candidates in their order, but those that leave no way for later steps last.

        ``leaves_a_way`` asks :meth:`gets_away`, :meth:`reaches` and :meth:`finds` about at most
        :data:`MOST_QUESTIONS` candidates; the others come as they are. A failure that ends the candidates is raised
        after those that were put off. What a choice cost is in the trace before it is yielded, as an event
        ``looked ahead``.
        """
        put_off, ended, before, asked = list[T](), list[LocationUnresolvable](), replace(self._spent), 0

        def ordered() -> Iterator[T]:
            for candidate in _until_failure(candidates, ended):
                if self._spent.questions - before.questions >= MOST_QUESTIONS:
                    while put_off:
                        yield put_off.pop(0)
                    yield candidate
                elif self._asked(candidate, leaves_a_way):
                    yield candidate
                else:
                    put_off.append(candidate)
            while put_off:
                yield put_off.pop(0)

        for candidate in ordered():
            spent = self._spent_since(before)
            if candidate is not None and spent["questions"] > asked:  # None only gives other tasks a turn
                asked = spent["questions"]
                self._scene.belief.tell("looked ahead", {"decision": decision, **spent, "put_off": len(put_off)})
            yield candidate
        if ended:
            raise ended[0]

    def decided(self, decision: str, decide: Callable[[], T]) -> T:
        """Return what is decided; what it cost is in the trace, as of :meth:`first`."""
        before = replace(self._spent)
        result, spent = decide(), self._spent_since(before)
        if any(spent.values()):
            self._scene.belief.tell("looked ahead", {"decision": decision, **spent})
        return result

    def _spent_since(self, before: Spent) -> dict[str, int]:
        return {name: getattr(self._spent, name) - getattr(before, name) for name in Spent.__slots__}

    def _asked(self, candidate: T, leaves_a_way: Callable[[T], bool]) -> bool:
        """Ask about a candidate, which counts as a question unless the answer needs neither search nor check."""
        spent, before = self._spent, replace(self._spent)
        answer = leaves_a_way(candidate)
        spent.questions += spent != before
        return answer

    def share(self, leaf: str) -> Share:
        """Return what is left for closing a door again in this run."""
        return self._shares.setdefault(leaf, Share())

    def gets_away(self, state: WorldState) -> bool:
        """Check whether the base gets away from where it stands in a state."""
        return self._spent.checks >= MOST_CHECKS or gets_away(self._scene, state, self._spent)

    def reaches(self, location: Location, state: WorldState) -> bool:
        """Check quickly whether the base finds a place for a location in a state."""

        def search(then: PlanningScene) -> bool:
            try:
                return self._resolver.is_possible(location, then)
            except DesignatorFailure:  # the step that goes there reports it
                return True

        return self.finds(location, state, search)

    def finds(
        self, what: object, state: WorldState, search: Callable[[PlanningScene], bool], *, otherwise: bool = True
    ) -> bool:
        """Check whether a search for something finds it in the scene of a state; the same is searched for once.

        ``otherwise`` is the answer where nothing more is searched in this run.
        """
        if self._spent.searches >= MOST_SEARCHES:
            return otherwise
        then = self._scene.supposing(state)

        def counted() -> bool:
            self._spent.searches += 1
            return search(then)

        return self._learnt.of((what, then.surroundings()), counted)


def _until_failure(candidates: Iterable[T], ended: list[LocationUnresolvable]) -> Iterator[T]:
    """Yield candidates up to the failure that ends them, which is noted."""
    try:
        yield from candidates
    except LocationUnresolvable as problem:
        ended.append(problem)
