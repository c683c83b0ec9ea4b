"""at_location: what a body has delivered is not delivered again."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import ManipulationPoseUnreachable

BED = an_object("Bed-PieceOfFurniture")
NEAR_CUP = a_location(in_reach_of=an_object("Cup", "http://example.org/map#cup1"))


def delivering(executive: Any, module: Any, log: list[str]) -> Any:
    """Give the cup to the hand of a module that tells what it lets go of, and logs it; return the step that does so."""
    executive.holding.append("cup1")

    async def let_go(wanted: Any) -> str:
        log.append("open")
        executive.holding.remove("cup1")
        return "cup1"

    executive.extra.append(module("gripper", ("OpeningAGripper",), let_go))
    return partial(perform, action("OpeningAGripper"))


def test_a_body_that_has_delivered_is_not_repeated_for_an_arm_that_cannot_be_tucked(
    executive: Any, module: Any
) -> None:
    log: list[str] = []
    put_down = delivering(executive, module, log)

    async def body() -> None:
        await put_down()
        raise ManipulationPoseUnreachable(arm="left", what="carrying")

    async def around() -> None:
        await at_location(a_location(in_reach_of=BED), body)

    for scope in (body, around):
        executive.holding[:] = ["cup1"]
        with pytest.raises(ManipulationPoseUnreachable, match="carrying"):
            go(partial(at_location, NEAR_CUP, scope), executive)
    assert log == ["open", "open"]


def test_what_was_delivered_by_a_step_with_a_goal_lets_the_rest_be_done_from_elsewhere(
    executive: Any, module: Any
) -> None:
    log: list[str] = []
    put_down = delivering(executive, module, log)

    async def body() -> float:
        await put_down(until=lambda: bool(log))
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable(arm="left")
        return float(executive.base[0])

    assert go(partial(at_location, NEAR_CUP, body), executive) == 2.0
    assert log == ["open"]
