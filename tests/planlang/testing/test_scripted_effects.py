"""Effects of actions on the belief of a scripted robot: what it holds, and where things are."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial

import pytest

from planlang import *
from planlang.designators import Action, Condition, Object
from planlang.testing import Script, run_plan

BOTTLE = an_object("DrinkingBottle", "http://example.org/map#bottle1")
CUP, TABLE, GUEST = an_object("Cup"), an_object("Table"), a_person("Guest")
ON_TABLE = a_location(on=TABLE)


def performs_in_turn(*actions: Action) -> Callable[[], Awaitable[None]]:
    async def main() -> None:
        for one in actions:
            await perform(one)

    return main


@pytest.mark.parametrize(
    "actions",
    [
        [action("PuttingDownAnObject", object_acted_on=CUP, to_location=ON_TABLE)],
        [action("http://example.org/o#Lay", below="PuttingSomethingSomewhere", object_acted_on=CUP, to_location=TABLE)],
        [action("TransportingAnObject", object_acted_on=CUP, to_location=ON_TABLE)],
        [action("LoweringAnObject", to_location=ON_TABLE), action("OpeningAGripper", object_acted_on=CUP)],
        [action("Reaching", to_location=ON_TABLE), action("OpeningAGripper")],
    ],
    ids=lambda actions: str(actions[0].type),
)
@pytest.mark.parametrize("held", [[CUP], [CUP, BOTTLE]], ids=["alone", "beside-another"])
def test_the_goal_of_a_task_that_puts_something_down_holds_at_its_end(
    actions: list[Action], held: list[Object]
) -> None:
    script = Script().performs("PuttingDownAnObject", "PuttingSomethingSomewhere", "TransportingAnObject")
    belief = run_plan(performs_in_turn(*actions), script=script.holding(*held)).belief
    assert belief.holds(located(ON_TABLE, CUP))
    assert not belief.holds(holding(CUP))
    assert not belief.holds(located(a_location(on=BOTTLE), CUP))
    assert not belief.holds(located(~ON_TABLE, CUP))


@pytest.mark.parametrize(
    "where", [{"in_center_of": TABLE}, {"in_front_of": GUEST}, {"in_front_of": GUEST, "on": TABLE}]
)
def test_an_object_put_down_is_wherever_the_location_says(where: dict[str, Object]) -> None:
    put = action("PuttingDownAnObject", object_acted_on=CUP, to_location=a_location(**where))
    script = Script().performs("PuttingDownAnObject").holding(CUP)
    assert run_plan(performs_in_turn(put), script=script).belief.at == {
        "Cup": where.get("on", next(iter(where.values()))).name
    }


def test_a_thing_of_which_nobody_said_where_it_is_is_located_nowhere() -> None:
    belief = run_plan(performs_in_turn(), script=Script()).belief
    assert not belief.holds(located(ON_TABLE, CUP))


def test_what_is_delivered_is_at_its_recipient_and_what_is_lifted_in_vain_is_at_no_place() -> None:
    deliver = performs_in_turn(action("DeliveringAnObject", object_acted_on=CUP, recipient=GUEST))
    assert run_plan(deliver, script=Script().performs("DeliveringAnObject")).belief.at == {"Cup": "Guest"}
    lift = performs_in_turn(action("Reaching", to_location=a_location(above=CUP)), action("OpeningAGripper"))
    assert run_plan(lift, script=Script().holding(CUP)).belief.at == {}


def test_scripted_actions_need_the_parts_of_the_robot_that_the_vocabulary_states() -> None:
    left, right = a_device("LeftArm"), a_device("RightArm")
    reach = partial(perform, action("Reaching", to_location=ON_TABLE, device_used=left))
    close = partial(perform, action("ClosingAGripper", device_used=right))
    lower = partial(perform, action("LoweringAnObject", to_location=ON_TABLE, device_used=right))
    assert run_plan(partial(par, reach, close)).seconds == 1.0
    assert run_plan(partial(par, reach, lower)).seconds == 2.0, "two arms on one torso take turns"


def test_a_class_of_the_vocabulary_is_performed_as_the_one_above_it() -> None:
    door = an_object("Door", "http://example.org/map#door1")
    run = run_plan(performs_in_turn(action("OpeningADoor", object_acted_on=door)))
    assert run.belief.holds(Condition("open", (door,)))
    assert not run.belief.holds(Condition("closed", (door,)))
