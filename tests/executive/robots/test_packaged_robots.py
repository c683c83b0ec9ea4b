"""Robots whose URDF is in an installed package, maybe on a base that the robot file describes."""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pybullet
import pytest

from executive.motion import Chain
from executive.robots import Robot, bind_robot
from executive.robots.mechanism import Mount, mounted
from planlang.diagnostics import BadInput
from sim import PlanningWorld, Scene


@pytest.fixture(params=["panda", "pr2"])
def robot(request: pytest.FixtureRequest) -> Robot:
    """A bundled robot; skips where its package is not installed."""
    if request.param == "pr2":
        try:
            distribution("example-robot-data")
        except PackageNotFoundError:
            pytest.skip("needs planlang[pr2]")
    return bind_robot(request.param)


def test_it_stands_free_of_contacts_in_its_carrying_posture_with_all_its_meshes(robot: Robot) -> None:
    assert "B013" not in [diagnostic.code for diagnostic in robot.diagnostics], "no mesh is absent"
    assert set(robot.postures["carrying"]) == {j for a in robot.arms for j in a.joints} | {robot.torso} - {None}
    world = PlanningWorld(Scene(()), robot.body())
    assert world.contacts() == ()
    lower, _ = world.robot.boxes()
    assert lower[:, 2].min() == pytest.approx(0.0, abs=0.06), "it stands on the floor"
    for arm in robot.arms:
        tip = world.link_pose(arm.tip).matrix()[:3, :3]
        assert abs((tip @ np.array(arm.approach))[2]) < 0.02, "its hands are level"
    world.close()


def test_its_urdf_can_be_loaded_by_anybody(robot: Robot) -> None:
    client = pybullet.connect(pybullet.DIRECT)
    try:
        assert pybullet.loadURDF(str(robot.urdf), useFixedBase=True, physicsClientId=client) >= 0
    finally:
        pybullet.disconnect(client)


def test_every_arm_has_seven_joints_of_its_own(robot: Robot) -> None:
    for arm in robot.arms:
        assert len(arm.joints) == 7
        assert arm.gripper
        assert Chain.from_urdf(robot.urdf, robot.base_link, arm.tip).dof == 7 + (robot.torso is not None)


ARM = '<robot name="arm"><link name="root"/><joint name="j" type="fixed"><parent link="root"/><child link="a"/></joint><link name="a"/></robot>'  # noqa: E501


@pytest.mark.parametrize(("size", "shape"), [((0.4, 0.5, 0.6), "box"), ((0.4, 0.6), "cylinder")])
def test_a_base_of_a_primitive_shape_is_put_under_the_root(
    size: tuple[float, ...], shape: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "arm.urdf").write_text(ARM)
    made = mounted(tmp_path / "arm.urdf", Mount(size, (0.1, 0.0, 0.6)))
    assert made != tmp_path / "arm.urdf"
    assert f"<{shape}" in made.read_text()
    assert mounted(tmp_path / "arm.urdf", Mount(size, (0.1, 0.0, 0.6))) == made
    assert mounted(tmp_path / "arm.urdf", Mount(size, (0.2, 0.0, 0.6))) != made


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ('urdf = { package = "pybullet", file = "no_such.urdf" }', "has no no_such.urdf"),
        ('urdf = { package = "../../etc", file = "passwd" }', "is not installed"),
        ('urdf = { package = "pybullet" }', "missing"),
        ('urdf = { package = "pybullet", file = "panda.urdf", folder = "x" }', "unknown key"),
        ('urdf = "arm.urdf"\n[mount]\nsize = [0.5]', "diameter and height"),
        ('urdf = "arm.urdf"\n[mount]\nsize = [0.5, -1.0]', "positive"),
        ('urdf = "arm.urdf"\n[mount]\nsize = [0.5, 0.5]\nat = "top"', "three numbers"),
    ],
)
def test_what_is_wrong_with_the_source_of_a_urdf_is_said(lines: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    base = "[base]\nradius = 0.3\nspeed = 1\nacceleration = 1\nturn_speed = 1\nturn_acceleration = 1\njerk = 5\n"
    (tmp_path / "robot.toml").write_text(f'name = "mine"\n{lines}\n{base}')
    with pytest.raises(BadInput, match=said):
        bind_robot(tmp_path / "robot.toml")
