"""COLLADA: which shapes of a document are read, and where they are."""

from __future__ import annotations

import numpy as np
import pytest

from planlang.geometry.mesh import BadMesh, Mesh, mesh_of

CUBE = "0 0 0 0 0 0.1 0 0.1 0 0 0.1 0.1 0.1 0 0 0.1 0 0.1 0.1 0.1 0 0.1 0.1 0.1"
SIDES = "0 1 3 0 3 2 4 6 7 4 7 5 0 4 5 0 5 1 2 3 7 2 7 6 0 2 6 0 6 4 1 5 7 1 7 3"
TRIANGLES = f'<triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{SIDES}</p></triangles>'
SCENE = '<scene><instance_visual_scene url="#s"/></scene>'
PLACED = '<node><instance_geometry url="#g"/></node>'


def document(
    nodes: str = PLACED, *, faces: str = TRIANGLES, points: str = CUBE, more: str = "", end: str = SCENE
) -> bytes:
    """Return a document with one geometry ``g`` and a scene ``s`` of these nodes."""
    count = len(points.split())
    text = f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>{more}
    <library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="{count}">{points}</float_array>
    <technique_common><accessor source="#a" count="{count // 3}" stride="3"/></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{faces}</mesh></geometry></library_geometries>
    <library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>{end}</COLLADA>"""
    return text.encode()


def read(*args: str, **kwargs: str) -> Mesh:
    """Read a document."""
    return mesh_of(document(*args, **kwargs), ".dae")


def ends(mesh: Mesh) -> tuple[list[float], list[float]]:
    """Return the corners of the box around the triangles of a mesh."""
    points = mesh.vertices[np.concatenate(mesh.parts)].reshape(-1, 3)
    return points.min(axis=0).round(6).tolist(), points.max(axis=0).round(6).tolist()


def area(mesh: Mesh) -> float:
    """Return the area of all triangles."""
    a, b, c = (mesh.vertices[np.concatenate(mesh.parts)[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


LIBRARY = '<library_nodes><node id="part"><instance_geometry url="#g"/></node></library_nodes>'


@pytest.mark.parametrize(
    "nodes",
    [
        '<node><translate>1 0 0</translate><instance_geometry url="#g"/></node>'
        '<node><translate>2 0 0</translate><instance_node url="#part"/></node>',
        '<node><translate>1 0 0</translate><instance_node url="#part"/>'
        '<node><translate>1 0 0</translate><instance_node url="#part"/></node></node>',
    ],
    ids=["mixed", "only of the library"],
)
def test_nodes_of_a_library_are_where_their_instances_are(nodes: str) -> None:
    mesh = read(nodes, more=LIBRARY)
    assert sum(map(len, mesh.parts)) == 24
    assert ends(mesh) == ([1.0, 0.0, 0.0], [2.1, 0.1, 0.1])


def test_the_scene_that_is_instantiated_is_read_and_no_other() -> None:
    other = '<visual_scene id="t"><node><translate>9 0 0</translate><instance_geometry url="#g"/></node></visual_scene>'
    more = f"<library_visual_scenes>{other}</library_visual_scenes>"
    assert ends(read(more=more)) == ([0.0, 0.0, 0.0], [0.1, 0.1, 0.1])
    assert ends(read(more=more, end=SCENE.replace("#s", "#t"))) == ([9.0, 0.0, 0.0], [9.1, 0.1, 0.1])


SQUARE = "0 0 0 2 0 0 2 2 0 0 2 0 0.5 0.5 0 1.5 0.5 0 1.5 1.5 0 0.5 1.5 0"
INPUT = '<input semantic="VERTEX" source="#v" offset="1"/><input semantic="NORMAL" source="#n" offset="0"/>'
POLYGONS = {
    "strip": ("<tristrips>{}<p>0 0 0 1 0 3 0 2</p></tristrips>", 4.0, 2),
    "fan": ("<trifans>{}<p>0 0 0 1 0 2 0 3</p></trifans>", 4.0, 2),
    "two strips": ("<tristrips>{}<p>0 0 0 1 0 2</p><p>0 0 0 2 0 3</p></tristrips>", 4.0, 2),
    "polygon": ("<polygons>{}<p>0 0 0 1 0 2 0 3</p></polygons>", 4.0, 2),
    "polygon with a hole": ("<polygons>{}<ph><p>0 0 0 1 0 2 0 3</p><h>0 4 0 5 0 6 0 7</h></ph></polygons>", 3.0, 8),
    "hole turned round": ("<polygons>{}<ph><p>0 0 0 1 0 2 0 3</p><h>0 7 0 6 0 5 0 4</h></ph></polygons>", 3.0, 8),
    "concave polygon": ("<polylist>{}<vcount>4</vcount><p>0 0 0 1 0 4 0 3</p></polylist>", 1.0, 2),
    "concave polygon among others": (
        "<polylist>{}<vcount>4 4 3</vcount><p>0 1 0 4 0 3 0 0 0 4 0 5 0 6 0 7 0 1 0 2 0 3</p></polylist>", 4.0, 5
    ),
    "polygon that lacks corners": ("<polylist>{}<vcount>3 9</vcount><p>0 0 0 1 0 2 0 3</p></polylist>", 2.0, 1),
}  # fmt: skip


@pytest.mark.parametrize(("faces", "size", "count"), POLYGONS.values(), ids=POLYGONS)
def test_every_kind_of_polygons_becomes_triangles_that_cover_it(faces: str, size: float, count: int) -> None:
    mesh = read(faces=faces.format(INPUT), points=SQUARE)
    assert area(mesh) == pytest.approx(size)
    assert sum(map(len, mesh.parts)) == count


def test_the_triangles_of_a_strip_are_all_turned_the_same_way() -> None:
    mesh = read(faces=POLYGONS["strip"][0].format(INPUT), points=SQUARE)
    a, b, c = (mesh.vertices[mesh.parts[0][:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


TRANSFORMS = {
    "matrix": ("<matrix>0 -1 0 5 1 0 0 0 0 0 1 0 0 0 0 1</matrix>", ([4.9, 0.0, 0.0], [5.0, 0.1, 0.1])),
    "rotate": ("<translate>5 0 0</translate><rotate>0 0 1 90</rotate>", ([4.9, 0.0, 0.0], [5.0, 0.1, 0.1])),
    "scale": ("<scale>2 1 3</scale>", ([0.0, 0.0, 0.0], [0.2, 0.1, 0.3])),
    "lookat": ("<lookat>5 0 0 5 0 -1 0 1 0</lookat>", ([5.0, 0.0, 0.0], [5.1, 0.1, 0.1])),
    "lookat along x": ("<lookat>5 0 0 4 0 0 0 0 1</lookat>", ([5.0, 0.0, 0.0], [5.1, 0.1, 0.1])),
    "skew": ("<skew>45 0 1 0 1 0 0</skew>", ([0.0, 0.0, 0.0], [0.2, 0.1, 0.1])),
}


@pytest.mark.parametrize(("transform", "box"), TRANSFORMS.values(), ids=TRANSFORMS)
def test_a_node_is_placed_by_every_transform(transform: str, box: tuple[list[float], list[float]]) -> None:
    assert ends(read(f'<node>{transform}<instance_geometry url="#g"/></node>')) == box


def test_a_skin_is_read_in_the_pose_in_which_it_was_bound() -> None:
    skin = '<skin source="#g"><bind_shape_matrix>1 0 0 3 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix></skin>'
    more = f'<library_controllers><controller id="c">{skin}</controller></library_controllers>'
    nodes = '<node><translate>0 4 0</translate><instance_controller url="#c"/></node>'
    assert ends(read(nodes, more=more)) == ([3.0, 4.0, 0.0], [3.1, 4.1, 0.1])


def test_units_count_and_the_upward_axis_does_not() -> None:
    text = document().decode().replace('meter="1"', 'meter="0.001"').replace("Z_UP", "Y_UP")
    long = text.replace(CUBE, CUBE.replace("0.1", "300", 1))
    assert ends(mesh_of(long.encode(), ".dae")) == ([0.0, 0.0, 0.0], [0.0001, 0.0001, 0.3])


def doubling(depth: int) -> str:
    """Return a library of nodes, each of which instantiates the next one twice."""
    twice = '<instance_node url="#n{0}"/><instance_node url="#n{0}"/>'
    nodes = "".join(f'<node id="n{k}">{twice.format(k + 1)}</node>' for k in range(depth))
    return f'<library_nodes>{nodes}<node id="n{depth}"/></library_nodes>'


HOSTILE = {
    "nodes that double": ('<node><instance_node url="#n0"/></node>', doubling(40), "nodes"),
    "a node in itself": ('<node id="a"><instance_node url="#a"/></node>', "", "nested"),
    "another document": ('<node><instance_geometry url="other.dae#g"/></node>', "", "another document: other.dae#g"),
    "too few numbers": ('<node><lookat>1 2 3</lookat><instance_geometry url="#g"/></node>', "", "3 numbers"),
}


@pytest.mark.parametrize(("nodes", "more", "reason"), HOSTILE.values(), ids=HOSTILE)
def test_a_document_that_cannot_be_read_is_refused_with_the_reason(nodes: str, more: str, reason: str) -> None:
    with pytest.raises(BadMesh, match=reason):
        read(nodes, more=more)


def test_shapes_that_are_instantiated_often_have_the_bounds_of_large_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.geometry.mesh.MOST_VERTICES", 100)
    with pytest.raises(BadMesh, match="more than 100 vertices"):
        read(PLACED * 9)
