"""Worlds in URDF: links become things of a map, joints those of doors and drawers, whatever a stranger wrote."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.maps import read_map, scene_of
from planlang.diagnostics import BadInput, Diagnostic
from planlang.ontology import load
from sim import Scene
from sim.joints import JointKind
from tests.support.examples import examples
from tests.support.refusals import refusal

KITCHEN = "IAI_kitchen@iai_maps.urdf"
CUPBOARD = """
<robot name="room">
  <link name="table"><visual><geometry><box size="0.8 1.2 0.7"/></geometry></visual></link>
  <link name="cupboard"><visual><geometry><mesh filename="package://room/Cupboard.dae"/></geometry></visual></link>
  <link name="cupboard_door"><collision><geometry><box size="0.02 0.6 0.8"/></geometry></collision></link>
  <link name="cupboard_door_handle"><visual><geometry><cylinder radius="0.01" length="0.1"/></geometry></visual></link>
  <joint name="place" type="fixed">
    <parent link="table"/><child link="cupboard"/><origin xyz="2 0 0.5" rpy="0 0 3.141592653589793"/>
  </joint>
  <joint name="hinge" type="revolute">
    <parent link="cupboard"/><child link="cupboard_door"/><origin xyz="0.3 0.3 0"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1.5" effort="1" velocity="1"/>
  </joint>
  <joint name="grip" type="fixed">
    <parent link="cupboard_door"/><child link="cupboard_door_handle"/><origin xyz="0.04 -0.5 0"/>
  </joint>
</robot>
"""
LABELS = "[meshes]\nCupboard = { size = [0.6, 0.6, 0.8] }\n"


def world(
    folder: Path, text: str, labels: str | None = LABELS, *, ignore_unread: bool = False
) -> tuple[Scene, list[Diagnostic]]:
    """Return the scene of a URDF, with labels beside it, and all that was reported."""
    (folder / "room.urdf").write_text(text, encoding="utf-8")
    if labels is not None:
        (folder / "room.toml").write_text(labels, encoding="utf-8")
    ontology = load(folder / "room.urdf")
    semantic_map = read_map(ontology, ignore_unread=ignore_unread)
    found: list[Diagnostic] = []
    scene = scene_of(semantic_map, found)
    return scene, [*ontology.diagnostics, *semantic_map.diagnostics, *found]


def test_links_inside_extensions_are_no_links_of_the_world(tmp_path: Path) -> None:
    extension = '<gazebo><plugin><link name="simulated_rod"/></plugin></gazebo></robot>'
    scene, _ = world(tmp_path, CUPBOARD.replace("</robot>", extension))
    assert [body.name for body in scene.bodies if "rod" in body.name] == []
    assert scene.body("cupboard_door").size[1] == 0.6


def test_all_joints_of_the_kitchen_are_joints_of_the_map(corpus: Path) -> None:
    ontology = load(corpus / "environments" / KITCHEN)
    scene = scene_of(read_map(ontology))
    assert not ontology.diagnostics
    assert sum(joint.kind is JointKind.PRISMATIC for joint in scene.joints) == 15
    assert sum(joint.kind is JointKind.HINGED for joint in scene.joints) == 8
    assert all(joint.handle is not None for joint in scene.joints)
    door = next(joint for joint in scene.joints if joint.leaf == "iai_fridge_door")
    assert door.holder == "iai_fridge_main"
    assert (door.motion(door.upper) @ scene.body("iai_fridge_door").pose).position[0] < 1.0  # into the room


def test_areas_drawers_and_appliances_of_the_kitchen_are_hollow(corpus: Path) -> None:
    scene = scene_of(read_map(load(corpus / "environments" / KITCHEN)))
    hollow = {body.type for body in scene.bodies if body.cavities}
    assert hollow == {"CounterTop", "Cupboard", "Drawer", "Dishwasher", "Oven", "Refrigerator"}
    assert all(body.cavities for body in scene.bodies if body.type in hollow)


BOTTLE = """
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: room: <http://planlang.org/kb/urdf/room#>
Ontology: <http://example.org/bottle.owl>

Individual: bottle1
    Types: knowrob:Bottle
    Facts: knowrob:pose here, knowrob:depthOfObject 0.06, knowrob:widthOfObject 0.06, knowrob:heightOfObject 0.2
