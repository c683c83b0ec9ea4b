"""Driving: around what is believed, around what is felt, and what is said when there is no way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from executive.modules.control import ROOMY
from executive.motion import clearance_at
from planlang import perform
from planlang.designators import Action, a_location, action
from planlang.failures import (
    ActionUnresolvable,
    LocationUnresolvable,
    NavigationGoalInCollision,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
)
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import THE_BOTTLE, WARD, MakeStage, Stage, hold_bottle

POST = Body("post", Pose((1.5, 0.0, 0.5)), (0.4, 0.4, 1.0), type="Chair-PieceOfFurniture", movable=True)
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


def test_a_location_is_gone_to_at_its_best_place(ward: Stage) -> None:
    location = a_location(in_reach_of=THE_BOTTLE)
    best = next(ward.resolver.bases(location)).base
    drive(ward, action("Translation-LocationChange", to_location=location))
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
    room = clearance_at(places[:, :2], scene.collisions.obstacles(), scene.collisions.silhouette())
    touching = np.array([bool(scene.collisions.contacts((x, y, yaw))) for x, y, yaw in places.tolist()])
    assert 20 < touching.sum() < len(places) - 20
    assert not touching[room >= ROOMY].any()


def test_an_obstacle_elsewhere_than_believed_is_felt_and_driven_around(make_stage: MakeStage) -> None:
    stage = make_stage(AWAY, truth=[POST])
    drive(stage, to(3.0, 0.0))
    assert stage.truth.configuration().base == pytest.approx((3.0, 0.0, 0.0), abs=1e-6)
    assert stage.belief.pose("post") == POST.pose, "the robot knows now where the post is"


def test_an_obstacle_that_is_in_no_map_ends_in_a_failure_that_names_it(make_stage: MakeStage) -> None:
    stage = make_stage(truth=[POST])
    with pytest.raises(NavigationGoalNotReached) as caught:
        drive(stage, to(3.0, 0.0))
    assert caught.value.blocked_by == "post"
    assert caught.value.target == (3.0, 0.0, 0.0)
    assert "blocked by post" in str(caught.value)
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


def test_a_base_motion_without_a_goal_is_refused(ward: Stage) -> None:
    with pytest.raises(ActionUnresolvable, match="to_location, or x, y and yaw"):
        drive(ward, action("Translation-LocationChange", x=1.0))


def test_a_location_without_places_is_told_as_such(make_stage: MakeStage) -> None:
    table = Body("cabinet", Pose((1.6, 0.0, 0.4)), (3.0, 3.0, 0.8), type="Table-PieceOfFurniture")
    stage = make_stage(table, replace(WARD[1], pose=Pose((1.6, 0.0, 0.9))), start=(-1.0, 0.0, 0.0))
    with pytest.raises(LocationUnresolvable):
        drive(stage, action("Translation-LocationChange", to_location=a_location(in_reach_of=THE_BOTTLE)))
