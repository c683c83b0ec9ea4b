"""Doors between rooms: opened from either side by pushing or pulling, driven through, and closed again."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from planlang import SimulationHost, perform, run
from planlang.designators import Condition, a_location, action
from planlang.failures import BehindClosedDoor, NavigationPoseUnreachable
from tests.support.extras import skip_without_pr2
from tests.support.leaves import Room
from tests.support.room_doors import HERE, THERE, RoomDoor, flat

OPEN, CLOSE = "OpeningADoor", "ClosingADoor"


def drive(stage: Room, pose: tuple[float, float, float]) -> None:
    """Drive the base to a pose; raises its failure."""
    x, y, yaw = pose

    async def plan() -> None:
        await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw))

    run(plan, host=SimulationHost(stage.truth), executive=stage.executive, max_steps=30_000)


def test_a_closed_door_is_a_wall_for_the_base_and_the_camera(stack: ExitStack, tmp_path: Path) -> None:
    shut = flat(stack, RoomDoor(), tmp_path)
    with pytest.raises(NavigationPoseUnreachable):
        drive(shut, THERE)
    assert shut.platform.scene.visibility.hidden(HERE, "grip1") is not None
    wide = flat(stack, RoomDoor(facts=("knowrob:jointPosition 1.57",)), tmp_path)
    drive(wide, THERE)
    assert wide.truth.configuration().base[:2] == pytest.approx(THERE[:2])


def test_what_a_shut_door_keeps_the_base_from_is_behind_it(stack: ExitStack, tmp_path: Path) -> None:
    facts = 'Facts: knowrob:translation "3.5 0 0.37", knowrob:boundingBoxSize "0.7 1.2 0.74"'
    table = f"Individual: table\n    Types: knowrob:KitchenTable\n    {facts}\n"
    stage = flat(stack, RoomDoor(more=table), tmp_path)
    near = a_location(near=stage.designator("table"))
    with pytest.raises(BehindClosedDoor, match="table is behind door, which is closed") as shut:
        next(stage.platform.resolver.bases(near))
    assert shut.value.door == stage.designator("door")
    wide = flat(stack, RoomDoor(more=table, facts=("knowrob:jointPosition 1.57",)), tmp_path)
    assert next(wide.platform.resolver.bases(a_location(near=wide.designator("table")))).base[0] > 0.0


@pytest.mark.parametrize(
    ("robot", "start", "beyond"),
    [
        ("amigo", HERE, THERE),
        pytest.param("amigo", THERE, HERE, marks=pytest.mark.long),
        pytest.param("pr2", HERE, THERE, marks=pytest.mark.long),
    ],
)
def test_a_door_is_opened_from_one_side_and_closed_from_the_other(
    stack: ExitStack, tmp_path: Path, robot: str, start: tuple[float, float, float], beyond: tuple[float, float, float]
) -> None:
    skip_without_pr2(robot)
    stage = flat(stack, RoomDoor(), tmp_path, robot, start)
    stage.do(OPEN, "door")
    assert stage.truth.joint("door") > 0.9 * 1.57
    drive(stage, beyond)
    stage.do(CLOSE, "doorway")
    assert stage.executive.holds(Condition("closed", (stage.designator("door"),)))
    assert stage.truth.joint("door") < 0.05
    assert stage.truth.contacts() == ()
