"""Facts about seeing: limits, occlusion, pictures."""

import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, CameraModel, PyBulletWorld
from sim.camera import save_png
from sim.engine import bullet
from tests.sim.conftest import AMIGO, MakeWorld, grasp

LINK = "openni_rgb_optical_frame"
LOOKING = {"neck_tilt_joint": 0.2}
SCREEN = Body("screen", Pose((-1.1, 1.6, 0.9)), (0.5, 0.02, 0.7))


def _seen(world: PyBulletWorld) -> dict[str, float]:
    return {detection.name: detection.visible for detection in world.detect(LINK)}


@pytest.fixture
def looking(world: PyBulletWorld) -> PyBulletWorld:
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
    return world


def test_bottle_in_front_of_the_camera_is_detected_where_it_is(looking: PyBulletWorld) -> None:
    detection = next(d for d in looking.detect(LINK) if d.name == "bottle")
    assert detection.pose == looking.pose("bottle")
    assert detection.visible > 0.85


def test_detections_come_in_the_order_of_the_scene_without_rooms_and_markers(looking: PyBulletWorld) -> None:
    names = [detection.name for detection in looking.detect(LINK)]
    assert names == [name for name in looking.names() if name in names]
    assert not {"room", "door"} & set(names)


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
    before = looking.state()
    assert looking.sight("bottle", Configuration((-1.1, 0.9, -1.5708), LOOKING))[0] == 0.0
    assert looking.sight("bottle")[0] > 0.9
    assert looking.state() == before


def test_lines_of_sight_name_what_they_hit_first(make_world: MakeWorld) -> None:
    world = make_world(extra=(SCREEN,))
    world.set_configuration(Configuration((-1.1, 0.9, 1.5708), LOOKING))
    share, lines = world.sight("bottle")
    assert (share, set(lines)) == (0.0, {"screen"})
    world.remove("screen")
    share, lines = world.sight("bottle")
    assert share > 0.9
    assert max(lines, key=lambda name: lines[name]) == "bottle"


def test_picture_is_a_valid_png_of_the_right_size(looking: PyBulletWorld, tmp_path: Path) -> None:
    looking.save_picture(tmp_path / "scene.png", width=64, height=48)
    data = (tmp_path / "scene.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (64, 48)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.png"]


def test_png_holds_the_pixels_it_was_given(tmp_path: Path) -> None:
    pixels = np.arange(4 * 3 * 3, dtype=np.uint8).reshape(4, 3, 3)
    save_png(tmp_path / "pixels.png", pixels)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "pixels.png")), pixels)


def test_a_close_view_shows_the_thing_and_the_hand_that_holds_it(world: PyBulletWorld) -> None:
    grasp(world)
    near, far = world.render(320, 240, of=["bottle"]), world.render(320, 240)
    for name, first, second in (("bottle", 1, 0), ("fingers", 0, 2)):
        shown = [(p[:, :, first] > p[:, :, second] + 40.0).sum() for p in map(np.int32, (near, far))]
        assert shown[0] > 300, f"{name} in the close view"
        assert shown[0] > 5 * shown[1], f"{name} against all of the room"
    assert np.array_equal(world.render(64, 48, of=["cabinet", "nothing"]), world.render(64, 48)), (
        "no thing, no close view"
    )


def test_default_view_shows_robot_and_furniture_and_walls_do_not_hide_them(looking: PyBulletWorld) -> None:
    picture = looking.render(320, 240)
    orange = (picture[:, :, 0] > 150) & (picture[:, :, 2] < 90) & (picture[:, :, 1] > 60)
    assert picture.shape == (240, 320, 3)
    assert orange.sum() > 2, "the fingers"
    assert looking.contacts(Configuration((-2.9, -1.0, 0.0), {})) != (), "walls are back after the picture"


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
        return looking.detect(LINK), ends.tobytes(), shown.tobytes(), looking.render(32, 24, of=["bottle"]).tobytes()

    arrays, tuples = seen_by(np.asarray), seen_by(lambda one: tuple(np.ravel(np.asarray(one)).tolist()))
    assert isinstance(made[0][2], np.ndarray)
    assert isinstance(made[-1][2], tuple)
    assert arrays == tuples
