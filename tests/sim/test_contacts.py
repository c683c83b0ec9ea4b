"""Contacts, boxes and outlines: what counts, how much room things take, and that asking changes nothing."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from contextlib import closing

import numpy as np
import pybullet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.files import bundled
from planlang.geometry import Pose
from planlang.protocols import Configuration, Contact
from sim import Body, CameraModel, PlanningWorld, PyBulletWorld, RobotBody, Scene
from tests.sim.conftest import AMIGO, GRASPING, LEVEL_HAND, ROOM, MakeWorld, grasp
from tests.support.locations.queries import Interrupter, physics
from tests.support.world_values import value_of

HANGING = {f"{joint}_joint_{side}": 0.0 for joint in ("elbow_pitch", "shoulder_pitch") for side in ("right", "left")}
BEFORE_THE_CABINET = Configuration((-1.32, 1.73, 1.5708), HANGING)


def _pairs(contacts: tuple[Contact, ...]) -> set[tuple[str, str]]:
    return {(contact.part, contact.body) for contact in contacts}


def test_robot_in_the_middle_of_the_room_touches_nothing(world: PyBulletWorld) -> None:
    assert world.contacts() == ()


def test_base_plate_in_the_cabinet_is_a_contact_with_its_depth(world: PyBulletWorld) -> None:
    (contact,) = world.contacts(BEFORE_THE_CABINET)
    assert (contact.part, contact.body) == ("base_plate", "cabinet")
    assert abs(contact.depth - (1.73 + 0.333 - 2.05)) < 1e-3


def test_walls_block_and_the_floor_does_not(world: PyBulletWorld) -> None:
    joints = world.configuration().joints
    assert ("base_plate", "room") in _pairs(world.contacts(Configuration((-2.8, 0.0, 0.0), joints)))
    assert world.contacts(Configuration((-2.6, -1.0, 3.1416), joints)) == ()


def test_asking_about_another_configuration_changes_nothing(world: PyBulletWorld) -> None:
    before, place = value_of(world), world.link_pose("hand_right")
    world.contacts(BEFORE_THE_CABINET)
    assert value_of(world) == before
    assert world.link_pose("hand_right") == place


def _hand_in_the_base() -> dict[str, float]:
    angles = {"shoulder_yaw": -0.02, "shoulder_pitch": -0.23, "shoulder_roll": 1.08, "elbow_pitch": 0.18}
    angles |= {"elbow_roll": 1.37, "wrist_pitch": 0.84, "wrist_yaw": -0.29}
    return {f"{name}_joint_right": value for name, value in angles.items()} | {"spindle_joint": 0.27}


def test_a_robot_touches_itself_alike_wherever_it_stands(world: PyBulletWorld) -> None:
    there = Configuration(BEFORE_THE_CABINET.base, _hand_in_the_base())
    own = _pairs(world.self_contacts(there))
    assert own == _pairs(world.self_contacts(Configuration(world.configuration().base, there.joints)))
    assert _pairs(world.contacts(there)) > own
    assert {"hand_right", "base"} in [set(pair) for pair in own]


def test_a_held_thing_that_touches_the_robot_counts_and_what_stands_in_the_room_does_not(world: PyBulletWorld) -> None:
    grasp(world)
    now = world.configuration()
    folded = Configuration(now.base, {**now.joints, **_hand_in_the_base()})
    links = set(world.robot.solid_names)
    assert set(world.self_contacts(folded)) == {one for one in world.contacts(folded) if one.body in links}
    assert any(one.part == "bottle" for one in world.self_contacts(folded))


def test_a_hand_deep_in_the_robots_own_base_is_a_contact(world: PyBulletWorld) -> None:
    there = Configuration(world.configuration().base, _hand_in_the_base())
    (contact,) = (one for one in world.contacts(there) if {one.part, one.body} == {"hand_right", "base"})
    assert abs(contact.depth - 0.046) < 1e-3


def test_among_given_pairs_the_same_contacts_are_found(world: PyBulletWorld) -> None:
    whole = world.contacts(BEFORE_THE_CABINET)
    among = [("base_plate", "cabinet"), ("base_plate", "room"), ("hand_right", "base")]
    assert world.contacts(BEFORE_THE_CABINET, among=among) == whole
    assert world.contacts(BEFORE_THE_CABINET, among=among[1:]) == ()
    assert world.contacts(BEFORE_THE_CABINET, among=among, ignore={("base_plate", "cabinet")}) == ()


def test_ignored_bodies_links_and_pairs_may_touch(world: PyBulletWorld) -> None:
    assert world.contacts(BEFORE_THE_CABINET, ignore={"cabinet"}) == ()
    assert world.contacts(BEFORE_THE_CABINET, ignore={("base_plate", "cabinet")}) == ()
    assert world.contacts(BEFORE_THE_CABINET, ignore={("base", "cabinet")}) != ()


def test_only_links_that_the_moving_joints_move_are_looked_at(world: PyBulletWorld) -> None:
    assert world.contacts(BEFORE_THE_CABINET, moving=("elbow_pitch_joint_right",)) == ()
    assert world.contacts(BEFORE_THE_CABINET, moving=("x", "y")) != ()


def test_markers_and_removed_bodies_touch_nothing(world: PyBulletWorld) -> None:
    assert world.contacts(Configuration((-2.6, 0.0, 0.0), world.configuration().joints)) == ()
    world.remove("cabinet")
    assert world.contacts(BEFORE_THE_CABINET) == ()
    world.restore("cabinet")
    assert world.contacts(BEFORE_THE_CABINET) != ()


def test_fingers_in_the_object_to_be_grasped_are_told_by_name(world: PyBulletWorld) -> None:
    world.set_pose("bottle", Pose((-1.06, 2.11, 0.9)))
    assert _pairs(world.contacts(GRASPING)) == {("finger2_right", "bottle")}


def test_held_object_may_touch_its_support_until_they_have_parted(world: PyBulletWorld) -> None:
    grasp(world)
    x, y, yaw = GRASPING.base
    lowered = {**GRASPING.joints, "spindle_joint": 0.38}
    assert world.contacts(Configuration((x, y, yaw), lowered)) == (), "one centimetre into the cabinet"
    deeper = {**GRASPING.joints, "spindle_joint": 0.36}
    assert ("bottle", "cabinet") in _pairs(world.contacts(Configuration((x, y, yaw), deeper)))
    world.set_configuration(Configuration((x, y, yaw), {"spindle_joint": 0.4}))
    assert ("bottle", "cabinet") in _pairs(world.contacts(Configuration((x, y, yaw), lowered)))


def test_held_object_that_meets_something_else_is_a_contact_of_the_object(make_world: MakeWorld) -> None:
    box = Body("box", Pose((-0.94, 2.11, 0.85)), (0.1, 0.1, 0.1))
    world = make_world(extra=(box,))
    grasp(world)
    x, y, yaw = GRASPING.base
    assert world.contacts() == ()
    assert ("bottle", "box") in _pairs(world.contacts(Configuration((x + 0.11, y, yaw), {})))


def test_hand_and_what_it_holds_are_no_contact(world: PyBulletWorld) -> None:
    grasp(world)
    assert world.contacts(Configuration((0.0, -1.0, 0.0), {"finger1_joint_right": -0.1})) == ()


def test_two_worlds_do_not_know_of_each_other(make_world: MakeWorld) -> None:
    truth, belief = make_world(), make_world()
    belief.set_pose("bottle", Pose((0.0, 0.0, 0.1)))
    belief.set_configuration(BEFORE_THE_CABINET)
    assert truth.contacts() == ()
    assert truth.pose("bottle").position == (-1.1, 2.11, 0.9)


def test_worlds_made_alike_and_stepped_alike_are_in_equal_states(make_world: MakeWorld) -> None:
    first, second = make_world(), make_world()
    for world in (first, second):
        grasp(world)
        world.release("bottle")
        world.step()
    assert (first.steps, value_of(first)) == (second.steps, value_of(second))
    second.set_pose("bottle", Pose((0.0, 0.0, 0.1)))
    assert value_of(first) != value_of(second)


JOINTS = ("spindle_joint", "neck_pan_joint", "elbow_pitch_joint_left", "wrist_yaw_joint_right", "finger1_joint_left")
bases = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
moves = st.tuples(st.none() | bases, st.dictionaries(st.sampled_from(JOINTS), st.floats(0.0, 0.2), max_size=3))


@pytest.fixture(scope="module")
def amigo() -> Iterator[PlanningWorld]:
    world = PlanningWorld(ROOM, AMIGO)
    yield world
    world.close()


@given(st.lists(st.tuples(moves, st.booleans()), min_size=1, max_size=6))
def test_boxes_are_the_same_whatever_moved_before_and_whenever_they_were_asked_for(
    amigo: PlanningWorld, steps: list[tuple[tuple[tuple[float, float, float] | None, dict[str, float]], bool]]
) -> None:
    robot = amigo.robot
    for (base, joints), asked in steps:
        robot.show(Configuration(base or robot.base, joints))
        if asked:
            robot.boxes()
    everything = range(len(robot.solid))
    for found, expected in zip(robot.boxes(), robot.boxes_of(everything), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5)


def test_what_is_held_is_where_the_hand_has_it_whatever_was_looked_at_in_between(world: PlanningWorld) -> None:
    grasp(world)
    before = world.pose("bottle")
    now = world.configuration()
    elsewhere = Configuration((0.0, 0.0, 0.0), {**now.joints, "elbow_pitch_joint_right": 1.0})
    world.contacts(elsewhere)
    assert world.pose("bottle") == before
    world.set_configuration(elsewhere)
    moved = world.pose("bottle")
    assert moved.distance(before) > 0.5
    put = Pose((moved.position[0], moved.position[1], moved.position[2] + 0.1), moved.orientation)
    world.set_pose("bottle", put)
    world.step()
    assert world.pose("bottle").distance(put) < 1e-6


def test_pieces_of_bodies_leave_out_floor_markers_held_and_removed_ones(world: PyBulletWorld) -> None:
    grasp(world)
    world.remove("bed")
    solids = world.solids()
    places = {solid.pose.position for solid in solids}
    assert world.scene.body("cabinet").pose.position in places
    for absent in ("bed", "bottle", "door"):
        assert world.scene.body(absent).pose.position not in places
    tops = [solid.pose.position[2] + solid.size[2] / 2 for solid in solids]
    assert min(tops) > 0.0


def test_silhouette_holds_plate_and_hands_and_grows_with_what_is_held(world: PyBulletWorld) -> None:
    plain = world.silhouette()
    low = [radius for z_low, _, radius in plain if z_low < 0.1]
    assert max(low) == pytest.approx(0.333, abs=0.001), "the plate is as wide as its disc"
    grasp(world)
    place = world.configuration()
    assert len(world.silhouette()) == len(plain) + 1
    assert world.configuration() == place
    assert max(radius for *_, radius in world.silhouette()) > 0.43


def test_refused_configuration_changes_nothing(world: PyBulletWorld) -> None:
    before = value_of(world)
    with pytest.raises(ValueError, match="no joint knee"):
        world.set_configuration(Configuration((0.0, 0.0, 0.0), {"knee": 1.0}))
    assert value_of(world) == before
    assert world.contacts() == ()


def test_released_with_nothing_below_stays_in_the_air(world: PyBulletWorld) -> None:
    world.set_pose("bottle", Pose((20.0, 0.0, 1.0)))
    world.attach("grippoint_right", "bottle")
    world.release("bottle")
    assert not world.falling("bottle")
    assert world.support("bottle") is None


DIRECTIONS = np.linspace(0.0, 2 * math.pi, 120, endpoint=False)


@pytest.fixture
def alone(make_world: MakeWorld) -> PyBulletWorld:
    """Amigo at the origin of an empty world, the right hand level."""
    world = make_world(bodies=(), start=(0.0, 0.0, 0.0))
    world.set_configuration(Configuration((0.0, 0.0, 0.0), LEVEL_HAND))
    return world


def pushed(world: PyBulletWorld, number: int) -> float:
    """Return how far a solid link reaches from the vertical through the origin, by a wall that meets it from around."""
    robot, away = world.robot, 3.0
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.01, 5.0, 5.0], physicsClientId=robot.client)
    wall = pybullet.createMultiBody(0, shape, physicsClientId=robot.client)
    reach = 0.0
    for direction in DIRECTIONS:
        place = [away * math.cos(direction), away * math.sin(direction), 1.0]
        turn = pybullet.getQuaternionFromEuler([0.0, 0.0, direction])
        pybullet.resetBasePositionAndOrientation(wall, place, turn, physicsClientId=robot.client)
        near = pybullet.getClosestPoints(robot.uid, wall, away, robot.solid[number], -1, physicsClientId=robot.client)
        reach = max([reach, *(away - 0.01 - point[8] for point in near)])
    pybullet.removeBody(wall, physicsClientId=robot.client)
    return reach


def test_the_spread_of_each_link_is_where_a_wall_meets_it_cylinders_having_round_ends(alone: PyBulletWorld) -> None:
    alone.contacts()
    for number, name in enumerate(alone.robot.solid_names):
        measured = pushed(alone, number)
        assert measured - 2e-3 <= alone.robot.spread(number) <= measured + 0.02, name


def test_the_links_of_a_hand_are_palm_and_fingers(alone: PyBulletWorld) -> None:
    for side, other in (("right", "left"), ("left", "right")):
        links = alone.robot.hand_links(f"grippoint_{side}")
        assert set(AMIGO.hands[f"hand_{side}"]) <= links
        assert not any(other in name for name in links)


def test_a_hand_fits_into_a_tube_of_its_radius_around_the_approach(alone: PyBulletWorld) -> None:
    radius = alone.robot.hand_radius("grippoint_right", (1.0, 0.0, 0.0))
    assert 0.03 < radius < 0.2
    frame = alone.link_pose("grippoint_right").matrix()
    lower, upper = alone.robot.boxes()
    for number, name in enumerate(alone.robot.solid_names):
        if name in alone.robot.hand_links("grippoint_right"):
            middle = (lower[number] + upper[number]) / 2 - frame[:3, 3]
            across = middle - (middle @ frame[:3, 0]) * frame[:3, 0]
            assert np.linalg.norm(across) <= radius, name


def test_without_its_arms_the_robot_is_no_wider_than_its_base(alone: PyBulletWorld) -> None:
    arms = [name for name in alone.configuration().joints if name.endswith(("_right", "_left"))]
    whole, body = alone.silhouette(), alone.silhouette(without=arms)
    assert len(body) < len(whole)
    assert set(body) <= set(whole)
    assert max(radius for _, _, radius in body) < 0.36 < max(radius for _, _, radius in whole)


def test_what_an_arm_holds_counts_with_the_arm(make_world: MakeWorld) -> None:
    world = make_world()
    grasp(world)
    arm = [name for name in world.configuration().joints if name.endswith("_right")]
    empty = make_world()
    empty.set_configuration(world.configuration())
    assert len(world.silhouette()) == len(empty.silhouette()) + 1
    assert world.silhouette(without=arm) == empty.silhouette(without=arm)


def test_asking_how_much_room_is_taken_changes_nothing(make_world: MakeWorld) -> None:
    world = make_world()
    grasp(world)
    before = value_of(world)
    world.silhouette()
    world.silhouette(without=["spindle_joint"])
    world.solids()
    assert value_of(world) == before


def test_an_outline_is_where_walls_meet_the_link_and_holds_no_more(alone: PyBulletWorld) -> None:
    shapes = alone.outlines()
    assert len(shapes) == len(alone.robot.solid_names)
    for number, (low, high, corners) in enumerate(shapes):
        assert low < high
        widest = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        assert pushed(alone, number) - 0.02 <= widest <= pushed(alone, number) + 2e-3


def test_outlines_are_told_in_the_frame_of_the_base_wherever_it_stands(alone: PyBulletWorld) -> None:
    before = alone.outlines()
    alone.set_configuration(Configuration((1.0, -2.0, 0.7), alone.configuration().joints))
    for one, other in zip(before, alone.outlines(), strict=True):
        np.testing.assert_allclose(one[2], other[2], atol=1e-9)


def test_links_that_a_joint_moves_together_do_not_move_against_each_other(alone: PyBulletWorld) -> None:
    robot = alone.robot
    apart = robot.moved_apart(frozenset({"elbow_pitch_joint_right"}))
    forearm, hand, upper = (robot.number[name] for name in ("fore_arm_right", "hand_right", "upper_arm_right"))
    assert apart[forearm, upper]
    assert apart[upper, hand]
    assert not apart[forearm, hand]
    assert not robot.moved_apart(frozenset({"x", "y"})).any()


DIRTY_ROOM = Scene(
    (
        Body("table", Pose((1.5, 0.0, 0.35)), (0.8, 0.8, 0.7)),
        Body("cup", Pose((1.3, 0.0, 0.75)), (0.08, 0.08, 0.1), "cylinder", movable=True),
    )
)
ELSEWHERE = Configuration((0.5, 0.2, 0.4), {"spindle_joint": 0.3, "elbow_pitch_joint_left": 1.2})
QUESTIONS: dict[str, Callable[[PlanningWorld], object]] = {
    "support": lambda world: world.support("cup"),
    "contacts": lambda world: world.contacts(ELSEWHERE),
    "link pose": lambda world: world.link_pose("grippoint_left", ELSEWHERE),
    "silhouette": lambda world: world.silhouette(),
    "outlines": lambda world: world.outlines(),
    "sight": lambda world: world.sight("cup", ELSEWHERE),
}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # generators that it hits
@pytest.mark.parametrize("question", QUESTIONS)
def test_an_interrupted_question_leaves_the_world_and_its_physics_as_they_were(question: str) -> None:
    urdf = bundled("ontologies") / "robots" / "amigo.urdf"
    world = PlanningWorld(DIRTY_ROOM, RobotBody(urdf, CameraModel("openni_rgb_optical_frame")))
    try:
        QUESTIONS[question](world)  # makes in the client what it comes near
        before = value_of(world), physics(world.robot.client)
        whole = False
        for calls in (*range(1, 80), *range(80, 4000, 17)):
            with contextlib.suppress(KeyboardInterrupt), Interrupter(calls):
                QUESTIONS[question](world)
                whole = True
            if whole:
                break
            assert (value_of(world), physics(world.robot.client)) == before, f"interrupted at call {calls}"
        assert whole
    finally:
        world.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_question_interrupted_while_bodies_are_made_is_answered_rightly_afterwards() -> None:
    urdf = bundled("ontologies") / "robots" / "amigo.urdf"
    body = RobotBody(urdf, CameraModel("openni_rgb_optical_frame"))
    answers = set()
    for calls in (10_000, *range(1, 90, 4)):
        world = PlanningWorld(DIRTY_ROOM, body)
        try:
            with contextlib.suppress(KeyboardInterrupt), Interrupter(calls):
                world.sight("cup", ELSEWHERE)
            share, lines = world.sight("cup", ELSEWHERE)
            support = world.support("cup")
            pieces = physics(world.robot.client)
            answers.add((share, tuple(sorted(lines.items())), support, len(pieces)))
        finally:
            world.close()
    assert len(answers) == 1


def test_of_a_large_map_only_what_something_comes_near_is_made_in_the_physics_client() -> None:
    boxes = tuple(
        Body(f"box{k}", Pose((3.0 + 0.5 * (k % 40), 0.5 * (k // 40), 0.2)), (0.3, 0.3, 0.4)) for k in range(2_000)
    )
    urdf = bundled("ontologies") / "robots" / "amigo.urdf"
    with closing(PlanningWorld(Scene(boxes), RobotBody(urdf, CameraModel("openni_rgb_optical_frame")))) as world:
        assert {contact.body for contact in world.contacts(Configuration((3.2, 0.1, 0.0), {}))} >= {"box0"}
        assert world.support("box1") == "floor"
        assert not world.clear_lines(np.array([[2.0, 0.0, 0.2]]), np.array([[3.2, 0.0, 0.2]]))[0]
        assert len(physics(world.robot.client)) < 50


def test_a_body_that_was_moved_hidden_or_removed_before_it_was_made_is_where_it_belongs() -> None:
    cups = tuple(Body(f"cup{k}", Pose((1.0, 0.5 * k, 0.5)), (0.1, 0.1, 0.1), movable=True) for k in range(3))
    with closing(PlanningWorld(Scene(cups))) as world:
        world.set_pose("cup0", Pose((1.0, 0.0, 0.9)))
        world.remove("cup1")
        lines = np.array([[0.0, y, z] for y, z in ((0.0, 0.5), (0.0, 0.9), (0.5, 0.5), (1.0, 0.5))])
        assert world.clear_lines(lines, lines + np.array((2.0, 0.0, 0.0))).tolist() == [True, False, True, False]
        world.restore("cup1")
        assert world.clear_lines(lines, lines + np.array((2.0, 0.0, 0.0))).tolist() == [True, False, False, False]


def test_a_tray_rests_on_its_table_not_on_the_hollow_cup_that_stands_on_it() -> None:
    table = Body("table", Pose((0.0, 0.0, 0.37)), (0.8, 0.8, 0.74))
    tray = Body("tray", Pose((0.0, 0.0, 0.755)), (0.32, 0.45, 0.03), movable=True, wall=0.004)
    cup = Body("cup", Pose((0.0, 0.0, 0.791)), (0.07, 0.07, 0.09), movable=True, wall=0.004)
    with closing(PyBulletWorld(Scene((table, tray, cup)))) as world:
        assert (world.support("tray"), world.support("cup")) == ("table", "tray")
