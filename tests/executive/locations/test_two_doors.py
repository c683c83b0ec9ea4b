"""Furniture with two doors side by side, in which something is put."""

from contextlib import ExitStack

import pytest

from planlang.designators import a_location
from planlang.failures import BehindClosedDoor
from planlang.geometry import Pose
from tests.support.leaves import Room, room, thing

BACK = (0.0, 0.0, 1.0, 0.0)


def cupboard(stack: ExitStack, width: float) -> Room:
    """Panda with a box in its hand before a cupboard with two doors, of which the left one is open."""

    def at(x: float, y: float) -> Pose:
        return Pose((x, y, 0.6), BACK)

    things = [thing("case", "Cupboard", at(0.8, 0.0), (0.4, 0.62, 0.5), "left", "right")]
    for name, side in (("left", 1.0), ("right", -1.0)):
        things.append(thing(f"grip_{name}", "Handle", at(0.55, 0.04 * side), (0.012, 0.012, 0.2)))
        things.append(thing(name, "Door", at(0.59, 0.151 * side), (0.02, 0.3, 0.5), f"grip_{name}"))
    box = thing("box", "CardboardBox", Pose((0.0, 1.5, 0.03)), (0.06, width, 0.06))
    stage = room(stack, (*things, box), "panda", start=(-0.1, 0.0, 0.0))
    stage.truth.set_joint("left", 1.5)
    stage.platform.belief.moved("left", 1.5)
    arm = stage.platform.robot.arms[0]
    there = stage.truth.link_pose(arm.tip)
    stage.truth.set_pose("box", Pose.planar(*there.position[:2], 0.0, there.position[2]))
    offset = there.inverse() @ stage.truth.pose("box")
    stage.truth.attach(arm.tip, "box")
    stage.platform.belief.grasped("box", arm.name, arm.tip, offset)
    stage.platform.observe()
    return stage


@pytest.mark.long
def test_second_door_is_opened_where_a_thing_does_not_pass_the_first_alone() -> None:
    with ExitStack() as stack:
        stage = cupboard(stack, 0.3)
        where = a_location(in_reach_of=a_location(in_=stage.designator("case")))
        with pytest.raises(BehindClosedDoor) as caught:
            next(stage.platform.resolver.bases(where))
        assert str(caught.value.door) == "right"


@pytest.mark.long
def test_second_door_stays_shut_where_a_thing_passes_the_first() -> None:
    with ExitStack() as stack:
        stage = cupboard(stack, 0.06)
        next(stage.platform.resolver.bases(a_location(in_reach_of=a_location(in_=stage.designator("case")))))
