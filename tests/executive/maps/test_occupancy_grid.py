"""Occupancy grids of ROS map_server: reading, hostile files, and obstacles."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from executive.cli.app import app
from executive.maps import read_map, scene_of
from executive.maps.occupancy_grid import HEIGHT, read_grid
from executive.maps.occupied_space import MOST_BOXES, OBSTACLE
from planlang.diagnostics import BadInput, Diagnostic, Severity
from planlang.files import bundled
from planlang.geometry.matrices import moved
from planlang.ontology import load
from sim import Body, Scene
from tests.support.examples import examples
from tests.support.refusals import refusal

FREE, UNKNOWN, OCCUPIED = 254, 205, 0
YAML = "image: grid.pgm\nresolution: {resolution}\norigin: [{x}, {y}, {yaw}]\nnegate: 0\n"
YAML += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
ROOM = bundled("ontologies") / "environments" / "hospital_room.omn"


def written(
    folder: Path, picture: NDArray[np.uint8], resolution: float = 0.05, x: float = 0, y: float = 0, yaw: float = 0
) -> Path:
    """Write a grid and its picture, whose upper row has the greatest y."""
    rows, columns = picture.shape
    header = f"P5\n# CREATOR: a test {resolution} m/pix\n{columns} {rows}\n255\n".encode()
    (folder / "grid.pgm").write_bytes(header + picture.tobytes())
    path = folder / "grid.yaml"
    path.write_text(YAML.format(resolution=resolution, x=x, y=y, yaw=yaw), encoding="utf-8")
    return path


def test_the_upper_row_of_the_picture_is_the_last_one_of_the_grid(tmp_path: Path) -> None:
    grid = read_grid(written(tmp_path, np.array([[OCCUPIED, FREE], [UNKNOWN, FREE]], np.uint8), 0.5, x=-1, y=2))
    assert grid.occupied.tolist() == [[False, False], [True, False]]
    assert moved(grid.frame.matrix(), grid.centres()).tolist() == [[-0.75, 2.75, 0.0]]


def test_the_origin_turns_the_grid(tmp_path: Path) -> None:
    grid = read_grid(written(tmp_path, np.array([[FREE, OCCUPIED]], np.uint8), 1.0, x=5, yaw=math.pi / 2))
    assert np.allclose(moved(grid.frame.matrix(), grid.centres()), [[4.5, 1.5, 0.0]])


def test_plain_pgm_negated_values_and_block_lists_are_read(tmp_path: Path) -> None:
    (tmp_path / "plain.pgm").write_text("P2\n2 1\n9\n9 0\n")
    text = 'image: "plain.pgm"  # a comment\nresolution: 0.1\norigin:\n- 1.0\n- 2.0\n- 0.0\nnegate: 1\n'
    (tmp_path / "grid.yaml").write_text(text)
    grid = read_grid(tmp_path / "grid.yaml")
    assert (grid.occupied.tolist(), grid.origin) == ([[True, False]], (1.0, 2.0, 0.0))


GOOD = YAML.format(resolution=0.05, x=0, y=0, yaw=0)
WRONG = {
    "no image": GOOD.replace("image: grid.pgm", "image:"),
    "an image that is not there": GOOD.replace("grid.pgm", "other.pgm"),
    "a file of the system": GOOD.replace("grid.pgm", "/etc/passwd"),
    "a file above": GOOD.replace("grid.pgm", "../../../../etc/passwd"),
    "a resolution of nothing": GOOD.replace("0.05", "0"),
    "a resolution that is no number": GOOD.replace("0.05", "nan"),
    "a height of nothing": GOOD + "height: 0\n",
    "an origin of four numbers": GOOD.replace("[0, 0, 0]", "[0, 0, 0, 1]"),
    "an origin far away": GOOD.replace("[0, 0, 0]", "[1e30, 0, 0]"),
    "anchors in anchors": "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\nimage: grid.pgm\n",
    "a Python object": "image: !!python/object/apply:os.system ['true']\nresolution: 0.05\norigin: [0, 0, 0]\n",
    "no YAML": "image grid.pgm\n",
    "a large file": "image: grid.pgm\n" + "# \n" * 10_000,
}


@pytest.mark.parametrize("kind", WRONG)
def test_an_invalid_grid_is_refused_with_the_reason(kind: str, tmp_path: Path) -> None:
    path = written(tmp_path, np.zeros((2, 2), np.uint8))
    path.write_text(WRONG[kind])
    with pytest.raises(BadInput) as problem:
        read_grid(path)
    assert [one.code for one in problem.value.diagnostics] == ["M024"]


@settings(max_examples=examples(60), deadline=None)
@given(
    content=st.binary(max_size=80)
    | st.binary(max_size=20).map(lambda tail: b"P5 3 2 255\n" + tail)
    | st.sampled_from([b"P5 99999 99999 255\n", b"P5 0 0 255\n", b"P2 2 1 9\n1 x\n", b"P5 1 1 99999\n\x00"])
)
def test_any_picture_is_read_or_refused(content: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = written(tmp_path_factory.mktemp("grid"), np.zeros((2, 2), np.uint8))
    (path.parent / "grid.pgm").write_bytes(content)
    assert read_or_refused(path) in ([], ["M024"])


def read_or_refused(path: Path) -> list[str]:
    """The codes of errors in a grid; none if it can be read."""
    try:
        read_grid(path)
    except BadInput as problem:
        return [one.code for one in problem.diagnostics]
    return []


# Obstacles

Around = Callable[[NDArray[np.uint8]], tuple[Scene, list[Diagnostic]]]


@pytest.fixture
def around(tmp_path: Path) -> Around:
    """Reads the bundled room with a grid of 7 m by 6 m around its centre, with cells of 5 cm."""

    def scene(picture: NDArray[np.uint8]) -> tuple[Scene, list[Diagnostic]]:
        path = written(tmp_path, picture[::-1], x=-3.5, y=-3.0)
        found: list[Diagnostic] = []
        return scene_of(read_map(load(ROOM, also=[path])), found), found

    return scene


def empty() -> NDArray[np.uint8]:
    """A picture without obstacles; its first row has the smallest y."""
    return np.full((120, 140), FREE, np.uint8)


def obstacles(scene: Scene) -> list[Body]:
    """The bodies made from a grid."""
    return [body for body in scene.bodies if body.name.startswith(OBSTACLE)]


def test_occupied_cells_that_no_object_explains_are_obstacles(around: Around) -> None:
    picture = empty()
    picture[40:60, 58:70] = OCCUPIED
    scene, found = around(picture)
    (box,) = obstacles(scene)
    assert (box.pose.position, box.size) == (
        pytest.approx((-0.3, -0.5, HEIGHT / 2)),
        pytest.approx((0.6, 1.0, HEIGHT)),
    )
    assert not box.movable
    assert found == []


def test_a_grid_states_the_height_of_its_obstacles(around: Around, tmp_path: Path) -> None:
    picture = empty()
    picture[40:60, 58:70] = OCCUPIED
    around(picture)
    path = tmp_path / "grid.yaml"
    path.write_text(f"{path.read_text()}height: 0.3  # of the crates [m]\n")
    (box,) = obstacles(scene_of(read_map(load(ROOM, also=[path]))))
    assert (box.pose.position[2], box.size[2]) == (0.15, 0.3)


def test_walls_and_objects_of_the_map_are_not_obstacles(around: Around) -> None:
    scene, _ = around(empty())
    bed = scene.body("bed1")
    picture = empty()
    picture[[9, 10, 109, 110], :] = OCCUPIED
    picture[:, [9, 10, 129, 130]] = OCCUPIED
    x, y, _ = bed.pose.position
    picture[int((y + 3) / 0.05), int((x + 3.5) / 0.05)] = OCCUPIED
    assert obstacles(around(picture)[0]) == []


def test_a_grid_of_many_specks_is_made_coarser_and_still_covers_each(around: Around) -> None:
    picture = empty()
    picture[20:100:2, 20:120:2] = OCCUPIED
    boxes = obstacles(around(picture)[0])
    assert 0 < len(boxes) <= MOST_BOXES
    middle = [(-3.5 + 0.05 * 60.5, -3.0 + 0.05 * 60.5)]
    assert any((abs(np.array(middle[0]) - box.pose.position[:2]) <= np.array(box.size[:2]) / 2).all() for box in boxes)


def test_an_unreadable_grid_is_an_error_unless_that_is_ignored(around: Around, tmp_path: Path) -> None:
    picture = empty()
    around(picture)
    (tmp_path / "grid.pgm").write_bytes(b"P5 7 7 255\n")
    both, found = load(ROOM, also=[tmp_path / "grid.yaml"]), list[Diagnostic]()
    with refusal("M024"):
        scene_of(read_map(both))
    assert obstacles(scene_of(read_map(both, ignore_unread=True), found)) == []
    assert [(one.code, one.severity) for one in found] == [("M024", Severity.WARNING)]


@pytest.mark.parametrize("kind", ["2D_occupancy_map", "octomap"])
def test_files_of_real_maps_are_reported_and_never_fetched(corpus: Path, kind: str) -> None:
    found: list[Diagnostic] = []
    scene = scene_of(read_map(load(corpus / "environments" / f"ias_hospital_room_{kind}@re_stack.owl.in")), found)
    assert scene.bodies == ()
    assert [(one.code, "not fetched" in one.message) for one in found] == [("M025", True)]


@pytest.mark.long
def test_a_robot_drives_around_obstacles_of_the_grid(around: Around, tmp_path: Path) -> None:
    picture = empty()
    picture[45:65, 58:72] = OCCUPIED
    around(picture)
    grid = str(tmp_path / "grid.yaml")
    result = CliRunner().invoke(app, ["run", "serve_a_drink", "--environment", "hospital_room", "--environment", grid])
    assert result.exit_code == 0, result.output
    assert "1 mapped obstacle" in CliRunner().invoke(app, ["check", grid]).stdout
