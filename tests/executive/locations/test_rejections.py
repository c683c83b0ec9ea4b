"""Rooms that are infeasible for one known reason: the failure names it, and the bodies that are in the way."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from executive.locations.explanations import explain_bases
from executive.locations.questions import BUDGETS, Question
from executive.locations.rejections import COLLISION, NO_HOLD, Rejections
from planlang.designators import Location, a_device, a_location, a_person, a_posture, an_object
from planlang.failures import LocationUnresolvable, ObjectUnresolvable
from planlang.geometry import Pose
from planlang.relations.demands import Reach, ReachKind
from sim import Body
from sim.scene import BodyShape, Handle
from tests.executive.conftest import BED, BOTTLE, CABINET, PATIENT, PLACE, THE_BOTTLE, MakeStage, Stage
from tests.support.examples import some
from tests.support.leaves import drawn, room

TO_GRASP = a_location(in_reach_of=THE_BOTTLE)
TO_SEE = a_location(visible_from=THE_BOTTLE)
Refused = Callable[..., LocationUnresolvable]


def box(name: str, x: float, y: float, size: tuple[float, float, float], low: float = 0.0, yaw: float = 0.0) -> Body:
    """A piece of furniture whose lowest point is ``low``."""
    return Body(name, Pose.planar(x, y, yaw, low + size[2] / 2), size, type="Cupboard")


@pytest.fixture
def refused(make_stage: MakeStage) -> Refused:
    """The failure that a location ends with in a room of these bodies, which it must."""

    def resolve(location: Location, *bodies: Body) -> LocationUnresolvable:
        with pytest.raises(LocationUnresolvable) as caught:
            next(make_stage(*bodies).resolver.bases(location))
        return caught.value

    return resolve


def test_a_bottle_on_a_high_pillar_is_out_of_reach(refused: Refused) -> None:
    pillar = box("pillar", 1.6, 0.0, (0.07, 0.07, 1.75))
    failure = refused(TO_GRASP, pillar, replace(BOTTLE, pose=Pose((1.6, 0.0, 1.85))))
    assert set(failure.counts) <= {"out of reach", "not visible", "no room for the base", "in collision"}
    assert failure.counts["out of reach"] > 0
    assert set(failure.blocking) <= {"pillar"}
    said = re.search(
        r"bottle is at (\d\.\d+) m, \d\.\d+ m too high; the \w+ arm grasps from the side up to (\d\.\d+) m",
        str(failure),
    )
    assert said is not None, str(failure)
    assert float(said[1]) > float(said[2]) > 1.2


@pytest.mark.parametrize(
    "location",
    some([TO_GRASP, a_location(near=an_object("Cabinet-PieceOfFurniture", PLACE + "cabinet"))], every=2),
    ids=str,
)
def test_a_corner_that_is_walled_off_has_no_way_for_the_base(
    refused: Refused, make_stage: MakeStage, location: Location
) -> None:
    aside = [
        replace(body, pose=Pose((body.pose.position[0] + 3.8, *body.pose.position[1:]))) for body in (CABINET, BOTTLE)
    ]
    wall = box("wall", 4.0, 0.0, (0.1, 12.0, 2.0))
    failure = refused(location, wall, *aside)
    assert failure.counts["no way for the base"] > 0
    assert "not looked at" not in failure.counts
    assert location is not TO_GRASP or "without wall this would work" in str(failure)
    gap = replace(wall, pose=Pose((4.0, -0.7, 1.0)), size=(0.1, 10.6, 2.0))
    beyond = next(make_stage(gap, *aside).resolver.bases(location)).base
    assert beyond[0] > 4.1, "around the wall's end there is one"


def test_of_two_walls_that_both_have_to_go_none_is_said_to_be_the_only_one(refused: Refused) -> None:
    aside = [
        replace(body, pose=Pose((body.pose.position[0] + 3.8, *body.pose.position[1:]))) for body in (CABINET, BOTTLE)
    ]
    walls = [box(f"wall{number}", 3.6 + 0.4 * number, 0.0, (0.1, 12.0, 2.0)) for number in (0, 1)]
    failure = refused(TO_GRASP, *walls, *aside)
    assert failure.because().startswith("no simple change")
    assert failure.because().endswith("; the base cannot drive to where it could reach bottle")
    assert failure.changes == ()


def test_before_a_thing_that_is_too_wide_for_hands_the_width_is_the_reason(refused: Refused) -> None:
    tray = replace(BOTTLE, name="tray", size=(0.4, 0.3, 0.05), shape="box", type="Tray")
    before = a_location(in_reach_of=a_location(in_front_of=an_object("Tray", PLACE + "tray")))
    assert "is 0.3 m wide, and nothing wider than 0.12 m is taken" in str(refused(before, CABINET, tray))
    before = a_location(in_reach_of=a_location(in_front_of=an_object("Cabinet-PieceOfFurniture", PLACE + "cabinet")))
    assert "cabinet, which is a Cabinet-PieceOfFurniture: things of this class are not taken" in str(
        refused(before, CABINET, tray)
    )


def test_a_bottle_wider_than_the_open_fingers_is_too_wide_for_the_gripper(refused: Refused) -> None:
    failure = refused(TO_GRASP, CABINET, replace(BOTTLE, size=(0.118, 0.118, 0.2)))
    assert failure.counts["too wide for the gripper"] > 0
    assert re.search(r": bottle is 0\.118 m wide, \w+ opens to 0\.\d+ m \(\d+ candidates", str(failure))
    assert "out of reach" not in failure.counts


def test_between_a_thing_in_a_drawer_and_its_furniture_no_more_room_is_asked_for() -> None:
    with ExitStack() as stack:
        stage = room(stack, drawn(0))
        scene, resolver = stage.platform.scene, stage.platform.resolver
        log = Rejections(counts=Counter({COLLISION: 9}), blocking=Counter({"case": 9}))
        explain_bases([Reach(ReachKind.PLACE, "leaf", inside=True)], (), scene, resolver.maps, Question(log), None)
    assert log.figures == {COLLISION: "in all 9 ways to reach leaf the robot would hit case"}


def test_a_hand_without_collision_shapes_is_said_to_be_the_cause(make_stage: MakeStage) -> None:
    stage, bare = make_stage(CABINET, BOTTLE), "jaw has no <collision> shape"
    scene, maps = stage.platform.scene, stage.platform.resolver.maps
    arms = [
        replace(arm, bare=bare, openings=replace(arm.openings, gaps=np.zeros_like(arm.openings.gaps)))
        for arm in scene.arms.all
    ]
    log = Rejections(counts=Counter({NO_HOLD.text: 9}))
    explain_bases([Reach(ReachKind.GRASP, "bottle")], arms, scene, maps, Question(log), None)
    said = r"bottle is 0\.\d+ m wide; whether that fits into the hand of the \w+ arm is not known, as "
    assert re.fullmatch(said + re.escape(f"{bare}: add such shapes to the URDF"), log.figures[NO_HOLD.text])


def test_a_plate_that_fits_between_the_fingers_is_not_called_too_wide(refused: Refused) -> None:
    failure = refused(TO_GRASP, CABINET, replace(BOTTLE, size=(0.06, 0.06, 0.003), pose=Pose((1.5, 0.0, 0.8015))))
    assert "too wide for the gripper" not in failure.counts
    assert "bottle is 0.060 m wide and fits between the fingers" in str(failure)


def test_what_is_as_wide_as_the_fingers_open_is_not_said_to_fit_between_them(refused: Refused) -> None:
    book = replace(BOTTLE, shape=BodyShape.BOX, size=(0.11, 0.18, 0.03), pose=Pose((1.5, 0.0, 0.815)))
    told = str(refused(TO_GRASP, CABINET, book))
    assert "bottle is 0.110 m wide; the gripper of the " in told
    assert "arm opens to 0.110 m, and needs 0.003 m of that to get around it" in told


def test_the_width_of_a_handle_is_called_that_of_the_handle(refused: Refused) -> None:
    handle = Handle(Pose((0.0, 0.0, 0.0)), (0.2, 0.03, 0.02))
    hammer = replace(BOTTLE, size=(0.3, 0.2, 0.03), pose=Pose((1.5, 0.0, 0.815)), handles=(handle,))
    said = str(refused(TO_GRASP, CABINET, hammer))
    assert "the handle of bottle is 0.030 m wide and fits between the fingers" in said


def test_posts_around_a_cabinet_leave_no_room_and_are_named(refused: Refused) -> None:
    posts = [
        box(f"post{k}", 1.6 + 0.9 * math.cos(k * math.pi / 6), 0.9 * math.sin(k * math.pi / 6), (0.4, 0.4, 0.6))
        for k in range(12)
    ]
    failure = refused(TO_GRASP, CABINET, BOTTLE, *posts)
    assert next(iter(failure.counts)) == "no room for the base", "the most frequent reason comes first"
    assert sum(name.startswith("post") for name in failure.blocking) >= 10
    assert set(failure.blocking) <= {"cabinet", *(post.name for post in posts)}


def test_the_middle_of_a_wide_table_is_out_of_the_bases_way(refused: Refused) -> None:
    table = box("table", 1.6, 0.0, (2.4, 2.4, 0.8))
    failure = refused(TO_GRASP, table, replace(BOTTLE, pose=Pose((1.6, 0.0, 0.9))))
    assert set(failure.blocking) == {"table"}


def test_a_bottle_between_screens_cannot_be_seen(refused: Refused) -> None:
    screens = [
        box("ahead", 1.3, 0.0, (0.02, 0.42, 0.5), 0.8),
        box("behind", 1.7, 0.0, (0.02, 0.42, 0.5), 0.8),
        box("left", 1.5, 0.2, (0.38, 0.02, 0.5), 0.8),
        box("right", 1.5, -0.2, (0.38, 0.02, 0.5), 0.8),
    ]
    failure = refused(TO_SEE, CABINET, BOTTLE, *screens)
    assert set(failure.counts) <= {"not visible", "no room for the base"}
    assert failure.counts["not visible"] > 100


def test_a_bottle_in_a_box_would_have_its_sides_touched_by_the_hand(make_stage: MakeStage) -> None:
    sides = [
        box("left", 1.5, 0.055, (0.2, 0.02, 0.3), 0.8),
        box("right", 1.5, -0.055, (0.2, 0.02, 0.3), 0.8),
        box("behind", 1.61, 0.0, (0.02, 0.2, 0.3), 0.8),
        box("roof", 1.5, 0.0, (0.24, 0.2, 0.02), 1.1),
    ]
    stage = make_stage(CABINET, BOTTLE, *sides, start=(0.827, 0.0, -0.35))
    arm = stage.platform.scene.arms.of(a_device("LeftGripper"))[0]
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.hands(a_location(in_center_of=THE_BOTTLE), arm, stage.platform.arm_joints(arm)))
    assert caught.value.counts == {"in collision": 32}, "16 headings with either side of the hand up"
    assert set(caught.value.blocking) <= {"left", "right", "roof", "behind"}


def test_each_way_of_a_hand_is_counted_once(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE, start=(0.55, 0.0, -0.35))
    arm = stage.platform.scene.arms.of(a_device("LeftGripper"))[0]
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.hands(a_location(in_center_of=THE_BOTTLE), arm, stage.platform.arm_joints(arm)))
    assert sum(caught.value.counts.values()) == 32, caught.value.counts


def test_the_message_tells_the_counts_and_the_bodies(refused: Refused) -> None:
    table = box("table", 1.6, 0.0, (2.4, 2.4, 0.8))
    failure = refused(TO_GRASP, table, replace(BOTTLE, pose=Pose((1.6, 0.0, 0.9))))
    text = str(failure)
    assert text.startswith("no place found for in_reach_of(bottle): ")
    assert f"{failure.counts['no room for the base']} no room for the base" in text
    assert f"; in the way: table {failure.blocking['table']})" in text


def test_links_of_the_robot_are_told_as_the_robot_itself_and_a_room_by_its_walls(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, Body("room0", Pose((0.0, 0.0, 1.3)), (8.0, 8.0, 2.6), "room"))
    bodies, log = stage.platform.scene.bodies, Rejections()
    first, second = stage.platform.scene.world.robot.solid_names[:2]
    for body in (first, second, "room0", "cabinet", "what was felt"):
        log.crowded(body)
    blocking = log.failure("somewhere", bodies).blocking
    assert blocking == {"the robot itself": 2, "a wall of room0": 1, "cabinet": 1, "what was felt": 1}


def test_each_place_is_counted_once(refused: Refused) -> None:
    """Two arms, 32 headings, side and tilted with either side of the hand up, of each the 48 places that count.

    So high as the palm leaves room for the bottle below it, no arm points straight down.
    """
    table = box("table", 1.6, 0.0, (2.4, 2.4, 0.8))
    failure = refused(TO_GRASP, table, replace(BOTTLE, pose=Pose((1.6, 0.0, 0.9))))
    assert failure.counts == {"no room for the base": 2 * 32 * 4 * 48}


@pytest.mark.long
def test_places_that_another_conjunct_refuses_are_counted_by_its_own_words(refused: Refused) -> None:
    bed, patient = an_object("Bed-PieceOfFurniture"), a_person("Patient")
    far = a_location(in_reach_of=(THE_BOTTLE, patient), facing=bed, not_=a_location(next_to=bed))
    failure = refused(far, CABINET, BOTTLE, BED, PATIENT)
    assert set(failure.counts) == {"no room for the base", "not in reach of patient"}, "nothing else is near"
    failure = refused(a_location(in_reach_of=THE_BOTTLE, near=bed, facing=bed), CABINET, BOTTLE, BED)
    assert {"not near bed", "no room for the base"} == set(failure.counts)
    behind = a_location(in_reach_of=THE_BOTTLE, facing=bed, not_=a_location(near=THE_BOTTLE))
    failure = refused(behind, CABINET, BOTTLE, BED)
    assert {"not facing bed", "near bottle"} < set(failure.counts)


@pytest.mark.parametrize("exact", some([0, 3], every=2))
def test_all_places_that_were_not_looked_at_are_counted(
    exact: int, make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    unseen = a_location(in_reach_of=THE_BOTTLE, not_=a_location(visible_from=THE_BOTTLE))
    counts = []
    for effort in (replace(BUDGETS[0], most=0), replace(BUDGETS[0], exact=exact)):
        monkeypatch.setattr("executive.locations.search.BUDGETS", (effort,))
        stage = make_stage(CABINET, BOTTLE)
        with pytest.raises(LocationUnresolvable) as caught:
            next(stage.resolver.bases(unseen))
        counts.append(caught.value.counts)
    before, after = counts
    assert sum(after.values()) - sum(before.values()) == BUDGETS[0].most, "each candidate has one reason"
    assert after.get("bottle is visible", 0) == exact
    assert after["not looked at"] > BUDGETS[0].most / 2


@pytest.mark.parametrize(
    ("location", "said"),
    [
        (a_location(above=an_object("Bed-PieceOfFurniture")), "in_reach_of, in_, in_front_of, behind"),
        (a_location(on=THE_BOTTLE), "in_reach_of, in_, in_front_of, behind"),
        (a_location(in_reach_of=a_location(visible_from=THE_BOTTLE)), "in_reach_of, above, on, in_, in_center_of"),
        (a_location(in_reach_of=a_location(facing=THE_BOTTLE)), "in_reach_of, above, on, in_, in_center_of"),
    ],
    ids=str,
)
def test_a_relation_that_means_nothing_is_refused_with_those_that_do(
    location: Location, said: str, refused: Refused
) -> None:
    assert f"relations that apply: {said}" in str(refused(location, CABINET, BOTTLE, BED))


def test_an_object_that_is_not_in_the_map_is_no_matter_of_places(make_stage: MakeStage) -> None:
    with pytest.raises(ObjectUnresolvable, match="there are cabinet"):
        next(make_stage(CABINET).resolver.bases(TO_GRASP))


def test_a_conjunct_without_which_there_would_be_a_place_is_named_and_nothing_else(refused: Refused) -> None:
    failure = refused(a_location(in_reach_of=THE_BOTTLE, near=an_object("Bed-PieceOfFurniture")), CABINET, BOTTLE, BED)
    assert failure.figures == "without 'near bed' there would be a place"


def test_conjuncts_of_a_hand_location_that_exclude_each_other_are_named(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE, BED, PATIENT)
    arm = stage.platform.scene.arms.all[0]
    both = a_location(in_center_of=THE_BOTTLE, above=an_object("Bed-PieceOfFurniture"))
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.hands(both, arm, stage.platform.arm_joints(arm)))
    assert set(caught.value.counts) == {"not above bed"}


@pytest.mark.parametrize(
    ("location", "said"),
    [
        (a_posture("carrying"), "no place for a hand"),
        (a_location(near=THE_BOTTLE), "what the hand is at"),
        (a_location(not_=a_location(above=an_object("Bed-PieceOfFurniture"))), "what the hand is at"),
    ],
    ids=str,
)
def test_a_hand_location_has_to_say_what_the_hand_is_at(location: Location, said: str, make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE, BED, PATIENT)
    arm = stage.platform.scene.arms.all[0]
    with pytest.raises(LocationUnresolvable, match=said):
        next(stage.resolver.hands(location, arm, stage.platform.arm_joints(arm)))


@pytest.mark.long
def test_a_patient_behind_a_wall_of_furniture_is_out_of_reach(refused: Refused) -> None:
    bed = replace(BED, size=(2.6, 3.4, 0.55))
    failure = refused(a_location(in_reach_of=a_person("Patient")), bed, PATIENT)
    assert failure.counts
    assert set(failure.blocking) <= {"bed", "patient"}


@pytest.mark.long
def test_when_all_places_were_given_the_last_word_is_a_failure(make_stage: MakeStage) -> None:
    stage: Stage = make_stage(CABINET, BOTTLE)
    solutions = []
    with pytest.raises(LocationUnresolvable) as caught:
        solutions.extend(stage.resolver.bases(TO_SEE))
    assert caught.value.designator == "visible_from(bottle)"
