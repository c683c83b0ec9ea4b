"""Strokes: how slowly they are made, and what may lean meanwhile."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from executive.modules.tools.strokes import slowed
from planlang import perform
from planlang.designators import action, an_object
from planlang.geometry import Pose
from planlang.motion_constraints import a_constraint, a_feature
from planlang.protocols import Trajectory
from sim import Body
from tests.executive.conftest import PLACE, MakeStage, stand

TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.9, 1.4, 0.74), type="KitchenTable")


@given(st.floats(1.0, 20.0), st.integers(2, 40))
def test_a_slowed_motion_goes_the_same_way_and_takes_so_many_times_as_long(factor: float, count: int) -> None:
    rows = np.stack([np.linspace(0.0, 1.0, count), np.linspace(1.0, -1.0, count)], axis=1)
    slow = slowed(Trajectory(("a", "b"), rows), factor).positions
    assert abs((len(slow) - 1) - factor * (count - 1)) <= 0.5 + 1e-9
    assert np.allclose(slow[[0, -1]], rows[[0, -1]])
    assert np.all(np.diff(slow[:, 0]) > 0)
    assert np.allclose(slow[:, 1], 1.0 - 2.0 * slow[:, 0])


def test_a_tool_that_is_upright_after_its_circles_is_watched_again(make_stage: MakeStage) -> None:
    pan = Body(
        "pan", Pose((1.0, 0.0, 0.79)), (0.3, 0.3, 0.1), "cylinder", type="FryingPan", iri=PLACE + "pan", wall=0.01
    )
    mug = Body(
        "mug", Pose((0.0, 0.0, 1.5)), (0.04, 0.04, 0.2), type="Cup", iri=PLACE + "mug", movable=True, largest_tilt=0.3
    )
    stage = make_stage(TABLE, pan, mug)
    stand(stage, (0.3, 0.0, 0.0))
    arm = stage.platform.robot.arm("left")
    x, y, z = stage.truth.link_pose(arm.tip).position
    stage.truth.set_pose("mug", Pose((x, y, z)))
    stage.truth.attach(arm.tip, "mug")
    offset = stage.truth.link_pose(arm.tip).inverse() @ Pose((x, y, z))
    stage.belief.grasped("mug", "left", arm.tip, offset)
    stage.platform.observe()
    bottom = a_feature("LINE", of=an_object("Cup", PLACE + "mug"), position=(0.0, 0.0, -0.1), direction=(0.0, 0.0, 1.0))
    floor = a_feature(
        "PLANE", of=an_object("FryingPan", PLACE + "pan"), position=(0.0, 0.0, -0.04), direction=(0.0, 0.0, 1.0)
    )
    over = a_constraint("HEIGHT", bottom, floor, lower=0.05, upper=0.2)
    upright = a_constraint("PERPENDICULARITY", bottom, floor, lower=0.99)
    stage.run(lambda: perform(action("CirclingMotion", constrained_by=(over, upright), number_of_circles=1)))
    assert not stage.platform.leaning
