"""Maps in the words of SOMA and KnowRob 2: shapes, poses, parts and joints are those that they state."""

import math
import os
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from rdflib import Graph

from executive.cli.app import app
from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.merging import merge
from planlang.designators import local_name
from planlang.diagnostics import BadInput
from planlang.geometry import Pose
from planlang.ontology import load
from tests.support.refusals import refusal

HERE = Path(__file__).parent / "soma"
REAL = os.environ.get("PLANLANG_SOMA_MAPS", "")
"""Folder of published maps in SOMA's words, such as iai_room_v1.owl, which are not part of this project."""
HEAD = """\
@prefix : <http://example.org/m.owl#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
@prefix dul: <http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#> .
@prefix soma: <http://www.ease-crc.org/ont/SOMA.owl#> .
@prefix obj: <http://www.ease-crc.org/ont/EASE-OBJ.owl#> .
@prefix ease: <http://www.ease-crc.org/ont/EASE.owl#> .
@prefix urdf: <http://knowrob.org/kb/urdf.owl#> .
@prefix knowrob: <http://knowrob.org/kb/knowrob.owl#> .
<http://example.org/m.owl> a owl:Ontology .
"""
BOX = "soma:hasShape [ a soma:Shape ; dul:hasRegion [ a soma:BoxShape ; %s ] ]"
AT = 'soma:hasLocalization [ soma:hasSpaceRegion [ a soma:6DPose ; soma:hasPositionVector "%s" ] ]'


def placed(cls: str, size: str, at: str, more: str = "") -> str:
    """State an object with a box of "depth width height" at a position, or at "FRAME x y z"."""
    depth, width, height = size.split()
    *frame, x, y, z = at.split()
    frames = f'" ; soma:hasReferenceFrame "{frame[0]}' if frame else ""
    shape = BOX % f"soma:hasDepth {depth} ; soma:hasWidth {width} ; soma:hasHeight {height}"
    return f"a {cls} ; {shape} ; {AT % f'{x} {y} {z}{frames}'}{more} ."


def read(folder: Path, text: str, name: str = "m.ttl") -> SemanticMap:
    (folder / name).write_text(HEAD + text, encoding="utf-8")
    return read_map(load(folder / name))


def test_a_map_of_somas_words_has_its_objects_with_their_classes_sizes_and_poses() -> None:
    ontology = load(HERE / "corner.ttl")
    corner = read_map(ontology)
    assert (ontology.diagnostics, corner.diagnostics) == ((), ())
    table, cup = corner.objects
    assert (table.name, table.size, cup.name, cup.size) == ("table1", (0.7, 1.2, 0.74), "cup1", (0.08, 0.08, 0.1))
    assert table.pose == Pose((1.6, 0.0, 0.37))
    assert cup.pose == Pose((1.5, 0.2, 0.79))
    assert corner.is_a(table, "Table-PieceOfFurniture")
    assert corner.is_a(cup, "Cup")
    assert scene_of(corner).body("cup1").graspable


def test_a_recipe_in_somas_words_runs_in_a_map_in_somas_words() -> None:
    arguments = ["run", str(HERE / "take.ttl"), "--environment", str(HERE / "corner.ttl"), "--robot", "amigo"]
    run = CliRunner().invoke(app, arguments)
    assert run.exit_code == 0, run.stderr
    assert "warning" not in run.stderr
    assert "cup1: held by robot" in run.stdout


