"""Robots that nobody has seen, and robots with a hand full, find places like any other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from executive.robots import Robot, bind_robot
from executive.robots.arms import with_carrying
from planlang import at_location, perform
from planlang.designators import Location, a_device, a_location, a_person, action, an_object
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.ontology import Ontology
from sim import Body
from tests.executive.conftest import (
    BOTTLE,
    CABINET,
    PLACE,
    THE_BOTTLE,
    WARD,
    MakeStage,
    Stage,
    furnisher,
    hold_bottle,
    model_of,
    stand,
)
from tests.executive.locations.conftest import Judge, MakeJudge
from tests.support.examples import some

NUMBERS = """name = "{name}"
urdf = "{name}.urdf"
{torso}
[base]
radius = {radius}
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
"""
ARM = """[arms.{name}]
tip = "{name}_grip"
hand = "{name}_palm"
{side}
approach = [1, 0, 0]
closing = [0, 1, 0]
[arms.{name}.gripper]
opened = {{ {name}_finger1 = 0.0, {name}_finger2 = 0.0 }}
closed = {{ {name}_finger1 = -0.044, {name}_finger2 = 0.044 }}
fingers = ["{name}_finger_link1", "{name}_finger_link2"]
max_opening = 0.085
"""


def box(name: str, size: str, at: str) -> str:
    """A link that is a box."""
    shape = f'<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'
    return f'<link name="{name}">{shape}</link>'


def joint(name: str, kind: str, ends: tuple[str, str], at: str, axis: str = "0 0 1", span: float = 2.9) -> str:
    """A joint between two links, its limits at both sides of zero."""
    low, high = (0.0, span) if kind == "prismatic" and axis == "0 0 1" else (-span, span)
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{ends[0]}"/><child link="{ends[1]}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="1" effort="10"/></joint>'
    )


def arm(name: str, carrier: str, at: str, links: tuple[tuple[str, float, float], ...]) -> str:
    """An arm of turning joints, each with its axis and the length of its link [m], span [rad]; a gripper at its end."""
    text, parent, place = "", carrier, at
    for number, (axis, length, span) in enumerate(links):
        link = f"{name}_link{number}"
        text += box(link, f"{max(length - 0.04, 0.03)} 0.05 0.05", f"{length / 2} 0 0")
        text += joint(f"{name}_joint{number}", "revolute", (parent, link), place, axis, span)
        parent, place = link, f"{length} 0 0"
    text += box(f"{name}_palm", "0.05 0.13 0.04", "0.03 0 0")
    text += joint(f"{name}_mount", "fixed", (parent, f"{name}_palm"), "0.03 0 0")
    for number, side in enumerate((0.052, -0.052), 1):
        text += box(f"{name}_finger_link{number}", "0.08 0.015 0.03", "0.04 0 0")
        ends = (f"{name}_palm", f"{name}_finger_link{number}")
        text += joint(f"{name}_finger{number}", "prismatic", ends, f"0.06 {side} 0", "0 1 0", 0.045)
    text += f'<link name="{name}_grip"/>'
    return text + joint(f"{name}_tool", "fixed", (f"{name}_palm", f"{name}_grip"), "0.11 0 0")


def written(folder: Path, name: str, links: str, radius: float, arms: tuple[str, ...], torso: str = "") -> Robot:
    """The robot of a URDF and a description file."""
    (folder / f"{name}.urdf").write_text(f'<robot name="{name}">{links}</robot>')
    text = NUMBERS.format(name=name, radius=radius, torso=torso and f'torso = "{torso}"')
    for each in arms:
        text += ARM.format(name=each, side=f'side = "{each}"' if len(arms) > 1 else "")
    (folder / f"{name}.toml").write_text(text)
    return with_carrying(bind_robot(folder / f"{name}.toml"))


def tricycle(folder: Path) -> Robot:
    """Five joints on a tricycle, beside its middle: it cannot turn its hand as it likes."""
    chassis = box("chassis", "0.5 0.4 0.3", "0 0 0.2") + box("wheel", "0.1 0.05 0.1", "0 0 0")
    chassis += joint("fork", "fixed", ("chassis", "wheel"), "0.3 0 0.05")
    chassis += box("mast", "0.1 0.1 0.5", "0 0 0.25") + joint("mount", "fixed", ("chassis", "mast"), "0.12 0.03 0.35")
    pitches = (("0 1 0", 0.4, 1.8), ("0 1 0", 0.34, 2.6), ("0 1 0", 0.08, 2.0))
    links = (("0 0 1", 0.0, 2.9), *pitches, ("1 0 0", 0.02, 3.0))
    return written(folder, "tricycle", chassis + arm("only", "mast", "0 0 0.6", links), 0.4, ("only",))


def twin(folder: Path) -> Robot:
    """Two short arms of six joints on a column that slides up by half a metre."""
    body = box("foot", "0.5 0.5 0.2", "0 0 0.12") + box("column", "0.12 0.12 0.3", "0 0 -0.15")
    body += joint("slide", "prismatic", ("foot", "column"), "0 0 0.75", "0 0 1", 0.5)
    wrist = (("0 0 1", 0.0, 2.0), ("0 1 0", 0.05, 2.0), ("1 0 0", 0.04, 3.0))
    links = (("0 0 1", 0.0, 2.0), ("0 1 0", 0.26, 1.9), ("0 1 0", 0.24, 2.6), *wrist)
    arms = arm("left", "column", "0.05 0.16 0", links) + arm("right", "column", "0.05 -0.16 0", links)
    return written(folder, "twin", body + arms, 0.36, ("left", "right"), "slide")


Furnish = Callable[[Robot], "Callable[..., Stage]"]


@pytest.fixture
def furnish_for(vocabulary: Ontology) -> Iterator[Furnish]:
    """Furnishes rooms for a robot."""
    running = []

    def make(robot: Robot) -> Callable[..., Stage]:
        running.append(furnisher(model_of(robot), vocabulary))
        return next(running[-1])

    yield make
    for one in running:
        next(one, None)


def assert_grasps(stage: Stage, robot: Robot, location: object, count: int) -> set[str]:
    """From some places the bottle is grasped as an independent judge sees it, and the places hold; the arms used."""
    judge, used = Judge(robot, stage.planning), set()
    places = list(islice(stage.resolver.bases(location), count))  # type: ignore[arg-type]
    try:
        for place in places:
            stand(stage, place.base)
            model = next(model for model in stage.platform.scene.arms.all if model.name == place.detail["arm"])
            hand = a_location(in_center_of=THE_BOTTLE, grasp="side")
            way = next(stage.resolver.hands(hand, model, stage.platform.arm_joints(model)))
            judge.assert_possible(way, place.base, stage)
            assert stage.resolver.holds(location)  # type: ignore[arg-type]
            used.add(model.name)
    finally:
        judge.close()
    assert len(places) == count
    return used


@pytest.mark.long
def test_five_joints_on_a_tricycle_grasp_from_the_side(tmp_path: Path, furnish_for: Furnish) -> None:
    robot = tricycle(tmp_path)
    stage = furnish_for(robot)(CABINET, BOTTLE)
    assert_grasps(stage, robot, a_location(in_reach_of=THE_BOTTLE, grasp="side"), 3)


@pytest.mark.long
def test_two_arms_on_a_sliding_column_grasp_high_and_low_things_each(tmp_path: Path, furnish_for: Furnish) -> None:
    robot = twin(tmp_path)
    left = a_location(in_reach_of=THE_BOTTLE, using=a_device("LeftArm"), grasp="side")
    heights = []
    for top in (0.55, 0.95):
        below = replace(CABINET, pose=Pose((1.6, 0.0, top / 2)), size=(0.4, 0.8, top))
        stage = furnish_for(robot)(below, replace(BOTTLE, pose=Pose((1.5, 0.0, top + 0.1))))
        assert assert_grasps(stage, robot, left, 2) == {"left"}
        model = stage.platform.scene.arms.of(a_device("LeftArm"))[0]
        hand = a_location(in_center_of=THE_BOTTLE, grasp="side")
        way = next(stage.resolver.hands(hand, model, stage.platform.arm_joints(model)))
        heights.append(float(way.joints[1][model.joints.index("slide")]))
    assert heights[1] > heights[0] + 0.1, "the column lifts the arm to the higher one"


CUP = Body("cup", Pose((1.5, 0.3, 0.85)), (0.07, 0.07, 0.1), "cylinder", type="Cup", movable=True)
THE_CUP, THE_BED = an_object("Cup", PLACE + "cup"), an_object("Bed-PieceOfFurniture")
BEFORE, GRASPED = a_location(in_front_of=THE_CUP), a_location(in_center_of=THE_CUP)
OFFERED = a_location(in_reach_of=a_person("Patient"))
RIGHT = a_device("RightArm")


def arm_for(stage: Stage, location: Location) -> str:
    """The arm with which the first place was found."""
    return str(next(stage.resolver.bases(location)).detail["arm"])


@pytest.mark.parametrize(("full", "free", "y"), some([("right", "left", 0.9), ("left", "right", -0.9)]))
def test_a_thing_is_taken_with_the_free_hand_while_what_is_held_is_offered_and_put_down(
    full: str, free: str, y: float, make_stage: MakeStage, judge_of: MakeJudge
) -> None:
    beside = replace(CABINET, name="beside", pose=Pose((-1.7, y, 0.4)), size=(0.3, 0.3, 0.8))
    stage = make_stage(*WARD, beside, replace(CUP, pose=Pose((-1.7, y, 0.85))))
    hold_bottle(stage, full)
    for wanted in (THE_CUP, BEFORE, GRASPED):
        assert arm_for(stage, a_location(in_reach_of=wanted)) == free
    for wanted in (THE_BED, OFFERED, a_location(on=THE_BED)):
        assert arm_for(stage, a_location(in_reach_of=wanted)) == full
    both = next(stage.resolver.bases(a_location(in_reach_of=(OFFERED, GRASPED)))).base
    stand(stage, both)
    for name, hand in ((free, GRASPED), (full, OFFERED)):
        arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == name)
        way = next(stage.resolver.hands(hand, arm, stage.platform.arm_joints(arm)))
        assert way.arm.name == name
        judge_of(stage).assert_possible(way, both, stage)


def test_a_full_hand_that_is_asked_to_grasp_is_the_reason_for_the_failure(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, CUP)
    hold_bottle(stage, "right")
    said = "no hand is free for cup: right holds bottle"
    location = a_location(in_reach_of=THE_CUP, using=RIGHT)
    with pytest.raises(LocationUnresolvable, match=said):
        next(stage.resolver.bases(location))
    assert not stage.resolver.holds(location)
    arm = stage.platform.scene.arms.of(RIGHT)[0]
    with pytest.raises(LocationUnresolvable, match=said):
        next(stage.resolver.hands(BEFORE, arm, stage.platform.arm_joints(arm)))


def test_a_plan_takes_a_second_thing_with_its_free_hand(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, CUP)
    hold_bottle(stage, "right")

    async def take() -> None:
        await perform(action("Reaching", to_location=BEFORE))
        await perform(action("OpeningAGripper", object_acted_on=THE_CUP))
        await perform(action("Reaching", to_location=GRASPED))
        await perform(action("ClosingAGripper", object_acted_on=THE_CUP))

    async def plan() -> None:
        await at_location(a_location(in_reach_of=(THE_CUP, BEFORE, GRASPED)), take)

    stage.run(plan)
    assert {name: grip.arm for name, grip in stage.belief.held.items()} == {"bottle": "right", "cup": "left"}
