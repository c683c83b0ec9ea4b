"""The reachability maps that come with planlang are those of its robots: none is missing, stale or damaged.

python tests/executive/locations/test_bundled_maps.py           writes them anew (make maps), about five minutes
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from executive.locations.reachability import GraspClass, ReachabilityMap, row_keys
from executive.locations.reachability_maps import (
    MAPS,
    build_map,
    bundled_file,
    map_key,
    packed,
    reachability_map,
    unpacked,
)
from executive.robots import bind_robot
from executive.robots.arms import ArmModel, arm_models
from planlang.diagnostics import BadInput
from planlang.files import Bundled
from sim import PlanningWorld, Scene

ROBOTS = ("amigo", "panda", "pr2")


@contextmanager
def arms_of(name: str) -> Iterator[tuple[ArmModel, ...]]:
    """The arms of a bundled robot; BadInput if its URDF is not installed."""
    robot = bind_robot(name)
    world = PlanningWorld(Scene(()), robot.body())
    try:
        yield arm_models(robot, world)
    finally:
        world.close()


def refused(what: str, share: float) -> None:
    pytest.fail(what)


def test_every_bundled_robot_has_maps_and_no_other_files_are_there() -> None:
    assert set(Bundled.ROBOT.names()) == set(ROBOTS)
    expected: set[str] = set()
    for robot in ROBOTS:
        try:
            with arms_of(robot) as arms:
                expected |= {
                    f"{robot}-{arm.name}-{grasp.value}-{map_key(arm, grasp)[:16]}.map"
                    for arm in arms
                    for grasp in GraspClass
                }
        except BadInput:  # its package is an extra
            expected |= {path.name for path in MAPS.glob(f"{robot}-*")}
    assert {path.name for path in MAPS.iterdir()} == expected, "run: make maps"


@pytest.mark.long
def test_a_map_that_is_built_here_is_the_bundled_one(tmp_path: Path) -> None:
    with arms_of("amigo") as (arm, *_):
        built = build_map(arm, GraspClass.TOP)
        bundled = reachability_map(arm, GraspClass.TOP, "amigo", refused)
    built = unpacked(packed(built), arm, GraspClass.TOP)
    assert same(built, bundled) > 0.999, "run: make maps"  # a rounding of another processor may decide otherwise


def same(one: ReachabilityMap, other: ReachabilityMap) -> float:
    """The share of rows that are in both with the same score and, but for a step, the same posture."""
    _, mine, theirs = np.intersect1d(row_keys(one.rows), row_keys(other.rows), return_indices=True)
    alike = np.abs(one.rows["score"][mine] - other.rows["score"][theirs]) < 0.01
    near = np.abs(one.postures[one.rows["posture"][mine]] - other.postures[other.rows["posture"][theirs]])
    return float((alike & (near.max(axis=1) < 0.02)).sum() / max(len(one), len(other)))


def write_maps() -> None:
    """Write all of the files, and take away those that are of nothing any more."""
    MAPS.mkdir(exist_ok=True)
    for robot in ROBOTS:
        with arms_of(robot) as arms:
            files = dict(bundled_file(arm, grasp, robot) for arm in arms for grasp in GraspClass)
        for path in MAPS.glob(f"{robot}-*"):
            path.unlink()
        for name, content in files.items():
            (MAPS / name).write_bytes(content)


if __name__ == "__main__":
    write_maps()
