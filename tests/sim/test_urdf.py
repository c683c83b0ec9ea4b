"""URDFs as they come: without their meshes, with other people's conventions, broken, hostile."""

import re
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.diagnostics import BadInput
from planlang.geometry.matrices import angles_of, rotation_of
from planlang.geometry.mesh import BadMesh, mesh_content, mesh_of
from planlang.package_paths import file_places
from planlang.protocols import Configuration
from sim import Body, CameraModel, PlanningWorld, RobotBody, Scene
from sim.description import Description, checked_mesh, inertia_box, read_description
from tests.support.refusals import refusal

INERTIAL = """<inertial><origin xyz="0.1 0 0" rpy="0 0 0.5"/><mass value="1200"/>
<inertia ixx="500" iyy="1000" izz="1300" ixy="0" ixz="0" iyz="0"/></inertial>"""
MESH = '<{0}><geometry><mesh filename="package://cart_description/meshes/{1}"/></geometry></{0}>'
BOX = '<{0}><geometry><box size="0.4 0.3 0.2"/></geometry></{0}>'
ARM = """<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 1"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""
CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "f 1 2 3\nf 2 3 4\nf 5 6 7\n"


def write(folder: Path, inside: str, head: str = "") -> Path:
    """A URDF with these elements."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "cart.urdf"
    path.write_text(f'{head}<robot name="cart">{inside}</robot>')
    return path


def shapes(description: Description, kind: str) -> list[dict[str, str]]:
    """Geometries of all links: the tag and its attributes."""
    geometries = ElementTree.fromstring(description.text).iterfind(f"link/{kind}/geometry/*")
    return [{"tag": geometry.tag, **geometry.attrib} for geometry in geometries]


def world_of(path: Path, *bodies: Body) -> PlanningWorld:
    """A world with the robot in it."""
    return PlanningWorld(Scene(bodies), RobotBody(path, CameraModel("base")))


def test_the_box_of_the_inertia_stands_in_for_a_mesh_that_may_be_touched(tmp_path: Path) -> None:
    path = write(tmp_path, f'<link name="base">{INERTIAL}{MESH.format("collision", "base.stl")}</link>')
    description = read_description(path)
    (box,) = shapes(description, "collision")
    extents = np.array(list(map(float, box["size"].split())))
    moments = 1200.0 / 12.0 * np.array([extents[[1, 2]] @ extents[[1, 2]], 0, extents[[0, 1]] @ extents[[0, 1]]])
    assert moments[[0, 2]] == pytest.approx([500, 1300]), "it has the moments of inertia that the URDF says"
    origin = ElementTree.fromstring(description.text).find("link/collision/origin")
    assert origin is not None
    assert (origin.get("xyz"), origin.get("rpy")) == ("0.1 0.0 0.0", "0.0 -0.0 0.5")


def test_what_may_be_touched_stands_in_for_what_is_seen(tmp_path: Path) -> None:
    path = write(tmp_path, f'<link name="base">{MESH.format("visual", "base.dae")}{BOX.format("collision")}</link>')
    description = read_description(path)
    assert shapes(description, "visual") == shapes(description, "collision") == [{"tag": "box", "size": "0.4 0.3 0.2"}]


def test_one_warning_counts_and_names_the_meshes(tmp_path: Path) -> None:
    meshes = "".join(MESH.format("visual", f"m{k}.dae") for k in range(9)) + MESH.format("collision", "m0.dae")
    (warning,) = read_description(write(tmp_path, f'<link name="base">{meshes}</link>')).diagnostics
    assert warning.code == "B013"
    assert warning.message.startswith("9 meshes are missing")
    assert "cart_description/meshes/m0.dae" in warning.message
    assert "a link has no usable inertia either" in warning.message


