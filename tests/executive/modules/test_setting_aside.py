"""What cannot be used as it is held is put down near the robot, and grasped otherwise."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from dataclasses import replace

import pytest

from executive.locations.demands import hand_demand
from executive.locations.hand_predicates import Stage as SearchStage
from executive.locations.hand_predicates import candidates_of
from executive.locations.rejections import Rejections
from planlang import Recovery, perform, put_down_and_regrasp, with_failure_handling
from planlang.designators import Action, a_location, action, an_object
from planlang.failures import HandsFull, ObjectUndeliverable, PlanFailure
from planlang.geometry import Pose
from planlang.kernel import checkpoint
from planlang.testing import Script, run_plan
from sim import Body
from sim.truth import at_rest_on
from tests.executive.conftest import BED, BOTTLE, CABINET, PATIENT, THE_BOTTLE, MakeStage, Stage, hold_bottle
from tests.support.leaves import room, thing

GRASP = a_location(in_center_of=THE_BOTTLE)
ASIDE = action("SettingAsideAnObject", object_acted_on=THE_BOTTLE, for_another_grip=True)


def grasps(stage: Stage) -> tuple[int, int]:
    """How many grasps of the bottle there are, and how many were left out as they could not be used."""
    scene, log = stage.platform.scene, Rejections()
    tables = candidates_of(hand_demand(GRASP, scene, None), scene.arms.all[0], scene, log, SearchStage.ALL)
    return sum(map(len, tables)), log.counts["a grip that could not be used"]


def test_what_is_set_aside_stands_on_furniture_and_is_not_taken_by_the_same_grip(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, PATIENT)
    every, left_out = grasps(stage)
    assert left_out == 0
    hold_bottle(stage)

    async def plan() -> None:
        await perform(ASIDE)

    stage.run(plan)
    assert at_rest_on(stage.truth, "bottle") == "cabinet"
    assert list(stage.platform.belief.held) == []
    others, left_out = grasps(stage)
    assert left_out > 0
    assert 0 < others < every


def test_a_table_is_furniture_although_it_may_stand_elsewhere(make_stage: MakeStage) -> None:
    stage = make_stage(BOTTLE, replace(CABINET, type="KitchenTable", movable=True), PATIENT)
    hold_bottle(stage)

    async def plan() -> None:
        await perform(ASIDE)

    stage.run(plan)
    assert at_rest_on(stage.truth, "bottle") == "cabinet"


class Notes:
    """Notes where things are put down, and does nothing."""

    name = "notes"
    actions = ("Translation-LocationChange", "LoweringAnObject", "OpeningAGripper", "Reaching")
    failures = ()

    def __init__(self) -> None:
        self.onto = list[str]()

    def resources(self, asked: Action) -> tuple[str, ...]:
        return ()

    async def execute(self, asked: Action) -> None:
        await checkpoint()
        if asked.type == "LoweringAnObject":
            self.onto.append(str(asked.get("to_location")))


def test_doors_and_handles_are_no_furniture_on_which_to_put_something(stack: ExitStack) -> None:
    leaves = [
        part
        for name, y in (("left", 0.15), ("right", -0.15))
        for part in (
            thing(name, "Door", Pose((0.59, y, 1.4)), (0.02, 0.3, 1.1), f"grip_{name}"),
            thing(f"grip_{name}", "Handle", Pose((0.55, 0.3 * y, 1.2)), (0.012, 0.012, 0.15)),
        )
    ]
    case = thing("case", "Cupboard", Pose((0.8, 0.0, 1.0)), (0.4, 0.62, 2.0), "left", "right")
    table = thing("table", "KitchenTable", Pose((-1.2, -2.8, 0.37)), (0.8, 0.8, 0.74))
    stage, notes = (
        room(stack, (case, *leaves, table, thing("box", "Box", Pose((-3.0, 3.0, 0.03)), (0.06,) * 3))),
        Notes(),
    )
    arm = stage.platform.robot.arms[0]
    there = stage.truth.link_pose(arm.tip)
    stage.truth.set_pose("box", there)
    stage.truth.attach(arm.tip, "box")
    stage.platform.belief.grasped("box", arm.name, arm.tip, Pose((0.0, 0.0, 0.0)))
    stage.platform.observe()
    stage.executive.modules = (notes, *stage.executive.modules)
    stage.do("SettingAsideAnObject", "box")
    assert notes.onto == ["table"]


def failing(*failures: PlanFailure) -> Callable[[], Awaitable[None]]:
    """A plan that holds the bottle and cannot deliver it so often, with the recovery."""
    left = list(failures)

    async def fetch() -> None:
        await perform(action("ClosingAGripper", object_acted_on=THE_BOTTLE))

    async def deliver() -> None:
        if left:
            raise left.pop(0)

    async def plan() -> None:
        await fetch()
        regrasp = Recovery(ObjectUndeliverable, put_down_and_regrasp(THE_BOTTLE, fetch), retries=1)
        await with_failure_handling(deliver, regrasp)

    return plan


def test_what_cannot_be_delivered_is_put_down_grasped_again_and_delivered() -> None:
    run = run_plan(failing(ObjectUndeliverable()))
    assert run.failure is None
    assert (run.attempts("SettingAsideAnObject"), run.attempts("ClosingAGripper")) == (1, 2)


def test_where_no_hand_is_free_for_a_thing_what_one_holds_is_put_down_and_not_taken_again() -> None:
    cup, held = an_object("Cup"), [THE_BOTTLE]

    async def grasp() -> None:
        if held:
            held.clear()
            raise ObjectUndeliverable(what="bottle") from HandsFull(what="cup", held={"right": THE_BOTTLE})
        await perform(action("ClosingAGripper", object_acted_on=cup))

    async def plan() -> None:
        await perform(action("ClosingAGripper", object_acted_on=THE_BOTTLE))
        await with_failure_handling(grasp, Recovery(ObjectUndeliverable, put_down_and_regrasp(cup), retries=1))

    run = run_plan(plan)
    assert run.failure is None
    assert (run.attempts("SettingAsideAnObject"), run.attempts("ClosingAGripper")) == (1, 2)
    assert run.belief.holding == ["Cup"]


def test_what_is_put_down_as_its_hand_is_needed_may_be_taken_by_the_same_grip(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, PATIENT)
    every, _ = grasps(stage)
    hold_bottle(stage)

    async def plan() -> None:
        await perform(action("SettingAsideAnObject", object_acted_on=THE_BOTTLE))

    stage.run(plan)
    assert at_rest_on(stage.truth, "bottle") == "cabinet"
    assert grasps(stage) == (every, 0)


def test_what_cannot_be_grasped_otherwise_stays_where_it_was_put_and_the_first_failure_is_reported() -> None:
    first = ObjectUndeliverable(what="bottle")
    script = Script().on("ClosingAGripper", since=2.0, fails=PlanFailure)
    run = run_plan(failing(first), script=script)
    assert run.failure is first
    assert run.belief.holding == []


SEATED = replace(PATIENT, pose=Pose((-0.9, 0.0, 0.8)), size=(0.6, 0.5, 1.2))
ARMCHAIR = Body("armchair", Pose((-0.9, 0.0, 0.25)), (0.8, 0.8, 0.5), type="Chair-PieceOfFurniture")
"""A person in a chair, nearer to the robot than the cabinet."""


@pytest.mark.parametrize("people", [(SEATED,), ()], ids=["where a person sits", "on an empty chair"])
def test_nothing_is_set_aside_on_what_people_sit_on_while_there_is_a_table(
    make_stage: MakeStage, people: tuple[Body, ...]
) -> None:
    stage = make_stage(BOTTLE, CABINET, ARMCHAIR, *people)
    hold_bottle(stage)
    stage.run(lambda: perform(action("SettingAsideAnObject", object_acted_on=THE_BOTTLE)))
    assert at_rest_on(stage.truth, "bottle") == "cabinet"


def test_what_is_held_stays_in_the_hand_if_people_sit_on_all_furniture_near_by(make_stage: MakeStage) -> None:
    stage = make_stage(BOTTLE, ARMCHAIR, SEATED)
    hold_bottle(stage)
    emptying = action("EmptyingTheHands", after_failure=("ContainerStuck", "EnvironmentManipulationFailure"))
    (told,) = stage.run(lambda: perform(emptying))
    assert told.startswith("bottle stays in the hand")
    assert stage.executive.held() == ("bottle",)


@pytest.mark.parametrize(
    ("kinds", "rests"),
    [(("HandoverNotTaken", "CommunicationFailure"), "cabinet"), (("GripperGoalNotReached", "GripperFailure"), None)],
)
def test_ontologies_state_after_which_failures_the_hands_are_emptied(
    make_stage: MakeStage, kinds: tuple[str, ...], rests: str | None
) -> None:
    stage = make_stage(BOTTLE, CABINET)
    hold_bottle(stage)
    told = stage.run(lambda: perform(action("EmptyingTheHands", after_failure=kinds)))
    assert told == (() if rests is None else (f"bottle was put down on {rests}",))
    assert at_rest_on(stage.truth, "bottle") == rests
