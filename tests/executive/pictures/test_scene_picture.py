"""Pictures of a world: what they show, from where, and that equal worlds give equal bytes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from executive.options.declaring import view as checked
from executive.pictures.rendering import View
from executive.pictures.scene_picture import picture, save_picture
from executive.pictures.stage import Stage
from executive.pictures.viewpoints import from_top, subjects, view_of
from planlang.diagnostics import WrongOption
from planlang.files import bundled
from planlang.geometry import Pose
from sim import Body, CameraModel, PyBulletWorld, RobotBody, Scene
from sim.scene import Cavity

AMIGO = RobotBody(bundled("ontologies") / "robots" / "amigo.urdf", CameraModel("base_link"))
SMALL = (240, 160)
RED = (0.9, 0.1, 0.1, 1.0)


@pytest.fixture
def world() -> Iterator[PyBulletWorld]:
    """A red bottle beside the robot, and a screen between it and half of the room."""
    bodies = (
        Body("room", Pose((0.0, 0.0, 1.3)), (6.0, 6.0, 2.6), "room"),
        Body("table", Pose((1.0, 0.0, 0.35)), (0.6, 1.2, 0.7), kinds=("Table-PieceOfFurniture",)),
        Body("screen", Pose((1.5, 0.0, 0.9)), (0.05, 2.0, 1.8)),
        Body("bottle", Pose((0.9, 0.0, 0.8)), (0.08, 0.08, 0.2), "cylinder", color=RED, kinds=("Bottle",)),
        Body("far away", Pose((-2.8, -2.8, 0.1)), (0.1, 0.1, 0.2), color=RED),
    )
    made = PyBulletWorld(Scene(bodies), AMIGO)
    yield made
    made.close()


def _red(pixels: np.ndarray) -> int:
    red, green, blue = (pixels[:, :, k].astype(int) for k in range(3))
    return int(((red > 2 * green) & (red > 2 * blue) & (red > 90)).sum())


@pytest.mark.long
def test_a_picture_is_a_png_of_its_size_and_the_same_each_time(world: PyBulletWorld, tmp_path: Path) -> None:
    for name in ("first.png", "second.png"):
        save_picture(tmp_path / name, world, ["bottle"])
    with Image.open(tmp_path / "first.png") as image:
        assert image.size == (960, 640)
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()


def test_what_a_picture_is_about_is_seen_from_the_side_on_which_nothing_hides_it(world: PyBulletWorld) -> None:
    stage = Stage(world)
    poses = stage.poses()
    about = subjects(stage, poses, ["bottle", "far away"])
    assert [paths[0][:2] for paths in about] == [("robot", about[0][0][1]), ("bodies", "bottle")], "what is near"
    view = view_of(stage, poses, about, 1.5)
    assert view.eye[0] < 1.5, "before the screen"
    assert _red(picture(world, ["bottle"], size=SMALL)) > 20


def test_all_of_the_robot_is_in_the_picture(world: PyBulletWorld) -> None:
    stage = Stage(world)
    poses = stage.poses()
    view = view_of(stage, poses, subjects(stage, poses, ["bottle"]), SMALL[0] / SMALL[1])
    seen = np.concatenate([view.project(stage.corners(path, poses[path]), SMALL) for path in stage.robot(poses)])
    assert (seen[:, :2] > 0).all()
    assert (seen[:, :2] < SMALL).all()


def test_a_link_with_several_collision_shapes_alone_is_in_the_picture(tmp_path: Path) -> None:
    box = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>"
    urdf = tmp_path / "boxes.urdf"
    urdf.write_text(f"<robot name='boxes'><link name='base_link'>{box * 3}</link></robot>")
    room = Body("room", Pose((0.0, 0.0, 1.3)), (6.0, 6.0, 2.6), "room")
    made = PyBulletWorld(Scene((room,)), RobotBody(urdf, CameraModel("base_link")))
    try:
        assert picture(made, [], size=SMALL).shape == (SMALL[1], SMALL[0], 3)
    finally:
        made.close()


def test_of_walls_before_the_room_only_their_lower_edges_are_drawn(world: PyBulletWorld) -> None:
    stage = Stage(world)
    poses = stage.poses()
    highest = {}
    for eye in ((-9.0, 0.0, 2.0), (9.0, 0.0, 2.0)):
        for wall in stage.walls(poses, View(eye, (0.0, 0.0, 0.5))):
            x, _, z = wall.vertices.max(axis=0)
            if x - wall.vertices[:, 0].min() < 0.2:
                highest[eye[0], x > 0] = round(z, 6)
    assert highest == {(-9.0, True): 2.6, (-9.0, False): 0.12, (9.0, True): 0.12, (9.0, False): 2.6}


def test_a_lintel_hangs_over_its_doorway_but_neither_in_a_plan_from_above_nor_over_a_wall_that_is_cut_off() -> None:
    doorway = Cavity((3.05, 0.0, -0.25), (0.3, 0.9, 2.1))
    room = Body("room", Pose((0.0, 0.0, 1.3)), (6.0, 6.0, 2.6), "room", cavities=(doorway,))
    made = PyBulletWorld(Scene((room,)), AMIGO)
    stage = Stage(made)
    poses = stage.poses()

    def over_doorway(view: View) -> list[bool]:
        corners = [(wall.vertices.min(axis=0), wall.vertices.max(axis=0)) for wall in stage.walls(poses, view)]
        return [bool(low[2] > 2.0) for low, high in corners if low[0] > 2.9 and low[1] <= 0.0 <= high[1]]

    try:
        assert over_doorway(View((-9.0, 0.0, 2.0), (0.0, 0.0, 0.5))) == [True], "seen from within the room"
        assert over_doorway(View((9.0, 0.0, 2.0), (0.0, 0.0, 0.5))) == [], "seen from behind the wall"
        assert over_doorway(from_top(stage, poses, 1.5)) == []
    finally:
        made.close()


def test_a_view_is_a_name_or_one_or_two_points(world: PyBulletWorld) -> None:
    for view in ("overview", "top", "1,2,3", "1,2,3:0,0,0.5"):
        assert checked(view) == view
    for view in ("", "left", "1,2", "1,2,3:1,2,3", "1,2,nan", "1,2,3:4,5,6:7,8,9"):
        with pytest.raises(WrongOption, match="write X,Y,Z"):
            checked(view)
    close = picture(world, ["bottle"], view="0.2,0,1:0.9,0,0.8", size=SMALL)
    assert _red(close) > 5 * _red(picture(world, view="overview", size=SMALL)) > 0


def test_colours_of_a_map_win_and_a_world_without_a_room_has_ground() -> None:
    blue = Body("box", Pose((0.0, 0.0, 0.5)), (1.0, 1.0, 1.0), color=(0.1, 0.1, 0.9, 1.0), kinds=("Box-Container",))
    made = PyBulletWorld(Scene((blue,)), AMIGO)
    pixels = picture(made, view="3,3,2", size=SMALL).astype(int)
    made.close()
    assert (pixels[:, :, 2] > 1.5 * pixels[:, :, 0]).sum() > 1000
    assert pixels[-1].mean() < 240, "ground"


def test_what_hangs_in_the_air_is_shown_from_the_side_with_a_vertical_to_what_is_below_it() -> None:
    bodies = (
        Body("shelf", Pose((1.5, 0.0, 0.4)), (0.5, 0.5, 0.8)),
        Body(
            "bottle", Pose((1.5, 0.0, 2.3)), (0.08, 0.08, 0.2), "cylinder", color=RED, kinds=("Bottle",), movable=True
        ),
    )
    world = PyBulletWorld(Scene(bodies), AMIGO)
    try:
        stage = Stage(world)
        poses = stage.poses()
        np.testing.assert_allclose(stage.drops()["bottle"], [(1.5, 0.0, 0.8), (1.5, 0.0, 2.2)], atol=0.01)
        about = subjects(stage, poses, ["bottle"])
        assert about[1:] == [[("bodies", "bottle")], [("bodies", "shelf")]], "with what is below it"
        view = view_of(stage, poses, about, 1.5)
        seen = np.concatenate(
            [view.project(stage.corners(path, poses[path]), SMALL) for paths in about for path in paths]
        )
        assert ((seen[:, :2] > 0) & (seen[:, :2] < SMALL)).all(), "all of it is in the picture"
        assert seen[:, 2].max() < 2.5 * seen[:, 2].min(), "nothing is so near that it looks much larger"
        assert view.eye[2] - view.target[2] < 0.3 * np.linalg.norm(np.subtract(view.eye, view.target))
        assert _red(picture(world, ["bottle"], size=SMALL)) > 15
    finally:
        world.close()
