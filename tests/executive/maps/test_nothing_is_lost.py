"""Whatever has a shape or a pose is in the world, or the map is refused, by all commands that read maps."""

import shutil
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from executive.cli.app import app
from executive.maps import read_map, scene_of
from executive.maps.occupancy_grid import read_grid
from executive.maps.occupied_space import OBSTACLE
from executive.maps.point_cloud import read_points
from planlang.diagnostics import BadInput
from planlang.ontology import load
from sim import Body
from tests.support.mesh_worlds import flat, link, mesh

FILES = Path(__file__).parents[2] / "strangers"
PREFIXES = (
    "Prefix: : <http://example.org/flat.owl#>\nPrefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
    "Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>\nOntology: <http://example.org/flat.owl>\n"
)
TABLE = "\nIndividual: table1\n    Types: knowrob:Table-PieceOfFurniture\n    Facts: knowrob:translation"
TABLE += ' "1.6 0 0.37", knowrob:boundingBoxSize "0.7 1.2 0.74"\n'


def obstacles(path: Path) -> list[Body]:
    return [body for body in scene_of(read_map(load(path))).bodies if body.name.startswith(OBSTACLE)]


def places(bodies: list[Body]) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    return [(body.pose.position, body.size) for body in bodies]


# Occupancy grids

OFFICE = "resolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


