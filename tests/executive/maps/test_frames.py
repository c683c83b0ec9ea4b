"""Merging maps in different frames: transformations that are stated, estimated from common objects, or unknown."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.merging import Merged, merge
from executive.maps.statements import main_statements, placements, text_of, with_placements
from planlang.diagnostics import BadInput
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import load
from tests.support.refusals import refusal

Write = Callable[..., str]
Merge = Callable[..., tuple[SemanticMap, Merged]]
BOX = (0.4, 0.8, 0.8)
HEADER = """
Prefix: : <http://example.org/{name}.owl#>
Prefix: one: <http://example.org/one.owl#>
Prefix: two: <http://example.org/two.owl#>
Prefix: roboearth: <http://www.roboearth.org/kb/roboearth.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/{name}.owl>

Individual: map1
    Types: knowrob:SemanticEnvironmentMap
"""
PLACES = {"cabinet1": (1.0, 0.0, 0.4), "table1": (2.0, 1.0, 0.4), "bed1": (0.5, 3.0, 0.4), "chair1": (-1.0, 2.0, 0.4)}
CLASSES = {"cabinet1": "Cabinet-PieceOfFurniture", "table1": "Table-PieceOfFurniture", "bed1": "Bed-PieceOfFurniture"}
FRAME = Pose.planar(4.0, -2.0, math.pi / 2)
"""The second map's frame in the first one's."""


@pytest.fixture
def merged(tmp_path: Path) -> Merge:
    """Merges maps, each given as a list of frames; the files are one and two, the prefixes of objects ``names``."""

    def merge_all(*maps: list[str], names: str = "") -> tuple[SemanticMap, Merged]:
        paths = [tmp_path / f"{name}.omn" for name in ("one", "two")]
        for path, frames in zip(paths, maps, strict=True):
            path.write_text(HEADER.format(name=names or path.stem) + "\n".join(frames), encoding="utf-8")
        result = merge(paths)
        (tmp_path / "merged.omn").write_text(result.text, encoding="utf-8")
        return read_map(load(tmp_path / "merged.omn")), result

    return merge_all


@pytest.fixture
def mapped(thing: Write, seen: Write) -> Callable[..., list[str]]:
    """Frames of objects with their poses in the first map, transformed into another frame."""

    def write(*names: str, frame: Pose = Pose((0.0, 0.0, 0.0)), **moved: Pose) -> list[str]:  # noqa: B008
        frames = []
        for name in names:
            pose = frame.inverse() @ moved.get(name, Pose(PLACES.get(name, (3.0, 3.0, 0.4))))
            rotation = pose.rotation.reshape(-1).tolist()
            frames += [
                thing(name, CLASSES.get(name, "Chair-PieceOfFurniture"), BOX),
                seen(name, pose.position, rotation),
            ]
        return frames

    return write


Mapped = Callable[..., list[str]]


def place(semantic_map: SemanticMap, name: str) -> tuple[float, ...]:
    """The position of an object."""
    thing = semantic_map.find(name)
    assert thing
    assert thing.pose
    return thing.pose.position


def frame_of(of: str, relative_to: str, pose: Pose) -> str:
    """The statement of a map's frame."""
    rotation, (x, y, z) = pose.rotation.tolist(), pose.position
    entries = [f"knowrob:m{i}{j} {rotation[i][j]:.12f}" for i in range(3) for j in range(3)]
    entries += [f"knowrob:m03 {x}", f"knowrob:m13 {y}", f"knowrob:m23 {z}", f"knowrob:relativeTo {relative_to}"]
    return (
        f"Individual: {of}\n    Types: knowrob:SemanticEnvironmentMap\n    Facts: knowrob:orientation frame_of_map\n"
        f"Individual: frame_of_map\n    Types: knowrob:RotationMatrix3D\n    Facts: {', '.join(entries)}\n"
    )


def test_a_map_whose_frame_is_stated_relative_to_the_other_map_is_moved_into_its_frame(
    merged: Merge, mapped: Mapped
) -> None:
    stated = frame_of("map1", "one:map1", FRAME)
    semantic_map, result = merged(mapped("cabinet1"), [stated, *mapped("table1", frame=FRAME)])
    assert place(semantic_map, "cabinet1") == PLACES["cabinet1"]
    assert place(semantic_map, "table1") == pytest.approx(PLACES["table1"])
    assert [one.code for one in result.diagnostics] == ["M027"]
    assert "as stated: moved by (4.0, -2.0, 0.0) m, 90.0 degrees" in result.diagnostics[0].message
    assert {thing.name for thing in semantic_map.objects} == {"cabinet1", "table1"}
    assert "frame_of_map" not in result.text


