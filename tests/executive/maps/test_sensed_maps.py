"""Point clouds and octrees: reading, hostile files, and obstacles."""

import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from executive.cli.app import app
from executive.maps import read_map, scene_of
from executive.maps.occupied_space import CELL, FLOOR, HIGHEST, MOST_BOXES, OBSTACLE, OccupiedSpace
from executive.maps.octree import DEPTH, read_octree
from executive.maps.point_cloud import read_points
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import bundled
from planlang.geometry import Array, Pose
from planlang.ontology import load
from sim import Body
from tests.support.examples import examples

ROOM = bundled("ontologies") / "environments" / "hospital_room.omn"
HALF = 1 << DEPTH - 1
Key = tuple[int, int, int]


# Writing


def pcd(points: Array, encoding: str) -> bytes:
    """A PCD file with a colour between y and z."""
    header = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y rgb z\nSIZE 4 4 4 8\nTYPE F F U F\nCOUNT 1 1 2 1\nWIDTH {len(points)}"
    )
    header += f"\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {encoding}\n"
    if encoding == "ascii":
        return header.encode() + "\n".join(f"{x} {y} 7 7 {z}" for x, y, z in points.tolist()).encode()
    return header.encode() + b"".join(struct.pack("<ffIId", x, y, 7, 7, z) for x, y, z in points.tolist())


def ply(points: Array, encoding: str, faces: int = 0) -> bytes:
    """A PLY file, with triangles of the first three vertices behind them."""
    header = f"ply\nformat {encoding} 1.0\ncomment a test\nelement vertex {len(points)}\nproperty uchar red\n"
    header += f"property float x\nproperty float32 y\nproperty double z\nelement face {faces}\n"
    header += "property list uchar int vertex_index\nend_header\n"
    if encoding == "ascii":
        return (
            header.encode()
            + "".join([*(f"9 {x} {y} {z}\n" for x, y, z in points.tolist()), *faces * ["3 0 1 2\n"]]).encode()
        )
    order = "<" if "little" in encoding else ">"
    return (
        header.encode()
        + b"".join(struct.pack(f"{order}Bffd", 9, *point) for point in points.tolist())
        + (struct.pack(f"{order}B3i", 3, 0, 1, 2) * faces)
    )


def xyz(points: Array, _encoding: str) -> bytes:
    """Lines of numbers."""
    return b"# x y z intensity\n" + "".join(f"{x} {y} {z} 0.5\n" for x, y, z in points.tolist()).encode()


FORMATS: dict[str, tuple[Callable[[Array, str], bytes], str, str]] = {
    "PCD ascii": (pcd, "ascii", ".pcd"),
    "PCD binary": (pcd, "binary", ".pcd"),
    "PLY ascii": (ply, "ascii", ".ply"),
    "PLY little-endian": (ply, "binary_little_endian", ".ply"),
    "PLY big-endian": (ply, "binary_big_endian", ".ply"),
    "XYZ": (xyz, "", ".xyz"),
}


def octree(cells: Iterable[Key], resolution: float, *, full: bool = False) -> bytes:
    """An octree with these occupied cells, counted from the origin; eight that fill a larger cell are merged."""
    kind = "" if full else "binary "
    header = f"# Octomap OcTree {kind}file\n# a test\nid OcTree\nsize 1\nres {resolution}\ndata\n".encode()
    keys = sorted((x + HALF, y + HALF, z + HALF) for x, y, z in cells)
    return header + b"".join((_full if full else _binary)(keys, DEPTH))


def children(keys: list[Key], level: int) -> list[list[Key]]:
    """The keys in each child of a node at a level above the smallest cells."""
    bits = [sum((part >> level - 1 & 1) << axis for axis, part in enumerate(key)) for key in keys]
    return [[key for key, bit in zip(keys, bits, strict=True) if bit == index] for index in range(8)]


def is_leaf(keys: list[Key], level: int) -> bool:
    return len(keys) == 8**level


