"""Doors between rooms: opened from either side by pushing or pulling, driven through, and closed again."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

import planlang
from executive.belief.doorways import free_width, gets_past, needed_width
from executive.locations.shut_ways import least_passed
from executive.modules.bundled import bundled_registry
from executive.modules.furniture.leaf_paths import LeafPaths
from executive.runs.assembly import RobotExecutive
from planlang import (
    Recovery,
    SimulationHost,
    StepLimit,
    Trace,
    at_location,
    open_what_is_in_the_way,
    perform,
    plan,
    run,
    sleep,
    with_failure_handling,
)
from planlang.designators import Condition, a_location, a_posture, action
from planlang.failures import (
    ActionUnresolvable,
    BehindClosedDoor,
    HandleNotReachable,
    NavigationFailure,
    NavigationPoseUnreachable,
    ObjectUnreachable,
)
from planlang.language.branches import Branch
from planlang.language.loading import load_plan
from planlang.language.source import PlanSource
from planlang.language.tidying import tidied
from planlang.runs import Past, RecordedRun, restore
from sim.truth import held_by
from tests.support.leaves import Room
from tests.support.room_doors import HERE, THERE, RoomDoor, flat

THERE_AND_BACK = """
from planlang import Recovery, open_what_is_in_the_way, perform, plan
from planlang.designators import a_location, action, an_object
from planlang.failures import BehindClosedDoor

TABLE = an_object("KitchenTable", "http://example.org/flat.owl#table")


@plan
async def there_and_back():
    await perform(
        action("Translation-LocationChange", to_location=a_location(near=TABLE)),
        recoveries=[Recovery(BehindClosedDoor, open_what_is_in_the_way(TABLE))],
    )
    await perform(action("Translation-LocationChange", x=-1.5, y=0.0, yaw=0.0))
