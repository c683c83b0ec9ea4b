"""Lanes over a surface: where a tool is moved that lies flat on it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from executive.modules.tools.lane_reach import torso_positions
from executive.modules.tools.lanes import HAND, Surface
from executive.robots.arms import ArmModel, Lift
from executive.runs.options import Outcome, RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.files import bundled
from planlang.geometry import Array, Pose
from sim import Body
from tests.executive.conftest import MakeStage

WIDTH, LENGTH = 0.07, 0.1
"""Of a sponge [m]."""
TABLE = Body("table", Pose((1.6, 0.0, 0.35)), (0.5, 0.8, 0.7), type="Table-PieceOfFurniture")
WALL = Body("wall", Pose((1.91, 0.0, 1.0)), (0.1, 3.0, 2.0), type="Wall-Construction")
"""One centimetre behind the table."""
COUNTER = Body("counter", Pose((1.91, 0.0, 0.355)), (0.1, 3.0, 0.71), type="Table-PieceOfFurniture")
"""The same, hardly higher than the table."""


def _places(make_stage: MakeStage, *bodies: Body) -> Array:
    """Return places (n, 3) of lanes over the table, in its frame."""
    stage = make_stage(TABLE, *bodies)
    x, y, z = np.eye(3)
    surface = Surface(stage.platform, "table", stage.platform.scene.world.pose("table").matrix(), 0.35 * z, z, (x, y))
    return np.concatenate([np.zeros((0, 3)), *(lane[:, :3] for lane in surface.room(WIDTH, LENGTH).lanes())])


def test_lanes_leave_the_hand_room_at_a_wall_and_begin_there(make_stage: MakeStage) -> None:
    farthest = _places(make_stage, WALL)[:, 0].max()
    wall = 0.26
    assert wall - (WIDTH / 2 + HAND) - 0.011 <= farthest <= wall - (WIDTH / 2 + HAND) + 1e-6


@pytest.mark.parametrize("bodies", [(), (COUNTER,)], ids=["nothing beside it", "a counter as high beside it"])
def test_lanes_go_to_the_edge_where_nothing_is_in_the_way_of_the_hand(
    make_stage: MakeStage, bodies: tuple[Body, ...]
) -> None:
    places = _places(make_stage, *bodies)
    assert np.abs(places[:, :2]).max(axis=0) == pytest.approx([0.25 - WIDTH / 2, 0.4 - WIDTH / 2])


def test_the_torso_is_lowered_for_wiping_only_as_far_as_the_other_arm_stays_clear_of_the_base() -> None:
    arm = cast(ArmModel, SimpleNamespace(lift=Lift("spindle", 0, 0.09, 0.39, 1.0)))
    collisions = cast(Any, SimpleNamespace(lifted=lambda _, every: tuple(one for one in every if one > 0.13)))
    now, *others = torso_positions(arm, np.array([0.25, 1.0]), collisions)
    assert now == 0.25
    assert others == pytest.approx([0.14, 0.39])


def test_no_lane_is_where_walls_leave_no_room_for_the_hand(make_stage: MakeStage) -> None:
    shelf = Body("shelf", Pose((1.6, 0.0, 0.85)), (0.6, 1.0, 0.2), type="Table-PieceOfFurniture")
    assert not len(_places(make_stage, shelf))


def test_all_that_is_free_between_things_is_wiped_though_it_is_narrow(make_stage: MakeStage) -> None:
    plate = Body("plate", Pose((1.6, 0.1, 0.71)), (0.26, 0.26, 0.02), type="DinnerPlate", movable=True)
    stage = make_stage(TABLE, plate)
    x, y, z = np.eye(3)
    pose = stage.platform.scene.world.pose("table").matrix()
    room = Surface(stage.platform, "table", pose, 0.35 * z, z, (x, y)).room(WIDTH, LENGTH)
    assert room.share(list(room.lanes()), room) > 0.9
    assert room.share(list(room.lanes())[:1], room) < 0.5


@pytest.mark.long
@pytest.mark.parametrize("name", [pytest.param("pr2", marks=pytest.mark.pr2), "panda"])
def test_a_table_at_a_wall_is_wiped_from_base_poses_that_reach_many_lanes(name: str) -> None:
    """Once the lanes at the wall came first, where the arm has no room, and nothing was wiped."""
    folder = Path(__file__).parents[2] / "strangers" / "wipe_side_table"
    home = folder / "home_pr2_4811_004.omn"
    robot = bundled("ontologies") / "robots" / f"{name}.toml"
    options = RunOptions(recipe=home.with_suffix(".r.omn"), robot=robot, environment=home, trust_map=name == "panda")
    result = run_plan_file(options)
    assert result.outcome is Outcome.DONE, result.message