def test_the_first_map_may_state_its_frame_relative_to_the_second(merged: Merge, mapped: Mapped) -> None:
    stated = frame_of("map1", "two:map1", FRAME.inverse())
    semantic_map, _ = merged([stated, *mapped("cabinet1")], mapped("table1", frame=FRAME))
    assert place(semantic_map, "table1") == pytest.approx(PLACES["table1"])


def test_a_frame_may_be_stated_relative_to_a_thing_of_the_other_map(merged: Merge, mapped: Mapped) -> None:
    stated = frame_of("map1", "one:cabinet1", Pose(PLACES["cabinet1"]).inverse() @ FRAME)
    semantic_map, _ = merged(mapped("cabinet1"), [stated, *mapped("table1", frame=FRAME)])
    assert place(semantic_map, "table1") == pytest.approx(PLACES["table1"])


def test_two_maps_with_different_frames_are_not_one_world(merged: Merge, mapped: Mapped, tmp_path: Path) -> None:
    merged(mapped("cabinet1"), [frame_of("map1", "one:map1", FRAME), *mapped("table1", frame=FRAME)])
    both = load(tmp_path / "one.omn", also=[tmp_path / "two.omn"])
    with refusal("M027"):
        read_map(both)
    assert [one.code for one in read_map(both, ignore_unread=True).diagnostics] == ["M027"]
    assert [one.code for one in read_map(load(tmp_path / "two.omn")).diagnostics] == []


def test_frames_may_be_stated_relative_to_one_place(merged: Merge, mapped: Mapped) -> None:
    corner = Pose.planar(-3.0, -3.0, 0.3)
    semantic_map, _ = merged(
        [frame_of("map1", "one:room1", corner.inverse()), *mapped("cabinet1")],
        [frame_of("map1", "one:room1", corner.inverse() @ FRAME), *mapped("table1", frame=FRAME)],
    )
    assert place(semantic_map, "table1") == pytest.approx(PLACES["table1"])


@pytest.mark.long
@settings(
    max_examples=20,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    x=st.floats(-20, 20),
    y=st.floats(-20, 20),
    yaw=st.floats(-3.1, 3.1),
    noise=st.lists(st.floats(-0.01, 0.01), min_size=8, max_size=8),
)
def test_three_objects_that_have_not_moved_determine_the_transformation(
    x: float,
    y: float,
    yaw: float,
    noise: list[float],
    tmp_path_factory: pytest.TempPathFactory,
    thing: Write,
    seen: Write,
) -> None:
    frame, folder = Pose.planar(x, y, yaw), tmp_path_factory.mktemp("frames")
    for number, name in enumerate(("one", "two")):
        frames = []
        for index, (one, at) in enumerate(PLACES.items()):
            dx, dy = noise[2 * index : 2 * index + 2]
            pose = Pose(at) if number == 0 else frame.inverse() @ Pose((at[0] + dx, at[1] + dy, at[2]))
            cls = CLASSES.get(one, "Chair-PieceOfFurniture")
            frames += [thing(one, cls, BOX), seen(one, pose.position, pose.rotation.reshape(-1).tolist())]
        (folder / f"{name}.omn").write_text(HEADER.format(name=name) + "\n".join(frames), encoding="utf-8")
    result = merge([folder / "one.omn", folder / "two.omn"])
    (folder / "merged.omn").write_text(result.text, encoding="utf-8")
    semantic_map = read_map(load(folder / "merged.omn"))
    assert {one.code for one in result.diagnostics} <= {"M022", "M023", "M027"}
    for one, at in PLACES.items():
        assert math.dist(place(semantic_map, one), at) < 0.05


def test_a_moved_object_is_a_conflict_even_if_the_frames_differ(merged: Merge, mapped: Mapped) -> None:
    there = Pose((6.0, 6.0, 0.4))
    semantic_map, result = merged(mapped(*PLACES), mapped(*PLACES, frame=FRAME, chair1=there), names="one")
    assert [one.code for one in result.diagnostics] == ["M027", "M022"]
    assert "3 common objects" in result.diagnostics[0].message
    assert place(semantic_map, "chair1") == pytest.approx((6.0, 6.0, 0.4))


