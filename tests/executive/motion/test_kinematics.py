"""Facts about chains: forward kinematics, Jacobians, mimics, locked joints, errors."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.motion.kinematics import Chain
from planlang.geometry import Array, Pose
from planlang.geometry.urdf import NoSuchChain
from tests.support.refusals import refusal

ROBOTS = ["amigo", "pr2", "panda"]
SMALL = """<robot name="small">
  <link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/><link name="f"/><link name="g"/>
  <joint name="turn" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="2" velocity="0.5"/></joint>
  <joint name="mount" type="fixed"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/></joint>
  <joint name="slide" type="prismatic"><parent link="c"/><child link="d"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.4" velocity="0.1"/></joint>
  <joint name="follow" type="prismatic"><parent link="d"/><child link="e"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" velocity="0.1"/><mimic joint="slide" multiplier="2" offset="0.1"/></joint>
  <joint name="roll" type="continuous"><parent link="e"/><child link="f"/><axis xyz="1 0 0"/></joint>
  <joint name="drift" type="floating"><parent link="f"/><child link="g"/></joint>
</robot>"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A URDF with a joint of every kind, one that mimics another."""
    path = tmp_path / "small.urdf"
    path.write_text(SMALL)
    return path


@pytest.mark.parametrize("robot", ROBOTS)
def test_jacobian_is_the_derivative_of_forward_kinematics(robot: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of(robot)
    q = chain.sample(np.random.default_rng(1), 20)
    jacobian = chain.jacobian(q)
    here = chain.fk(q)
    h = 1e-6
    for joint in range(chain.dof):
        step = np.zeros(chain.dof)
        step[joint] = h
        ahead, behind = chain.fk(q + step), chain.fk(q - step)
        linear = (ahead[:, :3, 3] - behind[:, :3, 3]) / (2 * h)
        spin = (ahead[:, :3, :3] - behind[:, :3, :3]) / (2 * h) @ here[:, :3, :3].transpose(0, 2, 1)
        angular = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        np.testing.assert_allclose(jacobian[:, :3, joint], linear, atol=1e-8)
        np.testing.assert_allclose(jacobian[:, 3:, joint], angular, atol=1e-8)


@pytest.mark.parametrize(("robot", "tip_link"), [("panda", "panda_hand"), ("amigo", "grippoint_right")])
def test_forward_kinematics_agrees_with_pybullet(
    robot: str, tip_link: str, chain_of: Callable[[str], Chain], urdf_of: Callable[[str], Path]
) -> None:
    chain = chain_of(robot)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(urdf_of(robot)), useFixedBase=True, physicsClientId=client)
        joints = [pybullet.getJointInfo(body, i, client) for i in range(pybullet.getNumJoints(body, client))]
        index = {joint[1].decode(): joint[0] for joint in joints}
        tip = next(joint[0] for joint in joints if joint[12].decode() == tip_link)
        for q in chain.sample(np.random.default_rng(2), 20):
            for name, value in zip(chain.names, q, strict=True):
                pybullet.resetJointState(body, index[name], value, physicsClientId=client)
            state = pybullet.getLinkState(body, tip, computeForwardKinematics=True, physicsClientId=client)
            np.testing.assert_allclose(chain.fk(q)[0], Pose(state[4], state[5]).matrix(), atol=1e-6)
    finally:
        pybullet.disconnect(client)


