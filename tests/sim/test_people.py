"""Facts about people: what they look like, reach for, take and leave alone."""

import math

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, PyBulletWorld
from sim.people import arm_parts, figure_of, reach_from
from sim.truth import at_rest_on, held_by
from tests.sim.conftest import MakeWorld, grasp, play

OPEN = {"finger1_joint_right": 0.4, "finger2_joint_right": -0.4}


@pytest.fixture
def offering(world: PyBulletWorld) -> PyBulletWorld:
    """The robot holds the bottle in front of the patient, beside the bed."""
    grasp(world)
    world.set_configuration(Configuration((1.55, -0.34, 1.5708), {}))
    assert world.person("patient").contains(world.pose("bottle").position)
    assert world.contacts() == ()
    return world


def _steps_until_taken(world: PyBulletWorld, most: int) -> int | None:
    for k in range(most):
        world.step()
        if world.taken("bottle"):
            assert world.pulled("grippoint_right")
            return k + 1
    return None


def test_offered_object_is_taken_after_reaching_and_a_second(offering: PyBulletWorld) -> None:
    start = np.array(offering.hand("patient", "left"))
    steps = _steps_until_taken(offering, 150)
    travelled = float(np.linalg.norm(np.array(offering.hand("patient", "left")) - start))
    assert steps is not None
    assert steps >= offering.rate * (1.0 + (travelled - 0.15) / 0.4), (
        "the hand is near enough a little before it arrives"
    )
    assert held_by(offering, "bottle") == "robot", "as long as the robot has not let go"


def test_released_after_taking_it_stays_in_the_persons_hand(offering: PyBulletWorld) -> None:
    _steps_until_taken(offering, 150)
    place = offering.pose("bottle")
    assert play(offering, "right_gripper", OPEN) is None
    assert play(offering, "base", {"y": -0.8}) is None
    assert held_by(offering, "bottle") == "patient"
    assert offering.pose("bottle").distance(place) < 1e-5
    assert not offering.falling("bottle")


def test_released_before_it_is_taken_it_falls(offering: PyBulletWorld) -> None:
    offering.release("bottle")
    for _ in range(30):
        offering.step()
    assert held_by(offering, "bottle") is None
    assert at_rest_on(offering, "bottle") == "bed"


def test_hand_moves_at_forty_centimetres_per_second_and_only_that_hand(offering: PyBulletWorld) -> None:
    right = offering.hand("patient", "right")
    for _ in range(60):
        before = np.array(offering.hand("patient", "left"))
        offering.step()
        assert np.linalg.norm(np.array(offering.hand("patient", "left")) - before) <= 0.4 / offering.rate + 1e-9
    assert offering.hand("patient", "right") == right


def test_person_does_not_move_for_what_is_out_of_comfort_or_not_held(world: PyBulletWorld) -> None:
    rest = world.hand("patient", "left"), world.hand("patient", "right")
    grasp(world)
    for _ in range(40):
        world.step()
    world.set_pose("cup", Pose((1.6, 0.3, 0.9)))
    for _ in range(40):
        world.step()
    assert (world.hand("patient", "left"), world.hand("patient", "right")) == rest


def test_the_other_hand_takes_what_is_offered_if_the_nearer_one_is_full(world: PyBulletWorld) -> None:
    zone = world.person("patient")
    right, left = map(np.array, zone.shoulders)
    point = 0.55 * right + 0.45 * left + 0.6 * zone.arm_length * np.array(zone.facing)
    assert zone.arm_for(point) == 0
    assert zone.arm_for(point, (1,)) == 1
    assert zone.arm_for(point, ()) is None


def test_object_in_motion_is_not_taken(offering: PyBulletWorld) -> None:
    rest = offering.hand("patient", "left")
    for k in range(60):
        offering.set_configuration(Configuration((1.55 + 0.03 * (k % 2), -0.34, 1.5708), {}))
        offering.step()
    assert offering.taken("bottle") is None
    assert offering.hand("patient", "left") == rest


def test_hand_goes_back_when_the_offer_ends(offering: PyBulletWorld) -> None:
    rest = offering.hand("patient", "left")
    for _ in range(25):
        offering.step()
    assert offering.hand("patient", "left") != rest
    offering.set_configuration(Configuration((0.0, -1.5, 1.5708), {}))
    for _ in range(60):
        offering.step()
    assert offering.hand("patient", "left") == pytest.approx(rest, abs=1e-6)
    assert offering.taken("bottle") is None


