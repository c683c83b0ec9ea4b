"""Facts about contacts: what counts, what is left out, and that asking changes nothing."""

from planlang.geometry import Pose
from planlang.protocols import Configuration, Contact
from sim import Body, PyBulletWorld
from tests.sim.conftest import GRASPING, MakeWorld, grasp

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
    before, place = world.state(), world.link_pose("hand_right")
    world.contacts(BEFORE_THE_CABINET)
    assert world.state() == before
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
    assert first.state() == second.state()
    second.step()
    assert first.state() != second.state()
