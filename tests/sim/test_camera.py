"""Facts about seeing: limits, occlusion, pictures."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, CameraModel, PyBulletWorld
from sim.engine import bullet
from sim.scene import BodyShape
from tests.sim.conftest import AMIGO, MakeWorld
from tests.support.world_values import value_of

LINK = "openni_rgb_optical_frame"
LOOKING = {"neck_tilt_joint": 0.2}
SCREEN = Body("screen", Pose((-1.1, 1.6, 0.9)), (0.5, 0.02, 0.7))


def _seen(world: PyBulletWorld) -> dict[str, float]:
    return {name: detection.visible for name, detection in world.shown(LINK).items()}


@pytest.fixture
def looking(world: PyBulletWorld) -> PyBulletWorld:
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
    return world


def test_bottle_in_front_of_the_camera_is_detected_where_it_is(looking: PyBulletWorld) -> None:
    detection = looking.shown(LINK)["bottle"]
    assert detection.pose == looking.pose("bottle")
    assert detection.visible > 0.85


def test_rooms_and_markers_are_not_detected_and_nothing_that_is_tells_its_name(looking: PyBulletWorld) -> None:
    found, shown = looking.detect(LINK), looking.shown(LINK)
    assert not {"room", "door"} & shown.keys()
    assert sorted(shown.values(), key=repr) == sorted(found, key=repr)
    for detection in found:
        assert not any(name in repr(detection) for name in looking.names() if name != "bed")
        with pytest.raises(AttributeError, match=r"read its type, pose, size, label or colour"):
            _ = detection.name


def test_object_behind_a_screen_is_not_seen(make_world: MakeWorld) -> None:
    world = make_world(extra=(SCREEN,))
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
    assert "bottle" not in _seen(world)
    assert world.sight("bottle")[0] == 0.0
    world.remove("screen")
    assert "bottle" in _seen(world)


def test_half_covered_object_is_half_visible_to_picture_and_rays(make_world: MakeWorld) -> None:
    cover = Body("cover", Pose((-1.0, 2.0, 0.9)), (0.2, 0.02, 0.3))
    world = make_world(extra=(cover,))
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
    assert _seen(world)["bottle"] == pytest.approx(0.5, abs=0.2)
    assert world.sight("bottle")[0] == pytest.approx(0.5, abs=0.15)


def test_picture_and_rays_agree_on_what_is_in_view(looking: PyBulletWorld) -> None:
    for yaw in (0.0, 0.8, 1.5708, 2.5):
        looking.set_configuration(Configuration((-0.8, 0.9, yaw), LOOKING))
        seen = _seen(looking)
        for name in ("bed", "patient", "cabinet", "bottle"):
            assert looking.sight(name)[0] == pytest.approx(seen.get(name, 0.0), abs=0.2), (name, yaw)


def test_too_near_and_too_far_objects_are_not_recognised(make_world: MakeWorld) -> None:
    for camera in (CameraModel(LINK, far=1.0), CameraModel(LINK, near=2.0)):
        world = make_world(robot=replace(AMIGO, camera=camera))
        world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
        assert "bottle" not in _seen(world)
        assert world.sight("bottle")[0] == 0.0


def test_visibility_from_another_configuration_leaves_the_robot_where_it_is(looking: PyBulletWorld) -> None:
    before = value_of(looking)
    assert looking.sight("bottle", Configuration((-1.1, 0.9, -1.5708), LOOKING))[0] == 0.0
    assert looking.sight("bottle")[0] > 0.9
    assert value_of(looking) == before


def test_lines_of_sight_name_what_they_hit_first(make_world: MakeWorld) -> None:
    world = make_world(extra=(SCREEN,))
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
    share, lines = world.sight("bottle")
    assert (share, set(lines)) == (0.0, {"screen"})
    world.remove("screen")
    share, lines = world.sight("bottle")
    assert share > 0.9
    assert max(lines, key=lambda name: lines[name]) == "bottle"


def test_nothing_is_printed_by_the_physics_engine() -> None:
    root = Path(__file__).resolve().parents[2]
    program = (
        "import sys; sys.path.insert(0, 'tests/sim')\n"
        "from conftest import AMIGO, ROOM\n"
        "from sim import PyBulletWorld\n"
        "world = PyBulletWorld(ROOM, AMIGO); world.step(); world.close(); print('only this')"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("only this\n", "")


def test_pictures_are_the_same_whether_pybullet_was_built_with_numpy_or_returns_tuples(
    looking: PyBulletWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    take, made = bullet.getCameraImage, []

    def seen_by(convert: Callable[[object], object]) -> tuple[object, ...]:
        def taken(*size: int, **options: object) -> tuple[object, ...]:
            made.append([convert(one) for one in take(*size, **options)])
            return tuple(made[-1])

        monkeypatch.setattr(bullet, "getCameraImage", taken)
        ends, shown = looking.scan(LINK)
        return looking.detect(LINK), ends.tobytes(), shown.tobytes()

    arrays, tuples = seen_by(np.asarray), seen_by(lambda one: tuple(np.ravel(np.asarray(one)).tolist()))
    assert isinstance(made[0][2], np.ndarray)
    assert isinstance(made[-1][2], tuple)
    assert arrays == tuples


def test_a_hollow_thing_in_full_view_is_visible_although_its_walls_hide_each_other(make_world: MakeWorld) -> None:
    bowl = Body("bowl", Pose((-1.1, 1.75, 0.8)), (0.09, 0.09, 0.12), shape=BodyShape.CYLINDER, wall=0.004)
    world = make_world(extra=(bowl,))
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), {"neck_tilt_joint": 0.4}))
    assert _seen(world)["bowl"] > 0.7
