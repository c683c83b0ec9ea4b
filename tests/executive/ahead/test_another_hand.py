"""A thing is grasped with the hand that leaves the other one for what the next steps take beside it."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from executive.ahead.later_steps import fetched_beside
from planlang.designators import Action, Location, Object, a_location, action
from planlang.geometry import Pose
from planlang.state import WorldState
from tests.support.leaves import Room, room, thing


@pytest.fixture
def stage(stack: ExitStack) -> Room:
    """A can and a cup on a table."""
    things = (
        thing("table", "KitchenTable", Pose((1.0, 0.0, 0.37)), (0.6, 1.2, 0.74)),
        thing("can", "TinCan", Pose((0.85, 0.0, 0.79)), (0.07, 0.07, 0.1)),
        thing("cup", "Cup", Pose((0.85, 0.4, 0.79)), (0.07, 0.07, 0.1)),
    )
    return room(stack, things)


def still_to_do(monkeypatch: pytest.MonkeyPatch, *steps: Action) -> None:
    """Let these steps remain of the plan."""
    monkeypatch.setattr("executive.ahead.later_steps.remaining_actions", lambda: iter(steps))


def test_what_is_taken_beside_a_thing_is_that_of_the_next_step_unless_the_thing_is_brought_away_before(
    stage: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    can, cup, table = map(stage.designator, ("can", "cup", "table"))
    lifting, fetching = action("Lifting", object_acted_on=can), action("FetchingAnObject", object_acted_on=cup)
    bringing = action("DeliveringAnObject", object_acted_on=can, to_location=table)

    def beside(*steps: Action) -> Object | None:
        still_to_do(monkeypatch, *steps)
        return fetched_beside("can", stage.platform.scene)

    assert beside() is None
    assert beside(lifting, fetching, bringing) == cup
    assert beside(lifting, bringing, fetching) is None
    assert beside(action("LookingAtSomething", object_acted_on=table), lifting) is None
    assert beside(action("FetchingAnObject", object_acted_on=Object("Cup"))) is None, "which one is not known yet"


def test_the_first_base_pose_is_that_of_the_hand_which_leaves_the_other_for_what_is_taken_next(
    stage: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = a_location(in_reach_of=stage.designator("can"))
    usual = next(stage.executive.solutions(where)).detail["arm"]
    still_to_do(monkeypatch, action("FetchingAnObject", object_acted_on=stage.designator("cup")))
    asked = list[str]()

    def reaches(beside: Location, state: WorldState) -> bool:
        asked.append(str(beside))
        return state.held["can"].arm != usual

    monkeypatch.setattr(stage.platform.ahead, "reaches", reaches)
    solutions = stage.executive.solutions(where)
    assert next(solutions).detail["arm"] != usual
    assert next(solutions).detail["arm"] == usual
    assert set(asked) == {"in_reach_of(cup)"}