def test_robot_that_withdraws_the_object_has_it_again(offering: PyBulletWorld) -> None:
    _steps_until_taken(offering, 150)
    play(offering, "base", {"y": -0.8})
    assert offering.taken("bottle") is None
    assert not offering.pulled("grippoint_right")
    assert held_by(offering, "bottle") == "robot"


def _at_the_left_hand(world: PyBulletWorld) -> Configuration:
    """Return where the grip point is in the middle of the patient's left palm."""
    hand, grip = world.hand("patient", "left"), world.link_pose("grippoint_right").position
    x, y, yaw = world.configuration().base
    lift = world.configuration().joints["spindle_joint"] + hand[2] - grip[2]
    return Configuration((x + hand[0] - grip[0], y + hand[1] - grip[1], yaw), {"spindle_joint": lift})


def _of_the_hand_with_the_patient(world: PyBulletWorld, there: Configuration) -> set[str]:
    hand = ("finger1_right", "finger2_right", "hand_right", "bottle")
    return {c.part for c in world.contacts(there) if c.body == "patient" and c.part in hand}


def test_resting_arms_of_a_person_stop_hands_and_what_they_hold(offering: PyBulletWorld) -> None:
    there = _at_the_left_hand(offering)
    assert {"bottle", "finger2_right"} <= _of_the_hand_with_the_patient(offering, there)
    assert [solid.limb for solid in offering.solids() if solid.body == "patient"].count(True) == 0


def test_hands_and_what_they_hold_may_touch_an_arm_that_reaches_for_it(offering: PyBulletWorld) -> None:
    for _ in range(25):
        offering.step()
    assert _of_the_hand_with_the_patient(offering, _at_the_left_hand(offering)) == set()
    assert [solid.limb for solid in offering.solids() if solid.body == "patient"].count(True) == 3, "of one arm"


def test_an_arm_that_came_back_to_its_rest_stops_hands_again(offering: PyBulletWorld) -> None:
    before, rest = offering.configuration(), _at_the_left_hand(offering)
    for _ in range(25):
        offering.step()
    offering.set_configuration(Configuration((0.0, -1.5, 1.5708), {}))
    for _ in range(60):
        offering.step()
    offering.set_configuration(before)
    assert _of_the_hand_with_the_patient(offering, rest) != set()


@pytest.mark.parametrize(
    ("size", "height_of_shoulders"),
    [((1.5, 0.5, 0.75), (0.35, 0.75)), ((0.8, 0.5, 1.3), (0.8, 1.1)), ((0.4, 0.5, 1.7), (1.25, 1.5))],
    ids=["lying", "seated", "standing"],
)
def test_figure_fits_its_box_and_faces_along_x(
    size: tuple[float, float, float], height_of_shoulders: tuple[float, float]
) -> None:
    body = Body("somebody", Pose.planar(1.0, 2.0, math.pi / 2, size[2] / 2), size, "person")
    figure, reach = figure_of(body), reach_from(figure_of(body), body.pose)
    assert reach.facing == pytest.approx((0, 1, 0), abs=1e-9)
    low, high = height_of_shoulders
    right, left = reach.shoulders
    assert low < right[2] < high
    assert right[0] > left[0]
    for part in figure.trunk:
        assert abs(part.offset.position[2]) < size[2] / 2
        assert abs(part.offset.position[0]) < size[0] / 2


def test_person_lying_across_its_x_axis_faces_along_y() -> None:
    body = Body("somebody", Pose((0.0, 0.0, 0.9)), (0.5, 1.7, 0.5), "person")
    assert reach_from(figure_of(body), body.pose).facing == pytest.approx((0, 1, 0), abs=1e-9)


def test_arm_has_its_length_wherever_the_hand_is() -> None:
    figure = figure_of(Body("somebody", Pose((0, 0, 0.85)), (0.4, 0.5, 1.7), "person"))
    for direction in np.random.default_rng(3).normal(size=(50, 3)):
        goal = figure.shoulders[0] + direction / np.linalg.norm(direction) * figure.arm_length * 0.8
        upper, fore, hand = arm_parts(figure, 0, goal)
        wrist_to_palm = hand.size[0] / 2
        assert upper.size[2] + fore.size[2] + wrist_to_palm == pytest.approx(figure.arm_length, abs=1e-6)
        assert hand.offset.position == pytest.approx(goal.tolist(), abs=1e-6)


def test_what_is_no_person_has_no_shoulders(make_world: MakeWorld) -> None:
    with pytest.raises(KeyError, match="patient"):
        make_world().person("bed")
