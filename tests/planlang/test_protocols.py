"""Poses obey the laws of rigid motions; what crosses the borders between the layers are values."""

import copy
import math
from dataclasses import FrozenInstanceError
from importlib.metadata import version

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import planlang
from executive.modules.arm.reaching import Reaching
from executive.modules.gripper import Grasping, Handover
from executive.modules.looking.perception import Head, Perception
from executive.modules.navigation import Navigation
from executive.runs.assembly import RobotExecutive
from planlang.changes import Physics
from planlang.failures import LowLevelFailure, PlanFailure
from planlang.geometry import Pose
from planlang.language.executive import Executive
from planlang.language.process_module import NEEDED, ProcessModule
from planlang.protocols import Configuration, Contact, Detection, Group, GroupKind, Motion, RobotInterface
from sim import PyBulletWorld
from sim.truth import Truth

length = st.floats(-10.0, 10.0)
quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda q: math.hypot(*q) > 1e-2)
    .map(lambda q: tuple(value / math.hypot(*q) for value in q))
)
poses = st.builds(Pose, st.tuples(length, length, length), quaternions)
IDENTITY = Pose((0.0, 0.0, 0.0))


def same(one: Pose, other: Pose) -> bool:
    """Equal up to rounding and the sign of the quaternion."""
    return bool(np.allclose(one.matrix(), other.matrix(), atol=1e-9))


@given(poses)
def test_a_pose_undone_is_no_motion(pose: Pose) -> None:
    assert same(pose @ pose.inverse(), IDENTITY)
    assert same(pose.inverse() @ pose, IDENTITY)
    assert same(pose @ IDENTITY, pose)


@given(poses, poses, poses)
def test_poses_compose_in_any_grouping(a: Pose, b: Pose, c: Pose) -> None:
    assert same((a @ b) @ c, a @ (b @ c))


@given(poses, poses)
def test_the_inverse_of_a_chain_is_the_chain_of_inverses_backwards(a: Pose, b: Pose) -> None:
    assert same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(poses)
def test_the_matrix_of_a_pose_is_a_rotation_and_a_translation(pose: Pose) -> None:
    matrix = pose.matrix()
    assert np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
    assert matrix[:3, 3] == pytest.approx(pose.position)
    assert matrix[3] == pytest.approx([0.0, 0.0, 0.0, 1.0])


@given(length, length, st.floats(-math.pi + 1e-6, math.pi))
def test_a_planar_pose_has_the_heading_it_was_made_with(x: float, y: float, yaw: float) -> None:
    pose = Pose.planar(x, y, yaw, 0.5)
    assert pose.yaw == pytest.approx(yaw, abs=1e-9)
    assert pose.position == (x, y, 0.5)
    assert pose.matrix()[:3, 0] == pytest.approx([math.cos(yaw), math.sin(yaw), 0.0], abs=1e-9)


@given(poses, poses, poses)
def test_distance_does_not_depend_on_the_frame(a: Pose, b: Pose, frame: Pose) -> None:
    assert (frame @ a).distance(frame @ b) == pytest.approx(a.distance(b), abs=1e-9)


@given(poses)
def test_a_pose_made_from_numpy_is_of_plain_floats_that_json_can_write(pose: Pose) -> None:
    again = Pose.from_matrix(pose.matrix())
    assert {type(value) for value in (*again.position, *again.orientation)} == {float}


