"""Rubbish is dropped into a bin from above its rim; tests/executive/into_the_bin has a kitchen with one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executive.maps.hollow import open_at
from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file
from planlang import perform
from planlang.designators import a_location, action, an_object
from planlang.failures import LocationUnresolvable
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.state.matter import Portion
from sim import Body
from sim.truth import at_rest_on
from tests.executive.conftest import BED, BOTTLE, CABINET, PLACE, THE_BOTTLE, MakeStage, Stage, hold_bottle, stand

KITCHEN = Path(__file__).with_name("into_the_bin")
THE_BIN = an_object("WasteBasket", PLACE + "bin")
IN_THE_BIN = a_location(in_=THE_BIN)


def a_bin(wide: float, high: float, at_floor: float = 0.0, **more: object) -> Body:
    """A bin that is open at the top, away from everything."""
    size = (wide, wide, high)
    hollow = {"cavities": tuple(open_at(size, ["+z"])), "largest_drop": 1.2}
    body = Body("bin", Pose((0.0, 2.0, at_floor + high / 2)), size, type="WasteBasket", **hollow)  # type: ignore[arg-type]
    return replace(body, **more)  # type: ignore[arg-type]


def stage_with(make_stage: MakeStage, *bodies: Body, bottle: Body = BOTTLE) -> Stage:
    """A robot that holds the bottle."""
    stage = make_stage(BED, CABINET, bottle, *bodies)
    hold_bottle(stage)
    return stage


def lower(stage: Stage) -> float:
    """Lower the bottle into the bin; the height of its bottom where the hand stops [m]."""
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=IN_THE_BIN))).base)

    async def plan() -> None:
        await perform(action("LoweringAnObject", object_acted_on=THE_BOTTLE, to_location=IN_THE_BIN))

    stage.run(plan)
    return stage.truth.pose("bottle").position[2] - BOTTLE.size[2] / 2


def let_go(stage: Stage) -> None:
    """Open the hand."""

    async def plan() -> None:
        await perform(action("OpeningAGripper", object_acted_on=THE_BOTTLE))

    stage.run(plan)


@pytest.mark.parametrize("robot", ["amigo.omn", pytest.param("pr2.toml", marks=pytest.mark.pr2)])
def test_a_can_is_thrown_into_a_waste_basket_on_the_floor(robot: str) -> None:
    robot_file = bundled("ontologies") / "robots" / robot
    options = RunOptions(recipe=KITCHEN / "throw_away.omn", robot=robot_file, environment=KITCHEN / "home.omn")
    run = run_plan_file(options)
    assert run.final_state[0] == "can1: at rest in bin1", run.message


def test_what_is_let_go_above_the_rim_falls_to_the_bottom_and_is_believed_there(make_stage: MakeStage) -> None:
    stage = stage_with(make_stage, a_bin(0.3, 0.45))
    assert lower(stage) > 0.45
    let_go(stage)
    assert stage.truth.pose("bottle").position[2] == pytest.approx(0.02 + BOTTLE.size[2] / 2, abs=0.005)
    assert stage.resolver.holds(IN_THE_BIN, THE_BOTTLE)
    assert stage.belief.pose("bottle").distance(stage.truth.pose("bottle")) < 0.005


def test_what_can_be_put_down_on_the_bottom_is_not_dropped(make_stage: MakeStage) -> None:
    stage = stage_with(make_stage, a_bin(0.6, 0.25, at_floor=0.5))
    assert lower(stage) < 0.53


def test_where_the_bottom_is_full_it_falls_onto_what_is_there(make_stage: MakeStage) -> None:
    box = Body("box", Pose((0.0, 2.0, 0.07)), (0.24, 0.24, 0.1), type="CardboardBox", movable=True)
    stage = stage_with(make_stage, a_bin(0.3, 0.45), box)
    lower(stage)
    let_go(stage)
    assert at_rest_on(stage.truth, "bottle") == "box"
    assert stage.resolver.holds(IN_THE_BIN, THE_BOTTLE)


@pytest.mark.parametrize(
    ("bin_", "bottle", "why"),
    [
        (a_bin(0.3, 0.45, largest_drop=0.3), BOTTLE, "is 0.43 m deep: its largestDrop is 0.3 m"),
        (a_bin(0.3, 0.45, largest_drop=0.0), BOTTLE, "if things may be dropped into bin, state its largestDrop"),
        (a_bin(0.3, 0.45, cavities=()), BOTTLE, 'is closed at the top: state openSide "\\+z" if it is open'),
        (a_bin(0.3, 0.45), replace(BOTTLE, content=(Portion("Water", 200.0),), capacity=500.0), "empty it first"),
    ],
    ids=["too deep", "not for that", "closed", "full bottle"],
)
def test_a_failure_says_why_a_thing_is_not_dropped(make_stage: MakeStage, bin_: Body, bottle: Body, why: str) -> None:
    stage = stage_with(make_stage, bin_, bottle=bottle)
    with pytest.raises(LocationUnresolvable, match=why):
        next(stage.resolver.bases(a_location(in_reach_of=IN_THE_BIN)))
