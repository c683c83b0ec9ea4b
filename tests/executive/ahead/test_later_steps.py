"""A step does what leaves the later ones a way: it grasps as the thing is put down, and a full hand is emptied."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

import planlang
from planlang import Recovery, SimulationHost, perform, put_down_first, run
from planlang.designators import action
from planlang.failures import HandsFull
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from tests.executive.conftest import BOTTLE, Stage, hold_bottle
from tests.support.leaves import drawn, room, thing

HERE = Path(__file__).parent


def test_what_is_put_under_a_board_later_is_not_grasped_from_above() -> None:
    result = planlang.simulate(HERE / "put_in_the_niche.omn", robot="amigo", environment=HERE / "niche.omn")
    assert result.succeeded
    assert "can1: at rest on shelf1" in result.final_state
    assert "SettingAsideAnObject(" not in str(result.trace), "the first grip served"


def test_a_drawer_is_opened_by_full_hands_once_one_has_put_down_what_it_held() -> None:
    bottles = [thing(name, "DrinkingBottle", Pose((-2.0, y, 0.1)), BOTTLE.size) for name, y in (("one", 1), ("two", 2))]
    table = thing("table", "KitchenTable", Pose((-1.2, -1.0, 0.37)), (0.8, 0.6, 0.74))
    with ExitStack() as stack:
        furnished = room(stack, (*drawn(2), table, *bottles))
        stage = Stage(furnished.truth, furnished.platform, furnished.executive)
        hold_bottle(stage, "right", name="one")
        hold_bottle(stage, "left", name="two")
        leaf = furnished.designator("leaf")
        opening = action("OpeningAContainerArtifact", object_acted_on=leaf)
        freed = Recovery(HandsFull, put_down_first(leaf))
        run(
            lambda: perform(opening, recoveries=[freed]),
            host=SimulationHost(stage.truth),
            executive=furnished.executive,
            max_steps=30_000,
        )
        assert stage.platform.belief.joints["leaf"].is_open(stage.truth.joint("leaf"))
        assert len(stage.belief.held) == 1


def _set_aside(stack: ExitStack, table: tuple[Pose, tuple[float, float, float]], *, is_stated: bool = True) -> Array:
    """Set a can aside beside a drawer over a table, out of its way if that is stated; return where it stands."""
    facing = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    things = (
        thing("table", "Table-PieceOfFurniture", *table),
        thing("case", "Cupboard", Pose((1.1, 0.0, 0.82)) @ facing, (0.4, 0.9, 0.24), "leaf"),
        thing("leaf", "Drawer", Pose((1.05, 0.0, 0.82)) @ facing, (0.3, 0.88, 0.22), "grip"),
        thing("grip", "Handle", Pose((0.86, 0.0, 0.82)) @ facing, (0.012, 0.14, 0.012)),
        thing("can", "TinCan", Pose((-2.0, 1.0, 0.06)), (0.07, 0.07, 0.12)),
    )
    furnished = room(stack, things)
    stage = Stage(furnished.truth, furnished.platform, furnished.executive)
    hold_bottle(stage, "right", name="can")
    what, leaf = furnished.designator("can"), furnished.designator("leaf")
    stated = {"out_of_the_way_of": leaf} if is_stated else {}
    stage.run(lambda: perform(action("SettingAsideAnObject", object_acted_on=what, **stated)))
    return np.array(stage.truth.pose("can").position)


@pytest.mark.parametrize("is_stated", [True, False])
def test_what_is_put_down_for_a_drawer_is_in_no_way_of_that(stack: ExitStack, is_stated: bool) -> None:
    drawn_out = Block.of(Pose((0.75, 0.0, 0.82)), (0.3, 0.88, 0.24))
    stands = _set_aside(stack, (Pose((0.95, 0.0, 0.35)), (0.8, 1.2, 0.7)), is_stated=is_stated)
    assert (drawn_out.away(stands) > 0.0) == is_stated, stands


def test_where_all_of_the_only_table_is_in_the_way_of_a_drawer_it_serves_all_the_same(stack: ExitStack) -> None:
    stands = _set_aside(stack, (Pose((0.75, 0.0, 0.35)), (0.28, 0.84, 0.7)))
    assert stands[2] == pytest.approx(0.76, abs=0.01)