def test_things_that_moved_together_do_not_move_the_rest(merged: Merge, mapped: Mapped) -> None:
    chairs = {f"stool{number}": Pose((number, 5.0, 0.4)) for number in range(3)}
    pushed = {name: Pose((0.5, 0.0, 0.0)) @ pose for name, pose in chairs.items()}
    semantic_map, result = merged(
        mapped("cabinet1", "table1", *chairs, **chairs), mapped("cabinet1", "table1", *chairs, **pushed)
    )
    assert place(semantic_map, "cabinet1") == PLACES["cabinet1"]
    assert "M027" not in {one.code for one in result.diagnostics}


def test_joints_and_files_move_with_their_map(merged: Merge, mapped: Mapped, tmp_path: Path) -> None:
    (tmp_path / "cloud.xyz").write_text("0.0 0.0 0.525\n")
    semantic_map, _ = merged(
        mapped("cabinet1", "table1", "bed1"),
        [
            *mapped("table1", "bed1", "chair1", "cabinet1", frame=FRAME),
            'Individual: cloud1\n    Types: roboearth:PointMap\n    Facts: knowrob:linkToMapFile "cloud.xyz"\n',
            "Individual: hinge1\n    Types: knowrob:HingedJoint\n    Facts: knowrob:direction sideways\n",
            "Individual: sideways\n    Types: knowrob:Vector\n"
            "    Facts: knowrob:vectorX 1.0, knowrob:vectorY 0.0, knowrob:vectorZ 0.0\n",
        ],
    )
    obstacle = next(body for body in scene_of(semantic_map).bodies if body.name.startswith("mapped"))
    assert obstacle.pose.position == pytest.approx((4.0, -2.0, 0.525), abs=0.05)
    values = {
        triple.predicate.rpartition("#")[2]: triple.object.value  # type: ignore[union-attr]
        for triple in semantic_map.ontology.triples("http://example.org/two.owl#sideways")
        if "vector" in triple.predicate
    }
    assert [float(values[f"vector{axis}"]) for axis in "XYZ"] == pytest.approx([0, 1, 0])


def test_a_frame_relative_to_an_object_that_the_other_map_lacks_is_refused_by_name(
    merged: Merge, mapped: Mapped
) -> None:
    with pytest.raises(BadInput) as problem:
        merged(mapped("cabinet1"), [frame_of("map1", "one:corner9", FRAME), *mapped("table1", frame=FRAME)])
    (one,) = problem.value.diagnostics
    assert one.code == "M028"
    assert "corner9" in one.message
    assert "relativeTo the map of one.omn" in (one.help or "")


def test_poses_relative_to_two_unrelated_frames_are_refused(merged: Merge, thing: Write, seen: Write) -> None:
    maps = [
        [thing(name, "Cabinet-PieceOfFurniture", BOX), seen(name, (1, 0, 0), relative_to="map1")]
        for name in ("cabinet1", "cabinet2")
    ]
    with refusal("M028", naming=("map1", "one.omn", "two.omn")):
        merged(*maps)


def test_maps_without_an_object_in_the_same_place_are_refused(merged: Merge, mapped: Mapped) -> None:
    elsewhere = {name: Pose((3.0 * index, 7.0 + index**2, 0.4)) for index, name in enumerate(PLACES)}
    with refusal("M028", naming="4 common objects"):
        merged(mapped(*PLACES), mapped(*PLACES, **elsewhere))


def test_a_bundled_map_in_another_frame_merges_to_the_same_world(tmp_path: Path) -> None:
    path = bundled("ontologies") / "environments" / "hospital_room.omn"
    ontology = load(path)
    before = read_map(ontology)
    turned = {
        iri: type(one)(one.thing, FRAME.inverse() @ one.pose, one.time, one.relative_to, one.facts)
        for iri, one in placements(before).items()
    }
    statements = with_placements(main_statements(ontology, {path}), ontology.iri, turned)
    (tmp_path / "turned.omn").write_text(text_of(statements, ontology.iri, []), encoding="utf-8")
    result = merge([path, tmp_path / "turned.omn"])
    assert [one.code for one in result.diagnostics if one.code.startswith("M02")] == ["M027"]
    (tmp_path / "merged.omn").write_text(result.text, encoding="utf-8")
    after = read_map(load(tmp_path / "merged.omn"))
    for thing in before.objects:
        other = after.find(thing.iri)
        assert other
        assert np.allclose((thing.pose or FRAME).matrix(), (other.pose or FRAME).matrix(), atol=1e-6)
