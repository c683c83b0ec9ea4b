"""Worlds in URDF with meshes: boxes that a robot can plan with, or an error."""

import struct
from pathlib import Path

import pytest

from executive.maps import read_map, scene_of
from planlang.diagnostics import BadInput
from planlang.ontology import load
from sim import Body
from tests.support.mesh_worlds import flat, link, mesh

FILES = Path(__file__).parents[2] / "strangers" / "world_with_meshes"


def box_mesh(low: tuple[float, ...], high: tuple[float, ...], first: int = 1) -> str:
    """The eight corners and six faces of a box, as OBJ."""
    ends = list(zip(low, high, strict=True))
    text = "".join(f"v {ends[0][i]} {ends[1][j]} {ends[2][k]}\n" for i in (0, 1) for j in (0, 1) for k in (0, 1))
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return text + "".join(f"f {' '.join(str(first + corner) for corner in face)}\n" for face in faces)


def solid(path: Path, *, ignore_unread: bool = False) -> dict[str, Body]:
    scene = scene_of(read_map(load(path), ignore_unread=ignore_unread))
    return {body.name: body for body in scene.bodies if body.shape != "marker"}


@pytest.mark.parametrize("urdf", ["flat.urdf", "ws/my_flat/urdf/flat.urdf"])
def test_the_meshes_of_a_world_are_boxes(urdf: str) -> None:
    bodies = solid(FILES / urdf)
    assert list(bodies) == ["dining_table", "sofa", "sideboard"]
    assert bodies["dining_table"].size == pytest.approx((1.2, 0.8, 0.04))
    assert bodies["dining_table"].pose.position == pytest.approx((2.0, 0.0, 0.73))
    assert bodies["sofa"].size == pytest.approx((2.0, 0.9, 0.8))
    assert bodies["sofa"].pose.position == pytest.approx((-2.0, 0.0, 0.4))


def test_a_table_with_legs_is_one_box_and_a_chair_in_pieces_too(tmp_path: Path) -> None:
    top = box_mesh((-0.6, -0.4, 0.7), (0.6, 0.4, 0.75))
    legs = [(x, y) for x in (-0.55, 0.5) for y in (-0.35, 0.3)]
    text = top + "".join(
        box_mesh((x, y, 0), (x + 0.05, y + 0.05, 0.7), 1 + 8 * number) for number, (x, y) in enumerate(legs, 1)
    )
    (tmp_path / "table.obj").write_text(text)
    boxes = [
        f'<origin xyz="{x} 0 {z}"/><geometry><box size="0.9 0.9 0.1"/></geometry>' for x, z in ((0, 0.4), (0.4, 0.8))
    ]
    bodies = solid(flat(tmp_path, link("table", mesh("table.obj")), link("bench", *boxes), where="0 0 0"))
    assert bodies["table"].size == pytest.approx((1.2, 0.8, 0.75))
    assert bodies["bench"].size == pytest.approx((1.3, 0.9, 0.5))


WALLS = [((-2.1, -2, 0), (-2, 2, 2.5)), ((2, -2, 0), (2.1, 2, 2.5)), ((-2, 2, 0), (2, 2.1, 2.5))]
FLOOR = ((-2.1, -2.1, -0.1), (2.1, 2.1, 0))


@pytest.mark.parametrize("kind", ["parts", "one part", "boxes"])
def test_walls_around_a_room_do_not_fill_it(kind: str, tmp_path: Path) -> None:
    if kind == "boxes":
        boxes = (
            f'<origin xyz="{" ".join(str((a + b) / 2) for a, b in zip(*ends, strict=True))}"/><geometry>'
            f'<box size="{" ".join(str(b - a) for a, b in zip(*ends, strict=True))}"/></geometry>'
            for ends in (*WALLS, FLOOR)
        )
        path = flat(tmp_path, link("walls", *boxes))
    else:
        ends = [*WALLS, FLOOR]
        text = "".join(f"g part{number}\n{box_mesh(*one, 1 + 8 * number)}" for number, one in enumerate(ends))
        if kind == "one part":  # the outline of the walls as one surface, which is open at one side
            corners = [(-2, -2), (-2, 2), (2, 2), (2, -2)]
            text = "".join(f"v {x} {y} {z}\n" for x, y in corners for z in (0, 2.5))
            text += "".join(f"f {2 * k + 1} {2 * k + 3} {2 * k + 4} {2 * k + 2}\n" for k in range(3))
        (tmp_path / "walls.obj").write_text(text)
        path = flat(tmp_path, link("walls", mesh("walls.obj")))
    bodies = list(solid(path).values())
    assert bodies[0].name == "walls"
    assert 3 <= len(bodies) <= 12

    def is_free(x: float, y: float) -> bool:
        return all(
            abs(x - b.pose.position[0]) > b.size[0] / 2 or abs(y - b.pose.position[1]) > b.size[1] / 2 for b in bodies
        )

    assert is_free(0, 0)
    assert is_free(0, -2)
    assert is_free(1.7, -1.7)
    assert not is_free(-2.0, 0)
    assert not is_free(2.0, 1)
    assert not is_free(1, 2.0)
    assert max(body.pose.position[2] + body.size[2] / 2 for body in bodies) == pytest.approx(2.5, abs=0.06)