@pytest.mark.parametrize(
    "inertial",
    [
        "",
        '<inertial><mass value="0.1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>',
        '<inertial><mass value="0"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>',
    ],
    ids=["no inertia", "lighter than foam", "no mass"],
)
def test_no_box_is_made_from_an_inertia_that_nobody_measured(tmp_path: Path, inertial: str) -> None:
    path = write(tmp_path, f'<link name="base">{inertial}{MESH.format("collision", "base.stl")}</link>')
    assert shapes(read_description(path), "collision") == []


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("package://cart_description/meshes/a.obj", "cart_description/meshes/a.obj"),
        ("package://cart_description/meshes/a.obj", "robots/cart_description/meshes/a.obj"),
        ("meshes/a.obj", "robots/urdf/meshes/a.obj"),
        ("../meshes/a.obj", "robots/meshes/a.obj"),
        ("package://robots/meshes/a.OBJ", "robots/meshes/a.OBJ"),
    ],
)
def test_meshes_are_found_beside_the_urdf_and_above_it(tmp_path: Path, name: str, place: str) -> None:
    (tmp_path / place).parent.mkdir(parents=True)
    (tmp_path / place).write_text(CUBE)
    folder = tmp_path / "robots" / "urdf"
    collision = MESH.format("collision", "a.obj").replace("package://cart_description/meshes/a.obj", name)
    path = write(folder, f'<link name="base">{INERTIAL}{collision}</link>')
    description = read_description(path)
    assert description.diagnostics == ()
    ((_, mesh),) = description.meshes.items()
    assert [shape["tag"] for shape in shapes(description, "collision")] == ["mesh"]
    assert mesh_of(mesh, ".stl").vertices[:3].tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    world = world_of(path)
    assert world.robot.solid_names == ["base"]
    world.close()


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset><unit meter="0.1"/></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">{points}</float_array>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="2"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4 3</vcount><p>{corners}</p></polylist>
</mesh></geometry></library_geometries><library_visual_scenes><visual_scene><node><translate>0 0 10</translate>
<node><scale>2 1 1</scale><instance_geometry url="#g"/></node>
</node></visual_scene></library_visual_scenes></COLLADA>"""
SQUARE = "0 0 0 1 0 0 1 1 0 0 1 0"
BOMB = '<!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
STL = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 {} 0\nendfacet\nendsolid s"
BROKEN_MESHES = {
    "unknown format": ("a.ply", CUBE, "format"),
    "no mesh": ("a.obj", "no mesh", "no triangle"),
    "empty": ("a.obj", "", "no triangle"),
    "face without its vertex": ("a.obj", CUBE + "f 1 2 999999999\n", "names vertex 999999999, there are 8"),
    "face before its vertices": ("a.obj", "v 0 0 0\nf -1 -2 -3\n", "names vertex"),
    "face of vertex 0": ("a.obj", CUBE + "f 0 1 2\n", "vertex 0, the first one is 1"),
    "face of a number that is none": ("a.obj", CUBE + "f 1 2 x\n", "malformed number"),
    "vertex that is no number": ("a.obj", CUBE.replace("v 0 0 1", "v nan 0 1"), "not finite"),
    "vertex beyond the world": ("a.obj", CUBE.replace("v 0 0 1", "v 1e300 0 1"), "beyond"),
    "no triangle": ("a.stl", "solid a\nendsolid a\n", "no triangle"),
    "infinite": ("a.stl", STL.format("inf"), "not finite"),
    "cut off": ("a.stl", "\0" * 80 + "\1\0\0\0" + "\0" * 10, "truncated"),
    "never fetched": ("a.stl", "version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 9\n", "git lfs pull"),
    "another document": ("a.dae", "<html/>", "<html>"),
    "empty document": ("a.dae", "<COLLADA></COLLADA>", "no triangle"),
    "entities": ("a.dae", BOMB + COLLADA.format(points=SQUARE, corners="0 1 2 3 0 1 2"), "entity"),
    "polygon without its points": ("a.dae", COLLADA.format(points=SQUARE, corners="0 1 2 9 0 1 2"), "names vertex 9"),
    "point that is no number": ("a.dae", COLLADA.format(points="nan " * 12, corners="0 1 2 3 0 1 2"), "not finite"),
    "nodes without end": ("a.dae", "<COLLADA>" + "<node>" * 1000 + "</node>" * 1000 + "</COLLADA>", "nested"),
}


@pytest.mark.parametrize(("name", "content", "reason"), BROKEN_MESHES.values(), ids=BROKEN_MESHES)
def test_a_broken_mesh_is_replaced_and_the_warning_says_why(
    tmp_path: Path, name: str, content: str, reason: str
) -> None:
    (tmp_path / name).write_text(content)
    mesh = MESH.format("collision", "").replace("package://cart_description/meshes/", name)
    path = write(tmp_path, f'<link name="base">{INERTIAL}{mesh}</link>')
    description = read_description(path)
    ((code, message),) = [(one.code, one.message) for one in description.diagnostics]
    assert code == "B013"
    assert f"{name} (" in message
    assert reason in message
    assert [shape["tag"] for shape in shapes(description, "collision")] == ["box"]
    world_of(path).close()


def test_meshes_have_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.obj").write_text(CUBE)
    monkeypatch.setattr("planlang.geometry.mesh.MOST_VERTICES", 7)
    with pytest.raises(BadMesh, match="more than 7 vertices"):
        mesh_of(CUBE.encode(), ".obj")
    monkeypatch.setattr("planlang.geometry.mesh.LARGEST", 20)
    with pytest.raises(BadMesh, match="larger than"):
        mesh_content(tmp_path / "a.obj")


def test_polygons_of_a_collada_scene_are_where_its_nodes_put_them() -> None:
    mesh = mesh_of(COLLADA.format(points=SQUARE, corners="0 1 2 3 0 1 2").encode(), ".dae")
    assert mesh.vertices.tolist() == pytest.approx(np.array([[0, 0, 1], [0.2, 0, 1], [0.2, 0.1, 1], [0, 0.1, 1]]))
    assert mesh.parts[0].tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]], "a square is two triangles"


TEXT, BINARY = STL.format("1").encode(), mesh_of(STL.format("1").encode(), ".stl").written()[1]
LOOSE = {
    "a name joined to solid": TEXT.replace(b"solid s", b"Solid_by_a_program"),
    "capitals": TEXT.upper(),
    "byte order mark": b"\xef\xbb\xbf" + TEXT,
    "a comment": b"# exported\n" + TEXT,
    "line ends of another system": TEXT.replace(b"\n", b"\r"),
    "a single line": TEXT.replace(b"\n", b" "),
    "neither head nor foot": TEXT.partition(b"\n")[2].rpartition(b"\n")[0],
    "a binary file that says solid": b"solid\nfacet vertex 0 0 0".ljust(80) + BINARY[80:],
    "a binary file without its count": BINARY[:80] + bytes(4) + BINARY[84:],
}


@pytest.mark.parametrize("content", LOOSE.values(), ids=LOOSE)
def test_stl_is_read_whatever_its_header_says(content: bytes) -> None:
    assert mesh_of(content, ".stl").written() == mesh_of(TEXT, ".stl").written()


POINTS, _, CORNERS = CUBE.partition("f ")
BACKWARDS = "".join(
    f"{POINTS}f {' '.join(str(int(number) - 9) for number in face.split())} # face\n"
    for face in CORNERS.replace("f ", "").splitlines()
)
"""Each face behind vertices of its own, counted from behind."""


@pytest.mark.parametrize("text", [CUBE.replace("f ", "fo "), BACKWARDS], ids=["of version 2", "counted from behind"])
def test_faces_of_obj_are_read_however_they_are_written(text: str) -> None:
    mesh, plain = mesh_of(text.encode(), ".obj"), mesh_of(CUBE.encode(), ".obj")
    assert np.array_equal(mesh.vertices[np.concatenate(mesh.parts)], plain.vertices[np.concatenate(plain.parts)])


def test_text_and_binary_stl_hold_the_same() -> None:
    mesh = mesh_of(STL.format("1").encode(), ".stl")
    suffix, binary = mesh.written()
    again = mesh_of(binary, suffix)
    assert again.vertices.tolist() == mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_groups_of_an_obj_stay_shapes_of_their_own() -> None:
    mesh = mesh_of((CUBE + "g other\nf 1// 2/1 -1\n").encode(), ".obj")
    assert [part.tolist() for part in mesh.parts] == [[[0, 1, 2], [1, 2, 3], [4, 5, 6]], [[0, 1, 7]]]
    assert [part.tolist() for part in mesh_of(mesh.written()[1], ".obj").parts] == [
        part.tolist() for part in mesh.parts
    ]


ODD_NAMES = ("a.obj", "", "\0.obj", "a" * 5000 + ".obj", "/dev/zero", "package://", "package://../../../etc/passwd")


@pytest.mark.parametrize("name", ODD_NAMES, ids=["folder", "empty", "zero", "long", "device", "package", "escape"])
def test_folders_and_odd_names_are_no_meshes(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.obj").mkdir()
    for place in file_places(tmp_path / "cart.urdf", name):
        with pytest.raises((OSError, BadMesh)):
            checked_mesh(place)


def test_a_robot_without_shapes_for_contacts_touches_with_those_for_looks(tmp_path: Path) -> None:
    description = read_description(write(tmp_path, f'<link name="base">{BOX.format("visual")}</link>'))
    assert shapes(description, "collision") == shapes(description, "visual")
    ((code, message),) = [(one.code, one.message) for one in description.diagnostics]
    assert code == "B015"
    assert "<visual>" in message
    (problem,) = read_description(write(tmp_path, '<link name="base"/>')).diagnostics
    assert (problem.code, problem.message) == ("B015", "no link has a shape (<collision> or <visual>)")


def test_nothing_stays_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    path = write(tmp_path / "robot", f'<link name="base">{MESH.format("visual", "../../out.dae")}</link>')
    world_of(path).close()
    assert list((tmp_path / "temporary").iterdir()) == []
    assert [file.name for file in (tmp_path / "robot").iterdir()] == ["cart.urdf"]


def test_two_robots_of_one_file_name_are_not_confused(tmp_path: Path) -> None:
    for inside, count in (("", 0), (BOX.format("collision"), 1)):
        world = world_of(write(tmp_path, f'<link name="base">{inside}</link>'))
        assert len(world.robot.solid) == count
        world.close()


LINKS = '<link name="base"/><link name="arm"/>'
BROKEN = {
    "empty": ("", "not XML"),
    "not XML": ("<robot><link>", "not XML"),
    "another root": ("<sdf/>", "not URDF"),
    "no links": ('<robot name="a"/>', "no links"),
    "two roots": (f"<robot>{LINKS}</robot>", "2 separate parts"),
    "two links of one name": (f'<robot>{LINKS}<link name="arm"/>{ARM}</robot>', "two links 'arm'"),
    "two joints of one name": (f"<robot>{LINKS}{ARM}{ARM}</robot>", "two joints 'turn'"),
    "link without name": ("<robot><link/></robot>", "no name"),
    "joint to nowhere": (f'<robot><link name="base"/>{ARM}</robot>', "'arm' that is not described"),
    "circle": (
        f"<robot>{LINKS}<link name='c'/>{ARM}"
        + ARM.replace("turn", "back").replace('"arm"', '"c"').replace('"base"', '"arm"')
        + ARM.replace("turn", "round").replace('"arm"', '"base"').replace('parent link="base"', 'parent link="c"')
        + "</robot>",
        "separate parts|loop|hangs",
    ),
    "negative box": (f"<robot><link name='a'>{BOX.format('collision').replace('0.4', '-1')}</link></robot>", "negat"),
    "no number": (f"<robot><link name='a'>{BOX.format('visual').replace('0.4', 'nan')}</link></robot>", "box size"),
    "many joints": (
        "<robot name='r'><link name='l0'/>"
        + "".join(
            f"<link name='l{k + 1}'/><joint name='j{k}' type='continuous'>"
            f"<parent link='l{k}'/><child link='l{k + 1}'/></joint>"
            for k in range(200)
        )
        + "</robot>",
        "at most 127",
    ),
    "entity bomb": (
        '<!DOCTYPE r [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;">]><robot><link name="&b;"/></robot>',
        "entity",
    ),
    "external entity": ('<!DOCTYPE r [<!ENTITY s SYSTEM "file:///etc/hostname">]><robot>&s;</robot>', "entity"),
    "deep": ("<robot>" + "<link>" * 500 + "</link>" * 500 + "</robot>", "deeply"),
    "unknown encoding": ('<?xml version="1.0" encoding="nonsense"?><robot/>', "not XML"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_urdf_is_told(tmp_path: Path, what: str) -> None:
    text, complaint = BROKEN[what]
    path = tmp_path / "cart.urdf"
    path.write_text(text)
    with pytest.raises(BadInput) as problem:
        read_description(path)
    assert {diagnostic.code for diagnostic in problem.value.diagnostics} == {"B009"}
    assert re.search(complaint, str(problem.value))


def test_a_folder_and_an_absent_file_are_told(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "gone.urdf"):
        with refusal("B009"):
            read_description(path)


def test_long_lines_are_no_obstacle(tmp_path: Path) -> None:
    path = write(tmp_path, LINKS + ARM.replace("\n", " ") + " " * 3000 + "<gazebo>" + "x" * 3000 + "</gazebo>")
    world = world_of(path)
    assert world.robot.limits == {"turn": (-1.0, 1.0)}
    world.close()


def test_a_shape_of_no_size_is_none_and_a_flat_one_is_thin(tmp_path: Path) -> None:
    empty, flat = (BOX.format("collision").replace("0.4 0.3 0.2", size) for size in ("0 0 0", "1 1 0"))
    path = write(tmp_path, f'<link name="base">{empty}{flat}</link>')
    assert shapes(read_description(path), "collision") == [{"tag": "box", "size": "1.0 1.0 0.002"}]


FOLLOWING = """<link name="left"/><link name="right">{box}</link><link name="tip">{box}</link>
<joint name="first" type="prismatic"><parent link="base"/><child link="left"/><axis xyz="0 1 0"/>
<limit lower="0" upper="0.1" velocity="1" effort="1"/></joint>
<joint name="second" type="prismatic"><parent link="base"/><child link="right"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/><mimic joint="first" multiplier="-2" offset="0.01"/></joint>
<joint name="third" type="prismatic"><parent link="base"/><child link="tip"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/><mimic joint="second" multiplier="3"/></joint>"""


def test_a_joint_that_mimics_another_moves_with_it(tmp_path: Path) -> None:
    path = write(tmp_path, '<link name="base"/>' + FOLLOWING.format(box=BOX.format("collision")))
    world = world_of(path)
    assert list(world.configuration().joints) == ["first"]
    world.set_configuration(Configuration((0.0, 0.0, 0.0), {"first": 0.05}))
    assert world.link_pose("right").position == pytest.approx((0.0, -0.09, 0.0))
    assert world.link_pose("tip").position == pytest.approx((-0.27, 0.0, 0.0))
    assert {world.robot.solid_names[number] for number in world.robot.moved_by("first")} == {"right", "tip"}
    world.close()


def test_wheels_in_the_floor_and_in_the_frame_are_no_contact(tmp_path: Path) -> None:
    wheel = ARM.replace("revolute", "continuous").replace("0 0 1", "0.1 0 0")
    path = write(
        tmp_path,
        f'<link name="base">{BOX.format("collision")}</link><link name="arm">{BOX.format("collision")}</link>{wheel}',
    )
    body = RobotBody(path, CameraModel("base"), moving=())
    world = PlanningWorld(Scene(()), body)
    assert world.contacts() == ()
    world.close()


@pytest.mark.parametrize("name", ["amigo@hydro.urdf", "pr2@hydro.urdf"])
def test_real_urdfs_without_their_meshes_load(corpus: Path, name: str) -> None:
    path = corpus / "robots" / name
    description = read_description(path)
    assert [diagnostic.code for diagnostic in description.diagnostics] == ["B013"]
    assert read_description(path).text == description.text
    world = PlanningWorld(Scene(()), RobotBody(path, CameraModel(description.root)))
    links = {link.get("name") for link in ElementTree.parse(path).getroot().findall("link")}
    assert set(world.robot.links) == links
    world.close()


def test_a_robot_with_its_meshes_keeps_them(tmp_path: Path) -> None:
    shutil.copytree(Path(pybullet_data.getDataPath()) / "franka_panda", tmp_path / "panda")
    description = read_description(tmp_path / "panda" / "panda.urdf")
    assert description.diagnostics == ()
    assert all(shape["tag"] == "mesh" for shape in shapes(description, "collision"))


def test_a_mesh_that_its_urdf_calls_concave_has_points(tmp_path: Path) -> None:
    (tmp_path / "hall.obj").write_text(CUBE)
    mesh = '<link name="base" concave="yes"><collision concave="yes"><geometry><mesh filename="hall.obj"/></geometry>'
    world = world_of(write(tmp_path, f"{mesh}</collision></link>"))
    assert len(world.robot.points([0])[0]) >= 3
    assert world.robot.spread(0) == pytest.approx(2**0.5, abs=0.01)
    world.close()


def test_geometry_of_no_urdf_is_told_and_replaced_like_an_absent_mesh(tmp_path: Path) -> None:
    field = '<collision><geometry><cdf filename="hall.cdf"/></geometry></collision>'
    path = write(tmp_path, f'<link name="base">{INERTIAL}{field}</link>')
    description = read_description(path)
    (warning,) = description.diagnostics
    assert (warning.code, "<cdf>" in warning.message) == ("B013", True)
    assert [shape["tag"] for shape in shapes(description, "collision")] == ["box"]
    world_of(path).close()


@given(
    extents=st.tuples(*[st.floats(0.05, 2.0)] * 3),
    angles=st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    density=st.floats(100.0, 5000.0),
)
def test_a_box_is_found_again_from_its_inertia(
    extents: tuple[float, float, float], angles: tuple[float, float, float], density: float
) -> None:
    mass = density * float(np.prod(extents))
    squares = np.square(extents)
    turned = rotation_of(*angles)
    inertia = turned @ np.diag(mass / 12 * (squares.sum() - squares)) @ turned.T
    found = inertia_box(mass, (inertia + inertia.T) / 2)
    assert found is not None
    size, axes = found
    assert sorted(size) == pytest.approx(sorted(extents), rel=1e-4)
    again = axes @ np.diag(mass / 12 * (np.square(size).sum() - np.square(size))) @ axes.T
    assert np.allclose(again, inertia, atol=1e-6 * mass)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_axes_of_the_box_of_an_inertia_are_those_next_to_the_axes_of_the_link() -> None:
    squares, turned = np.square((0.4, 0.2, 0.3)), rotation_of(0.2, -0.1, 0.3)
    inertia = turned @ np.diag(10.0 * (squares.sum() - squares)) @ turned.T
    found = inertia_box(120.0, (inertia + inertia.T) / 2)
    assert found is not None
    assert np.allclose(found[0], (0.4, 0.2, 0.3))
    assert np.allclose(found[1], turned), "not sorted by moment, nor mirrored, as an eigenvalue solver may have them"


@given(angles=st.tuples(*[st.floats(-3.1, 3.1)] * 3))
def test_angles_give_the_rotation_that_they_are_taken_from(angles: tuple[float, float, float]) -> None:
    rotation = rotation_of(*angles)
    assert np.allclose(rotation_of(*angles_of(rotation)), rotation, atol=1e-6)


def test_an_expression_of_xacro_is_recognised(tmp_path: Path) -> None:
    turn = ARM.replace("0 0 1", "$(arg turns_about)", 1)
    with pytest.raises(BadInput) as refused:
        read_description(write(tmp_path, f'<link name="base"/><link name="arm"/>{turn}'))
    (found,) = refused.value.diagnostics
    assert found.help == "this is an expression of xacro; write it out first: xacro cart.urdf.xacro > cart.urdf"


def test_what_xacro_leaves_to_the_environment_has_its_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARM_XYZ", "1 0 0")
    turn = ARM.replace("0 0 1", "$(optenv ARM_XYZ 0 0 1)", 1)
    plain, with_default = (
        read_description(write(tmp_path, f'<link name="base"/><link name="arm"/>{joint}')) for joint in (ARM, turn)
    )
    assert with_default.text == plain.text
