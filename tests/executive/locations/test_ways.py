"""The judge's own flood fill: where a base can drive to, by a physics client that the product does not know."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from executive.robots import Robot
from sim import Body
from tests.support.locations.oracle import Oracle
from tests.support.locations.rooms import Furnisher, box
from tests.support.locations.ways import Ways

CORNER, MIDDLE = (2.4, 1.9, 0.0), (1.0, -1.0, 1.0)
WALLS = (box("wall0", (0.05, 1.2, 1.0), (1.8, 1.9, 0.5)), box("wall1", (1.2, 0.05, 1.0), (2.4, 1.3, 0.5)))
"""Two walls around a corner of the room."""


@pytest.fixture
def ways(amigo: Robot) -> Iterator[Callable[..., Ways]]:
    """Make the ways of Amigo in a room with some bodies."""
    oracles: list[Oracle] = []

    def make(*bodies: Body) -> Ways:
        room = Furnisher("walled", 0)
        for body in bodies:
            room.add(body)
        oracles.append(Oracle(room.room(), amigo))
        return Ways(oracles[-1])

    yield make
    for oracle in oracles:
        oracle.close()


@pytest.mark.long
def test_a_corner_that_is_walled_off_has_no_way(ways: Callable[..., Ways]) -> None:
    walled = ways(*WALLS)
    assert not walled.lead_to(CORNER)
    assert walled.lead_to(MIDDLE)
    assert not walled.lead_to((2.3, 1.8, 1.5)), "what was found out of one place holds for those beside it"


def test_a_corner_with_a_gap_has_one(ways: Callable[..., Ways]) -> None:
    assert ways(WALLS[0]).lead_to(CORNER)


def test_a_place_in_a_wall_has_none(ways: Callable[..., Ways]) -> None:
    assert not ways(*WALLS).lead_to((1.8, 1.9, 0.0))