def test_amigos_right_arm_hangs_from_its_lift(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    assert chain.names[:2] == ("spindle_joint", "shoulder_yaw_joint_right")
    assert chain.dof == 8
    assert chain.prismatic.tolist() == [True] + [False] * 7
    # lift at its zero, arm stretched straight down: 0.32 + 0.28 + 0.14 below the shoulder
    tip = chain.fk(np.zeros(8))[0]
    assert tip[2, 3] == pytest.approx(0.055 + 0.58 + 0.135 + 0.05 - 0.74, abs=1e-3)
    lifted = chain.fk([0.3, 0, 0, 0, 0, 0, 0, 0])[0]
    assert lifted[2, 3] - tip[2, 3] == pytest.approx(0.3)


@pytest.mark.parametrize("robot", ROBOTS)
def test_what_a_configuration_reaches_is_not_too_far_away(robot: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of(robot)
    reached = chain.fk(chain.sample(np.random.default_rng(2), 5000))
    assert chain.may_reach(reached).all()
    farthest = np.linalg.norm(reached[:, :3, 3] - chain.fk(chain.sample(np.random.default_rng(3), 1))[0, :3, 3], axis=1)
    away = reached.copy()
    away[:, :3, 3] += 3 * farthest.max() * np.array([0.6, 0.0, 0.8])
    assert not chain.may_reach(away).any()


def test_joints_that_slide_and_mimic_reach_as_far_as_both_of_them_slide(small: Path) -> None:
    chain = Chain.from_urdf(small, "a", "f")
    reached = chain.fk(np.stack([chain.lower, chain.upper, (chain.lower + chain.upper) / 2]))
    assert chain.may_reach(reached).all()
    outstretched = reached[1]
    outstretched[:3, 3] *= 1.5
    assert not chain.may_reach(outstretched[None]).any()


def test_result_of_a_row_does_not_depend_on_other_rows(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("panda")
    q = chain.sample(np.random.default_rng(3), 300)
    together = chain.fk(q)
    assert all(np.array_equal(chain.fk(row)[0], pose) for row, pose in zip(q, together, strict=True))


def test_joint_that_mimics_moves_with_its_master(small: Path) -> None:
    chain = Chain.from_urdf(small, "a", "f")
    assert chain.names == ("turn", "slide", "roll")
    assert chain.fk([0.0, 0.1, 0.0])[0][0, 3] == pytest.approx(1 + 0.1 + (2 * 0.1 + 0.1))
    assert chain.jacobian([0.0, 0.1, 0.0])[0, 0, 1] == pytest.approx(3.0)


def test_limits_of_a_mimic_bind_its_master(small: Path) -> None:
    chain = Chain.from_urdf(small, "a", "f")
    assert chain.lower.tolist() == pytest.approx([-1, 0, -np.pi])
    assert chain.upper.tolist() == pytest.approx([2, 0.2, np.pi])
    assert chain.velocity.tolist() == [0.5, 0.1, 0.0]


def test_mimic_without_its_master_in_the_chain_is_moved_by_the_master(small: Path) -> None:
    assert Chain.from_urdf(small, "d", "e").names == ("slide",)


def test_locked_joint_stays_where_it_is_put(small: Path) -> None:
    assert Chain.from_urdf(small, "a", "d", {"slide": 0.3}).names == ("turn",)
    assert Chain.from_urdf(small, "a", "d", {"slide": 0.3}).fk([0.0])[0][0, 3] == pytest.approx(1.3)
    assert Chain.from_urdf(small, "a", "d", ["slide"]).fk([0.0])[0][0, 3] == pytest.approx(1.0)


def test_continuous_joint_has_no_limits_and_is_taken_the_short_way(small: Path) -> None:
    chain = Chain.from_urdf(small, "a", "f")
    assert chain.within([0.0, 0.1, 50.0]).all()
    assert not chain.within([2.1, 0.1, 0.0]).any()
    np.testing.assert_allclose(chain.near([0.0, 0.0, 3.0], [0.0, 0.0, -3.0]), [0.0, 0.0, 3.0 - 2 * np.pi])


@pytest.mark.parametrize(
    ("base", "tip", "said"),
    [
        ("nowhere", "b", "there is no link 'nowhere'"),
        ("d", "b", "'b' does not hang from 'd'"),
        ("a", "g", "joint 'drift' is 'floating'"),
        ("b", "c", "no joint between them moves"),
    ],
)
def test_links_that_form_no_chain_are_refused_with_the_reason(small: Path, base: str, tip: str, said: str) -> None:
    with pytest.raises(NoSuchChain, match=said):
        Chain.from_urdf(small, base, tip)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("<robot", "XML"),
        ("<sdf/>", "<sdf>"),
        (SMALL.replace('lower="-1"', 'lower="x"'), "<limit lower='x'> of joint 'turn'"),
        (SMALL.replace('lower="-1"', 'lower="3"'), "[3.0, 2.0]"),
        (SMALL.replace('xyz="0 0 2"', 'xyz="0 0 0"'), "joint 'turn'"),
        (SMALL.replace('<parent link="a"/>', ""), "<parent>"),
    ],
)
def test_file_that_is_no_urdf_is_refused_with_the_reason(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with refusal("B009", naming=named):
        Chain.from_urdf(path, "a", "d")


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with refusal("B009"):
        Chain.from_urdf(tmp_path / "none.urdf", "a", "b")


def test_configurations_of_another_length_are_refused(small: Path) -> None:
    with pytest.raises(ValueError, match=r"expected configurations \(n, 3\)"):
        Chain.from_urdf(small, "a", "f").fk([0.0, 0.0])


def test_a_chain_of_which_nothing_moves_has_a_tip_and_no_frames(chain_of: Callable[[str], Chain]) -> None:
    moving = chain_of("amigo")
    chain = moving.locked(dict.fromkeys(moving.names, 0.1))
    np.testing.assert_allclose(chain.fk(np.zeros((2, 0))), moving.fk(np.full((2, moving.dof), 0.1)))
    assert chain.frames(np.zeros((2, 0))).shape == (2, 0, 4, 4)
    assert chain.jacobian(np.zeros((2, 0))).shape == (2, 6, 0)


def test_kinematics_need_no_program_of_the_machine(urdf_of: Callable[[str], Path], tmp_path: Path) -> None:
    code = f"""
import numpy as np, pathlib
from executive.motion import Chain
chain = Chain.from_urdf(pathlib.Path({str(urdf_of("amigo"))!r}), "base_link", "grippoint_right")
q = (chain.lower + chain.upper)[None] / 2
assert chain.solve(chain.fk(q), q[:, None] + 0.02)[1].all()
"""
    bare = {"PATH": "", "CC": "/nonexistent", "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(Path.cwd())}
    subprocess.run([sys.executable, "-c", code], env=bare, check=True)
    assert not list(tmp_path.rglob("*.so"))


def test_a_row_is_the_same_alone_and_among_many(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    q = chain.sample(np.random.default_rng(3), 300)
    many, jacobians, frames = chain.fk(q), chain.jacobian(q), chain.frames(q)
    for row in (0, 7, 150, 299):
        np.testing.assert_array_equal(chain.fk(q[row])[0], many[row])
        np.testing.assert_array_equal(chain.jacobian(q[row])[0], jacobians[row])
        np.testing.assert_array_equal(chain.frames(q[row])[0], frames[row])
    solver, seeds = chain, (q + 0.05)[:, None]
    found, solved = solver.solve(many, seeds)
    assert solved.all()
    for row in (0, 299):
        np.testing.assert_array_equal(solver.solve(many[row : row + 1], seeds[row : row + 1])[0][0], found[row])


KINDS = ("revolute", "continuous", "prismatic", "fixed")
number = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))
vector = st.tuples(number, number, number)
joint = st.tuples(st.sampled_from(KINDS), vector, vector, vector.filter(lambda axis: math.hypot(*axis) > 0.1))
mimic = st.none() | st.tuples(st.integers(0, 5), number.filter(lambda value: abs(value) > 0.2), number)


@st.composite
def mechanisms(draw: st.DrawFn) -> str:
    """URDF of a chain l0, l1, ... in which some joints follow earlier ones, maybe ones that follow others too."""
    joints = draw(st.lists(st.tuples(joint, mimic), min_size=1, max_size=6))
    lines = ['<robot name="any">', '<link name="l0"/>']
    moving: list[int] = []
    for number, ((kind, xyz, rpy, axis), follows) in enumerate(joints):
        lines.append(f'<link name="l{number + 1}"/><joint name="j{number}" type="{kind}"><parent link="l{number}"/>')
        lines.append(f'<child link="l{number + 1}"/><origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/>')
        unit = tuple(
            (np.array(axis) / math.hypot(*axis)).tolist()
        )  # as URDF asks for; PyBullet takes others as they are
        lines.append(f'<axis xyz="{_text(unit)}"/><limit lower="-9" upper="9" velocity="1" effort="1"/>')
        if follows is not None and moving and kind != "fixed":
            master, multiplier, offset = follows
            lines.append(
                f'<mimic joint="j{moving[master % len(moving)]}" multiplier="{multiplier}" offset="{offset}"/>'
            )
        lines.append("</joint>")
        if kind != "fixed":
            moving.append(number)
    return "\n".join([*lines, "</robot>"])


def _text(values: tuple[float, ...]) -> str:
    return " ".join(map(str, values))


@contextmanager
def written(text: str) -> Iterator[Path]:
    """The text as a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "any.urdf"
        path.write_text(text)
        yield path


def chain_of(path: Path, text: str) -> Chain | None:
    """Its chain from the first link to the last; None if nothing moves."""
    if all(f'type="{kind}"' not in text for kind in KINDS[:3]):
        return None
    tip = f"l{text.count('<joint')}"
    return Chain.from_urdf(path, "l0", tip)


def all_positions(text: str, chain: Chain, q: Array) -> dict[str, float]:
    """Positions of all joints, what follows others worked out one after another."""
    import xml.etree.ElementTree as ElementTree

    values = dict(zip(chain.names, q.tolist(), strict=True))
    for element in ElementTree.fromstring(text).findall("joint"):
        follows = element.find("mimic")
        if follows is not None:
            master = values[follows.attrib["joint"]]
            values[element.attrib["name"]] = master * float(follows.attrib["multiplier"]) + float(
                follows.attrib["offset"]
            )
    return values


@settings(max_examples=15, deadline=None)
@given(mechanisms(), st.integers(0, 100))
def test_forward_kinematics_of_any_mechanism_agrees_with_pybullet(text: str, seed: int) -> None:
    with written(text) as path:
        chain = chain_of(path, text)
        if chain is None:
            return
        client = pybullet.connect(pybullet.DIRECT)
        try:
            body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
            infos = [pybullet.getJointInfo(body, k, client) for k in range(pybullet.getNumJoints(body, client))]
            for q in np.random.default_rng(seed).uniform(-2, 2, (3, chain.dof)):
                for name, value in all_positions(text, chain, q).items():
                    index = next(info[0] for info in infos if info[1].decode() == name)
                    pybullet.resetJointState(body, index, value, physicsClientId=client)
                state = pybullet.getLinkState(
                    body, len(infos) - 1, computeForwardKinematics=True, physicsClientId=client
                )
                np.testing.assert_allclose(chain.fk(q)[0], Pose(state[4], state[5]).matrix(), atol=2e-6)
        finally:
            pybullet.disconnect(client)


@settings(max_examples=25, deadline=None)
@given(mechanisms(), st.integers(0, 100))
def test_jacobian_and_frames_of_any_mechanism_are_those_of_its_motion(text: str, seed: int) -> None:
    with written(text) as path:
        chain = chain_of(path, text)
        if chain is None:
            return
        last = chain.carriers[-1]
        to_last = Chain.from_urdf(path, "l0", last)
    q = np.random.default_rng(seed).uniform(-2, 2, (2, chain.dof))
    assert_is_derivative(chain, q)
    frames = chain.frames(q)
    assert frames.shape == (2, len(chain.carriers), 4, 4)
    at = q[:, [chain.names.index(name) for name in to_last.names]]
    np.testing.assert_allclose(frames[:, -1], to_last.fk(at), atol=1e-9)


def assert_is_derivative(chain: Chain, q: Array) -> None:
    """The Jacobian against central differences."""
    jacobian, here, h = chain.jacobian(q), chain.fk(q), 1e-6
    for column in range(chain.dof):
        step = h * np.eye(chain.dof)[column]
        ahead, behind = chain.fk(q + step), chain.fk(q - step)
        linear = (ahead[:, :3, 3] - behind[:, :3, 3]) / (2 * h)
        spin = (ahead[:, :3, :3] - behind[:, :3, :3]) / (2 * h) @ here[:, :3, :3].transpose(0, 2, 1)
        turning = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        np.testing.assert_allclose(jacobian[:, :3, column], linear, atol=1e-7)
        np.testing.assert_allclose(jacobian[:, 3:, column], turning, atol=1e-7)


GRIPPING_ARM = """<robot name="arm">
  <link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="l4"/>
  <joint name="j0" type="prismatic"><parent link="l0"/><child link="l1"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" velocity="1"/></joint>
  <joint name="j1" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1"/></joint>
  <joint name="j2" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1"/><mimic joint="j1" multiplier="-0.5" offset="0.2"/></joint>
  <joint name="j3" type="continuous"><parent link="l3"/><child link="l4"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/>
  </joint></robot>"""


def test_a_chain_with_a_mimic_solves_its_own_poses() -> None:
    with written(GRIPPING_ARM) as path:
        chain = chain_of(path, GRIPPING_ARM)
    assert chain is not None
    assert chain.names == ("j0", "j1", "j3")
    assert chain.carriers == ("l1", "l2", "l3", "l4")
    q = chain.sample(np.random.default_rng(0), 20)
    assert_is_derivative(chain, q)
    np.testing.assert_allclose(chain.frames(q)[:, -1], chain.fk(q), atol=1e-12)
    found, ok = chain.solve(chain.fk(q), (q + 0.02)[:, None])
    assert ok.all()
    assert chain.within(found).all()
    np.testing.assert_allclose(chain.fk(found)[:, :3, 3], chain.fk(q)[:, :3, 3], atol=1.1e-4)


def test_jacobian_agrees_with_pybullet() -> None:
    panda = Path(__import__("pybullet_data").getDataPath()) / "franka_panda" / "panda.urdf"
    chain = Chain.from_urdf(panda, "panda_link0", "panda_hand")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(panda), useFixedBase=True, physicsClientId=client)
        infos = [pybullet.getJointInfo(body, k, client) for k in range(pybullet.getNumJoints(body, client))]
        tip = next(info[0] for info in infos if info[12].decode() == "panda_hand")
        moving = [info for info in infos if info[2] != pybullet.JOINT_FIXED]
        for q in chain.sample(np.random.default_rng(2), 5):
            at = [*q.tolist(), *([0.0] * (len(moving) - len(q)))]
            for info, value in zip(moving, at, strict=True):
                pybullet.resetJointState(body, info[0], value, physicsClientId=client)
            zero, here = [0.0] * len(moving), [0.0, 0.0, 0.0]
            linear, angular = pybullet.calculateJacobian(body, tip, here, at, zero, zero, physicsClientId=client)
            there = np.concatenate([np.array(linear), np.array(angular)])[:, : chain.dof]
            np.testing.assert_allclose(chain.jacobian(q)[0], there, atol=1e-5)
    finally:
        pybullet.disconnect(client)
