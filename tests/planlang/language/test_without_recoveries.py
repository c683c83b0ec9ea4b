"""A plan without its failure handling: no recovery handles a failure, wherever it is stated, and one place is tried.

A plan with more of it: each recovery tries more often than it states.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import GraspMissed, ManipulationPoseUnreachable, ObjectUnfetchable, ObjectUnreachable
from planlang.language.recovery import trying_more, without_recoveries

CUP = an_object("Cup", "http://example.org/map#cup1")


def bare(body: Callable[[], Awaitable[Any]]) -> Callable[[], Awaitable[Any]]:
    async def inside() -> Any:
        with without_recoveries():
            return await body()

    return inside


class Grasp:
    """A step that fails once."""

    tried = 0

    async def __call__(self, side: str = "front") -> str:
        self.tried += 1
        if self.tried == 1:
            raise GraspMissed
        return side


def test_a_failure_is_raised_as_it_is_and_nothing_is_tried_again() -> None:
    for recovery in (Recovery(GraspMissed, retries=3), Recovery(GraspMissed, retries=0, otherwise=ObjectUnfetchable)):
        grasp = Grasp()
        with pytest.raises(GraspMissed):
            go(bare(partial(with_failure_handling, grasp, recovery)))
        assert grasp.tried == 1
    assert go(partial(with_failure_handling, Grasp(), Recovery(GraspMissed))) == "front"


def test_the_first_run_still_has_the_first_of_its_alternatives() -> None:
    async def grasp(side: str) -> str:
        return side

    sides = Recovery(GraspMissed, alternatives={"side": lambda: ["top", "left"]})
    assert go(bare(partial(with_failure_handling, grasp, sides))) == "top"


def test_it_holds_in_branches_and_ends_with_the_block() -> None:
    tried = Grasp()

    async def plan() -> str:
        handled = partial(with_failure_handling, tried, Recovery(GraspMissed))
        with pytest.raises(GraspMissed), without_recoveries():
            await par(handled, partial(sleep, 1.0))
        tried.tried = 0
        return str(await handled())

    assert go(plan) == "front"


def test_a_location_scope_tries_its_first_base_pose_only(executive: Any) -> None:
    async def body() -> None:
        raise ManipulationPoseUnreachable(arm="right")

    again = Recovery(ObjectUnreachable, retries=2)
    with pytest.raises(ObjectUnreachable):
        go(bare(partial(at_location, a_location(in_reach_of=CUP), body, again)), executive)
    assert executive.log == ["at 1"]


def test_with_more_attempts_each_recovery_tries_so_many_times_more_than_it_states() -> None:
    async def grasp() -> None:
        tried.append("front")
        raise GraspMissed

    async def plan() -> None:
        with trying_more(2):
            await with_failure_handling(grasp, Recovery(GraspMissed, retries=1))

    tried: list[str] = []
    with pytest.raises(GraspMissed):
        go(plan)
    assert len(tried) == 1 + 1 + 2
