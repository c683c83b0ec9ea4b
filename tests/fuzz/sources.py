"""Files of every kind that the commands read, to be broken: made once for a campaign."""

from __future__ import annotations

import json
import os
import shutil
import socket
import struct
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

OWN_ROBOT = """name = "own"
urdf = "own.urdf"
[base]
radius = 0.3
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
[camera]
link = "camera"
forward = [1, 0, 0]
up = [0, 0, 1]
[arms.arm]
tip = "tip"
hand = "wrist"
approach = [0, 0, 1]
closing = [0, 1, 0]
[arms.arm.gripper]
opened = { left = 0.04, right = 0.04 }
closed = { left = 0.0, right = 0.0 }
fingers = ["left_finger", "right_finger"]
max_opening = 0.08
"""
WORLD = """<robot name="flat">
<link name="world"/>
<link name="table1"><collision><origin xyz="0 0 0.35"/><geometry><box size="1 0.8 0.7"/></geometry></collision></link>
<joint name="j1" type="fixed"><parent link="world"/><child link="table1"/><origin xyz="2 1 0"/></joint>
<link name="cabinet"><collision><origin xyz="0 0 0.5"/><geometry><box size="0.5 0.6 1"/></geometry></collision></link>
<joint name="j2" type="fixed"><parent link="world"/><child link="cabinet"/><origin xyz="-2 1 0" rpy="0 0 1.57"/></joint>
<link name="cabinet_door">
<collision><origin xyz="0 0.3 0.5"/><geometry><box size="0.02 0.6 1"/></geometry></collision></link>
<joint name="j3" type="revolute"><parent link="cabinet"/><child link="cabinet_door"/><origin xyz="0.26 -0.3 0"/>
<axis xyz="0 0 1"/><limit lower="0" upper="1.57" effort="10" velocity="1"/></joint>
<link name="lamp"><visual><geometry><mesh filename="lamp.obj" scale="1 1 1"/></geometry></visual>
<collision><geometry><mesh filename="lamp.obj"/></geometry></collision></link>
<joint name="j4" type="fixed"><parent link="world"/><child link="lamp"/><origin xyz="0 2 0"/></joint>
<link name="pillar"><collision><geometry><cylinder radius="0.1" length="2"/></geometry></collision></link>
<joint name="j5" type="fixed"><parent link="world"/><child link="pillar"/><origin xyz="0 -2 1"/></joint>
</robot>
"""
LABELS = """[meshes]
lamp = { size = [0.2, 0.2, 0.4], centre = [0, 0, 0.2] }
[links]
table1 = { class = "Table" }
cabinet = { class = "Cupboard", open = "+x", walls = 0.02 }
"*_door" = { class = "Door", size = [0.02, 0.6, 1.0], centre = [0, 0.3, 0.5] }
"""
MODULE = '''from planlang.protocols import process_module


@process_module
class Stirring:
    """Moves a spoon."""

    name = "stirring"
    actions = ("Stirring",)
    failures = ()

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        return ()

    async def execute(self, action):
        return "stirred"
'''
SRDF = """<robot name="own"><group name="arm"><chain base_link="base_link" tip_link="tip"/></group>
<group name="hand"><joint name="left"/></group>
<end_effector name="gripper" parent_link="wrist" group="hand"/></robot>
"""
GRID = """image: grid.pgm
resolution: 0.1
origin: [-3.0, -3.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
PCD = """VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {0}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {0}
DATA {1}
"""
PLY = """ply
format ascii 1.0
element vertex {}
property float x
property float y
property float z
end_header
"""
FETCH = """<?xml version="1.0"?>
<Ontology xmlns="http://www.w3.org/2002/07/owl#" xml:base="http://example.org/fetch" ontologyIRI="http://example.org/fetch">
<Prefix name="k" IRI="http://knowrob.org/kb/knowrob.owl#"/>
<Import>http://knowrob.org/kb/knowrob.owl</Import><Import>http://example.org/words</Import>
<Declaration><Class IRI="#Fetch"/></Declaration><Declaration><NamedIndividual IRI="#cup1"/></Declaration>
<SubClassOf><Annotation><AnnotationProperty abbreviatedIRI="k:why"/><Literal xml:lang="en">so</Literal></Annotation>
<Class IRI="#Fetch"/><Class abbreviatedIRI="k:PurposefulAction"/></SubClassOf>
<SubClassOf><Class IRI="#Fetch"/><ObjectSomeValuesFrom><ObjectProperty abbreviatedIRI="k:subAction"/>
<Class IRI="#Take"/></ObjectSomeValuesFrom></SubClassOf>
<SubClassOf><Class IRI="#Take"/><ObjectIntersectionOf><Class abbreviatedIRI="k:PickingUpAnObject"/>
<ObjectHasValue><ObjectProperty abbreviatedIRI="k:objectActedOn"/><NamedIndividual IRI="#cup1"/></ObjectHasValue>
<ObjectMaxCardinality cardinality="1"><ObjectProperty IRI="#on"/></ObjectMaxCardinality>
</ObjectIntersectionOf></SubClassOf>
<ClassAssertion><Class IRI="http://example.org/words#SoupCup"/><NamedIndividual IRI="#cup1"/></ClassAssertion>
<DataPropertyRange><DataProperty IRI="#size"/><DatatypeRestriction><Datatype abbreviatedIRI="xsd:decimal"/>
<FacetRestriction facet="http://www.w3.org/2001/XMLSchema#minInclusive"><Literal>0</Literal></FacetRestriction>
</DatatypeRestriction></DataPropertyRange>
</Ontology>
"""
WORDS = """Prefix(:=<http://example.org/words#>)
Prefix(k:=<http://knowrob.org/kb/knowrob.owl#>)
Ontology(<http://example.org/words> <http://example.org/words/1>
SubClassOf(Annotation(k:why "so"@en) :SoupCup ObjectIntersectionOf(k:Cup ObjectSomeValuesFrom(k:on k:Table)))
)
"""
CATALOG = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
    <group id="Folder Repository" xml:base=""><uri name="http://example.org/words" uri="words.ofn"/></group>
    <rewriteURI uriStartString="http://example.org/" rewritePrefix="./"/><nextCatalog catalog="catalog-v001.xml"/>
</catalog>
"""
INERTIA = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
BUNDLED = {
    "drink.omn": "recipes/serve_a_drink.omn",
    "soup.omn": "recipes/stir_soup.omn",
    "wipe.omn": "recipes/wipe_table.omn",
    "cabinet.omn": "recipes/fetch_from_cabinet.omn",
    "room.omn": "ontologies/environments/hospital_room.omn",
    "kitchen.omn": "ontologies/environments/kitchenette.omn",
    "amigo.urdf": "ontologies/robots/amigo.urdf",
    "amigo.toml": "ontologies/robots/amigo.toml",
    "amigo.omn": "ontologies/robots/amigo.omn",
}
CUBE = [(x, y, z) for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.3)]
FACES = (
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
)


def own_robot() -> str:
    """A mobile arm of six joints with a gripper of two fingers."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
    box = f"<collision><geometry>{_box('0.06 0.06 0.2')}</geometry></collision>"
    base = '<collision><geometry><cylinder radius="0.3" length="0.6"/></geometry></collision>'
    mesh = '<visual><geometry><mesh filename="arm.stl"/></geometry><material name="grey"/></visual>'
    parts = ['<?xml version="1.0"?>', '<robot name="own">', '<material name="grey"><color rgba="1 0 0 1"/></material>']
    parts.append(f'<link name="base_link">{INERTIA}{base}</link>')
    parent = "base_link"
    for number, axis in enumerate(axes, 1):
        child = "wrist" if number == len(axes) else f"link{number}"
        parts.append(f'<link name="{child}">{INERTIA}{mesh if number == 2 else ""}{box}</link>')
        limit = '<limit lower="-2.5" upper="2.5" effort="50" velocity="1.5"/>'
        moves = f'<axis xyz="{axis}"/>{limit}'
        parts.append(_joint(f"joint{number}", "revolute", parent, child, f"0 0 {0.6 if number == 1 else 0.25}", moves))
        parent = child
    for side, sign in (("left", ""), ("right", "-")):
        mimic = '<mimic joint="left"/>' if side == "right" else ""
        finger = f"<collision><geometry>{_box('0.02 0.01 0.06')}</geometry></collision>"
        moves = f'<axis xyz="0 {sign}1 0"/>{mimic}<limit lower="0" upper="0.04" effort="10" velocity="0.1"/>'
        parts.append(f'<link name="{side}_finger">{finger}</link>')
        parts.append(_joint(side, "prismatic", "wrist", f"{side}_finger", "0 0 0.15", moves))
    for name, mount, xyz in (("tip", "wrist", "0 0 0.2"), ("camera", "base_link", "0.1 0 1.2")):
        parts.append(f'<link name="{name}"/>' + _joint(f"{name}_joint", "fixed", mount, name, xyz))
    return "\n".join([*parts, "</robot>\n"])


def _box(size: str) -> str:
    return f'<box size="{size}"/>'


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, moves: str = "") -> str:
    links = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{links}<origin xyz="{xyz}" rpy="0 0 0"/>{moves}</joint>'


def _mesh(folder: Path) -> None:
    corners = ("".join("vertex {} {} {}\n".format(*CUBE[at]) for at in face) for face in FACES)
    facets = "".join(f"facet normal 0 0 0\nouter loop\n{one}endloop\nendfacet\n" for one in corners)
    (folder / "arm.stl").write_text(f"solid arm\n{facets}endsolid arm\n")
    vertices = "".join("v {} {} {}\n".format(*point) for point in CUBE)
    faces = "".join("f {} {} {}\n".format(*(at + 1 for at in face)) for face in FACES)
    (folder / "lamp.obj").write_text(vertices + faces)


def _is_wall(x: int, y: int) -> bool:
    return x in (0, 59) or y in (0, 59) or (20 < x < 24 and y < 40)


def _sensed(folder: Path) -> None:
    rows = bytes(0 if _is_wall(x, y) else 254 for y in range(60) for x in range(60))
    (folder / "grid.pgm").write_bytes(b"P5\n60 60\n255\n" + rows)
    (folder / "grid.yaml").write_text(GRID)
    points = [(2 + 0.05 * i, -1 + 0.05 * j, 0.1 * k) for i in range(4) for j in range(20) for k in range(5)]
    lines = "".join("{:.2f} {:.2f} {:.2f}\n".format(*point) for point in points)
    (folder / "cloud.pcd").write_text(PCD.format(len(points), "ascii") + lines)
    packed = b"".join(struct.pack("<fff", *point) for point in points)
    (folder / "binary.pcd").write_bytes(PCD.format(len(points), "binary").encode() + packed)
    (folder / "cloud.xyz").write_text(lines)
    (folder / "cloud.ply").write_text(PLY.format(len(points)) + lines)
    tree = b"# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.05\ndata\n"
    (folder / "tree.bt").write_bytes(tree + b"\x02\xc0" + b"\x03\x00" * 14 + b"\x0a\x50")


def _odd(folder: Path) -> None:
    (folder / "folder").mkdir()
    (folder / "empty").write_bytes(b"")
    (folder / "text.txt").write_text("some text\nof nothing\n")
    (folder / "noise.bin").write_bytes(bytes((7 * at * at + 3 * at) % 256 for at in range(4000)))
    (folder / "zeros.bin").write_bytes(bytes(100_000))
    (folder / "deep.json").write_text("[" * 100_000)
    (folder / "loop").symlink_to("loop")
    (folder / "dangling").symlink_to("nowhere")
    drink = (folder / "drink.omn").read_text()
    (folder / "bom.omn").write_bytes(b"\xef\xbb\xbf" + drink.encode())
    (folder / "utf16.omn").write_bytes(drink.encode("utf-16"))
    (folder / "latin1.omn").write_bytes(drink.replace("bottle", "b\xf6ttle").encode("latin-1"))
    bound = socket.socket(socket.AF_UNIX)
    here = os.getcwd()
    os.chdir(folder)  # the path of a socket has at most 107 characters
    bound.bind("socket")
    os.chdir(here)
    bound.close()


def _store(path: Path) -> None:
    from tests.support.knowledge_bases import hospital

    store = hospital(path)
    store.new_key("ada", "2026-01-01T00:00:00Z")
    store.close()


def make(folder: Path, planlang: Callable[[str], None]) -> None:
    """Write all files; ``planlang`` runs a command line in the folder."""
    for name, source in BUNDLED.items():
        shutil.copyfile(ROOT / source, folder / name)
    (folder / "own.urdf").write_text(own_robot())
    (folder / "own.toml").write_text(OWN_ROBOT)
    (folder / "fetch.owx").write_text(FETCH)
    (folder / "words.ofn").write_text(WORDS)
    (folder / "catalog-v001.xml").write_text(CATALOG)
    (folder / "own.srdf").write_text(SRDF)
    (folder / "world.urdf").write_text(WORLD)
    (folder / "world.toml").write_text(LABELS)
    (folder / "stirring.py").write_text(MODULE)
    (folder / "bindings.txt").write_text("bottle=bottle1\n# nothing\n")
    (folder / "faults.toml").write_text('faults = "gripper:misses@1"\nrate = 0.1\nexpect = "done"\n')
    (folder / "author.key").write_text("abcdefghijklmnop\n")
    _mesh(folder)
    _sensed(folder)
    for syntax, suffix in (("rdfxml", "owl"), ("turtle", "ttl"), ("ntriples", "nt"), ("functional", "ofn")):
        planlang(f"convert drink.omn --to {syntax} -o drink.{suffix}")
    planlang("convert room.omn --to rdfxml -o room.owl")
    here = "--robot amigo --environment room.omn"
    planlang("compile drink.omn -o drink.py")
    planlang(f"run drink.omn {here} --trace drink.jsonl --poses poses.jsonl")
    planlang(f"sweep drink.omn {here} --worlds 2 --processes 1 --out sweep.jsonl")
    _store(folder / "kb.sqlite")
    _odd(folder)
    failed = {"event": "failed", "failure": {"type": "GraspMissed", "message": "missed", "fields": {"arm": "left"}}}
    (folder / "failed.jsonl").write_text((folder / "drink.jsonl").read_text() + json.dumps(failed) + "\n")
