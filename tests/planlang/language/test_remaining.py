"""What remains of a plan behind the step that runs, as actions with their values."""

from __future__ import annotations

import pytest
from loaded_plans import read

from planlang.designators import a_location, action, an_object, local_name
from planlang.language.loading import load_plan
from planlang.language.remaining import remaining_actions
from planlang.misuse import WrongType
from planlang.testing import Script, compiled, run_plan

HEAD = """
from functools import partial
from planlang import Recovery, action, an_object, at_location, par, perform, plan, seq
from planlang.designators import a_location
from planlang.failures import GraspMissed

KITCHEN = "http://example.org/kitchen.owl#"
DRAWER = an_object("Drawer", KITCHEN + "drawer1")
CUP, CAN = an_object("Cup", KITCHEN + "cup1"), an_object("Can", KITCHEN + "can1")
"""
KITCHEN = "http://example.org/kitchen.owl#"
DRAWER, CUP, CAN = (
    an_object(cls, f"{KITCHEN}{name}") for cls, name in (("Drawer", "drawer1"), ("Cup", "cup1"), ("Can", "can1"))
)


def told_at(cls: str, *lines: str) -> list[list[str]]:
    """Return what remains each time an action of a class is performed, of the plan ``serve`` in these lines."""
    module = load_plan(read(HEAD, *lines))
    told = list[list[str]]()
    script = Script().on(cls, does=lambda belief, action: told.append([str(one) for one in remaining_actions()]))
    run_plan(module.serve, script=script)
    return told


def named(cls: str, what: object) -> str:
    return str(action(cls, object_acted_on=what))


OPEN = '    await perform(action("OpeningAContainerArtifact", object_acted_on=DRAWER))'
CLOSE = '    await perform(action("ClosingAContainerArtifact", object_acted_on=drawer))'


def test_behind_a_step_remain_the_actions_after_it_with_the_values_of_parameters() -> None:
    told = told_at("OpeningAContainerArtifact", "@plan", "async def serve(drawer=DRAWER):", CLOSE, OPEN, CLOSE)
    assert told == [[named("ClosingAContainerArtifact", DRAWER)]]


def test_a_pose_with_negative_numbers_remains() -> None:
    drive = '    await perform(action("Translation-LocationChange", x=-1.5, y=0.0, yaw=-0.5))'
    told = told_at("OpeningAContainerArtifact", "@plan", "async def serve():", OPEN, drive)
    assert told == [[str(action("Translation-LocationChange", x=-1.5, y=0.0, yaw=-0.5))]]


def test_what_remains_of_an_inner_plan_comes_before_what_remains_of_the_outer() -> None:
    told = told_at(
        "OpeningAContainerArtifact",
        "@plan",
        "async def take(thing):",
        OPEN,
        '    await perform(action("PickingUpAnObject", object_acted_on=thing))',
        "@plan",
        "async def serve(drawer=DRAWER):",
        "    await take(CUP)",
        CLOSE,
    )
    assert told == [[named("PickingUpAnObject", CUP), named("ClosingAContainerArtifact", DRAWER)]]


def test_a_plan_that_is_called_later_is_told_with_what_it_is_called_with() -> None:
    told = told_at(
        "OpeningAContainerArtifact",
        "@plan",
        "async def take(thing, where=None):",
        '    there = a_location("there", on=where)',
        '    await perform(action("PickingUpAnObject", object_acted_on=thing, to_location=there))',
        "@plan",
        "async def serve(drawer=DRAWER):",
        OPEN,
        "    await seq(partial(take, CAN, where=drawer))",
    )
    there = a_location("there", on=DRAWER)
    assert told == [[str(action("PickingUpAnObject", object_acted_on=CAN, to_location=there))]]


def test_in_a_branch_remains_the_rest_of_it_and_of_the_plan_that_waits_for_it() -> None:
    told = told_at(
        "OpeningAContainerArtifact",
        "@plan",
        "async def serve(thing=CUP):",
        "    async def body():",
        '        await perform(action("Reaching", to_location=thing))',
        f"    {OPEN}",
        '        await perform(action("PickingUpAnObject", object_acted_on=thing))',
        "    await at_location(a_location(in_reach_of=thing), body)",
        '    await perform(action("PuttingDownAnObject", object_acted_on=thing))',
    )
    assert told == [[named("PickingUpAnObject", CUP), named("PuttingDownAnObject", CUP)]]


def test_of_what_only_the_running_plan_makes_nothing_is_told() -> None:
    told = told_at(
        "OpeningAContainerArtifact",
        "@plan",
        "async def serve(drawer=DRAWER):",
        OPEN,
        "    for each in (CUP, CAN):",
        '        await perform(action("PickingUpAnObject", object_acted_on=each))',
        '    await perform(action("Reaching", to_location=print(1)))',
    )
    assert told == [[]]


def test_in_a_round_of_a_loop_its_thing_is_known() -> None:
    told = told_at(
        "OpeningAContainerArtifact",
        "@plan",
        "async def serve(drawer=DRAWER):",
        "    for each in (CUP, CAN):",
        f"    {OPEN}",
        '        await perform(action("LookingForSomething", object_acted_on=each))',
    )
    assert told == [[named("LookingForSomething", CUP)], [named("LookingForSomething", CAN)]]


def test_outside_a_plan_with_a_text_nothing_remains() -> None:
    assert list(remaining_actions()) == []


def test_of_a_compiled_plan_remains_what_its_recipe_has_behind_the_step() -> None:
    told = list[list[str]]()
    script = Script().on(
        "ClosingAGripper", does=lambda belief, _: told.append([one.type for one in remaining_actions()])
    )
    run_plan(compiled("serve_a_drink"), script=script)
    assert [[local_name(one) for one in each] for each in told] == [
        ["LiftBottle", "ParkArm", "ReachToHandoverPose", "HandOverBottle"]
    ]


def test_a_plan_that_is_given_what_it_does_not_take_has_nothing_to_tell() -> None:
    inner = ("@plan", "async def put_back(drawer):", CLOSE)
    serve = ("@plan", "async def serve():", OPEN, "    await par(partial(put_back, CUP, CAN))")
    module, told = load_plan(read(HEAD, *inner, *serve)), list[list[str]]()
    script = Script().on(
        "OpeningAContainerArtifact", does=lambda belief, action: told.append([str(one) for one in remaining_actions()])
    )
    with pytest.raises(WrongType, match="takes 1 positional argument"):
        run_plan(module.serve, script=script)
    assert told == [[]]
