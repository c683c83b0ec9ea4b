"""Dishes are taken by their rims, flat things from above, cloth by a fold; what is too heavy is left where it is."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from executive.locations.grasps_from_above import CLEARANCES, from_above, grips, is_low
from executive.locations.hand_predicates import Stage, candidates_of
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections
from executive.robots.arms import HandFrame
from executive.robots.openings import Openings
from planlang import perform
from planlang.designators import a_location, action, an_object
from planlang.failures import LocationUnresolvable, TooHeavy
from planlang.geometry import Pose
from planlang.geometry.areas import Block
from planlang.relations.demands import Reach, ReachKind
from sim import Body
from sim.bodies import plain
from sim.scene import Cavity, Handle
from sim.truth import held_by
from tests.executive.conftest import BED, BOTTLE, CABINET, PLACE, THE_BOTTLE, MakeStage, stand
from tests.support.examples import some
from tests.support.leaves import drawn, room

TOP = 0.8
"""Height of the cabinet [m]."""


def lying(name: str, cls: str, size: tuple[float, float, float], shape: str = "box", **more: object) -> Body:
    """A thing on the cabinet, near the edge before the robot."""
    return Body(name, Pose((1.52, 0.0, TOP + size[2] / 2)), size, shape, type=cls, movable=True, **more)  # type: ignore[arg-type]


THINGS = {
    "plate": lying("plate", "DinnerPlate", (0.24, 0.24, 0.025), "cylinder", wall=0.008, largest_tilt=math.radians(15)),
    "bowl": lying("bowl", "Bowl-Mixing", (0.22, 0.22, 0.1), "cylinder", wall=0.006, largest_tilt=math.radians(15)),
    "mug": lying("mug", "DrinkingMug", (0.14, 0.14, 0.12), "cylinder", wall=0.004, largest_tilt=math.radians(15)),
    "glass": lying("glass", "DrinkingGlass", (0.07, 0.07, 0.12), "cylinder", wall=0.003),
    "fork": lying("fork", "Fork-SilverwarePiece", (0.19, 0.025, 0.015)),
    "napkin": lying("napkin", "Napkin", (0.2, 0.2, 0.01), soft=True),
    "bottle": replace(BOTTLE, pose=Pose((1.5, 0.0, TOP + 0.0325), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))),
}


PAN = Handle(Pose((-0.2, 0.0, 0.0)), (0.14, 0.025, 0.02))
POT = Handle(Pose((0.0, 0.13, 0.05)), (0.08, 0.06, 0.015))
JUG = Handle(Pose((0.0, -0.11, 0.0)), (0.02, 0.05, 0.14))
WIDE = {
    "pan": lying("pan", "Skillet", (0.26, 0.26, 0.04), "cylinder", handles=(PAN,)),
    "pot": lying("pot", "StoveTopCookingPot", (0.22, 0.22, 0.14), "cylinder", handles=(POT,)),
    "jug": lying("jug", "Kettle", (0.18, 0.18, 0.2), "cylinder", handles=(JUG,)),
}
THINGS |= WIDE


@pytest.mark.parametrize("name", some(WIDE))
def test_what_is_too_wide_is_gripped_at_its_handle_with_the_hand_off_the_rest(make_stage: MakeStage, name: str) -> None:
    stage = make_stage(CABINET, WIDE[name], BED)
    what, handle = an_object(WIDE[name].type, PLACE + name), WIDE[name].handles[0]
    base = next(stage.resolver.bases(a_location(in_reach_of=what))).base
    for one in (one for found in stage.resolver.reached_from(base).values() for one in found.values()):
        grip = (WIDE[name].pose @ handle.pose).inverse() @ Pose.from_matrix(one.plan.poses[1])
        assert (np.abs(grip.position) <= np.array(handle.size) / 2 + 0.05).all()
        assert not stage.platform.scene.collisions.contacts(base, one.arm, one.joints[1], fingers=one.plan.fingers)


@pytest.mark.long
def test_what_stands_in_something_open_above_is_lifted_over_its_rim_before_the_hand_goes_back(
    make_stage: MakeStage,
) -> None:
    deep = Cavity((0.0, 0.0, 0.02), (0.36, 0.56, 0.19))
    drawer = Body("drawer", Pose((1.6, 0.0, 0.7)), (0.4, 0.6, 0.2), cavities=(deep,))
    bowl = replace(THINGS["bowl"], pose=Pose((1.6, 0.0, 0.66)), size=(0.14, 0.14, 0.07))
    stage = make_stage(drawer, bowl)
    base = next(stage.resolver.bases(a_location(in_reach_of=an_object("Bowl-Mixing", PLACE + "bowl")))).base
    for found in (one for hand in stage.resolver.reached_from(base).values() for one in hand.values()):
        grasped, lifted, back = found.plan.poses[1:, 2, 3]
        assert back >= lifted >= grasped + 0.8 - (0.66 - 0.035)


@pytest.mark.parametrize("name", some(["mug", "bowl", "plate", "napkin", "fork", "bottle"], every=6))
def test_what_no_gripper_spans_or_what_lies_is_taken(make_stage: MakeStage, name: str) -> None:
    stage = make_stage(CABINET, THINGS[name], BED)
    what = an_object(THINGS[name].type, PLACE + name)
    before, around = a_location(in_front_of=what), a_location(in_center_of=what)
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(what, before, around)))).base)

    async def take() -> None:
        await perform(action("Reaching", to_location=before))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=around))
        await perform(action("ClosingAGripper", object_acted_on=what))
        await perform(action("Reaching", to_location=before))

    stage.run(take)
    assert held_by(stage.truth, name) == "robot"
    assert stage.truth.pose(name).position[2] > TOP + 0.04


def test_a_glass_that_fits_between_the_fingers_is_taken_in_its_middle(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, THINGS["glass"], BED)
    base = next(stage.resolver.bases(a_location(in_reach_of=an_object("DrinkingGlass", PLACE + "glass")))).base
    found = [one for some in stage.resolver.reached_from(base).values() for one in some.values()]
    assert found
    for one in found:
        grip = THINGS["glass"].pose.inverse() @ Pose.from_matrix(one.plan.poses[1])
        assert math.hypot(*grip.position[:2]) < 0.01


def test_a_dish_is_hollow_and_its_walls_are_where_it_is_gripped() -> None:
    bowl = THINGS["bowl"]
    block = replace(Block.of(bowl.pose, bowl.size, cylinder=True), wall=bowl.wall)
    walls = [part for part in plain(bowl) if part.size[2] == bowl.size[2]]
    assert max(math.hypot(*part.offset.position[:2]) for part in walls) < 0.11 - bowl.wall / 2
    for part in walls:
        place = (bowl.pose @ part.offset).position
        assert np.linalg.norm(grips(block)[:, :2] - place[:2], axis=1).min() < 1e-6


@pytest.mark.parametrize("width", [0.11, 0.13, 0.14])
def test_a_small_bowl_on_a_counter_is_gripped_by_its_rim_with_room_for_the_finger_inside(
    make_stage: MakeStage, width: float
) -> None:
    """Fingers of a tilted hand reach ahead of the grip point, where the wall of a small bowl has curved aside."""
    counter = Body("counter", Pose((1.9, 0.0, 0.45)), (0.6, 2.4, 0.9), type="CounterTop")
    size = (width, width, 0.06)
    bowl = Body("bowl", Pose((1.72, -0.3, 0.93)), size, "cylinder", type="Bowl-Eating", movable=True, wall=0.006)
    stage = make_stage(counter, bowl)
    found = next(stage.resolver.bases(a_location(in_reach_of=an_object("Bowl-Eating", PLACE + "bowl"))))
    contacts = stage.platform.scene.collisions.contacts
    grips = [one for hand in stage.resolver.reached_from(found.base).values() for one in hand.values()]
    assert grips
    assert not any(contacts(found.base, one.arm, one.joints[1], fingers=one.plan.fingers) for one in grips)


def test_what_is_flat_is_not_taken_from_the_side(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, THINGS["fork"], BED)
    what = an_object("Fork-SilverwarePiece", PLACE + "fork")
    assert is_low(stage.platform.scene.bodies.block("fork"))
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.bases(a_location(in_reach_of=what, grasp=GraspClass.SIDE.value)))
    assert caught.value.counts["too low for a grasp except from above"]


def test_tilted_fingers_go_beside_what_lies_flat_as_deep_as_their_lowest_corner_is_in_the_support() -> None:
    """Of the PR2's tips, taken for as low as that, a phone of 1 cm met only the rounded ends."""
    phone = Block(0.0, 0.0, 0.0, 0.08, 0.04, TOP, TOP + 0.01)
    frame, below = HandFrame((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 0.02
    found = from_above("phone", phone, frame, 0.1, (GraspClass.TILTED,), 4, (0.0, below))
    tips = set((found.points[:, 2] - below - TOP).round(4).tolist())
    assert tips == set(CLEARANCES[GraspClass.TILTED])


def test_what_is_heavier_than_the_hand_carries_is_refused_before_anything_moves(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, replace(BOTTLE, mass=40.0), BED)
    with pytest.raises(TooHeavy, match=r"bottle weighs 40 kg, the hand carries 1\.5 kg") as caught:
        next(stage.resolver.bases(a_location(in_reach_of=THE_BOTTLE)))
    assert (caught.value.mass, caught.value.payload) == (40.0, 1.5)


@pytest.mark.parametrize("covered", some([False, True]))
def test_a_cloth_is_taken_where_nothing_lies_on_it(make_stage: MakeStage, covered: bool) -> None:
    cloth = lying("cloth", "PlaceMat", (0.28, 0.36, 0.004), soft=True)
    size = (0.3, 0.4, 0.012) if covered else (0.1, 0.16, 0.012)
    over = Body("over", Pose((1.45, 0.0, TOP + 0.0101)), size, type="Napkin", movable=True, soft=True)
    stage = make_stage(CABINET, cloth, over, BED)
    bases = stage.resolver.bases(a_location(in_reach_of=an_object("PlaceMat", PLACE + "cloth")))
    if not covered:
        grasp = next(iter(stage.resolver.reached_from(next(bases).base).values()))
        for one in grasp.values():
            x, y, _ = one.plan.poses[1][:3, 3]
            assert max(abs(x - 1.45) - 0.05, abs(y) - 0.08) > 0.0
        return
    with pytest.raises(LocationUnresolvable) as caught:
        next(bases)
    assert "under something else" in caught.value.counts


def test_a_palm_ends_where_its_mesh_does_however_that_lies_in_the_box_around_it() -> None:
    with ExitStack() as stack:
        (arm,) = room(stack, drawn(0), "panda").platform.scene.arms.all
        thick = np.array(arm.palm) @ np.cross(arm.frame.approach, arm.frame.closing)
        assert np.ptp(thick) < 0.07, "the hand is 63 mm thick"


def test_a_low_cup_that_fits_between_the_fingers_is_gripped_around_as_well_as_by_its_rim(make_stage: MakeStage) -> None:
    cup = lying("cup", "Cup", (0.075, 0.075, 0.06), "cylinder", wall=0.004)
    scene = make_stage(CABINET, cup).platform.scene
    reach = Reach(ReachKind.GRASP, "cup")
    found = [one for arm in scene.arms.all for one in candidates_of(reach, arm, scene, Rejections(), Stage.ALL)]
    away = np.concatenate([np.hypot(*(table.points[:, :2] - cup.pose.position[:2]).T) for table in found])
    assert (away < 0.01).any()
    assert (abs(away - 0.0355) < 0.003).any()


def test_a_glass_as_wide_as_the_fingers_open_is_gripped_by_its_rim(make_stage: MakeStage) -> None:
    arm = make_stage(CABINET).platform.scene.arms.all[0]
    wide = arm.max_opening - 0.001
    glass = lying("glass", "DrinkingGlass", (wide, wide, 0.12), "cylinder", wall=0.003)
    scene = make_stage(CABINET, glass).platform.scene
    found = candidates_of(Reach(ReachKind.GRASP, "glass"), arm, scene, Rejections(), Stage.ALL)
    heights = np.concatenate([table.points[:, 2] for table in found])
    assert len(heights)
    assert (heights > TOP + 0.08).all()


def test_fingers_that_turn_reach_out_most_in_between(make_stage: MakeStage) -> None:
    for arm in make_stage(CABINET).platform.scene.arms.all:
        openings, tips = arm.openings, Openings((), np.zeros((0, 1)), np.zeros(0))
        assert tips.advance(0.05) == 0.0
        assert openings.advance(0.01) == pytest.approx(max(0.0, openings.ends.max() - openings.ends[-1]), abs=1e-3)
