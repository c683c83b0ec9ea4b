"""What is put down leaves the way of doors and drawers free that later steps use, and their handles."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest

from executive.locations.demands import ThingDemand
from executive.locations.leaf_ways import leaves_used
from executive.locations.placement import IN_THE_WAY, Placement
from executive.locations.rejections import Rejections
from planlang.designators import a_location, action
from planlang.geometry import Pose
from planlang.geometry.areas import Block
from tests.support.leaves import Room, room, thing

FRONT = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


def cupboard_on_a_table(stack: ExitStack, *, slides: bool = False) -> Room:
    """A small cupboard far back on a table, with a door or a drawer that opens over the table, and a can beside it."""
    size = (0.3, 0.38, 0.28) if slides else (0.02, 0.38, 0.28)
    x = 1.0 + size[0] / 2
    y = 0.0 if slides else 0.16
    things = (
        thing("table", "Table-PieceOfFurniture", Pose((1.0, 0.0, 0.35)), (0.9, 1.4, 0.7)),
        thing("case", "Cupboard", Pose((1.2, 0.0, 0.85)) @ FRONT, (0.4, 0.4, 0.3), "leaf"),
        thing("leaf", "Drawer" if slides else "Door", Pose((x, 0.0, 0.85)) @ FRONT, size, "grip"),
        thing("grip", "Handle", Pose((0.96, y, 0.85)) @ FRONT, (0.012, 0.012, 0.14)),
        thing("can", "TinCan", Pose((1.2, 0.5, 0.76)), (0.07, 0.07, 0.12)),
    )
    return room(stack, things)


def spots(stage: Room, *clear: str, on: str | None = "table", inside: str | None = None) -> tuple[np.ndarray, int]:
    """Return where the can may be put, (n, 4), and how many places are in the way of what has to stay clear."""
    log = Rejections()
    demand = ThingDemand(on, inside, clear=clear)
    places, _ = Placement("can", demand, stage.platform.scene, near=False).spots(log)
    return places, log.counts[IN_THE_WAY]


@pytest.mark.parametrize("slides", [False, True], ids=["door", "drawer"])
def test_a_place_in_the_way_of_a_leaf_or_before_its_handle_is_none_if_that_is_to_stay_clear(
    stack: ExitStack, slides: bool
) -> None:
    stage = cupboard_on_a_table(stack, slides=slides)
    scene, (every, none), (some, many) = stage.platform.scene, spots(stage), spots(stage, "leaf")
    assert none == 0 < many
    assert 0 < len(some) < len(every)
    joint = scene.belief.joints["leaf"]
    for value in np.linspace(0.0, joint.upper, 30):
        leaf = scene.supposing(scene.belief.with_leaf("leaf", float(value))).bodies
        for part in ("leaf", "grip"):
            assert min(leaf.block(part).away(np.array(place)) for place in some[:, :3].tolist()) > 0.03
    before = Block.of(Pose((0.85, 0.0 if slides else 0.16, 0.8)), (0.1, 0.05, 0.2))
    assert min(before.away(np.array(place)) for place in every[:, :3].tolist()) == 0.0
    assert min(before.away(np.array(place)) for place in some[:, :3].tolist()) > 0.03


def test_what_is_put_into_a_drawer_is_in_no_way_of_that(stack: ExitStack) -> None:
    stage = cupboard_on_a_table(stack, slides=True)
    places, in_the_way = spots(stage, "leaf", on=None, inside="leaf")
    assert len(places)
    assert not in_the_way


def test_leaves_are_used_by_what_moves_them_and_by_what_is_taken_from_or_put_behind_them(stack: ExitStack) -> None:
    stage = cupboard_on_a_table(stack)
    case, leaf, can, table = map(stage.designator, ("case", "leaf", "can", "table"))
    scene = stage.platform.scene
    for using in (
        action("OpeningAContainerArtifact", object_acted_on=case),
        action("ClosingAContainerArtifact", object_acted_on=leaf),
        action("PuttingDownAnObject", object_acted_on=can, to_location=a_location(in_=case)),
    ):
        assert leaves_used([using], scene) == ("leaf",)
    assert leaves_used([action("PuttingDownAnObject", object_acted_on=can, to_location=table)], scene) == ()
    inside = scene.supposing(scene.belief.state.placed({"can": Pose((1.2, 0.0, 0.78))}))
    assert leaves_used([action("PickingUpAnObject", object_acted_on=can)], inside) == ("leaf",)
