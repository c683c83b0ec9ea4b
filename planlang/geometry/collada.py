"""Reader for COLLADA (ISO/PAS 17506, version 1.4.1): the triangles of the scene that a document instantiates.

Nodes are placed by all transforms of the format, also those of ``library_nodes``; skins are in the pose in which they
were bound. ``<up_axis>`` is ignored, as by RViz and MoveIt, in which the descriptions of robots are drawn: of 34 meshes
of published robots that state ``Y_UP`` and have an STL file beside them, all fit it unturned. ``<unit>`` counts.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np

from planlang.geometry.matrices import Array, cross_matrix, moved, product
from planlang.geometry.polygons import Faces, bridged, fans, triangles

DEEPEST_NODES = 100
"""Maximum nesting of nodes, also by instances."""
MOST_NODES = 100_000
"""Maximum number of nodes of a scene: a few nodes that instantiate each other twice would be millions."""
STRIDE = 100
"""Most numbers of a corner or a point."""
Shape = tuple[Array, Faces]
"""Vertices (n, 3) and triangles (m, 3)."""


class BadCollada(Exception):
    """A document was refused; the message has the reason."""


def shapes_of(root: ElementTree.Element, most: int) -> Iterator[Shape]:
    """Yield the shapes of a document's scene [m]; of all its geometries if there is no scene.

    Raises BadCollada, also beyond ``most`` vertices or triangles; ValueError for a malformed number.
    """
    for element in root.iter():
        element.tag = element.tag.rpartition(":")[2]
    if root.tag != "COLLADA":
        raise BadCollada(f"it is not COLLADA: its root element is <{root.tag}>")
    unit = root.find("asset/unit")
    scale = float(unit.get("meter", "1")) if unit is not None else 1.0
    upright = np.diag([scale, scale, scale, 1.0])
    document = _Document(root, most)
    is_placed = False
    for scene in document.scenes():
        for shape, matrix in document.placed(scene, upright, 0):
            is_placed = True
            yield moved(matrix, shape[0]), shape[1]
    if not is_placed:  # a library of geometries
        yield from ((moved(upright, vertices), faces) for vertices, faces in map(document.shape, document.geometries))


class _Document:
    def __init__(self, root: ElementTree.Element, most: int) -> None:
        self._root, self._most = root, most
        self.geometries = {one.get("id", ""): one for one in root.iter("geometry")}
        self._controllers = {one.get("id", ""): one for one in root.iter("controller")}
        self._nodes = {one.get("id", ""): one for one in root.iter("node")}
        self._shapes: dict[str, Shape] = {}
        self._visited = self._size = 0

    def scenes(self) -> list[ElementTree.Element]:
        """List the scenes to be read: the instantiated one, all if none is."""
        every = list(self._root.iter("visual_scene"))
        instance = self._root.find("scene/instance_visual_scene")
        name = "" if instance is None else _local(instance)
        return [scene for scene in every if scene.get("id") == name] if name else every

    def placed(self, node: ElementTree.Element, above: Array, depth: int) -> Iterator[tuple[Shape, Array]]:
        """Yield the shapes of a node and those below it, with their transforms (4, 4)."""
        self._visited += 1
        if depth > DEEPEST_NODES:
            raise BadCollada("the nodes of its scene are nested too deeply")
        if self._visited > MOST_NODES:
            raise BadCollada(f"its scene has more than {MOST_NODES:,} nodes")
        here = above
        for child in node:
            if child.tag in _TRANSFORMS:
                here = product(here, _transform(child))
        for instance in node.findall("instance_geometry"):
            yield from self._counted(_local(instance), here)
        for instance in node.findall("instance_controller"):
            yield from self._controlled(_local(instance), here, 0)
        for instance in node.findall("instance_node"):
            if (other := self._nodes.get(_local(instance))) is not None:
                yield from self.placed(other, here, depth + 1)
        for child in node.findall("node"):
            yield from self.placed(child, here, depth + 1)

    def _controlled(self, name: str, here: Array, depth: int) -> Iterator[tuple[Shape, Array]]:
        """Yield the shape of a skin in the pose in which it was bound, or what a morph starts from."""
        controller = self._controllers.get(name)
        if controller is None or depth > DEEPEST_NODES:
            yield from self._counted(name, here)
            return
        for kind in controller:
            if kind.tag in ("skin", "morph"):
                bound = kind.find("bind_shape_matrix")
                pose = here if bound is None else product(here, _reals(bound.text, 16).reshape(4, 4))
                yield from self._controlled(_name(kind.get("source", "")), pose, depth + 1)

    def _counted(self, name: str, here: Array) -> Iterator[tuple[Shape, Array]]:
        if name not in self.geometries:
            return
        shape = self.shape(name)
        self._size += max(len(shape[0]), len(shape[1]))
        if self._size > self._most:
            raise BadCollada(f"it has more than {self._most:,} vertices or triangles")
        yield shape, here

    def shape(self, name: str) -> Shape:
        """Read a geometry, once."""
        if name not in self._shapes:
            self._shapes[name] = _shape(self.geometries[name])
        return self._shapes[name]


def _name(url: str) -> str:
    """Return the name that a URL of this document means; raises BadCollada for one of another document."""
    document, _, name = url.strip().rpartition("#")
    if document:
        raise BadCollada(f"it needs another document: {url[:120]}")
    return name


def _local(instance: ElementTree.Element) -> str:
    return _name(instance.get("url", ""))


def _shape(geometry: ElementTree.Element) -> Shape:
    mesh = geometry.find("mesh")
    mesh = geometry.find("convex_mesh") if mesh is None else mesh
    if mesh is None:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    sources = {source.get("id", ""): source for source in mesh.findall("source")}
    aliases = {
        vertices.get("id", ""): _name(entry.get("source", ""))
        for vertices in mesh.findall("vertices")
        for entry in vertices.findall("input")
        if entry.get("semantic") == "POSITION"
    }
    points: list[Array] = [np.zeros((0, 3))]
    known: dict[str, tuple[int, Array]] = {}
    faces = [np.zeros((0, 3), np.int64)]
    for block in mesh:
        vertex = next((entry for entry in block.findall("input") if entry.get("semantic") == "VERTEX"), None)
        if block.tag not in _READERS or vertex is None:
            continue
        source = aliases.get(_name(vertex.get("source", "")), "")
        if source not in known:
            known[source] = sum(map(len, points)), _points(sources.get(source))
            points.append(known[source][1])
        first, own = known[source]
        found = _Corners(block, vertex, own).triangles()
        faces.append(found + first)
    return np.concatenate(points), np.concatenate(faces)


def _points(source: ElementTree.Element | None) -> Array:
    values = None if source is None else source.find("float_array")
    if source is None or values is None:
        return np.zeros((0, 3))
    accessor = source.find("technique_common/accessor")
    stride = max(3, int("3" if accessor is None else accessor.get("stride", "3")))
    if stride > STRIDE:
        raise BadCollada("its points have too many numbers")
    first = 0 if accessor is None else int(accessor.get("offset", "0"))
    numbers = np.array((values.text or "").split()[max(0, first) :]).astype(float)
    return numbers[: len(numbers) // stride * stride].reshape(-1, stride)[:, :3]


class _Corners:
    """The corners of a block of polygons, and the triangles that they are."""

    def __init__(self, block: ElementTree.Element, vertex: ElementTree.Element, points: Array) -> None:
        self._block, self._points = block, points
        self._offset = int(vertex.get("offset", "0"))
        self._stride = 1 + max(int(entry.get("offset", "0")) for entry in block.findall("input"))
        if self._stride > STRIDE or not 0 <= self._offset < self._stride:
            raise BadCollada("the corners of its polygons have too many numbers")

    def triangles(self) -> Faces:
        """Split the polygons into triangles (m, 3); raises BadCollada if one lacks its vertices."""
        return _READERS[self._block.tag](self)

    def corners(self, element: ElementTree.Element | None) -> Faces:
        """Indices of the vertices of one run of corners."""
        numbers = _whole_numbers(None if element is None else element.text)
        corners = numbers[: len(numbers) // self._stride * self._stride].reshape(-1, self._stride)[:, self._offset]
        if len(corners) and (corners.min() < 0 or corners.max() >= len(self._points)):
            raise BadCollada(f"a polygon names vertex {int(corners.max())}, there are {len(self._points)}")
        return corners

    def _runs(self) -> list[Faces]:
        return [self.corners(one) for one in self._block.findall("p")]

    def separate(self) -> Faces:
        """Triangles, each for itself."""
        return np.concatenate(
            [np.zeros((0, 3), np.int64), *(run[: len(run) // 3 * 3].reshape(-1, 3) for run in self._runs())]
        )

    def listed(self) -> Faces:
        """Polygons in one run, with a list of their numbers of corners."""
        stated = self._block.find("vcount")
        if stated is None:
            return self.separate()
        counts = _whole_numbers(stated.text)
        corners = np.concatenate([np.zeros(0, np.int64), *self._runs()])
        if not len(counts) or counts.min() < 0:
            return np.zeros((0, 3), np.int64)
        return triangles(counts, corners, self._points)

    def single(self) -> Faces:
        """Polygons in a run each, some with holes."""
        rings = self._runs()
        for one in self._block.findall("ph"):
            outer = self.corners(one.find("p"))
            if len(outer) >= 3:
                rings.append(bridged(outer, [self.corners(hole) for hole in one.findall("h")], self._points))
        counts = np.array([len(ring) for ring in rings], np.int64)
        return triangles(counts, np.concatenate([np.zeros(0, np.int64), *rings]), self._points)

    def strips(self) -> Faces:
        """Each corner makes a triangle with the two before it, turned the same way."""
        found = [np.zeros((0, 3), np.int64)]
        for run in self._runs():
            if len(run) >= 3:
                rows = np.column_stack([run[:-2], run[1:-1], run[2:]])
                rows[1::2] = rows[1::2, [1, 0, 2]]
                found.append(rows)
        return np.concatenate(found)

    def fans(self) -> Faces:
        """Each corner makes a triangle with the one before it and the first."""
        runs = self._runs()
        return fans([len(run) for run in runs], np.concatenate([np.zeros(0, np.int64), *runs]))


_READERS = {
    "triangles": _Corners.separate,
    "polylist": _Corners.listed,
    "polygons": _Corners.single,
    "tristrips": _Corners.strips,
    "trifans": _Corners.fans,
}


def _whole_numbers(text: str | None) -> Faces:
    return np.array((text or "").split()).astype(np.int64)


def _transform(element: ElementTree.Element) -> Array:
    """Compute the matrix (4, 4) of a transform."""
    tag, matrix = element.tag, np.eye(4)
    values = _reals(element.text, _TRANSFORMS[tag])
    match tag:
        case "matrix":
            return values.reshape(4, 4)
        case "translate":
            matrix[:3, 3] = values
        case "scale":
            matrix[:3, :3] = np.diag(values)
        case "rotate":  # an axis and degrees
            cross, turn = cross_matrix(_unit(values[:3])), np.radians(values[3])
            matrix[:3, :3] += cross * np.sin(turn) + product(cross, cross) * (1 - np.cos(turn))
        case "lookat":  # eye, target and up: the node's -z points to the target, as a camera's
            eye, target, up = values.reshape(3, 3)
            back = _unit(eye - target)
            right = _unit(np.cross(up, back))
            matrix[:3, :3] = np.column_stack([right, np.cross(back, right), back])
            matrix[:3, 3] = eye
        case "skew":  # degrees, the axis that is turned, the axis along which points move (RenderMan)
            matrix[:3, :3] += _skew(float(np.radians(values[0])), values[1:4], values[4:7])
    return matrix


def _skew(angle: float, turned: Array, along: Array) -> Array:
    """Compute what a skew adds to the identity (3, 3): it turns one axis by the angle towards another."""
    along = _unit(along)
    level = turned - along * float(turned @ along)
    height = float(np.linalg.norm(level))
    if height < 1e-12:
        return np.zeros((3, 3))
    level /= height
    across, up = float(turned @ level), float(turned @ along)
    now = np.arctan2(up, across)
    moved_by: Array = np.outer(along, level) * (np.tan(now + angle) - np.tan(now))
    return moved_by


def _unit(vector: Array) -> Array:
    length = max(float(np.linalg.norm(vector)), 1e-12)
    return vector / length


def _reals(text: str | None, count: int) -> Array:
    numbers = np.array((text or "").split()).astype(float)
    if len(numbers) != count:
        raise BadCollada(f"a transform has {len(numbers)} numbers instead of {count}")
    return numbers


_TRANSFORMS = {"matrix": 16, "translate": 3, "scale": 3, "rotate": 4, "lookat": 9, "skew": 7}
"""Transforms, and how many numbers each has."""