"""
OPEN, CLOSE = "OpeningADoor", "ClosingADoor"


def table(x: float) -> str:
    """A table in a row of rooms, as a map states it."""
    facts = f'Facts: knowrob:translation "{x} 0 0.37", knowrob:boundingBoxSize "0.7 1.2 0.74"'
    return f"Individual: table\n    Types: knowrob:KitchenTable\n    {facts}\n"


def drive_to_the_table(stage: Room, around: Callable[[Branch], Awaitable[None]] | None = None) -> None:
    """Drive near the table, through doors that are opened on the way; ``around`` runs the plan."""
    what = stage.designator("table")

    async def go() -> None:
        await perform(action("Translation-LocationChange", to_location=a_location(near=what)))

    async def plan() -> None:
        await with_failure_handling(go, Recovery(BehindClosedDoor, open_what_is_in_the_way(what)))

    body = plan if around is None else partial(around, plan)
    run(body, host=SimulationHost(stage.truth), executive=stage.executive, max_steps=30_000)


def drive(stage: Room, pose: tuple[float, float, float]) -> None:
    """Drive the base to a pose; raises its failure."""
    x, y, yaw = pose

    async def plan() -> None:
        await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw))

    run(plan, host=SimulationHost(stage.truth), executive=stage.executive, max_steps=30_000)


async def refused(*request: object) -> None:
    """A base that does not drive."""
    raise NavigationPoseUnreachable("something is in the way")


def test_a_closed_door_is_a_wall_for_the_base_and_the_camera(stack: ExitStack, tmp_path: Path) -> None:
    shut = flat(stack, RoomDoor(), tmp_path)
    with pytest.raises(NavigationPoseUnreachable):
        drive(shut, THERE)
    assert shut.platform.scene.visibility.hidden(HERE, "grip1") is not None
    wide = flat(stack, RoomDoor(facts=("knowrob:jointPosition 1.57",)), tmp_path)
    drive(wide, THERE)
    assert wide.truth.configuration().base[:2] == pytest.approx(THERE[:2])


def test_what_a_shut_door_keeps_the_base_from_is_behind_it(stack: ExitStack, tmp_path: Path) -> None:
    stage = flat(stack, RoomDoor(more=table(3.5)), tmp_path)
    near = a_location(near=stage.designator("table"))
    with pytest.raises(BehindClosedDoor, match="table is behind door, which is closed") as shut:
        next(stage.platform.resolver.bases(near))
    assert shut.value.door == stage.designator("door")
    wide = flat(stack, RoomDoor(more=table(3.5), facts=("knowrob:jointPosition 1.57",)), tmp_path)
    assert next(wide.platform.resolver.bases(a_location(near=wide.designator("table")))).base[0] > 0.0


@pytest.mark.parametrize(
    ("robot", "start", "beyond"),
    [
        ("amigo", HERE, THERE),
        pytest.param("amigo", THERE, HERE, marks=pytest.mark.long),
        pytest.param("pr2", HERE, THERE, marks=[pytest.mark.long, pytest.mark.pr2]),
    ],
)
def test_a_door_is_opened_from_one_side_and_closed_from_the_other(
    stack: ExitStack, tmp_path: Path, robot: str, start: tuple[float, float, float], beyond: tuple[float, float, float]
) -> None:
    stage = flat(stack, RoomDoor(), tmp_path, robot, start)
    stage.do(OPEN, "door")
    assert stage.truth.joint("door") > 0.9 * 1.57
    drive(stage, beyond)
    stage.do(CLOSE, "doorway")
    assert stage.executive.holds(Condition("closed", (stage.designator("door"),)))
    assert stage.truth.joint("door") < 0.05
    assert stage.truth.contacts() == ()


def test_a_door_is_moved_from_where_the_base_would_be_shut_out_only_so_far_that_it_still_drives_past(
    stack: ExitStack, tmp_path: Path
) -> None:
    door = RoomDoor(slides=True, upright=True, handles=(-1.0,), facts=("knowrob:jointPosition 0.8",))
    stage = flat(stack, door, tmp_path)
    scene, joint = stage.platform.scene, stage.platform.belief.joints["door"]
    least = least_passed(scene, joint)
    assert gets_past(scene.supposing(scene.belief.with_leaf("door", least)), joint)
    assert free_width(scene, joint, least - 0.01) < needed_width(scene) <= free_width(scene, joint, least)
    paths = LeafPaths(scene, joint, THERE, only_there=True).towards(0.0, scene.arms.all[:1], joint.last_shut)
    path = next(filter(None, paths))
    assert path.values[-1] == least


def test_all_closed_doors_of_a_row_of_rooms_are_named_and_opened_in_their_order(
    stack: ExitStack, tmp_path: Path
) -> None:
    stage = flat(stack, RoomDoor(more=table(7.6) + RoomDoor().next_room()), tmp_path)
    with pytest.raises(BehindClosedDoor, match="table is behind door and door_2, which are closed") as shut:
        next(stage.platform.resolver.bases(a_location(near=stage.designator("table"))))
    assert (shut.value.door, shut.value.further) == (stage.designator("door"), (stage.designator("door_2"),))
    drive_to_the_table(stage)
    assert stage.truth.configuration().base[0] > 4.2


@pytest.mark.long
def test_doors_on_the_way_are_closed_behind_the_robot_before_it_drives_on(stack: ExitStack, tmp_path: Path) -> None:
    stage = flat(stack, RoomDoor(more=table(7.6) + RoomDoor().next_room()), tmp_path)
    drive_to_the_table(stage, tidied)
    assert stage.truth.configuration().base[0] > 4.2
    assert (stage.truth.joint("door") < 0.05, stage.truth.joint("door_2") < 0.05) == (True, True)


def test_only_doors_between_rooms_are_closed_again(stack: ExitStack, tmp_path: Path) -> None:
    stage = flat(stack, RoomDoor(more=table(3.5)), tmp_path)
    for named in (stage.designator("table"), (stage.designator("door"), "door")):
        with pytest.raises(ActionUnresolvable, match="name doors between rooms as object_acted_on"):
            run(
                partial(perform, action("ClosingDoorsAgain", object_acted_on=named)),
                host=SimulationHost(stage.truth),
                executive=stage.executive,
            )


@pytest.mark.long
def test_of_doors_in_a_row_none_is_closed_before_those_behind_it(stack: ExitStack, tmp_path: Path) -> None:
    door = RoomDoor(facts=("knowrob:jointPosition 1.57",))
    stage = flat(stack, replace(door, more=door.next_room() + door.next_room(2)), tmp_path)
    names = ("door", "door_2", "door_3")
    trace, again = Trace(), action("ClosingDoorsAgain", object_acted_on=tuple(map(stage.designator, names)))
    host = SimulationHost(stage.truth)
    assert run(partial(perform, again), host=host, executive=stage.executive, trace=trace, max_steps=30_000) == ()
    assert all(stage.truth.joint(name) < 0.05 for name in names)


def test_a_door_that_cannot_be_closed_again_is_named_and_no_failure(stack: ExitStack, tmp_path: Path) -> None:
    stage = flat(stack, RoomDoor(handles=(), facts=("knowrob:jointPosition 1.57",)), tmp_path)
    trace, again = Trace(), action("ClosingDoorsAgain", object_acted_on=stage.designator("door"))
    host = SimulationHost(stage.truth)
    assert run(partial(perform, again), host=host, executive=stage.executive, trace=trace) == ("door",)
    (told,) = (event for event in trace.events if event["event"] == "stays open")
    assert (told["name"], "has no handle" in told["because"]) == ("door", True)


def test_a_base_that_does_not_get_back_after_closing_doors_is_told_and_a_failure(
    stack: ExitStack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = flat(stack, RoomDoor(facts=("knowrob:jointPosition 0.8",)), tmp_path)
    monkeypatch.setattr("executive.modules.navigation.Navigation.execute", refused)
    monkeypatch.setattr("executive.modules.furniture.closing_again.apart", lambda *poses: (1.0, 0.0))
    trace, again = Trace(), action("ClosingDoorsAgain", object_acted_on=stage.designator("door"))
    with pytest.raises(NavigationFailure, match="does not get back"):
        run(partial(perform, again), host=SimulationHost(stage.truth), executive=stage.executive, trace=trace)
    assert [event["because"] for event in trace.events if event["event"] == "stays away"] == ["something is in the way"]


@pytest.mark.long
def test_what_later_steps_need_open_is_closed_in_the_end_and_the_base_is_back_in_its_place(
    stack: ExitStack, tmp_path: Path
) -> None:
    stage = flat(stack, RoomDoor(more=table(7.6) + RoomDoor().next_room()), tmp_path)
    module = load_plan(PlanSource(THERE_AND_BACK, "there_and_back.py"))
    run(partial(tidied, module.there_and_back), host=SimulationHost(stage.truth), executive=stage.executive)
    assert stage.truth.configuration().base == pytest.approx(HERE, abs=0.01)
    assert (stage.truth.joint("door") < 0.05, stage.truth.joint("door_2") < 0.05) == (True, True)


@pytest.mark.long
@pytest.mark.parametrize(
    ("handles", "match"),
    [
        ((), "door_2 has no handle"),
        ((1.0,), "door_2 has its handle on the other side and none on this; state one in the map"),
    ],
)
def test_what_keeps_a_door_on_the_way_closed_is_said(
    stack: ExitStack, tmp_path: Path, handles: tuple[float, ...], match: str
) -> None:
    stage = flat(stack, RoomDoor(more=table(7.6) + RoomDoor(handles=handles).next_room()), tmp_path)
    with pytest.raises(HandleNotReachable, match=match):
        drive_to_the_table(stage)
    assert stage.truth.joint("door") > 0.9 * 1.57
    assert stage.truth.joint("door_2") == 0.0


def test_a_handle_behind_a_closed_door_is_reached_once_that_is_open(stack: ExitStack, tmp_path: Path) -> None:
    stage = flat(stack, RoomDoor(more=RoomDoor().next_room()), tmp_path)
    with pytest.raises(BehindClosedDoor, match="door_2 is behind door, which is closed"):
        stage.do(OPEN, "door_2")


LAMP = """
Individual: lamp
    Types: knowrob:ElectricalLightingDevice
    Facts: knowrob:translation "2.6 0 0.9", knowrob:boundingBoxSize "0.2 0.2 0.32",
        knowrob:properPhysicalParts button_of_lamp, knowrob:stateOfObject knowrob:DeviceStateOn

