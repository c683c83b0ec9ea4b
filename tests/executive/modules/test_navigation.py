"""Driving around what is believed and felt, looking for things, and what is said when there is no way."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest

from executive.belief.obstacles import NAMES
from executive.modules.drive import ROOMY
from executive.motion import clearance_at
from executive.robots.arms import RobotModel
from planlang import Recovery, look_from_another_place, perform, with_failure_handling
from planlang.designators import Action, Location, Object, a_location, action, an_object
from planlang.failures import (
    ActionUnresolvable,
    LocationUnresolvable,
    NavigationGoalInCollision,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
    ObjectNotFound,
    ObjectNowhereToBeFound,
)
from planlang.geometry import Pose
from planlang.ontology import Ontology
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, WARD, MakeStage, Stage, furnisher, hold_bottle, stand

POST = Body("post", Pose((1.5, 0.0, 0.5)), (0.4, 0.4, 1.0), type="Chair-PieceOfFurniture", movable=True)
BESIDE = replace(POST, pose=Pose((1.5, 1.4, 0.5)))
AWAY = replace(POST, pose=Pose((-3.0, 3.0, 0.5)))


def to(x: float, y: float, yaw: float = 0.0) -> Action:
    """The base motion to a pose."""
    return action("Translation-LocationChange", x=x, y=y, yaw=yaw)


def drive(stage: Stage, motion: Action) -> None:
    """Perform a base motion in the true world."""
    stage.run(lambda: perform(motion))


def test_the_base_arrives_at_the_pose(make_stage: MakeStage) -> None:
    stage = make_stage(POST)
    drive(stage, to(3.0, 0.2, 2.0))
    assert stage.truth.configuration().base == pytest.approx((3.0, 0.2, 2.0), abs=1e-6)
    assert stage.planning.configuration().base == stage.truth.configuration().base


@pytest.mark.parametrize("target", [a_location(in_reach_of=THE_BOTTLE), THE_BOTTLE])
def test_a_location_is_gone_to_at_its_best_place_a_thing_to_where_it_is_in_reach(
    ward: Stage, target: Location | Object
) -> None:
    best = next(ward.resolver.bases(a_location(in_reach_of=THE_BOTTLE))).base
    drive(ward, action("Translation-LocationChange", to_location=target))
    assert ward.truth.configuration().base == pytest.approx(best, abs=1e-6)


def test_where_the_base_is_already_it_does_not_move(ward: Stage) -> None:
    drive(ward, to(0.0, 0.0, 2 * math.pi))
    assert ward.truth.steps == 0


def test_where_the_robot_taken_for_round_has_room_it_touches_nothing(make_stage: MakeStage) -> None:
    leaning = replace(POST, pose=Pose((0.6, 1.6, 0.5), (math.sin(0.3), 0.0, 0.0, math.cos(0.3))))
    stage = make_stage(*WARD, leaning)
    hold_bottle(stage)
    scene = stage.platform.scene
    places = np.random.default_rng(0).uniform((-4.0, -2.0, -math.pi), (3.0, 3.0, math.pi), (400, 3))
    room = clearance_at(places[:, :2], scene.collisions.obstacles(), scene.world.silhouette())
    touching = np.array([bool(scene.collisions.contacts((x, y, yaw))) for x, y, yaw in places.tolist()])
    assert 20 < touching.sum() < len(places) - 20
    assert not touching[room >= ROOMY].any()


def test_the_path_to_where_the_base_stands_ends_there(make_stage: MakeStage) -> None:
    stage = make_stage()
    here = stage.platform.base()
    assert stage.platform.drive.path(here).positions.tolist() == [list(here)]


def test_an_obstacle_elsewhere_than_believed_is_felt_and_driven_around(make_stage: MakeStage) -> None:
    stage = make_stage(BESIDE, truth=[POST])
    drive(stage, to(3.0, 0.0))
    assert stage.truth.configuration().base == pytest.approx((3.0, 0.0, 0.0), abs=1e-6)
    assert stage.belief.pose("post") == POST.pose, "the robot knows now where the post is"


def test_an_obstacle_like_one_that_is_believed_far_away_is_another_and_driven_around(make_stage: MakeStage) -> None:
    stage = make_stage(AWAY, truth=[POST])
    drive(stage, to(3.0, 0.0))
    assert stage.truth.configuration().base == pytest.approx((3.0, 0.0, 0.0), abs=1e-6)
    assert stage.belief.pose("post") == AWAY.pose, "nothing tells that it has moved"
    assert stage.belief.pose("post#2") == POST.pose, "the camera shows one where it was touched"


def test_an_obstacle_that_is_in_no_map_is_felt_and_driven_around(make_stage: MakeStage) -> None:
    stage = make_stage(truth=[POST])
    drive(stage, to(3.0, 0.0))
    assert stage.truth.configuration().base == pytest.approx((3.0, 0.0, 0.0), abs=1e-6)
    assert stage.belief.pose("chair-PieceOfFurniture#1") == POST.pose, "the camera shows what was touched"
    assert not any(name in NAMES for name in stage.belief.names()), "that explains the touch"
    assert "post" not in stage.belief.names(), "nobody tells its name"


def test_an_obstacle_that_no_camera_shows_is_felt_and_driven_around(make_blind: MakeStage) -> None:
    stage = make_blind(truth=[POST])
    drive(stage, to(3.0, 0.0))
    assert stage.truth.configuration().base == pytest.approx((3.0, 0.0, 0.0), abs=1e-6)
    felt = [name for name in stage.belief.names() if name in NAMES]
    assert felt, "of what was touched the robot believes that something is there"
    assert all(math.dist(stage.belief.pose(name).position[:2], POST.pose.position[:2]) < 0.2 for name in felt)
    assert set(felt) == set(stage.belief.names()), "nobody tells its name"


def test_an_obstacle_that_is_in_no_map_ends_in_a_failure_that_says_where_it_was_touched(make_stage: MakeStage) -> None:
    stage = make_stage(truth=[replace(POST, size=(0.1, 11.5, 1.0))])
    with pytest.raises(NavigationGoalNotReached) as caught:
        drive(stage, to(3.0, 0.0))
    assert caught.value.blocked_by == "something unknown at 1.45, -0.10"
    assert caught.value.target == (3.0, 0.0, 0.0)
    assert "blocked by something unknown at" in str(caught.value)
    assert stage.truth.contacts() == (), "the robot stopped before it"


def test_a_goal_inside_furniture_is_refused_with_its_name(ward: Stage) -> None:
    with pytest.raises(NavigationGoalInCollision) as caught:
        drive(ward, to(1.4, 0.0))
    assert caught.value.blocked_by == "cabinet"
    assert ward.truth.configuration().base == (0.0, 0.0, 0.0)


def test_a_goal_behind_walls_has_no_path(make_stage: MakeStage) -> None:
    walls = [
        Body(f"wall{k}", Pose((3.0 + dx, dy, 0.5)), size, type="Wall-ConstructionArtifact")
        for k, (dx, dy, size) in enumerate(
            (
                (1.0, 0.0, (0.1, 2.1, 1.0)),
                (-1.0, 0.0, (0.1, 2.1, 1.0)),
                (0.0, 1.0, (2.1, 0.1, 1.0)),
                (0.0, -1.0, (2.1, 0.1, 1.0)),
            )
        )
    ]
    stage = make_stage(*walls)
    with pytest.raises(NavigationPoseUnreachable) as caught:
        drive(stage, to(3.0, 0.0))
    assert caught.value.target == (3.0, 0.0, 0.0)


def test_a_robot_that_starts_inside_furniture_says_that_it_is_stuck(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, start=(1.3, 0.0, 0.0))
    with pytest.raises(NavigationGoalNotReached, match="stuck") as caught:
        drive(stage, to(0.0, 0.0))
    assert caught.value.blocked_by == "cabinet"


def test_a_robot_that_only_seems_to_be_in_furniture_gets_out_of_it_and_drives(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    for x in range(60, 130):
        stand(stage, (x / 100, 0.0, 0.0))
        if _depths(stage):
            break
    assert 0.0 < max(_depths(stage)) < 0.03
    drive(stage, to(0.0, 0.0))
    assert stage.truth.configuration().base == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def _depths(stage: Stage) -> list[float]:
    """How deep the robot is in what, as it believes [m]."""
    return [contact.depth for contact in stage.platform.scene.collisions.contacts(stage.platform.base())]


def test_a_base_motion_without_a_goal_is_refused(ward: Stage) -> None:
    with pytest.raises(ActionUnresolvable, match="to_location, or x, y and yaw"):
        drive(ward, action("Translation-LocationChange", x=1.0))


def test_a_location_without_places_is_told_as_such(make_stage: MakeStage) -> None:
    table = Body("cabinet", Pose((1.6, 0.0, 0.4)), (3.0, 3.0, 0.8), type="Table-PieceOfFurniture")
    stage = make_stage(table, replace(WARD[1], pose=Pose((1.6, 0.0, 0.9))), start=(-1.0, 0.0, 0.0))
    with pytest.raises(LocationUnresolvable):
        drive(stage, action("Translation-LocationChange", to_location=a_location(in_reach_of=THE_BOTTLE)))


CLOSE = (0.3, 0.0, 0.0)
"""From here the cabinet's top is seen."""


