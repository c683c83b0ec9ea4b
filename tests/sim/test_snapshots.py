"""Snapshots of a world: JSON from which another world of the scene goes on exactly as the first would have."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import PyBulletWorld
from tests.sim.conftest import CLOSED, MakeWorld, grasp, play

OPEN = {"finger1_joint_right": 0.4, "finger2_joint_right": -0.4}


def snapshot(world: PyBulletWorld) -> Any:
    """As it comes back from a file."""
    return json.loads(json.dumps(world.snapshot()))


def at_the_beginning(world: PyBulletWorld) -> None:
    """Nothing has happened."""


def with_the_bottle_in_the_hand(world: PyBulletWorld) -> None:
    """The bottle is grasped, and still touches the cabinet."""
    grasp(world)


def while_the_patient_reaches(world: PyBulletWorld) -> None:
    """A hand is on its way to the bottle."""
    grasp(world)
    world.set_configuration(Configuration((1.55, -0.34, 1.5708), {}))
    for _ in range(20):
        world.step()


def after_the_patient_took_it(world: PyBulletWorld) -> None:
    """The patient has the bottle."""
    while_the_patient_reaches(world)
    for _ in range(100):
        world.step()
    assert world.taken("bottle") == "patient"
    play(world, "right_gripper", OPEN)
    world.release("bottle")


def while_it_falls(world: PyBulletWorld) -> None:
    """The bottle is in the air; a cup was taken away."""
    world.set_pose("bottle", Pose((-1.2, 2.2, 1.4)))
    world.attach("grippoint_right", "bottle")
    world.release("bottle")
    world.remove("cup")
    for _ in range(4):
        world.step()
    assert world.falling("bottle")


MOMENTS = (
    at_the_beginning,
    with_the_bottle_in_the_hand,
    while_the_patient_reaches,
    after_the_patient_took_it,
    while_it_falls,
)


@pytest.mark.parametrize("moment", MOMENTS, ids=lambda moment: moment.__name__)
def test_a_world_that_is_brought_back_goes_on_as_the_first(
    moment: Callable[[PyBulletWorld], None], make_world: MakeWorld
) -> None:
    first, other = make_world(), make_world()
    moment(first)
    play(other, "base", {"x": -1.0}, rows=3)  # whatever it was before
    other.set_pose("cup", Pose((0.0, 0.0, 1.0)))
    other.restore_state(snapshot(first))
    assert other.state()[:6] == first.state()[:6]
    assert other.snapshot() == first.snapshot()
    for world in (first, other):
        play(world, "base", {"x": world.configuration().base[0] + 0.01, "yaw": 1.5}, rows=5)
        play(world, "right_gripper", CLOSED, rows=6)
        for _ in range(30):
            world.step()
    assert other.snapshot() == first.snapshot()
    assert [other.pose(name) for name in other.names()] == [first.pose(name) for name in first.names()]
    assert other.contacts() == first.contacts()


def test_a_snapshot_tells_only_what_differs_from_the_scene(world: PyBulletWorld) -> None:
    assert world.snapshot()["bodies"] == {}
    world.set_pose("cup", Pose((0.0, 0.0, 1.0)))
    assert list(world.snapshot()["bodies"]) == ["cup"]
    assert len(json.dumps(world.snapshot())) < 3000


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("base", [0.0, 0.0]),
        ("base", [0.0, 0.0, "north"]),
        ("base", [0.0, 0.0, float("nan")]),
        ("base", [0.0, 0.0, 1e300]),
        ("joints", {"third_arm": 1.0}),
        ("bodies", {"grail": [0.0] * 7}),
        ("bodies", {"cup": 17}),
        ("bodies", {"cup": [1e300, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}),
        ("bodies", {"cup": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]}),
        ("falling", {"cup": [1e300, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]}),
        ("held", {"cup": ["third_hand", [0.0] * 7, []]}),
        ("held", {"cup": []}),
        ("falling", {"cup": [0.0]}),
        ("persons", {}),
        ("persons", {"patient": {"hands": []}}),
        ("removed", ["grail"]),
        ("groups", None),
        ("step", "soon"),
        ("step", -1),
    ],
)
def test_a_damaged_snapshot_is_a_value_error(key: str, value: Any, world: PyBulletWorld) -> None:
    state = snapshot(world)
    with pytest.raises(ValueError, match=r"."):
        world.restore_state({**state, key: value})
    del state[key]
    with pytest.raises(ValueError, match="damaged"):
        world.restore_state(state)
