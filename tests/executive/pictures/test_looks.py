"""The table of looks: classes, closed surfaces, and that they fill the boxes of things."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from executive.maps import read_map, scene_of
from executive.pictures.drawn import drawn_in, fewer
from executive.pictures.looks import look_of, looks_of_classes, pieces_of, table_of_looks
from executive.pictures.solids import Solid, ball, box, lathe, prism, tube
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import load
from sim import Body, CameraModel, PyBulletWorld, RobotBody, Scene

SIZES = ((0.3, 0.4, 0.5), (0.07, 0.07, 0.2), (2.0, 0.9, 0.6))
AMIGO = RobotBody(bundled("ontologies") / "robots" / "amigo.urdf", CameraModel("base_link"))


def _volume(solid: Solid) -> float:
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", np.cross(a, b), c)) / 6


def _open_edges(solid: Solid) -> list[tuple[int, int]]:
    """Return edges that do not have one face on each side, vertices at one place counted once."""
    _, numbers = np.unique(solid.vertices.round(9), axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[solid.faces]
    edges = Counter((one[k], one[(k + 1) % 3]) for one in faces.tolist() for k in range(3) if len(set(one)) == 3)
    return [edge for edge, count in edges.items() if count != edges[edge[::-1]]]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("look", sorted(table_of_looks()))
def test_the_surfaces_of_a_look_are_closed_and_inside_its_box(look: str, size: tuple[float, float, float]) -> None:
    for piece in pieces_of(look, size):
        assert not _open_edges(piece.solid)
        assert _volume(piece.solid) > 0
        assert (np.abs(piece.solid.vertices).max(axis=0) <= 0.511 * np.array(size)).all(), "labels stick out a little"


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("cls", ["Sink", "WasteBasket", "CounterTop", "SideTable", "Dishwasher"])
def test_furniture_on_whose_top_things_stand_is_drawn_up_to_there_in_its_middle(
    cls: str, size: tuple[float, float, float]
) -> None:
    tops = [-size[2]]
    for piece in pieces_of(look_of([cls]), size):
        for a, b, c in piece.solid.vertices[piece.solid.faces]:
            edges = np.array([[*(b - a)[:2]], [*(c - a)[:2]]]).T
            if abs(np.linalg.det(edges)) > 1e-12:
                along = np.linalg.solve(edges, -a[:2])
                if along.min() >= 0 and along.sum() <= 1:
                    tops.append(float((a + along @ (b - a, c - a))[2]))
    assert max(tops) == pytest.approx(size[2] / 2, abs=0.005)


@pytest.mark.parametrize(
    "solid",
    [
        box((1, 2, 3)),
        box((1, 2, 3), 0.2),
        ball(),
        lathe([(0.5, 0), (1, 1), (0.9, 1), (0.4, 0.1)]),
        tube(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.5]]), [0.1, 0.2, 0.1], smooth=True),
        prism([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]]),
        prism([[0, 2], [1, 0.5], [2, 2], [2, 0], [0, 0]]),
    ],
)
def test_solids_are_closed_and_their_faces_look_outwards(solid: Solid) -> None:
    assert not _open_edges(solid)
    assert _volume(solid) > 0


def test_volumes_of_solids_are_those_of_what_they_stand_for() -> None:
    assert _volume(box((1, 2, 3))) == pytest.approx(6)
    assert _volume(prism([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]])) == pytest.approx(2.5)
    assert _volume(lathe([(1, 0), (1, 2)])) == pytest.approx(2 * np.pi, rel=0.02)


def test_the_nearest_class_decides_and_no_class_stands_twice_in_the_table() -> None:
    assert look_of(("MyMug", "DrinkingMug", "Cup", "Container")) == "cup"
    assert look_of(("DrinkingGlass", "Cup")) == "glass"
    assert look_of((), "http://example.org/house#Pancake") == "flat_cake", "what came into being in a run"
    assert look_of(("Unheard",)) is None
    every = [cls for row in table_of_looks().values() for cls in row["classes"]]
    assert len(every) == len(set(every)) == len(looks_of_classes())


def _furniture_and_things() -> Iterator[Body]:
    for path in sorted((bundled("ontologies") / "environments").glob("*.omn")):
        yield from scene_of(read_map(load(path))).bodies


@pytest.mark.long
def test_most_things_of_the_bundled_maps_have_a_look() -> None:
    things = [body for body in _furniture_and_things() if body.shape in ("box", "cylinder")]
    without = {body.type for body in things if look_of(body.kinds, body.type) is None}
    assert len(without) <= 4, sorted(without)


def test_people_have_heads_hands_and_feet_within_reach_of_their_boxes() -> None:
    sizes = {"standing": (0.3, 0.5, 1.75), "sitting": (0.6, 0.5, 1.28), "lying": (1.8, 0.5, 0.35)}
    for name, size in sizes.items():
        world = PyBulletWorld(Scene((Body(name, Pose((0.0, 0.0, size[2] / 2)), size, "person"),)), AMIGO)
        drawn = [one for one in drawn_in(world) if one.path[0] == "bodies"]
        world.close()
        assert [len(one.path) for one in drawn] == [2, *[3] * 6], "a body, and two arms of three pieces"
        colours = {shape.colour for one in drawn for shape in one.shapes}
        assert len(colours) >= 6, "skin, hair, eyes, lips, clothes, shoes"


def test_links_with_too_many_triangles_get_fewer_and_keep_their_extents() -> None:
    fine = ball(200)
    found = fewer(fine)
    assert len(fine.faces) > 30_000 > 1500 >= len(found.faces) > 500
    assert np.abs(np.abs(found.vertices).max(axis=0) - 1).max() < 0.05
