"""Pushing: leaves are pushed shut by a closed hand, on a line or on an arc."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from planlang.designators import Condition
from planlang.failures import ActionUnresolvable
from tests.support.leaves import drawn, room

DOOR, DRAWER = 0, 2
"""Seeds of a door and of a drawer."""


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Yield what ends the worlds of a test."""
    with ExitStack() as stack:
        yield stack


@pytest.mark.parametrize(("seed", "value"), [(DRAWER, 0.2), (DOOR, 1.2)])
def test_an_open_leaf_is_pushed_shut(stack: ExitStack, seed: int, value: float) -> None:
    stage = room(stack, drawn(seed))
    stage.truth.set_joint("leaf", value)
    stage.platform.belief.moved("leaf", value)
    stage.do("PushingMotion", "leaf")
    assert stage.truth.joint("leaf") < 0.03
    assert stage.executive.holds(Condition("closed", (stage.designator("leaf"),)))
    assert stage.truth.contacts() == ()


def test_what_cannot_be_pushed_is_refused(stack: ExitStack) -> None:
    stage = room(stack, drawn(DRAWER))
    with pytest.raises(ActionUnresolvable, match="cannot be pushed along"):
        stage.do("PushingMotion", "case")