SHAPES = {
    "depth, width, height": (BOX % "soma:hasDepth 0.1 ; soma:hasWidth 0.2 ; soma:hasHeight 0.3", (0.1, 0.2, 0.3)),
    "length for depth": (BOX % "soma:hasLength 0.1 ; soma:hasWidth 0.2 ; soma:hasHeight 0.3", (0.1, 0.2, 0.3)),
    "cylinder": ("soma:hasShape [ dul:hasRegion [ soma:hasRadius 0.05 ; soma:hasLength 0.3 ] ]", (0.1, 0.1, 0.3)),
    "sphere": ("soma:hasShape [ dul:hasRegion [ a soma:SphereShape ; soma:hasRadius 0.05 ] ]", (0.1, 0.1, 0.1)),
    "region of the object": (
        "soma:hasShapeRegion [ soma:hasDepth 0.1 ; soma:hasWidth 0.2 ; soma:hasHeight 0.3 ]",
        (0.1, 0.2, 0.3),
    ),
    "quality with numbers": (
        "soma:hasShape [ soma:hasDepth 0.1 ; soma:hasWidth 0.2 ; soma:hasHeight 0.3 ]",
        (0.1, 0.2, 0.3),
    ),
    "in EASE": (
        "obj:hasShape [ dul:hasRegion [ obj:hasDepth 0.1 ; obj:hasWidth 0.2 ; obj:hasHeight 0.3 ] ]",
        (0.1, 0.2, 0.3),
    ),
    "region named elsewhere": (
        "a owl:NamedIndividual . :region1 soma:isShapeRegionOf :thing1 ; soma:hasDepth 0.1 ; soma:hasWidth 0.2 ;"
        " soma:hasHeight 0.3 . :thing1 a soma:Box",
        (0.1, 0.2, 0.3),
    ),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_shape_is_read_however_its_region_is_reached(kind: str, tmp_path: Path) -> None:
    shape, size = SHAPES[kind]
    (thing,) = read(tmp_path, f":thing1 a soma:Box ; {AT % '1 2 3'} ; {shape} .").objects
    assert thing.size == pytest.approx(size)
    assert thing.pose == Pose((1.0, 2.0, 3.0))


TURNED = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
POSES = {
    "array_double": 'knowrob:translation "1 2 3"^^soma:array_double ; knowrob:quaternion "0 0 1 1"^^soma:array_double',
    "lists": 'soma:hasPositionVector "[1.0, 2.0, 3.0]" ; soma:hasOrientationVector "[0, 0, 0.5, 0.5]"',
    "one literal": 'soma:hasPositionData "1 2 3 0 0 0.7071067811865476 0.7071067811865476"',
    "frame of the map": 'soma:hasReferenceFrame "map" ; knowrob:translation "1 2 3" ; knowrob:quaternion "0 0 1 1"',
    "relative to a thing": 'soma:hasReferenceFrame "base1" ; soma:hasPositionVector "0 0 2" ;'
    ' soma:hasOrientationVector "0 0 1 1"',
}


@pytest.mark.parametrize("kind", POSES)
@pytest.mark.parametrize("path", ["soma:hasLocalization [ soma:hasSpaceRegion [ %s ] ]", "soma:hasPose [ %s ]"])
def test_a_pose_is_read_however_its_numbers_are_written(kind: str, path: str, tmp_path: Path) -> None:
    base = placed("soma:Table", "1 1 1", "1 2 1")
    semantic_map = read(tmp_path, f":base1 {base} :thing1 a soma:Box ; {path % POSES[kind]} .")
    pose = semantic_map.find("thing1").pose  # type: ignore[union-attr]
    assert pose is not None
    assert pose.position == pytest.approx((1.0, 2.0, 3.0))
    assert pose.turn(Pose((0, 0, 0), TURNED)) < 1e-9


def test_the_origin_of_a_shape_places_its_box_and_not_what_is_relative_to_the_object(tmp_path: Path) -> None:
    shape = BOX % (
        "soma:hasDepth 0.4 ; soma:hasWidth 0.4 ; soma:hasHeight 1.0 ;"
        ' urdf:hasOrigin [ soma:hasPositionVector "0 0 0.5" ; soma:hasOrientationVector "0 0 0 1" ]'
    )
    text = f":shelf1 a soma:Cupboard ; {shape} ; {AT % '2 0 0'} ."
    text += f"\n:cup1 {placed('soma:Cup', '0.08 0.08 0.1', 'shelf1 0 0 1.05')}"
    shelf, cup = read(tmp_path, text).objects
    assert shelf.pose is not None
    assert cup.pose is not None
    assert shelf.pose.position == pytest.approx((2.0, 0.0, 0.5))
    assert cup.pose.position == pytest.approx((2.0, 0.0, 1.05))


def test_the_mesh_of_a_shape_has_its_bounding_box(tmp_path: Path) -> None:
    corners = [(x, y, z) for x in (0, 2) for y in (0, 1) for z in (0, 4)]
    mesh = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 2 3 4\nf 5 6 7\nf 6 7 8\n"
    (tmp_path / "box.obj").write_text(mesh)
    shape = 'soma:hasShape [ dul:hasRegion [ soma:hasFilePath "package://things/meshes/box.obj" ; soma:hasShapeScale'
    (tmp_path / "meshes").mkdir()
    (tmp_path / "box.obj").rename(tmp_path / "meshes" / "box.obj")
    (thing,) = read(tmp_path, f':thing1 a soma:Box ; {shape} "0.1 0.1 0.1" ] ] ; {AT % "1 0 0"} .').objects
    assert thing.size == pytest.approx((0.2, 0.1, 0.4))
    assert thing.pose is not None
    assert thing.pose.position == pytest.approx((1.1, 0.05, 0.2))


def test_an_object_without_a_name_is_called_after_its_class(tmp_path: Path) -> None:
    shape = BOX % "soma:hasDepth 0.1 ; soma:hasWidth 0.2 ; soma:hasHeight 0.3"
    semantic_map = read(tmp_path, f"[ a owl:NamedIndividual, soma:DesignedHandle ; {shape} ; {AT % '1 2 3'} ] .")
    (thing,) = semantic_map.objects
    assert (thing.name, thing.size, thing.pose) == ("DesignedHandle_1", (0.1, 0.2, 0.3), Pose((1.0, 2.0, 3.0)))
    assert [one.code for one in semantic_map.diagnostics] == ["M033"]


UNREAD = {
    "a shape without numbers": f":thing1 a soma:Box ; soma:hasShape [ a soma:Shape ] ; {AT % '1 2 3'} .",
    "a pose without numbers": f":thing1 a soma:Box ; {BOX % 'soma:hasRadius 0.1'} ; soma:hasLocalization :nowhere .",
    "an absent mesh": f':thing1 a soma:Box ; soma:hasShape [ soma:hasFilePath "a.stl" ] ; {AT % "1 2 3"} .',
    "an absent URDF": ':thing1 a soma:Box ; urdf:hasBaseLinkName "box_link" .',
}


@pytest.mark.parametrize("kind", UNREAD)
def test_what_a_soma_map_states_and_cannot_be_read_is_an_error(kind: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as bad:
        read(tmp_path, f":table1 {placed('soma:Table', '1 1 1', '0 0 0.5')}\n{UNREAD[kind]}")
    (problem,) = [one for one in bad.value.diagnostics if one.code == "M033"]
    assert "thing1" in problem.message
    assert problem.help is not None
    assert "ignore_unread=True" in problem.help


def test_what_lies_outside_the_folders_of_a_map_is_not_read_as_its_mesh(tmp_path: Path) -> None:
    (tmp_path / "secret.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n")
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    shape = f'soma:hasShape [ dul:hasRegion [ soma:hasFilePath "file://{tmp_path}/secret.obj" ] ]'
    with refusal("M033", naming=("thing1", "secret.obj")):
        read(inner, f":thing1 a soma:Box ; {shape} ; {AT % '1 2 3'} .")


# Parts and joints

KITCHEN = f"""
:slides a owl:Class ; rdfs:subClassOf urdf:PrismaticJoint , [ a owl:Restriction ; owl:onProperty urdf:hasJointLimits ;
    owl:hasValue [ a urdf:JointLimits ; urdf:hasLowerLimit 0.0 ; urdf:hasUpperLimit 0.48 ] ] .
:swings a owl:Class ; rdfs:subClassOf urdf:RevoluteJoint , [ a owl:Restriction ; owl:onProperty urdf:hasJointLimits ;
    owl:hasValue [ a urdf:JointLimits ; urdf:hasLowerLimit 0.0 ; urdf:hasUpperLimit 2.0 ] ] .
:block1 {placed("soma:Cupboard", "0.58 2.06 0.85", "1.5 0.3 0.425", " ; soma:hasPhysicalComponent :drawer1 , :fridge1")}
:drawer1 {
    placed(
        "soma:Drawer",
        "0.5 0.8 0.14",
        "1.4 0.9 0.75",
        ''' ; soma:hasPhysicalComponent :handle1 ;
    urdf:hasJoint [ a :slides ; urdf:hasParentLink :drawer1 ; urdf:hasChildLink :handle1 ]''',
    )
}
:handle1 {placed("soma:DesignedHandle", "0.07 0.7 0.01", "1.12 0.9 0.78")}
:fridge1 {
    placed(
        "soma:Refrigerator",
        "0.5 0.59 0.72",
        "1.4 0.2 0.46",
        ''' ; soma:hasPhysicalComponent :door1 ;
    urdf:hasJoint [ a :swings ; urdf:hasParentLink :fridge1 ; urdf:hasChildLink :door1 ]''',
    )
}
:door1 {placed("soma:Door", "0.05 0.59 0.72", "1.12 0.2 0.46")}
"""
"""The structure of iai_room_v1.owl: joints without names, limits in their classes, a drawer's joint at its handle."""


def test_drawers_and_doors_move_as_the_joints_of_a_soma_map_say(tmp_path: Path) -> None:
    semantic_map = read(tmp_path, KITCHEN)
    assert semantic_map.find("block1").parts[:2] == (  # type: ignore[union-attr]
        "http://example.org/m.owl#drawer1",
        "http://example.org/m.owl#fridge1",
    )
    drawer, door = sorted(scene_of(semantic_map).joints, key=lambda one: -len(one.leaf))
    assert (drawer.leaf, drawer.handle, drawer.upper) == ("drawer1", "handle1", 0.48)
    assert drawer.axis == pytest.approx((-1.0, 0.0, 0.0))
    assert (door.leaf, door.holder, door.upper) == ("door1", "fridge1", 2.0)


def test_a_joint_of_soma_states_limits_axis_origin_and_position(tmp_path: Path) -> None:
    joint = """:hinge1 a soma:RevoluteJoint ; soma:hasParentLink :box1 ; soma:hasChildLink :lid1 ;
    soma:hasJointLimit [ soma:hasJointPositionMin 0.0 ; soma:hasJointPositionMax 1.2 ] ;
    soma:hasJointState [ soma:hasJointPosition 0.5 ] ; urdf:hasJointAxis [ urdf:hasAxisVector "0 0 1" ] ;
    urdf:hasOrigin [ soma:hasPositionVector "-0.25 0.3 0" ; soma:hasOrientationVector "0 0 0 1" ] ."""
    text = f":box1 {placed('soma:Cupboard', '0.5 0.6 0.8', '2 0 0.4')}"
    text += f"\n:lid1 {placed('soma:Door', '0.02 0.6 0.8', '1.75 0 0.4')}\n{joint}"
    (found,) = scene_of(read(tmp_path, text)).joints
    assert (found.leaf, found.upper, found.first) == ("lid1", 1.2, 0.5)
    assert found.point[:2] == pytest.approx((1.75, 0.3))
    assert [abs(one) for one in found.axis] == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("written", "misspelt", "code", "meant"),
    [
        ("hasParentLink :drawer1", "hasParentLinkk :drawer1", "M036", "hasParentLink"),
        ("hasParentLink :drawer1", "hasParentLink :drawr1", "M033", "drawer1"),
        ("hasChildLink :door1", "hasChildLink :dor1", "M033", "door1"),
        ("soma:hasPositionVector", "soma:hasPositonVector", "M036", "hasPositionVector"),
    ],
)
def test_what_is_misspelt_in_a_map_is_an_error_that_names_what_is_meant(
    written: str, misspelt: str, code: str, meant: str, tmp_path: Path
) -> None:
    assert written in KITCHEN
    with pytest.raises(BadInput) as problem:
        read(tmp_path, KITCHEN.replace(written, misspelt))
    found = next(one for one in problem.value.diagnostics if one.code == code)
    assert f"did you mean {meant}?" in (found.help or "")


def test_a_thing_is_no_part_of_what_has_no_shape(tmp_path: Path) -> None:
    cup = placed("soma:Cup", "0.08 0.08 0.1", "1 0 0.05")
    text = f":map1 a dul:PhysicalObject ; dul:hasComponent :cup1 .\n:cup1 {cup}"
    assert scene_of(read(tmp_path, text)).body("cup1").graspable


def test_a_merged_map_keeps_what_soma_states_and_the_newer_pose(tmp_path: Path) -> None:
    read(tmp_path, f":table1 {placed('soma:Table', '1 1 0.7', '2 0 0.35')}")
    newer = tmp_path / "newer.omn"
    newer.write_text(
        "Prefix: : <http://example.org/m.owl#>\nPrefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
        "Ontology: <http://example.org/newer.owl>\nIndividual: seen\n    Types: knowrob:SemanticMapPerception\n"
        "    Facts: knowrob:objectActedOn table1, knowrob:eventOccursAt place, knowrob:startTime timepoint_20\n"
        "Individual: table1\n    Types: knowrob:Table-PieceOfFurniture\n"
        "Individual: timepoint_20\n    Types: knowrob:TimePoint\nIndividual: place\n"
        '    Facts: knowrob:translation "3 0 0.35"\n'
    )
    (tmp_path / "all.omn").write_text(merge([tmp_path / "m.ttl", newer]).text)
    (table,) = [one for one in read_map(load(tmp_path / "all.omn")).objects if one.size]
    assert table.size == (1.0, 1.0, 0.7)
    assert table.pose == Pose((3.0, 0.0, 0.35))


def test_a_joint_with_extents_of_zero_is_no_object_that_lost_its_shape(tmp_path: Path) -> None:
    slider = """:slider1 a knowrob:PrismaticJoint ; knowrob:connectedTo-Rigidly :drawer1 ; knowrob:maxJointValue 0.48 ;
    knowrob:depthOfObject 0.0 ; knowrob:widthOfObject 0.0 ; knowrob:heightOfObject 0.0 ."""
    (joint,) = scene_of(read(tmp_path, f"{KITCHEN.partition(':fridge1 a')[0]}{slider}")).joints
    assert (joint.leaf, joint.upper) == ("drawer1", 0.48)


# Links of a URDF

URDF = """<robot name="flat">
  <link name="floor"/>
  <link name="case"><collision><origin xyz="0 0 0.4"/><geometry><box size="0.5 0.6 0.8"/></geometry></collision></link>
  <link name="tray"><collision><geometry><box size="0.45 0.5 0.1"/></geometry></collision></link>
  <joint name="a" type="fixed"><parent link="floor"/><child link="case"/><origin xyz="2 0 0"/></joint>
  <joint name="b" type="prismatic"><parent link="case"/><child link="tray"/><origin xyz="0 0 0.6"/><axis xyz="-1 0 0"/>
    <limit lower="0" upper="0.3" effort="1" velocity="1"/></joint>
</robot>
"""
LINKED = """
:case1 a soma:KitchenCabinet ; urdf:hasBaseLinkName "case" ; soma:hasPhysicalComponent :tray1 .
:tray1 a soma:Drawer ; urdf:hasBaseLinkName "tray" .
:floor1 a dul:PhysicalObject ; urdf:hasBaseLinkName "floor" .
"""
NAMED = """
:flat a soma:KinoDynamicData .
:file dul:realizes :flat ; soma:hasPersistentIdentifier "%s" ; soma:hasDataFormat "URDF" .
"""


@pytest.mark.parametrize(
    ("urdf", "more"),
    [
        ("m.urdf", ""),
        ("other.urdf", NAMED % "other"),
        ("other.urdf", "<http://example.org/m.owl> owl:imports <other.urdf> ."),
    ],
    ids=["of the same name", "named", "imported"],
)
def test_an_object_that_names_a_link_of_the_urdf_has_its_shape_and_joint(urdf: str, more: str, tmp_path: Path) -> None:
    (tmp_path / urdf).write_text(URDF)
    semantic_map = read(tmp_path, LINKED + more)
    case, tray = semantic_map.find("case1"), semantic_map.find("tray1")
    assert case is not None
    assert tray is not None
    assert (case.size, tray.size) == ((0.5, 0.6, 0.8), (0.45, 0.5, 0.1))
    assert case.pose == Pose((2.0, 0.0, 0.4))
    assert list(map(local_name, case.types)) == ["KitchenCabinet"]
    (joint,) = scene_of(semantic_map).joints
    assert (joint.leaf, joint.holder, joint.upper) == ("tray1", "case1", 0.3)


def test_the_urdf_of_a_map_is_found_in_the_folders_of_imports(tmp_path: Path) -> None:
    folder = tmp_path / "robots"
    folder.mkdir()
    (folder / "m.urdf").write_text(URDF)
    (tmp_path / "m.ttl").write_text(HEAD + LINKED)
    case = read_map(load(tmp_path / "m.ttl", folders=[folder])).find("case1")
    assert case is not None
    assert case.pose == Pose((2.0, 0.0, 0.4))


def test_the_urdf_with_most_of_the_named_links_is_that_of_the_map(tmp_path: Path) -> None:
    package = tmp_path / "lab_flat"
    for folder in ("owl", "urdf"):
        (package / folder).mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    (package / "urdf" / "house.urdf").write_text(URDF)
    (package / "urdf" / "another.urdf").write_text(URDF.replace('"case"', '"box"').replace('"tray"', '"lid"'))
    found = read(package / "owl", LINKED)
    case = found.find("case1")
    assert case is not None
    assert case.pose == Pose((2.0, 0.0, 0.4))
    assert "house.urdf has 3 of the 3 links that the map names" in " ".join(one.message for one in found.diagnostics)


def test_a_urdf_with_few_of_the_named_links_is_another_world(tmp_path: Path) -> None:
    (tmp_path / "another.urdf").write_text(URDF.replace('"case"', '"box"').replace('"tray"', '"lid"'))
    with refusal("M033"):
        read(tmp_path, LINKED)


def test_a_map_whose_urdf_is_absent_is_refused_for_that_alone(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as bad:
        read(tmp_path, LINKED)
    assert [one.code for one in bad.value.diagnostics] == ["M033"]
    with pytest.raises(BadInput) as bad:
        read_map(load(tmp_path / "m.ttl"), ignore_unread=True)
    assert [(one.code, one.severity.name) for one in bad.value.diagnostics] == [("M033", "WARNING"), ("M009", "ERROR")]


# Published maps


def test_published_maps_have_the_objects_sizes_and_poses_that_rdflib_finds() -> None:
    files = sorted(Path(REAL).glob("*.owl")) if REAL else []
    if not files:
        pytest.skip("PLANLANG_SOMA_MAPS names no folder of published maps")
    for path in files:
        truth = stated(path)
        found = {thing.iri: (thing.size, thing.pose) for thing in read_map(load(path)).objects}
        named = [iri for iri in found if iri in truth]
        assert len(found) == len(truth)
        unnamed = zip(found.keys() - truth.keys(), truth.keys() - found.keys(), strict=True)
        for iri, name in [*((iri, iri) for iri in named), *unnamed]:  # no real map has two objects without a name
            (size, pose), (true_size, position, orientation) = found[iri], truth[name]
            assert size == pytest.approx(true_size), iri
            assert pose is not None
            assert pose.position == pytest.approx(position), iri
            agreement = sum(a * b for a, b in zip(pose.orientation, orientation, strict=True))
            assert abs(agreement) == pytest.approx(1.0), iri


def stated(path: Path) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Size, position and orientation of each object of a map in SOMA's words, by an independent reader."""
    graph, found = Graph().parse(path), {}

    def reached(start: Any, *names: str) -> Any:
        for name in names:
            start = next(value for prop, value in graph.predicate_objects(start) if local_name(str(prop)) == name)
        return start

    for subject in set(graph.subjects()):
        if any(local_name(str(prop)) == "hasLocalization" for prop in graph.predicates(subject)):
            region = reached(subject, "hasShape", "hasRegion")
            size = tuple(float(reached(region, name)) for name in ("hasDepth", "hasWidth", "hasHeight"))
            place = reached(subject, "hasLocalization", "hasSpaceRegion")
            numbers = (reached(place, name) for name in ("translation", "quaternion"))
            found[str(subject)] = (size, *(tuple(map(float, str(one).split())) for one in numbers))
    return found