Individual: here
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:relativeTo room:cupboard, knowrob:translation "0.1 0 -0.28", knowrob:quaternion "0 0 0 1"
"""


def test_things_are_added_by_a_map_beside_a_world_or_importing_it(tmp_path: Path) -> None:
    world(tmp_path, CUPBOARD)
    (tmp_path / "bottle.omn").write_text(BOTTLE)
    imports = BOTTLE.replace("bottle.owl>", "bottle.owl>\n    Import: <file:room.urdf>")
    (tmp_path / "importing.omn").write_text(imports)
    beside = load(tmp_path / "room.urdf", also=(tmp_path / "bottle.omn",))
    for ontology in (beside, load(tmp_path / "importing.omn")):
        bottle = scene_of(read_map(ontology)).body("bottle1")
        assert bottle.movable
        assert bottle.pose.position == pytest.approx((1.9, 0.0, 0.22))


def test_boxes_of_meshes_classes_and_joints_follow_from_labels_and_names(tmp_path: Path) -> None:
    scene, _ = world(tmp_path, CUPBOARD)
    assert scene.body("cupboard").size == (0.6, 0.6, 0.8)
    assert [body.type for body in scene.bodies if body.shape == "box"] == [
        *("Table-PieceOfFurniture", "Cupboard", "Door", "Handle")
    ]
    (joint,) = scene.joints
    assert (joint.leaf, joint.holder, joint.handle) == ("cupboard_door", "cupboard", "cupboard_door_handle")
    assert joint.point == pytest.approx((1.7, -0.3, 0.5))


def test_a_missing_mesh_is_an_error_and_costs_its_link_only_if_that_is_ignored(tmp_path: Path) -> None:
    with refusal("M019", naming=("package://room/Cupboard.dae", str(tmp_path))):
        world(tmp_path, CUPBOARD, None)
    scene, found = world(tmp_path, CUPBOARD, None, ignore_unread=True)
    assert "cupboard" not in [body.name for body in scene.bodies]
    assert scene.body("table").size == (0.8, 1.2, 0.7)
    assert [one.code for one in found if one.code.startswith("M019")] == ["M019"]


def test_other_labels_are_another_map(tmp_path: Path) -> None:
    (tmp_path / "room.urdf").write_text(CUPBOARD, encoding="utf-8")
    digests = set()
    for size in (0.6, 0.7):
        (tmp_path / "room.toml").write_text(f"[meshes]\nCupboard = {{ size = [{size}, 0.6, 0.8] }}\n")
        digests.add(load(tmp_path / "room.urdf").documents[0].sha256)
    assert len(digests) == 2


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('<!DOCTYPE robot [<!ENTITY a "aaaa">]><robot name="&a;"/>', "B009"),
        ("<robot><link name='a'/><link name='b'/>" + "<joint name='j' type='fixed'><parent link='a'/><child link='b'/>"
         "</joint><joint name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>", "B009"),
        (CUPBOARD.replace('xyz="2 0 0.5"', 'xyz="nan 0 0.5"'), "B009"),
        (CUPBOARD.replace('xyz="2 0 0.5"', 'xyz="1e300 0 0.5"'), "B009"),
        (CUPBOARD.replace("</robot>", ""), "B009"),
        (CUPBOARD.replace("0.02 0.6 0.8", "1e308 1e308 1e308"), "B009"),
        ("<robot name='empty'><link name='a'/></robot>", "M009"),
    ],
)  # fmt: skip
def test_a_hostile_world_gives_a_diagnostic(tmp_path: Path, text: str, code: str) -> None:
    try:
        _, found = world(tmp_path, text)
    except BadInput as problem:
        found = list(problem.diagnostics)
    assert code in [one.code for one in found]


@pytest.mark.long
def test_a_chain_of_20000_links_is_refused_at_once(tmp_path: Path) -> None:
    links = "".join(f"<link name='l{k}'/>" for k in range(20000))
    joints = "".join(
        f"<joint name='j{k}' type='fixed'><parent link='l{k}'/><child link='l{k + 1}'/></joint>" for k in range(19999)
    )
    with refusal("B009", naming=("5000", "20000")):
        world(tmp_path, f"<robot name='chain'>{links}{joints}</robot>")


KEYS = st.sampled_from(("robot", "meshes", "links", "size", "centre", "open", "walls", "class", "Cupboard", "cupboard"))
VALUES = st.recursive(
    st.one_of(st.integers(), st.floats(), st.booleans(), st.sampled_from(('"+x"', '"Cupboard"', '""')).map(str)),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=3)),
    max_leaves=6,
)


def written(value: object) -> str:
    """Return a value as TOML writes it."""
    match value:
        case bool():
            return str(value).lower()
        case list():
            return f"[{', '.join(map(written, value))}]"
        case dict():
            return "{" + ", ".join(f"{key} = {written(inner)}" for key, inner in value.items()) + "}"
    return str(value)


@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(table=st.dictionaries(KEYS, VALUES, max_size=3))
def test_labels_of_any_kind_are_read_or_refused(tmp_path: Path, table: dict[str, object]) -> None:
    lines = "".join(f"{key} = {written(value)}\n" for key, value in table.items())
    try:
        world(tmp_path, CUPBOARD, lines, ignore_unread=True)
    except BadInput as problem:
        found = problem.diagnostics
    else:
        return
    assert {one.code for one in found} == {"M020"}