@pytest.mark.parametrize(
    ("value", "field"),
    [
        (Pose((0.0, 0.0, 0.0)), "position"),
        (Configuration((0.0, 0.0, 0.0), {}), "base"),
        (Contact("hand", "bed", 0.01), "depth"),
        (Motion("done"), "state"),
        (Detection("Bottle", Pose((0.0, 0.0, 0.0)), 1.0, (0.06, 0.06, 0.2)), "visible"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_crosses_a_border_cannot_be_changed(value: object, field: str) -> None:
    with pytest.raises(FrozenInstanceError):
        setattr(value, field, None)


def test_a_detection_has_no_name_and_says_what_to_read() -> None:
    seen = Detection("Bottle", Pose((0.0, 0.0, 0.0)), 1.0, (0.06, 0.06, 0.2))
    with pytest.raises(AttributeError, match=r"read its type, pose, size, label or colour; platform\.sensing\.see\(\)"):
        assert seen.name
    assert not hasattr(Motion("blocked"), "blocked_by"), "nor does a motion name what has stopped it"


def public(protocol: type) -> set[str]:
    """Names that a protocol asks for."""
    return {name for name in (*vars(protocol), *protocol.__annotations__) if not name.startswith("_")}


@pytest.mark.parametrize(
    ("protocol", "kind"),
    [
        (RobotInterface, PyBulletWorld),
        (Truth, PyBulletWorld),
        (Physics, PyBulletWorld),
        (Executive, RobotExecutive),
    ],
)
def test_the_simulator_and_the_executive_have_all_that_their_protocols_ask_for(protocol: type, kind: type) -> None:
    given_at_creation = {"rate", "modules", "scene", "steps", "changed", "simulated"}
    assert public(protocol) - given_at_creation <= set(dir(kind))


def test_a_robot_has_of_the_truth_only_where_it_is_itself() -> None:
    assert public(RobotInterface) & public(Truth) == {"rate", "configuration", "link_pose"}


MODULES = (Navigation, Reaching, Grasping, Head, Perception, Handover)


@pytest.mark.parametrize("module", MODULES)
def test_a_process_module_says_what_it_performs_and_how_it_may_fail(module: type[ProcessModule]) -> None:
    assert set(NEEDED) <= set(dir(module))
    assert module.actions
    assert all(issubclass(failure, PlanFailure) for failure in module.failures)
    assert any(issubclass(failure, LowLevelFailure) for failure in module.failures)


def test_no_two_modules_perform_the_same_class_or_share_a_name() -> None:
    performed = [cls for module in MODULES for cls in module.__dict__["actions"]]
    assert len(performed) == len(set(performed))
    assert len({module.__dict__["name"] for module in MODULES}) == len(MODULES)


def test_all_names_that_are_listed_can_be_imported() -> None:
    assert all(hasattr(planlang, name) for name in planlang.__all__)


def test_planlang_tells_its_version() -> None:
    assert planlang.__version__ == version("planlang")
    with pytest.raises(AttributeError, match="has no attribute 'pars'"):
        _ = getattr(planlang, "pars")  # noqa: B009 - mypy knows that there is none


component = st.floats(-1.0, 1.0)
unit_poses = st.builds(Pose, st.tuples(component, component, component), st.tuples(*[component] * 4))


@given(st.tuples(component, component, component, component).filter(lambda q: math.hypot(*q) > 1e-3))
def test_a_pose_survives_becoming_a_matrix_and_back(quaternion: tuple[float, float, float, float]) -> None:
    norm = math.hypot(*quaternion)
    x, y, z, w = (value / norm for value in quaternion)
    pose = Pose((1.0, 2.0, 3.0), (x, y, z, w))
    again = Pose.from_matrix(pose.matrix())
    assert again.position == pose.position
    assert abs(np.dot(again.orientation, pose.orientation)) == pytest.approx(1.0, abs=1e-12)


def test_a_half_turn_about_a_diagonal_keeps_its_axis() -> None:
    half_turn = np.eye(4)
    half_turn[:3, :3] = [[0, -1, 0], [-1, 0, 0], [0, 0, -1]]
    assert np.allclose(Pose.from_matrix(half_turn).matrix(), half_turn, atol=1e-12)


@given(st.lists(unit_poses, max_size=6))
def test_many_matrices_at_once_are_to_the_last_bit_those_of_one_by_one(several: list[Pose]) -> None:
    together = Pose.matrices(several)
    assert together.shape == (len(several), 4, 4)
    for matrix, pose in zip(together, several, strict=True):
        assert (matrix == pose.matrix()).all()


@pytest.mark.parametrize(
    ("group", "text"),
    [
        (Group(GroupKind.BASE), "base"),
        (Group(GroupKind.HEAD), "head"),
        (Group(GroupKind.ARMS, "right"), "right"),
        (Group(GroupKind.ARMS, "right", "left"), "right and left"),
        (Group(GroupKind.FINGERS, "left_arm"), "gripper of left_arm"),
    ],
)
def test_a_group_is_its_text_and_is_read_from_it(group: Group, text: str) -> None:
    read = Group.of(text)
    assert (group, hash(group)) == (text, hash(text))
    assert (read, read.kind, read.arms) == (text, group.kind, group.arms)
    assert Group.of(group) is group
    copied = copy.deepcopy(group)
    assert (copied, copied.kind, copied.arms) == (group, group.kind, group.arms)