@pytest.fixture
def office(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a YAML file beside the pictures of an office."""
    for picture in ("office.pgm", "office.png"):
        shutil.copy(FILES / picture, tmp_path)

    def written(text: str) -> Path:
        path = tmp_path / "office.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_a_png_is_the_grid_that_its_pgm_is(office: Callable[[str], Path]) -> None:
    expected = places(obstacles(office("image: office.pgm\n" + OFFICE)))
    assert len(expected) == 5
    assert places(obstacles(office("image: office.png\n" + OFFICE))) == expected


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("negate: 0", "negate: false"),
        ("negate: 0", "negate: No"),
        ("negate: 0", 'negate: "0"  # as it is'),
        ("negate: 0", "negate: off\nmode: Trinary"),
        ("negate: 0\n", ""),
        ("[0.0, 0.0, 0.0]", "[0, 0]"),
        ("[0.0, 0.0, 0.0]", "\n  - 0.0\n  - 0e0\n  - 0.  # yaw"),
        ("[0.0, 0.0, 0.0]", "[0.0,\n   0.0,\n   0.0]"),
        ("image: office.pgm", "'image': \"office.pgm\""),
        ("image: office.pgm", "image: OFFICE.PGM"),
        ("image: office.pgm", "image: /home/somebody/maps/office.pgm"),
        ("image: office.pgm", "image: C:\\maps\\office.pgm"),
        ("image: office.pgm", "---\n# written by nav2\nimage: office.pgm\nfloor: {number: 3, name: [a, b]}"),
        ("image: office.pgm", "\ufeffimage: office.pgm"),
        ("image: office.pgm", "image: office.png\nmode: scale"),
    ],
)
def test_yaml_is_read_however_it_is_written(old: str, new: str, office: Callable[[str], Path]) -> None:
    text = "image: office.pgm\n" + OFFICE
    assert old in text
    assert places(obstacles(office(text.replace(old, new)))) == places(obstacles(office(text)))


@pytest.mark.parametrize(
    "entry",
    [
        *(
            "negate: maybe",
            "mode: ternary",
            "occupied_thresh: 65",
            "resolution: [1, 2]",
            "origin: here",
            "image: a.png",
        ),
        *("image: [", "image: {office: pgm}", "origin: [0, 0, .nan]"),
    ],
)
def test_an_entry_that_means_nothing_is_an_error_with_its_line(entry: str, office: Callable[[str], Path]) -> None:
    key = entry.partition(":")[0]
    lines = [line for line in ("image: office.pgm\n" + OFFICE).splitlines() if not line.startswith(key)]
    path = office("\n".join([*lines, entry, ""]))
    with pytest.raises(BadInput) as problem:
        obstacles(path)
    (found,) = problem.value.diagnostics
    assert found.code == "M024"
    assert found.span is not None
    assert found.span.file.endswith("a.png") or found.span.line == len(lines) + 1 or "not YAML" in found.message


PIXELS = np.array([[0, 254, 205], [254, 254, 0]], np.uint8)
IS_OCCUPIED = [[False, False, True], [True, False, False]]


def as_image(kind: str) -> Image.Image:
    """The same six cells in another kind of image."""
    grey = Image.fromarray(PIXELS)
    match kind:
        case "palette":
            return grey.convert("P")
        case "transparent palette":
            image = Image.new("P", grey.size)
            image.putpalette([0, 0, 0, 254, 254, 254, 205, 205, 205])
            image.putdata([0, 1, 2, 1, 1, 0])
            image.info["transparency"] = 1
            return image
        case "16 bit":
            return Image.fromarray(PIXELS.astype(np.uint16) * 257)
        case "1 bit":
            return grey.point(lambda value: 255 if value > 100 else 0).convert("1")
        case mode:
            return grey.convert(mode)


@pytest.mark.parametrize(
    ("kind", "suffix"),
    [
        *(("L", "png"), ("LA", "png"), ("RGB", "png"), ("RGBA", "png"), ("palette", "png"), ("16 bit", "png")),
        *(("transparent palette", "png"), ("1 bit", "png"), ("L", "bmp"), ("RGB", "bmp"), ("palette", "bmp")),
        *(("1 bit", "bmp"), ("L", "pgm"), ("16 bit", "pgm"), ("RGB", "ppm"), ("1 bit", "pbm"), ("L", "gif")),
    ],
)
def test_every_image_that_map_server_reads_is_read(kind: str, suffix: str, tmp_path: Path) -> None:
    as_image(kind).save(tmp_path / f"cells.{suffix}")
    (tmp_path / "grid.yaml").write_text(f"image: cells.{suffix}\n" + OFFICE)
    assert read_grid(tmp_path / "grid.yaml").occupied.tolist() == IS_OCCUPIED


@pytest.mark.parametrize(
    "text", ["P2\n# by hand\n3 2\n# max\n254\n0 254 205\n254 254 0\n", "P2 3 2 254 0 254 205 254 254 0"]
)
def test_a_plain_pgm_has_comments_or_none(text: str, tmp_path: Path) -> None:
    (tmp_path / "cells.pgm").write_text(text)
    (tmp_path / "grid.yaml").write_text("image: cells.pgm\n" + OFFICE)
    assert read_grid(tmp_path / "grid.yaml").occupied.tolist() == IS_OCCUPIED


def test_black_is_an_obstacle_whatever_the_threshold_if_the_image_has_transparency(tmp_path: Path) -> None:
    cells = np.array([[[0, 255], [0, 0], [255, 0], [255, 255]]], np.uint8)
    Image.fromarray(cells, "LA").save(tmp_path / "cells.png")
    (tmp_path / "grid.yaml").write_text("image: cells.png\n" + OFFICE.replace("0.65", "0.9"))
    assert read_grid(tmp_path / "grid.yaml").occupied.tolist() == [[True, True, False, False]]


def test_raw_images_state_percentages_and_scaled_ones_their_unknown_cells_by_transparency(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 66, 100], [64, 255, 101]], np.uint8)).save(tmp_path / "cells.png")
    (tmp_path / "grid.yaml").write_text("image: cells.png\nmode: raw\n" + OFFICE)
    assert read_grid(tmp_path / "grid.yaml").occupied.tolist() == [[False, False, False], [False, True, True]]
    clear = np.array([[[0, 255], [0, 0], [0, 254]]], np.uint8)
    Image.fromarray(clear, "LA").save(tmp_path / "cells.png")
    (tmp_path / "grid.yaml").write_text("image: cells.png\nmode: scale\n" + OFFICE)
    assert read_grid(tmp_path / "grid.yaml").occupied.tolist() == [[True, False, False]]


# Point clouds


@pytest.mark.parametrize("points", ["2000 0 100\n2000 50 900\n", "1 0 0\n2 0 0\n", "1 0 8\n", "nan nan nan\n"])
def test_a_cloud_that_shows_no_obstacle_is_not_passed_over_in_silence(points: str, tmp_path: Path) -> None:
    path = tmp_path / "cloud.xyz"
    path.write_text(points)
    checked = CliRunner().invoke(app, ["check", str(path)])
    assert "warning M035 no obstacle is read from it" in checked.stderr


def test_a_grid_without_occupied_cells_is_not_passed_over_in_silence(tmp_path: Path) -> None:
    Image.new("L", (8, 8), 205).save(tmp_path / "grey.png")
    path = tmp_path / "grey.yaml"
    path.write_text("image: grey.png\n" + OFFICE)
    assert "warning M035" in CliRunner().invoke(app, ["check", str(path)]).stderr


@pytest.mark.parametrize("name", ["office.png", "cloud.pcd"])
def test_a_pointer_of_git_lfs_is_named_with_the_way_to_the_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n")
    (tmp_path / "office.yaml").write_text(f"image: {name}\n{OFFICE}")
    checked = CliRunner().invoke(app, ["check", str(tmp_path / ("office.yaml" if name.endswith("png") else name))])
    assert checked.exit_code == 2
    assert "pointer of Git LFS" in checked.stderr
    assert "git lfs pull" in checked.stderr


def test_a_cloud_without_its_number_of_points_has_all_rows(tmp_path: Path) -> None:
    text = (FILES / "organized.pcd").read_text()
    (tmp_path / "with_points.pcd").write_text(text.replace("DATA", "POINTS 1200\nDATA"))
    found = obstacles(FILES / "organized.pcd")
    assert len(found) == 193
    assert places(found) == places(obstacles(tmp_path / "with_points.pcd"))


def packed(content: bytes) -> bytes:
    """Compress bytes as LibLZF does: a repetition of the last four bytes, or a byte as it is."""
    result, at = bytearray(), 0
    while at < len(content):
        run = 0
        while at >= 4 and at + run < len(content) and content[at + run] == content[at + run - 4] and run < 260:
            run += 1
        if run > 2:
            length = run - 2
            result += bytes([length << 5, 3] if length < 7 else [7 << 5, length - 7, 3])
            at += run
        else:
            result += bytes([0, content[at]])
            at += 1
    return bytes(result)


def test_a_compressed_cloud_is_read_field_by_field(tmp_path: Path) -> None:
    points = np.array([[0.5, -1.25, 0.75], [0.5, -1.25, 0.75], [0.5, 3.5, np.nan], [0.5, 0.0, 1.5]])
    header = "VERSION 0.7\nFIELDS rgb z x y\nSIZE 4 8 4 4\nTYPE U F F F\nCOUNT 2 1 1 1\nWIDTH 2\nHEIGHT 2\n"
    header += "VIEWPOINT 0 0 0 1 0 0 0\nDATA binary_compressed\n"
    x, y, z = points.T
    content = struct.pack("<8I", *8 * [7]) + z.astype("<f8").tobytes()
    content += x.astype("<f4").tobytes() + y.astype("<f4").tobytes()
    data = packed(content)
    assert len(data) < len(content)
    path = tmp_path / "cloud.pcd"
    path.write_bytes(header.encode() + struct.pack("<II", len(data), len(content)) + data)
    assert np.array_equal(read_points(path), points, equal_nan=True)


def test_fields_of_padding_and_of_no_values_are_skipped(tmp_path: Path) -> None:
    header = "VERSION 0.7\nFIELDS x y z _ intensity _ noise\nSIZE 4 4 4 1 4 2 2\nTYPE F F F U F U U\n"
    header += "COUNT 1 1 1 4 1 1 0\nWIDTH 1\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA binary\n"
    rows = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    data = b"".join(struct.pack("<3f4xfH", *row, 0.5, 7) for row in rows)
    (tmp_path / "cloud.pcd").write_bytes(header.encode() + data)
    assert read_points(tmp_path / "cloud.pcd").tolist() == [list(row) for row in rows]


WALL = "property float x\nproperty float y\nproperty float z\nelement face 1\n"
CORNERS = ((2, -1, 0), (2, 1, 0), (2, 1, 1), (2, -1, 1))


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_wall_of_a_mesh_is_an_obstacle_between_its_corners(encoding: str, tmp_path: Path) -> None:
    header = f"ply\nformat {encoding} 1.0\nelement vertex 4\n{WALL}property list uchar int vertex_indices\n"
    header += "property uchar red\nend_header\n"
    data = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS).encode() + b"4 0 1 2 3 255\n"
    if encoding != "ascii":
        order = "<" if "little" in encoding else ">"
        data = b"".join(struct.pack(f"{order}3f", *one) for one in CORNERS) + struct.pack(
            f"{order}B4iB", 4, 0, 1, 2, 3, 9
        )
    path = tmp_path / "wall.ply"
    path.write_bytes(header.encode() + data)
    (box,) = obstacles(path)
    assert box.size[1] == pytest.approx(2.05)
    assert box.pose.position == pytest.approx((2.025, 0.0, 0.525), abs=0.05)


def test_points_in_a_tilted_frame_are_where_it_puts_them(tmp_path: Path) -> None:
    (tmp_path / "post.xyz").write_text("".join(f"{x / 100} 0 0\n" for x in range(10, 100, 2)))
    facts = 'knowrob:linkToMapFile "post.xyz", knowrob:pose upright'
    pose = '\nIndividual: upright\n    Types: knowrob:RotationMatrix3D\n    Facts: knowrob:translation "2 1 0", '
    pose += 'knowrob:quaternion "0 -0.70710678 0 0.70710678"\n'
    (tmp_path / "map.omn").write_text(
        f"{PREFIXES}\nIndividual: scan\n    Types: knowrob:Map\n    Facts: {facts}\n{pose}"
    )
    (box,) = obstacles(tmp_path / "map.omn")
    assert box.pose.position[:2] == pytest.approx((2.0, 1.0), abs=0.06)
    assert box.size[2] > 0.8


# Maps in OWL

UNREAD = {
    "a pose in words": ("M033", 'Facts: knowrob:pose "1 2 3", knowrob:boundingBoxSize "1 1 1"'),
    "a pose that is not there": ("M003", 'Facts: knowrob:pose nowhere, knowrob:boundingBoxSize "1 1 1"'),
    "another vocabulary": ("M033", "Facts: <http://www.ease-crc.org/ont/SOMA.owl#hasShape> shape1"),
    "an unknown frame": ("M010", 'Facts: knowrob:relativeTo nobody, knowrob:translation "1 2 3"'),
    "no turn at all": ("M004", 'Facts: knowrob:translation "1 2 3", knowrob:quaternion "0 0 0 0"'),
    "half a size": ("M006", 'Facts: knowrob:translation "1 2 3", knowrob:widthOfObject 1.0'),
    "no height": ("M002", 'Facts: knowrob:translation "1 2 3", knowrob:boundingBoxSize "1 1 high"'),
    "inside out": ("M007", 'Facts: knowrob:translation "1 2 3", knowrob:boundingBoxSize "1 -1 1"'),
    "no place": ("M012", 'Facts: knowrob:describedInMap map1, knowrob:boundingBoxSize "1 1 1"'),
    "no such file": ("M025", 'Facts: knowrob:linkToMapFile "absent.yaml"'),
    "no file of this kind": ("M025", 'Facts: knowrob:linkToMapFile "map.omn"'),
    "a file elsewhere": ("M025", 'Facts: knowrob:linkToMapFile "../../absent.pcd"'),
}


@pytest.mark.parametrize("kind", UNREAD)
def test_what_a_map_states_and_cannot_be_read_is_an_error_unless_ignored(kind: str, tmp_path: Path) -> None:
    code, facts = UNREAD[kind]
    path = tmp_path / "map.omn"
    path.write_text(f"{PREFIXES}{TABLE}\nIndividual: thing1\n    Types: knowrob:EnduringThing-Localized\n    {facts}\n")
    run = CliRunner()
    refused = run.invoke(app, ["check", str(path)])
    assert refused.exit_code == 2, refused.output
    assert f"error {code} " in refused.stderr
    assert "--ignore-unread" in refused.stderr
    ignored = run.invoke(app, ["check", str(path), "--ignore-unread"])
    assert ignored.exit_code == 0, ignored.output
    assert f"warning {code} " in ignored.stderr
    assert "a map of 1 object" in ignored.stdout


def test_what_states_no_shape_or_lies_nowhere_is_harmless(tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    things = (
        '\nIndividual: corner1\n    Types: knowrob:EnduringThing-Localized\n    Facts: knowrob:translation "1 2 0"\n'
    )
    things += '\nIndividual: pancake1\n    Types: knowrob:Pancake\n    Facts: knowrob:boundingBoxSize "0.1 0.1 0.01"\n'
    path.write_text(PREFIXES + TABLE + things)
    result = CliRunner().invoke(app, ["check", str(path)])
    assert result.exit_code == 0, result.output
    assert "1 object, 1 mere place" in result.stdout


@pytest.mark.parametrize(
    "command",
    [
        ["check", "{world}"],
        ["show", "{world}"],
        ["merge", "{world}", "{map}"],
        ["convert", "{world}", "--to", "turtle"],
        ["locate", "near the table", "--robot", "amigo", "--environment", "{world}", "--count", "1"],
        ["run", "{plan}", "--robot", "amigo", "--environment", "{world}"],
    ],
    ids=lambda command: command[0],
)
def test_each_command_that_reads_a_map_refuses_it_unless_told_otherwise(command: list[str], tmp_path: Path) -> None:
    world = flat(
        tmp_path,
        link("thing", mesh("absent.stl")),
        link("table", '<geometry><box size="1 1 1"/></geometry>'),
        where="2 0 0.5",
    )
    (tmp_path / "map.omn").write_text(PREFIXES + TABLE)
    plan = tmp_path / "waiting.py"
    plan.write_text("from planlang import plan, sleep\n\n\n@plan()\nasync def wait() -> None:\n    await sleep(0.1)\n")
    words = [word.format(world=world, map=tmp_path / "map.omn", plan=plan) for word in command]
    refused, ignored = (CliRunner().invoke(app, [*words, *more]) for more in ((), ("--ignore-unread",)))
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "error M019 link 'thing' is not in the world" in refused.stderr
    assert ignored.exit_code == 0, ignored.output
    assert "warning M019 link 'thing' is not in the world" in ignored.stderr


# Drawers

PART = "knowrob:properPhysicalParts"


@pytest.mark.parametrize(
    ("of_table", "of_drawer"),
    [
        (f"{PART} drawer1", ""),
        ("", "knowrob:properPhysicalPartOf table1"),
        ("", "knowrob:physicalPartOf table1"),
        ("", "knowrob:hingedTo table1"),
        (f"{PART} unit1", ""),
    ],
)
def test_a_table_is_not_the_content_of_its_own_drawer(of_table: str, of_drawer: str, tmp_path: Path) -> None:
    def thing(name: str, cls: str, size: str, *facts: str, z: float = 0.37) -> str:
        stated = ", ".join(
            [f'knowrob:translation "1.6 0 {z}"', f'knowrob:boundingBoxSize "{size}"', *filter(None, facts)]
        )
        return f"\nIndividual: {name}\n    Types: knowrob:{cls}\n    Facts: {stated}\n"

    things = thing("table1", "Table-PieceOfFurniture", "0.7 1.2 0.74", of_table)
    things += thing("unit1", "Box-Container", "0.6 0.6 0.6", f"{PART} drawer1") if "unit1" in of_table else ""
    things += thing("drawer1", "Drawer", "0.5 0.4 0.2", of_drawer, z=0.4) + thing(
        "cup1", "Cup", "0.08 0.08 0.1", z=0.36
    )
    path = tmp_path / "map.omn"
    path.write_text(PREFIXES + things)
    found: list[object] = []
    scene = scene_of(read_map(load(path)), found)  # type: ignore[arg-type]
    assert [line for line in map(str, found) if "table1 inside" in line] == []
    assert any("note M013 cup1 inside drawer1" in line for line in map(str, found))
    assert not scene.body("table1").movable
