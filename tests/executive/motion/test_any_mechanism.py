"""Facts about chains of any kind: PyBullet and finite differences agree about all joints, mimics among them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.motion import Chain, InverseKinematics
from planlang.geometry import Array, Pose

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
    found, ok = InverseKinematics(chain).solve(chain.fk(q), (q + 0.02)[:, None])
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
