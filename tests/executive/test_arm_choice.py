"""Choices of a run: the arm, one of several alternatives, where the robot stands when it begins."""

from __future__ import annotations

import json
import re
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.modules.arm_choices import ArmChoices
from executive.modules.gripper import Grasping
from executive.robots import bind_robot
from executive.robots.arms import with_carrying
from executive.runs.assembly import world_at_start
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.plan_run import run_plan_file
from planlang import VirtualHost, checkpoint, par, perform, run, seq
from planlang.designators import a_device, a_location, action, an_object
from planlang.diagnostics import BadInput
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.protocols import Solution
from planlang.state import Hold
from sim import Body, Scene
from tests.executive.conftest import CABINET, PLACE, MakeStage

CHOICES = "right", "left"


def test_side_by_side_each_strand_keeps_its_own_arm() -> None:
    choices, seen = ArmChoices(), []

    async def one(arm: str) -> None:
        choices.choose(arm)
        await checkpoint()
        seen.append((arm, choices.mine(), choices.others()))
        await checkpoint()

    async def plan() -> None:
        await par(lambda: one("right"), lambda: one("left"))

    run(plan, host=VirtualHost())
    assert seen == [("right", "right", {"left"}), ("left", "left", {"right"})]


def test_a_strand_goes_on_with_what_was_chosen_before_it_and_inside_of_it() -> None:
    choices, seen = ArmChoices(), []

    async def look() -> None:
        seen.append(choices.mine())

    async def reach() -> None:
        choices.choose("left")
        await checkpoint()

    async def plan() -> None:
        assert choices.mine() is None
        await par(reach, look)  # reach chooses, and what comes after both goes on with it
        seen.append(choices.mine())
        choices.choose("right")
        await seq(look, lambda: par(look, look))
        assert choices.others() == frozenset()

    run(plan, host=VirtualHost())
    assert seen == [None, "left", "right", "right", "right"]


def test_where_no_plan_runs_the_last_choice_counts() -> None:
    choices = ArmChoices()
    for arm in CHOICES:
        choices.choose(arm)
        assert (choices.mine(), choices.others()) == (arm, frozenset())


def test_what_is_done_at_a_place_is_done_with_the_arm_it_was_found_for(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET)
    opens = Grasping(stage.executive.platform)
    for arm in CHOICES:
        stage.executive.move_to(Solution((0.0, 0.0, 0.0), stage.executive.revision(), {"arm": arm}))
        assert opens.resources(action("OpeningAGripper", device_used=a_device("HolderGripper"))) == (arm,)
    stage.executive.move_to(Solution((0.0, 0.0, 0.0), stage.executive.revision(), {}))
    assert opens.resources(action("OpeningAGripper")) == (arm,)


def test_two_plans_side_by_side_take_two_things_with_two_arms(make_stage: MakeStage) -> None:
    bottles = [
        Body(name, Pose((1.5, y, 0.9)), (0.065, 0.065, 0.2), "cylinder", type="DrinkingBottle", movable=True)
        for name, y in (("first", -0.2), ("second", 0.2))
    ]
    stage = make_stage(CABINET, *bottles, start=(0.83, 0.0, 0.0))

    async def take(name: str) -> None:
        what = an_object("DrinkingBottle", PLACE + name)
        await perform(action("Reaching", to_location=a_location(in_front_of=what)))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=a_location(in_center_of=what)))
        await perform(action("ClosingAGripper", object_acted_on=what))

    async def plan() -> None:
        await par(lambda: take("first"), lambda: take("second"))

    stage.run(plan)
    held = {name: grip.arm for name, grip in stage.belief.held.items()}
    assert sorted(held) == ["first", "second"]
    assert sorted(held.values()) == ["left", "right"]


ONTOLOGIES = bundled("ontologies")
PLAN = Path(__file__).parents[1] / "diagnostics" / "X008_without_gripper.plan"


@pytest.fixture
def options(tmp_path: Path) -> RunOptions:
    """A run of the plan in the bundled room with the bundled robot, its grippers taken off."""
    robots = ONTOLOGIES / "robots"
    urdf, robot = tmp_path / "handless.urdf", tmp_path / "handless.omn"
    shape = (robots / "amigo.urdf").read_text(encoding="utf-8")
    urdf.write_text(re.sub(r'(<joint name="finger[^"]*" type=")revolute"', r'\1fixed"', shape), encoding="utf-8")
    frames = (robots / "amigo.omn").read_text(encoding="utf-8").split("\n\n")
    robot.write_text("\n\n".join(f for f in frames if not re.match(r"Individual: \w+_gripper\b", f)), encoding="utf-8")
    room = ONTOLOGIES / "environments" / "hospital_room.omn"
    return RunOptions(recipe=PLAN, robot=robot, urdf=urdf, environment=room, trace=tmp_path / "run.jsonl")


def told(result: RunResult) -> list[tuple[str, str, int]]:
    return [
        (found.severity.value, Path(found.span.file).name, found.span.line)
        for found in result.diagnostics
        if found.code == "X008" and found.span is not None
    ]