STL = b"\0" * 80 + struct.pack("<I", 2) + struct.pack("<12fH", *3 * [0], 0, 0, 0, 1, 0, 0, 1, 1, 0, 0)
STL += struct.pack("<12fH", *3 * [0], 0, 0, 0, 1, 1, 0, 0, 1, 0, 0)


def test_shapes_of_every_kind_are_read(tmp_path: Path) -> None:
    (tmp_path / "carpet.stl").write_bytes(STL)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "box.obj").write_text(box_mesh((0, 0, 0), (1, 2, 3)))
    bodies = solid(
        flat(
            tmp_path,
            link("sheet", '<origin xyz="0 0 1"/>' + mesh("carpet.stl", ' scale="2 1 1"'), kind="visual"),
            link("scaled", mesh("package://flat/meshes/box.obj", ' scale="0.1 0.1 -0.1"')),
            link("ball", '<geometry><sphere radius="0.2"/></geometry>'),
            link("pill", '<geometry><capsule radius="0.1" length="0.5"/></geometry>'),
            link("post", '<geometry><cylinder radius="0.1" length="0.5"/></geometry>', kind="visual"),
        )
    )
    assert bodies["sheet"].size == pytest.approx((2, 1, 0.001))
    assert bodies["scaled"].size == pytest.approx((0.1, 0.2, 0.3))
    assert bodies["scaled"].pose.position == pytest.approx((0.05, 0.1, -0.15))
    assert bodies["pill"].size == pytest.approx((0.2, 0.2, 0.7))
    assert {"ball", "post"} <= set(bodies)


@pytest.mark.parametrize(
    ("shapes", "reason"),
    [
        ((mesh("absent.stl"),), "no mesh absent.stl; looked for {}/absent.stl"),
        ((mesh("package://flat/absent.stl"),), "no mesh package://flat/absent.stl; looked for {}/flat/absent.stl"),
        ((mesh("broken.obj"),), "broken.obj cannot be read"),
        ((mesh("text.md"),), "text.md cannot be read"),
        (('<geometry><box size="1 1 1"/></geometry>', mesh("absent.stl")), "no mesh absent.stl"),
        (("<geometry><heightmap/></geometry>",), "<heightmap> is no shape"),
        (('<geometry><box size="0 1 1"/></geometry>',), "its box is 0 x 1 x 1 m"),
    ],
)
def test_a_shape_that_cannot_be_read_is_an_error_at_its_line(
    shapes: tuple[str, ...], reason: str, tmp_path: Path
) -> None:
    (tmp_path / "broken.obj").write_text("v 0 0\n")
    (tmp_path / "text.md").write_text("# a mesh\n")
    path = flat(tmp_path, link("thing", *shapes), link("other", '<geometry><box size="1 1 1"/></geometry>'))
    with pytest.raises(BadInput) as problem:
        read_map(load(path))
    (found,) = problem.value.diagnostics
    assert (found.code, found.span and found.span[:2]) == ("M019", (str(path), 3))
    assert reason.format(tmp_path) in found.message
    assert list(solid(path, ignore_unread=True)) == ["other"]


def test_another_mesh_is_another_map(tmp_path: Path) -> None:
    digests = set()
    for size in (1, 2):
        (tmp_path / "box.obj").write_text(box_mesh((0, 0, 0), (1, 1, size)))
        path = flat(tmp_path, link("thing", mesh("box.obj")))
        digests.add(load(path).documents[0].sha256)
    assert len(digests) == 2