Individual: button_of_lamp
    Types: knowrob:PushButton
    Facts: knowrob:relativeTo lamp, knowrob:translation "-0.105 0 0", knowrob:boundingBoxSize "0.01 0.03 0.03"
"""


OFF = """
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: : <http://example.org/off.owl#>
Prefix: m: <http://example.org/flat.owl#>
Ontology: <http://example.org/off.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: m:lamp
    Types: knowrob:ElectricalLightingDevice

Class: LampOff
    SubClassOf: knowrob:TurningOffPoweredDevice, knowrob:objectActedOn value m:lamp

Class: LightsOut
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some LampOff
"""


def test_a_door_is_opened_to_switch_a_device_behind_it(tmp_path: Path) -> None:
    (tmp_path / "flat.omn").write_text(RoomDoor(more=table(2.8) + LAMP).text(), encoding="utf-8")
    ended = planlang.simulate(OFF, robot="amigo", environment=tmp_path / "flat.omn", start=HERE)
    assert ended.outcome.value == "done"
    assert "lamp: off" in ended.final_state


def test_a_door_that_stands_half_open_is_opened_further(stack: ExitStack, tmp_path: Path) -> None:
    stage = flat(stack, RoomDoor(more=table(3.5), facts=("knowrob:jointPosition 0.8",)), tmp_path)
    wider = "door stands half-open: opening it further would make 0.87 m instead of 0.26 m"
    with pytest.raises(BehindClosedDoor, match=wider):
        next(stage.platform.resolver.bases(a_location(near=stage.designator("table"))))
    narrow = "door stands half-open and leaves 0.26 m; the robot needs 0.76 m; opening it further would make 0.87 m"
    with pytest.raises(NavigationPoseUnreachable, match=narrow):
        drive(stage, THERE)
    drive_to_the_table(stage)
    assert stage.truth.configuration().base[0] > 0.5
    assert stage.truth.joint("door") > 0.9 * 1.57


def test_the_door_that_closes_the_way_to_a_fixed_pose_is_named(stack: ExitStack, tmp_path: Path) -> None:
    with pytest.raises(NavigationPoseUnreachable, match="door in doorway is closed"):
        drive(flat(stack, RoomDoor(), tmp_path), THERE)


@pytest.mark.long
def test_a_run_that_goes_on_in_the_world_as_it_was_left_knows_the_door_and_what_is_held(
    stack: ExitStack, tmp_path: Path
) -> None:
    """The robot's process was killed when it had opened the door on the way and taken the can behind it."""
    facts = 'Facts: knowrob:translation "3.3 0 0.8", knowrob:boundingBoxSize "0.066 0.066 0.12"'
    can = f"Individual: can\n    Types: knowrob:DrinkingCan\n    {facts}\n"
    door = RoomDoor(more=table(3.5) + can)
    stage = flat(stack, door, tmp_path)
    what = stage.designator("can")

    @plan
    async def fetch() -> None:
        opens = Recovery(ObjectUnreachable, open_what_is_in_the_way(what))
        await at_location(a_location(in_reach_of=what), grasp, opens)
        await sleep(120.0)
        await perform(action("Translation-LocationChange", x=-1.5, y=0.0, yaw=0.0))

    async def grasp() -> None:
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=a_location(in_center_of=what)))
        await perform(action("ClosingAGripper"))
        await perform(action("Reaching", to_location=a_posture("carrying")))

    trace, host = Trace(), SimulationHost(stage.truth)
    with pytest.raises(StepLimit):  # while it waits with the can
        run(fetch, host=host, executive=stage.executive, trace=trace, max_steps=6000, resumable=True)
    assert held_by(stage.truth, "can") == "robot"
    again = flat(stack, door, tmp_path)  # knows nothing of it yet
    platform = replace(again.platform, handle=stage.platform.handle)
    executive = RobotExecutive(platform, bundled_registry().resolve([]), stage.truth)
    past = Past(RecordedRun.of(trace.events))
    restore(executive, past)
    assert platform.belief.joint("door") == pytest.approx(stage.truth.joint("door"), abs=0.01)
    assert list(platform.belief.held) == ["can"]
    run(fetch, host=SimulationHost(stage.truth), executive=executive, trace=Trace(), resume=past)
    assert stage.truth.configuration().base[0] < 0.0
    assert held_by(stage.truth, "can") == "robot"