@pytest.mark.long
def test_an_alternative_that_the_robot_cannot_do_is_told_and_the_plan_runs(options: RunOptions) -> None:
    result = run_plan_file(options)
    assert told(result) == [("note", PLAN.name, 29)]
    assert (result.outcome, result.failures) == (Outcome.DONE, ())
    assert options.trace is not None
    header = json.loads(options.trace.read_text(encoding="utf-8").splitlines()[0])
    assert header["infeasible"] == ["grasp"]


def test_a_plan_of_such_alternatives_only_is_refused(options: RunOptions) -> None:
    result = run_plan_file(replace(options, task="grasp"))
    assert (result.outcome, result.failures) == (Outcome.LACKS_CAPABILITY, ("MissingCapability",))
    assert told(result) == []


ROBOT = """
name = "mine"
urdf = "robot.urdf"
[base]
radius = 0.2
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
"""
URDF = """<robot name="mine"><link name="base">
  <collision><origin xyz="0 0 0.5"/><geometry><box size="0.2 0.2 1"/></geometry></collision>
  <collision><origin xyz="0.5 0 1"/><geometry><box size="1 0.1 0.1"/></geometry></collision>
</link></robot>"""
SHELF = Body("shelf", Pose((0.8, 0.0, 0.75)), (0.4, 2.0, 1.5))


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A pole on a small base that reaches 1 m ahead of it."""
    (tmp_path / "robot.urdf").write_text(URDF)
    (tmp_path / "robot.toml").write_text(ROBOT)
    return tmp_path / "robot.toml"


def test_a_robot_starts_where_its_arms_have_room_too(robot: Path) -> None:
    with ExitStack() as stack:
        world = world_at_start(Scene((SHELF,), (-2, -2, 2, 2)), bind_robot(robot), None, stack)
        assert world.scene.start == world.configuration().base
        assert world.scene.start[0] < -0.39, "the nearest place with room for the base alone would be at 0"
        assert not world.contacts()


def test_a_robot_that_holds_something_starts_where_that_has_room_too() -> None:
    pole, amigo = Body("pole", Pose((0.0, 0.0, -100.0)), (0.8, 0.03, 0.03)), bind_robot("amigo")
    arm = amigo.arm("right")
    held = Hold(arm.name, arm.tip, Pose((0.35, 0.0, 0.0)))
    scene = Scene((SHELF, pole), (-3, -3, 3, 3))
    robot = with_carrying(amigo, {"pole": held}, scene)
    with ExitStack() as stack:
        bare, full = (world_at_start(scene, robot, None, stack, things) for things in ({}, {"pole": held}))
        for world in (bare, full):
            world.set_pose("pole", world.link_pose(held.link) @ held.offset)
            world.attach(held.link, "pole")
        assert "shelf" in bare.touched_since_grasp("pole")
        assert "shelf" not in full.touched_since_grasp("pole")


def test_a_robot_whose_arms_have_room_nowhere_has_no_place_to_start(robot: Path) -> None:
    with ExitStack() as stack, pytest.raises(BadInput) as caught:
        world_at_start(Scene((SHELF,), (-0.3, -0.3, 0.3, 0.3)), bind_robot(robot), None, stack)
    assert [diagnostic.code for diagnostic in caught.value.diagnostics] == ["X003"]


LEFT = """
Prefix: : <http://example.org/take.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: t: <http://planlang.org/kb/tea_room.owl#>
Ontology: <http://example.org/take.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: t:cup3
    Types: knowrob:Cup
Individual: leftHand
    Types: knowrob:LeftHand
Class: TakeTheCup
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Take
Class: Take
    SubClassOf: knowrob:PickingUpAnObject, knowrob:objectActedOn value t:cup3, knowrob:deviceUsed value leftHand
"""


def test_an_arm_that_a_recipe_names_and_the_robot_lacks_is_missed_before_anything_moves(tmp_path: Path) -> None:
    amigo = bundled("ontologies") / "robots" / "amigo.toml"
    text = re.sub(r"(?m)^\[arms\.left.*\]\n(.+\n)+|^self_model = .*\n", "", amigo.read_text(encoding="utf-8"))
    (tmp_path / "one_arm.toml").write_text(text.replace('name = "amigo"', 'name = "one_arm"'), encoding="utf-8")
    (tmp_path / "amigo.urdf").write_bytes((amigo.parent / "amigo.urdf").read_bytes())
    (tmp_path / "take.omn").write_text(LEFT, encoding="utf-8")
    said = "one_arm has no leftHand; its arms: right"
    robot, recipe = str(tmp_path / "one_arm.toml"), str(tmp_path / "take.omn")
    matched = CliRunner().invoke(app, ["match", recipe, "--robot", robot])
    assert matched.exit_code == 3
    assert said in matched.output
    ran = CliRunner().invoke(app, ["run", recipe, "--robot", robot, "--environment", "tea_room"])
    assert ran.exit_code == 3
    assert said in ran.output