def look(stage: Stage, what: Object = THE_BOTTLE) -> Pose:
    """Look for a thing from where the robot stands."""
    found: Pose = stage.run(lambda: perform(action("LookingForSomething", object_acted_on=what)))
    return found


def elsewhere(x: float, y: float, z: float = 0.9) -> Body:
    """The bottle at another place."""
    return replace(BOTTLE, pose=Pose((x, y, z)))


def test_a_bottle_where_it_is_believed_to_be_is_seen_there(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, start=CLOSE)
    assert look(stage) == BOTTLE.pose
    assert stage.belief.seen_from_here("bottle")


@pytest.mark.parametrize("y", [-0.35, -0.2, 0.15, 0.35])
def test_a_bottle_elsewhere_on_its_support_is_found_and_believed_there(y: float, make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, truth=[CABINET, elsewhere(1.55, y), *WARD[2:]], start=CLOSE)
    pose = look(stage)
    assert pose.position == (1.55, y, 0.9)
    assert stage.belief.pose("bottle") == pose
    assert stage.planning.pose("bottle") == pose, "the robot plans with what it saw"


def test_a_bottle_beyond_the_middle_of_the_picture_is_found_by_looking_around(make_stage: MakeStage) -> None:
    """The cabinet is so wide that a look at the believed place does not show its ends."""
    wide = Body("cabinet", Pose((1.6, 0.0, 0.4)), (0.4, 3.0, 0.8), type=CABINET.type)
    stage = make_stage(wide, BOTTLE, truth=[wide, elsewhere(1.5, -1.3)], start=(0.6, 0.0, 0.0))
    assert look(stage).position == (1.5, -1.3, 0.9)
    assert stage.truth.configuration().joints["neck_pan_joint"] < -0.5, "the head has turned to the right end"


