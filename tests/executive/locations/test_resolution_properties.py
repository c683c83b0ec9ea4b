"""What holds for every resolution: it changes nothing, and it moves with the scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planlang.designators import Location, a_location, a_person, an_object
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Configuration, Detection
from tests.executive.conftest import THE_BOTTLE, WARD, MakeStage, Stage, hold_bottle, stand

LOCATIONS = (
    a_location(in_reach_of=(THE_BOTTLE, a_location(in_center_of=THE_BOTTLE))),
    a_location(in_reach_of=a_person("Patient")),
    a_location(in_reach_of=a_location(above=an_object("Bed-PieceOfFurniture"))),
    a_location(visible_from=THE_BOTTLE),
    a_location(in_front_of=an_object("Cabinet-PieceOfFurniture")),
)


def snapshot(stage: Stage) -> tuple[object, ...]:
    """Everything that a query must leave alone."""
    belief = stage.belief
    return (
        stage.truth.state(),
        stage.planning.state(),
        belief.revision,
        tuple((name, belief.pose(name)) for name in belief.names()),
        tuple(belief.held.items()),
    )


@pytest.mark.parametrize("location", LOCATIONS, ids=str)
def test_asking_for_places_changes_neither_truth_nor_belief_nor_the_planning_world(
    location: Location, ward: Stage
) -> None:
    before = snapshot(ward)
    list(islice(ward.resolver.bases(location), 5))
    ward.platform.sync()
    assert snapshot(ward) == before


def test_asking_for_hand_poses_changes_nothing_even_with_a_bottle_in_hand(ward: Stage) -> None:
    stand(ward, (-1.2, 0.9, 2.6))
    hold_bottle(ward)
    before = snapshot(ward)
    arm = ward.platform.scene.arms.all[0]
    for location in (a_location(above=an_object("Bed-PieceOfFurniture")), a_location(in_front_of=THE_BOTTLE)):
        try:
            list(islice(ward.resolver.hands(location, arm, ward.platform.arm_joints(arm)), 3))
        except LocationUnresolvable:
            continue
    ward.platform.sync()
    assert snapshot(ward) == before


def test_a_failed_resolution_changes_nothing(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    stage.planning.set_configuration(Configuration((0.0, 0.0, 0.0), {}))
    stage.belief.bump("bottle", Pose((1.6, 0.0, 2.4)))
    stage.platform.sync()
    before = snapshot(stage)
    with pytest.raises(LocationUnresolvable):
        next(stage.resolver.bases(LOCATIONS[0]))
    stage.platform.sync()
    assert snapshot(stage) == before


@pytest.fixture(scope="module")
def moved(furnish: MakeStage) -> Callable[[Pose], Stage]:
    """The ward as the robot believes it after all of it, itself included, has been moved."""
    stage = furnish(*WARD)
    joints = stage.truth.configuration().joints

    def move(motion: Pose) -> Stage:
        turned = motion.matrix()
        base = turned @ np.array([0.0, 0.0, 0.0, 1.0])
        stage.truth.set_configuration(Configuration((base[0], base[1], motion.yaw), joints))
        for there in (Pose.planar(9.0, 9.0) @ motion, motion):  # a move of less than 2 mm would not count as one
            stage.belief.see(Detection(body.name, there @ body.pose, 1.0) for body in WARD)
        stage.platform.sync()
        return stage

    return move


def transported(motion: Pose, base: tuple[float, float, float]) -> tuple[float, float, float]:
    """A base pose after a motion of the whole scene."""
    there = motion @ Pose.planar(*base)
    return there.position[0], there.position[1], there.yaw


offsets = st.floats(-1.5, 1.5)
PROPERTY = settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.parametrize("location", LOCATIONS, ids=str)
@PROPERTY
@given(x=offsets, y=offsets, yaw=st.floats(-math.pi, math.pi))
def test_places_stay_places_when_the_whole_scene_is_moved_and_turned(
    moved: Callable[[Pose], Stage], location: Location, x: float, y: float, yaw: float
) -> None:
    bases = [solution.base for solution in islice(moved(Pose((0.0, 0.0, 0.0))).resolver.bases(location), 3)]
    motion = Pose.planar(x, y, yaw)
    stage = moved(motion)
    for base in bases:
        there = transported(motion, base)
        assert stage.resolver.satisfies(location, there), f"{base} was a place, {there} is none after {motion}"


@pytest.mark.parametrize("location", LOCATIONS, ids=str)
@PROPERTY
@given(x=offsets, y=offsets, yaw=st.floats(-math.pi, math.pi))
def test_a_moved_and_turned_scene_gives_the_same_places_moved_in_the_same_order(
    moved: Callable[[Pose], Stage], location: Location, x: float, y: float, yaw: float
) -> None:
    motion = Pose.planar(x, y, yaw)
    bases = [solution.base for solution in islice(moved(Pose((0.0, 0.0, 0.0))).resolver.bases(location), 4)]
    found = [solution.base for solution in islice(moved(motion).resolver.bases(location), 4)]
    for base, other in zip(bases, found, strict=True):
        there = transported(motion, base)
        assert other[:2] == pytest.approx(there[:2], abs=1e-4)
        assert math.remainder(other[2] - there[2], 2 * math.pi) == pytest.approx(0.0, abs=1e-4)


def test_places_are_begun_anew_when_the_belief_changes_in_between(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    solutions = stage.executive.solutions(LOCATIONS[0])
    first = next(solutions)
    x, y, z = stage.belief.pose("bottle").position
    stage.belief.see([Detection("bottle", Pose((x, y + 0.25, z)), 1.0)])
    second = next(solutions)
    assert second.revision == stage.belief.revision > first.revision
    assert second == next(stage.executive.solutions(LOCATIONS[0]))
