"""The base works where it gets away from afterwards: not in a corner that an open drawer closes."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import planlang
from executive.ahead.leaving import gets_away
from executive.ahead.spent import Spent
from executive.locations.supposed import at_rest
from planlang.geometry import Pose
from tests.support.leaves import room, thing

HERE = Path(__file__).parent


def walled(open_by: float, stack: ExitStack) -> bool:
    """Whether Amigo gets away from between three walls and a drawer that is open by so much [m]."""
    grip = thing("grip", "Handle", Pose((0.56, 0.0, 0.65)), (0.012, 0.2, 0.012))
    leaf = thing("leaf", "Drawer", Pose((0.84, 0.0, 0.65)), (0.48, 0.5, 0.14), "grip")
    case = thing("case", "Dresser-PieceOfFurniture", Pose((0.85, 0.0, 0.36)), (0.5, 0.54, 0.72), "leaf")
    walls = [
        thing(name, "Wall-GenericBarrier", Pose((x, y, 1.0)), size)
        for name, x, y, size in (
            ("west", -0.15, 0.71, (0.1, 0.78, 2.0)),
            ("north", 0.3, 1.15, (1.0, 0.1, 2.0)),
            ("east", 0.75, 0.7, (0.1, 0.8, 2.0)),
        )
    ]
    stage = room(stack, (case, leaf, grip, *walls))
    scene = stage.platform.scene
    return gets_away(scene, at_rest(scene, scene.belief.with_leaf("leaf", open_by), (0.27, 0.7, 0.0)), Spent())


def test_a_drawer_that_is_open_closes_the_only_way_out_of_a_corner(stack: ExitStack) -> None:
    assert walled(0.08, stack)
    assert not walled(0.4, stack)


def test_a_phone_is_taken_from_a_drawer_where_the_base_gets_away() -> None:
    result = planlang.simulate(HERE / "take_the_phone.omn", robot="amigo", environment=HERE / "chest_in_a_corner.omn")
    assert result.succeeded
    assert "phone1: held by robot" in result.final_state
