"""What of an arm's reach the robot's own body is in the way of, and what to write about it."""

from __future__ import annotations

import re
from pathlib import Path

from executive.locations.capabilities import Capabilities, capabilities_of
from executive.locations.reachability import GraspClass
from executive.locations.reachability_maps import build_map
from executive.robots import bind_robot
from executive.robots.arms import arm_models, with_carrying
from sim import PlanningWorld, Scene
from tests.support.hands import TWO, robot_with


def reaching(path: Path, name: str, grasp: GraspClass) -> Capabilities:
    """What a robot can do, with the reach of one arm by one class of grasps."""
    robot = with_carrying(bind_robot(path))
    world = PlanningWorld(Scene(()), robot.body())
    models = arm_models(robot, world)
    world.close()
    (arm,) = (one for one in models if one.name == name)
    return capabilities_of(robot, models, {name: {grasp: build_map(arm, grasp)}})


def test_the_floor_is_no_part_of_the_own_body(tmp_path: Path) -> None:
    path, urdf = robot_with(tmp_path, arm=TWO), tmp_path / "mine.urdf"
    low = urdf.read_text().replace('xyz="0.1 0.0 0.5"', 'xyz="0.1 0.0 0.05"')
    urdf.write_text(low.replace("0 0 0.25", "0 0 0.02").replace("0.4 0.4 0.48", "0.1 0.1 0.02"))
    path.write_text(path.read_text().replace("radius = 0.25", "radius = 0.1"))
    own = reaching(path, "arm", GraspClass.SIDE).reaches[0].own_body
    assert own.share < 0.05
    assert own.link == "base"


def test_for_another_arm_in_the_way_another_carrying_posture_is_advised(tmp_path: Path) -> None:
    path, urdf = robot_with(tmp_path, left=TWO, right=TWO), tmp_path / "mine.urdf"
    text = urdf.read_text().replace('xyz="0.1 0.2 0.5"', 'xyz="0.1 -0.2 0.5"')
    big = r'\1<collision><geometry><box size="0.8 0.3 1.2"/></geometry></collision></link>'
    urdf.write_text(re.sub(r'(<link name="right_l3">).*?</link>', big, text))
    lines = (
        f"{side}_j{k} = {-0.5 if side + str(k) == 'left2' else 0}\n" for side in ("left", "right") for k in range(1, 5)
    )
    path.write_text(f"{path.read_text()}[postures.carrying]\n{''.join(lines)}")
    found = reaching(path, "left", GraspClass.SIDE)
    assert found.reaches[0].own_body.other == "right"
    (said,) = (str(one) for one in found.warnings if "places" in one.what)
    assert re.fullmatch(
        r"the left arm cannot go to \d+ % of places, as parts of the robot touch, mostly right_l\d and left_l\d, with "
        r"the right arm in its carrying posture: another posture of the right arm in \[postures.carrying\]",
        said,
    )
