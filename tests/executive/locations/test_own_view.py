"""What the robot's own body keeps it from seeing, told without rays, against what the planning world says."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from executive.belief.planning_scene import Unseen
from tests.support.locations.rooms import BOUNDS, asked, room_of
from tests.support.locations.stage import Stage, robot_of


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    stage = Stage(room_of("normal", 1), robot_of("amigo"))
    stage.platform.sync()
    yield stage
    stage.close()


def test_no_place_from_which_a_thing_is_seen_is_taken_for_one_from_which_it_surely_is_not(stage: Stage) -> None:
    scene, rng = stage.platform.scene, np.random.default_rng(0)
    block, view = scene.bodies.block("bottle"), scene.visibility.own_view()
    assert view is not None
    away, bearing, yaw = rng.uniform(0.3, 1.5, 120), rng.uniform(-3.1, 3.1, 120), rng.uniform(-3.1, 3.1, 120)
    bases = np.column_stack([block.x + away * np.cos(bearing), block.y + away * np.sin(bearing), yaw])
    solids = scene.collisions.solids()
    others = solids.only(np.array([body != "bottle" for body in solids.bodies], bool))
    by_itself, by_the_room = Unseen(view, block)(bases), view.hidden_by(others, bases, block)
    seen = np.array(
        [scene.visibility.hidden((float(x), float(y), float(turn)), "bottle") is None for x, y, turn in bases]
    )
    assert not (by_itself & seen).any()
    assert not (by_the_room & seen).any()
    assert by_itself.sum() > 10, "the robot cannot see behind itself"


def test_the_camera_sees_to_the_corners_of_its_picture(stage: Stage) -> None:
    camera = stage.robot.camera
    assert camera is not None
    wide, high = math.tan(camera.fov / 2), math.tan(camera.fov / 2) * camera.height / camera.width
    assert math.tan(camera.half_angle) == pytest.approx(math.hypot(wide, high))


@pytest.mark.parametrize("seed", [54, 114])
def test_a_place_is_found_where_only_few_of_thousands_will_do(seed: int) -> None:
    room = room_of("hard", seed)
    crowded = Stage(room, robot_of("amigo"))
    answer = crowded.ask(asked(room))
    crowded.close()
    assert answer.solved
    assert all(
        low < value < high for value, low, high in zip(answer.solutions[0].base[:2], BOUNDS, BOUNDS[2:], strict=False)
    )