def _binary(keys: list[Key], level: int) -> Iterator[bytes]:
    below = children(keys, level)
    states = [0 if not one else 2 if is_leaf(one, level - 1) else 3 for one in below]
    states = [1 if state == 0 and index == 7 else state for index, state in enumerate(states)]  # known to be free
    yield struct.pack("<H", sum(state << 2 * index for index, state in enumerate(states)))
    for one, state in zip(below, states, strict=True):
        if state == 3:
            yield from _binary(one, level - 1)


def _full(keys: list[Key], level: int) -> Iterator[bytes]:
    if not keys or is_leaf(keys, level):
        yield struct.pack("<fB", 0.85 if keys else -0.4, 0)
        return
    below = children(keys, level)
    yield struct.pack("<fB", 0.85, 0b1000_0000 | sum(bool(one) << index for index, one in enumerate(below)))
    for index, one in enumerate(below):
        if one or index == 7:
            yield from _full(one, level - 1)


# Reading


@pytest.mark.parametrize("kind", FORMATS)
def test_points_are_read_in_each_format(kind: str, tmp_path: Path) -> None:
    write, encoding, suffix = FORMATS[kind]
    points = np.array([[0.5, -1.25, 0.75], [2.0, 3.5, -0.5], [-4.0, 0.0, 1.5]])
    (tmp_path / f"cloud{suffix}").write_bytes(write(points, encoding))
    assert read_points(tmp_path / f"cloud{suffix}").tolist() == points.tolist()


key = st.tuples(*3 * [st.integers(-3, 4)])


