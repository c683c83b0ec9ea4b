"""What the robot itself has opened is closed, or opened further, before what it is in the way of."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from executive.maps import MapObject
from executive.modules.arm_paths import ArmPaths
from executive.motion import NoPath
from planlang import SimulationHost, at_location, checkpoint, perform, run
from planlang.designators import Object, a_location, action
from planlang.failures import (
    ContainerStuck,
    HandleNotReachable,
    LocationUnresolvable,
    ManipulationPoseUnreachable,
    ObjectUnreachable,
)
from planlang.geometry import Pose
from planlang.language.recovery import Recovery
from planlang.protocols import Trajectory
from planlang.recoveries import open_what_is_in_the_way, step_back_and_repeat
from tests.support.leaves import Room, room, thing


def chest() -> tuple[MapObject, ...]:
    """A chest with a drawer in a narrow aisle, tall cupboards at its sides, and a cup at the back of its top."""
    grip = thing("grip", "Handle", Pose((0.56, 0.0, 0.65)), (0.012, 0.2, 0.012))
    leaf = thing("leaf", "Drawer", Pose((0.89, 0.0, 0.65)), (0.58, 0.5, 0.14), "grip")
    case = thing("case", "Dresser-PieceOfFurniture", Pose((0.9, 0.0, 0.36)), (0.6, 0.54, 0.72), "leaf")
    others = [
        thing(name, "Wall-GenericBarrier", Pose((x, y, 1.0)), size)
        for name, x, y, size in (
            ("left", 0.9, 0.68, (0.6, 0.8, 2.0)),
            ("right", 0.9, -0.68, (0.6, 0.8, 2.0)),
            ("back", 1.25, 0.0, (0.1, 2.2, 2.0)),
            ("opposite", -0.4, 0.0, (0.1, 2.2, 2.0)),
        )
    ]
    cup = thing("cup", "Cup", Pose((1.1, 0.0, 0.77)), (0.07, 0.07, 0.1))
    return (case, leaf, grip, *others, cup)


def refrigerator() -> tuple[MapObject, ...]:
    """A refrigerator in a narrow aisle, with a cup in it."""
    back = (0.0, 0.0, 1.0, 0.0)
    grip = thing("grip", "Handle", Pose((0.545, 0.2, 0.9), back), (0.015, 0.015, 0.2))
    leaf = thing("leaf", "Door", Pose((0.59, 0.0, 0.9), back), (0.02, 0.5, 0.6), "grip")
    case = thing("case", "Refrigerator", Pose((0.85, 0.0, 0.9), back), (0.5, 0.52, 0.62), "leaf")
    plinth = thing("plinth", "Cabinet-PieceOfFurniture", Pose((0.85, 0.0, 0.29), back), (0.5, 0.52, 0.58))
    walls = [
        thing(name, "Wall-GenericBarrier", Pose((x, 0.0, 1.0)), (0.1, 3.2, 2.0))
        for name, x in (("back", 1.15), ("opposite", -0.35))
    ]
    cup = thing("cup", "Cup", Pose((0.9, -0.1, 0.67)), (0.07, 0.07, 0.1))
    return (case, leaf, grip, plinth, *walls, cup)


def open_by(things: tuple[MapObject, ...], stack: ExitStack, robot: str, by: float) -> Room:
    """A room in which the leaf is open by so much [m, rad], which the robot knows."""
    stage = room(stack, things, robot, start=(0.1, -1.8, 1.57))
    stage.truth.set_joint("leaf", by)
    stage.platform.belief.touched("leaf", by)
    stage.platform.observe()
    return stage


def stands_near(stage: Room, cup: Object) -> None:
    """Drive to where the cup is in reach, as compiled plans do."""

    async def plan() -> None:
        where = a_location(in_reach_of=cup)
        await at_location(where, checkpoint, Recovery(ObjectUnreachable, open_what_is_in_the_way(cup), retries=2))

    host = SimulationHost(stage.truth)
    run(plan, executive=stage.executive, host=host, max_steps=30_000)


def test_a_drawer_that_keeps_the_base_from_a_cup_is_closed_first(stack: ExitStack) -> None:
    stage = open_by(chest(), stack, "amigo", 0.46)
    cup = stage.designator("cup")
    with pytest.raises(LocationUnresolvable, match="with leaf closed, cup could be reached") as failed:
        next(stage.platform.resolver.bases(a_location(in_reach_of=cup)))
    assert failed.value.first is not None
    stands_near(stage, cup)
    assert stage.truth.joint("leaf") == pytest.approx(0.0, abs=0.03)


def test_an_arm_without_a_path_says_what_has_to_be_opened_further(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, path = open_by(refrigerator(), stack, "amigo", 0.68), ArmPaths.path
    cup, now = stage.designator("cup"), stage.truth.configuration()
    base = next(stage.platform.resolver.bases(a_location(in_reach_of=cup))).base
    stage.truth.set_configuration(replace(now, base=base))
    stage.platform.observe()

    def only_past_a_wide_door(self: ArmPaths, *arguments: Any, **keywords: Any) -> Trajectory:
        if self._control.scene.belief.joint("leaf") < 1.0:
            raise NoPath([], [], {})
        return path(self, *arguments, **keywords)

    monkeypatch.setattr(ArmPaths, "path", only_past_a_wide_door)
    with pytest.raises(ManipulationPoseUnreachable) as failed:
        stage.run(partial(perform, action("Reaching", to_location=a_location(in_front_of=cup))))
    found = next(link for link in failed.value.chain() if isinstance(link, LocationUnresolvable))
    assert "with leaf open by 90 degrees instead of 39 degrees" in str(found)
    assert found.first == action(
        "OpeningAContainerArtifact", object_acted_on=stage.designator("leaf"), all_the_way=True
    )


@pytest.mark.long
@pytest.mark.pr2
def test_a_refrigerator_whose_door_is_in_the_way_is_opened_further(stack: ExitStack) -> None:
    stage = open_by(refrigerator(), stack, "pr2", 0.5)
    stands_near(stage, stage.designator("cup"))
    assert stage.truth.joint("leaf") > 1.5


def test_the_drawer_above_is_closed_before_the_one_below_it_is_opened(stack: ExitStack) -> None:
    parts = [
        part
        for name, z in (("leaf", 0.65), ("lower", 0.45))
        for part in (
            thing(name, "Drawer", Pose((0.84, 0.0, z)), (0.48, 0.5, 0.14), f"grip_{name}"),
            thing(f"grip_{name}", "Handle", Pose((0.56, 0.0, z)), (0.012, 0.2, 0.012)),
        )
    ]
    case = thing("case", "Dresser-PieceOfFurniture", Pose((0.85, 0.0, 0.36)), (0.5, 0.54, 0.72), "leaf", "lower")
    stage = open_by((case, *parts), stack, "amigo", 0.38)
    lower = stage.designator("lower")
    again = Recovery((HandleNotReachable, ContainerStuck), step_back_and_repeat(lower), retries=3)

    async def plan() -> None:
        await perform(action("OpeningAContainerArtifact", object_acted_on=lower), recoveries=[again])

    run(plan, executive=stage.executive, host=SimulationHost(stage.truth), max_steps=30_000)
    assert stage.truth.joint("leaf") == pytest.approx(0.0, abs=0.03)
    assert stage.platform.belief.joints["lower"].is_open(stage.truth.joint("lower"))
