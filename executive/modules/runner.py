"""The one runner of skills: candidates in order, each tried once, until one succeeds or the world is as wanted.

A skill is what the robot does about one thing: reach it, open it, push it, drive to it. Its module states the parts.
Trying a candidate again is not one of them: that is the policy of the plan, whose recoveries know what it costs. Only
when what was believed about the thing has changed, by a look or a touch, are there new candidates.
"""

from __future__ import annotations

from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable, Iterable
from typing import Generic, TypeVar

from planlang.failures import (
    DesignatorFailure,
    ManipulationFailure,
    ManipulationPoseUnreachable,
    NavigationFailure,
    PlanFailure,
)
from planlang.kernel import checkpoint
from planlang.records import dataclass

C = TypeVar("C")
R = TypeVar("R")

MOST = 6
"""Candidates of one skill that are tried; more differ little."""


async def nothing(*parts: object) -> None:
    """Do nothing: what a skill does in the parts that it leaves out."""


async def first_failure(problem: PlanFailure | None, tried: int) -> PlanFailure:
    """Report the failure of the first candidate, which was the best."""
    return problem or ManipulationPoseUnreachable("no candidate was found")


async def each(candidates: AsyncIterable[C | None] | Iterable[C | None]) -> AsyncIterator[C]:
    """Yield the results of a slow search; at each None, other tasks get a turn."""
    if isinstance(candidates, AsyncIterable):
        async for candidate in candidates:
            if candidate is not None:
                yield candidate
        return
    for candidate in candidates:
        if candidate is not None:
            yield candidate
        else:
            await checkpoint()


@dataclass(slots=True, eq=False)
class _Tally:
    tried: int = 0
    problem: PlanFailure | None = None
    """First failure of a candidate that was tried in the world, else of one for which no place was found."""

    def failed(self, failure: PlanFailure) -> None:
        """Count a candidate's failure."""
        is_met = not isinstance(failure, DesignatorFailure)
        if self.problem is None or (is_met and isinstance(self.problem, DesignatorFailure)):
            self.problem = failure


@dataclass(frozen=True, slots=True, eq=False)
class Skill(Generic[C, R]):
    """Parts of a skill. Each candidate goes through approach, contact, retreat and verification, in this order.

    A failure of one of the classes ``failures`` leads to the next candidate, any other one ends the skill.
    """

    candidates: Callable[[], AsyncIterable[C | None] | Iterable[C | None]]
    """Makes the candidates for the world as it is believed now, best first; at each None, other tasks get a turn."""
    contact: Callable[[C], Awaitable[R]]
    """Makes the motion that matters; what it returns is the result of the skill."""
    approach: Callable[[C], Awaitable[object]] = nothing
    """Drives to where the candidate needs the base, looks from there, and brings the hand before the thing."""
    retreat: Callable[[C], Awaitable[object]] = nothing
    """Leaves the thing, also after a contact that failed."""
    verify: Callable[[C, PlanFailure | None], Awaitable[object]] = nothing
    """Looks at what has become of the thing, with the failure of the contact, if any; raises another if need be."""
    between: Callable[[], Awaitable[object]] = nothing
    """Prepares the robot for the next candidate after one has failed."""
    believed: Callable[[], object] = lambda: None
    """Reads what the candidates were made for; as soon as it has changed, they are made anew."""
    failures: tuple[type[PlanFailure], ...] = (ManipulationFailure, NavigationFailure)
    most: int = MOST
    """Candidates to try in all, so that the work is bounded even if each one changes what is believed."""
    otherwise: Callable[[PlanFailure | None, int], Awaitable[PlanFailure]] = first_failure
    """Makes the failure of the skill from the first one of a candidate, if any, and the number of candidates tried."""

    async def run(self) -> R:
        """Try one candidate after another; return the result of the first that succeeds."""
        return await self._succeed(_Tally())

    async def until(self, is_done: Callable[[], Awaitable[bool]]) -> None:
        """Go on after candidates that succeed, each a step, until ``is_done``."""
        tally = _Tally()
        while not await is_done():
            await self._succeed(tally)

    async def _succeed(self, tally: _Tally) -> R:
        is_new = tally.tried < self.most
        while is_new:
            is_new, believed = False, self.believed()
            async for candidate in each(self.candidates()):
                tally.tried += 1
                try:
                    return await self._attempt(candidate)
                except self.failures as failure:
                    tally.failed(failure)
                await self.between()
                is_new = self.believed() != believed and tally.tried < self.most
                if is_new or tally.tried == self.most:
                    break
        first = tally.problem
        final = await self.otherwise(first, tally.tried)
        if final is first or final.__cause__ is not None:
            raise final
        raise final from first

    async def _attempt(self, candidate: C) -> R:
        await self.approach(candidate)
        problem: PlanFailure | None = None
        try:
            result = await self.contact(candidate)
        except PlanFailure as failure:
            problem = failure
        await self.retreat(candidate)
        await self.verify(candidate, problem)
        if problem is not None:
            raise problem
        return result