@pytest.mark.parametrize("full", [False, True])
@settings(max_examples=examples(60), deadline=None)
@given(cells=st.sets(key, min_size=1, max_size=40), cube=st.booleans())
def test_an_octree_has_the_cells_that_were_written(
    full: bool, cells: set[Key], cube: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if cube:
        cells = cells | {(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)}
    path = tmp_path_factory.mktemp("octree") / "tree.bt"
    path.write_bytes(octree(cells, 0.5, full=full))
    centres, length = read_octree(path)
    assert length == 0.5
    assert {tuple(cell) for cell in np.floor(centres / length).astype(int).tolist()} == cells


def test_an_octree_with_one_huge_leaf_is_read_coarsely_and_fast(tmp_path: Path) -> None:
    header = b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.05\ndata\n"
    (tmp_path / "tree.bt").write_bytes(header + struct.pack("<H", 2 << 2 * 7))
    centres, length = read_octree(tmp_path / "tree.bt")
    assert len(centres) * length**3 == pytest.approx((0.05 * HALF) ** 3)
    assert centres.min() > 0


def codes(path: Path) -> list[str]:
    """The codes of errors in a file; none if it can be read."""
    try:
        (read_octree if path.suffix in (".bt", ".ot") else read_points)(path)
    except BadInput as problem:
        return [one.code for one in problem.diagnostics]
    return []


SOME = np.array([[1.0, 2.0, 3.0]])
WRONG = {
    "nothing.pcd": b"",
    "damaged.pcd": pcd(SOME, "binary").replace(b"DATA binary", b"DATA binary_compressed"),
    "more.pcd": pcd(SOME, "ascii") + b"\n1 2 7 7 3\n",
    "longer.pcd": pcd(SOME, "binary") + b" " * 28,
    "other size.pcd": pcd(SOME, "ascii").replace(b"HEIGHT 1", b"HEIGHT 2"),
    "longer.bt": octree([(0, 0, 0)], 0.1) + b"\1\1",
    "no corner.ply": ply(SOME, "ascii", faces=1),
    "no faces.ply": ply(SOME, "ascii").replace(b"face 0", b"face 9"),
    "short.pcd": pcd(SOME, "binary")[:-1],
    "many.pcd": pcd(SOME, "ascii").replace(b"POINTS 1", b"POINTS 99999999"),
    "words.pcd": pcd(SOME, "ascii").replace(b"7 7", b"7 x"),
    "flat.pcd": pcd(SOME, "ascii").replace(b"x y rgb z", b"x y rgb w"),
    "wide.pcd": pcd(SOME, "binary").replace(b"COUNT 1 1 2 1", b"COUNT 1 1 99999999 1"),
    "odd.pcd": pcd(SOME, "binary").replace(b"TYPE F F U F", b"TYPE F F O F"),
    "nothing.ply": b"ply\n\nend_header\n",
    "faces.ply": b"ply\nformat ascii 1.0\nelement face 1\nelement vertex 1\nend_header\n1 2 3\n",
    "short.ply": ply(SOME, "binary_big_endian")[:-10],
    "uneven.xyz": b"1 2 3\n1 2\n",
    "underscores.xyz": b"1_0 2 3\n",
    "nothing.bt": b"",
    "short.bt": octree([(0, 0, 0)], 0.1)[:-1],
    "deep.bt": octree([(0, 0, 0)], 0.1)[:-2] + b"\3\0" * 4,
    "fine.bt": octree([(0, 0, 0)], 1e-9),
    "short.ot": octree([(0, 0, 0)], 0.1, full=True)[:-1],
    "other.ot": octree([(0, 0, 0)], 0.1, full=True).replace(b"id OcTree", b"id StampedOcTree"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_contradicts_its_header_is_refused_with_the_reason(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(WRONG[name])
    assert codes(tmp_path / name) == ["M024"]


@settings(max_examples=examples(150), deadline=None)
@given(data=st.data())
def test_any_corrupted_file_is_read_or_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    points = np.arange(9.0).reshape(3, 3)
    whole = {f"{kind}{suffix}": write(points, how) for kind, (write, how, suffix) in FORMATS.items()}
    whole |= {f"a{suffix}": octree([(0, 0, 0), (2, 1, 0)], 0.1, full=suffix == ".ot") for suffix in (".bt", ".ot")}
    name = data.draw(st.sampled_from(sorted(whole)))
    content = bytearray(whole[name])
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
    path = tmp_path_factory.mktemp("changed") / name
    path.write_bytes(content)
    assert codes(path) in ([], ["M024"])


# Obstacles


def covers(boxes: list[tuple[Pose, tuple[float, float, float]]], points: Array) -> NDArray[np.bool_]:
    """Mask of the points inside any of the boxes."""
    inside = [(np.abs(points - pose.position) <= np.array(size) / 2 + 1e-9).all(axis=1) for pose, size in boxes]
    return np.any(inside, axis=0) if inside else np.zeros(len(points), dtype=bool)


@settings(max_examples=examples(60), deadline=None)
@given(cells=st.sets(st.tuples(*2 * [st.integers(-20, 20)], st.integers(1, 20)), min_size=1, max_size=60))
def test_boxes_cover_exactly_the_cells_with_points(cells: set[Key]) -> None:
    points = (np.array(sorted(cells)) + 0.5) * 0.1
    boxes, _ = OccupiedSpace(points, 0.1).boxes([])
    assert covers(boxes, points).all()
    assert sum(np.prod(size) for _, size in boxes) == pytest.approx(len(cells) * 0.1**3)
    assert boxes == OccupiedSpace(points[::-1], 0.1).boxes([])[0]


def test_a_cloud_of_many_specks_is_made_coarser_and_still_covered() -> None:
    points = np.random.default_rng(1).uniform([-3, -3, 0.1], [3, 3, 2], size=(5000, 3))
    boxes, _ = OccupiedSpace(points, CELL).boxes([])
    assert 0 < len(boxes) <= MOST_BOXES
    assert covers(boxes, points).all()


def test_isolated_obstacles_and_walls_stay_exact_beside_dense_clutter() -> None:
    random = np.random.default_rng(1)
    alone = random.uniform([-6, -4, 0.1], [0, 4, 2], size=(300, 3))
    dense = random.uniform([4, 2, 0.1], [5, 3, 1.1], size=(3000, 3))
    wall = np.stack(np.meshgrid(np.arange(1, 6, 0.05), [0.0], np.arange(0.1, 2, 0.05)), axis=-1).reshape(-1, 3)
    boxes, apart = OccupiedSpace(np.concatenate([alone, dense, wall + 0.01]), CELL).boxes([])
    assert MOST_BOXES - 100 < len(boxes) <= MOST_BOXES
    assert covers(boxes, np.concatenate([alone, dense, wall + 0.01])).all()
    assert apart == pytest.approx(0.2)
    lone = [max(size) for pose, size in boxes if pose.position[0] < 0]
    assert np.mean(np.array(lone) <= CELL + 1e-9) > 0.9
    assert not covers(boxes, np.array([[3.0, 1.0, 1.0], [3.0, -1.0, 1.0], [4.5, 2.5, 1.3]])).any()


@pytest.mark.parametrize(("size", "severity"), [(300, None), (2000, "warning")])
def test_obstacles_joined_over_gaps_are_reported(tmp_path: Path, size: int, severity: str | None) -> None:
    points = np.random.default_rng(1).uniform([-3, -2, 0.1], [3, 2, 2], size=(size, 3))
    path = tmp_path / "cloud.pcd"
    path.write_bytes(pcd(points, "ascii"))
    found: list[Diagnostic] = []
    scene_of(read_map(load(ROOM, also=[path])), found)
    assert [one.severity.value for one in found if one.code == "M032"] == ([severity] if severity else [])


def test_floor_ceiling_and_known_objects_are_not_obstacles() -> None:
    table = Body("table1", Pose((1.0, 0.0, 0.4)), (1.0, 1.0, 0.8))
    none = [[0, 0, FLOOR / 2], [0, 0, HIGHEST + 0.1], [1.2, 0.3, 0.85], [np.nan, 0, 1], [0, 1e5, 1]]
    points = np.array([*none, [0.0, 0.0, 1.0], [1.0, 0.0, 1.5]])
    boxes, _ = OccupiedSpace(points, CELL).boxes([table])
    assert covers(boxes, points).tolist() == [False] * len(none) + [True, True]


@pytest.mark.long
def test_a_robot_drives_around_obstacles_of_an_octree(tmp_path: Path) -> None:
    path = tmp_path / "crate.bt"
    crate = [(x, y, z) for x in range(-6, 6) for y in range(-8, 8) for z in range(12)]
    floor = [(x, y, 0) for x in range(-60, 60) for y in range(-60, 60)]
    path.write_bytes(octree({*crate, *floor}, 0.05))
    scene = scene_of(read_map(load(ROOM, also=[path])))
    (box,) = (body for body in scene.bodies if body.name.startswith(OBSTACLE))
    assert box.pose.position == pytest.approx((0.0, 0.0, 0.325))
    assert box.size == pytest.approx((0.6, 0.8, 0.55))
    result = CliRunner().invoke(
        app, ["run", "serve_a_drink", "--environment", "hospital_room", "--environment", str(path)]
    )
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("kind", FORMATS)
def test_points_are_named_by_a_map_or_given_beside_one(kind: str, tmp_path: Path) -> None:
    write, encoding, suffix = FORMATS[kind]
    cube = np.stack(np.meshgrid(*2 * [np.arange(-0.2, 0.2, 0.04)], np.arange(0.1, 0.6, 0.04)), axis=-1).reshape(-1, 3)
    path = tmp_path / f"cloud{suffix}"
    path.write_bytes(write(cube, encoding))
    named = tmp_path / "named.omn"
    named.write_text(
        "Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
        "Prefix: roboearth: <http://www.roboearth.org/kb/roboearth.owl#>\nOntology: <http://example.org/named.owl>\n"
        f"Individual: <http://example.org/named.owl#points>\n    Types: roboearth:PointMap\n"
        f'    Facts: knowrob:linkToMapFile "cloud{suffix}"\n'
    )
    for given_file in (named, path):
        bodies = scene_of(read_map(load(ROOM, also=[given_file]))).bodies
        boxes = [(body.pose, body.size) for body in bodies if body.name.startswith(OBSTACLE)]
        assert covers(boxes, cube).all()
        assert len(boxes) == 1
