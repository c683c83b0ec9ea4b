"""Strategies for necks that stop, for things that look alike, and for amounts that were not poured."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import (
    PlanFailure,
    Recovery,
    look_by_moving_the_base,
    pour_the_rest,
    with_failure_handling,
)
from planlang.failures import AmbiguousPerception, AmountNotPoured, LookingFailure
from tests.support.looking import BOTTLE, eyes


class Once:
    """A body that fails the first time."""

    def __init__(self, failure: PlanFailure) -> None:
        self.failures = [failure]

    async def __call__(self) -> None:
        if self.failures:
            raise self.failures.pop()


@pytest.mark.parametrize("failure", [LookingFailure, AmbiguousPerception])
@pytest.mark.parametrize(
    ("seen_from", "log"),
    [((0.0,), ["looks at 0"]), ((1.0,), ["looks at 0", "at 1", "looks at 1"])],
)
def test_where_the_neck_stops_or_a_mark_is_hidden_the_base_moves_unless_the_thing_is_seen_by_now(
    executive: Any, module: Any, seen_from: tuple[float, ...], log: list[str], failure: type[PlanFailure]
) -> None:
    eyes(executive, module, *seen_from)
    recovery = Recovery(failure, look_by_moving_the_base(BOTTLE))
    go(partial(with_failure_handling, Once(failure()), recovery), executive)
    assert executive.log == log


def test_a_neck_that_stops_fails_where_the_thing_is_seen_from_nowhere(executive: Any, module: Any) -> None:
    eyes(executive, module)
    with pytest.raises(LookingFailure):
        go(
            partial(
                with_failure_handling,
                Once(LookingFailure()),
                Recovery(LookingFailure, look_by_moving_the_base(BOTTLE)),
            ),
            executive,
        )


@pytest.mark.parametrize(("poured", "is_repeated"), [(60.0, True), (0.0, False), (120.0, False)])
def test_the_rest_is_poured_if_some_has_been(poured: float, is_repeated: bool) -> None:
    body = Once(AmountNotPoured(asked=100.0, poured=poured))
    handled = partial(with_failure_handling, body, Recovery(AmountNotPoured, pour_the_rest))
    if is_repeated:
        go(handled)
    else:
        with pytest.raises(AmountNotPoured):
            go(handled)