def test_a_bottle_that_is_not_there_is_not_found(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, truth=[CABINET, elsewhere(-1.0, 3.0, 0.1), *WARD[2:]], start=CLOSE)
    with pytest.raises(ObjectNotFound) as caught:
        look(stage)
    assert caught.value.what == "bottle"
    assert stage.belief.looked_in_vain("bottle") == (CLOSE,)
    assert stage.belief.pose("bottle") == BOTTLE.pose, "where it is instead is not known"


@pytest.mark.long
def test_a_bottle_hidden_from_everywhere_is_nowhere_to_be_found_after_three_recoveries(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, truth=[CABINET, elsewhere(-1.0, 4.0, 0.1), *WARD[2:]], start=CLOSE)
    places = []

    async def body() -> None:
        places.append(stage.truth.configuration().base)
        await perform(action("LookingForSomething", object_acted_on=THE_BOTTLE))

    async def plan() -> None:
        await with_failure_handling(
            body,
            Recovery(ObjectNotFound, look_from_another_place(THE_BOTTLE), retries=3, otherwise=ObjectNowhereToBeFound),
        )

    with pytest.raises(ObjectNowhereToBeFound) as caught:
        stage.run(plan)
    assert caught.value.what == "bottle"
    assert len(places) == 2, "it is looked for once more from here, then wherever it may be"


def test_a_bottle_behind_another_thing_is_found_from_another_place(make_stage: MakeStage) -> None:
    box = Body("box", Pose((1.45, 0.25, 0.95)), (0.1, 0.3, 0.3), type="Box-Container")
    at = elsewhere(1.65, 0.25)
    stage = make_stage(CABINET, at, truth=[CABINET, at, box], start=(0.3, 0.25, 0.0))
    found = []

    async def body() -> None:
        found.append(await perform(action("LookingForSomething", object_acted_on=THE_BOTTLE)))

    async def plan() -> None:
        await with_failure_handling(
            body,
            Recovery(ObjectNotFound, look_from_another_place(THE_BOTTLE), retries=3, otherwise=ObjectNowhereToBeFound),
        )

    stage.run(plan)
    assert found == [at.pose]
    assert stage.truth.configuration().base != (0.3, 0.25, 0.0)


@pytest.mark.long
def test_a_class_that_is_not_in_the_map_is_looked_for_where_it_is_likely(ward: Stage) -> None:
    with pytest.raises(ObjectNowhereToBeFound, match=r"looked at: \w+"):
        look(ward, an_object("Refrigerator"))


def test_looking_needs_an_object(ward: Stage) -> None:
    with pytest.raises(ActionUnresolvable, match="object_acted_on"):
        ward.run(lambda: perform(action("LookingForSomething")))


def test_the_head_turns_to_what_it_looks_at(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, start=(1.0, 1.2, 0.0))
    stage.run(lambda: perform(action("LookingAtSomething", object_acted_on=THE_BOTTLE)))
    assert stage.truth.configuration().joints["neck_pan_joint"] < -0.8, "the bottle is to the right"


def test_a_bottle_ahead_is_seen_however_narrow_the_images_are(model: RobotModel, vocabulary: Ontology) -> None:
    assert model.robot.camera
    narrow = replace(model.robot, camera=replace(model.robot.camera, fov=0.3, width=160, height=160))
    (make,) = islice(furnisher(replace(model, robot=narrow), vocabulary), 1)
    for bearing in (0.0, 0.1, 0.2, 0.3, 0.4):
        place = elsewhere(2.0 * math.cos(bearing), 2.0 * math.sin(bearing), 1.0)
        stage = make(elsewhere(0.0, -2.0), truth=[place])
        stage.belief.not_there("bottle")
        checking = action("CheckingWhetherConditionObtains", object_acted_on=THE_BOTTLE)
        assert stage.run(partial(perform, checking)), bearing
