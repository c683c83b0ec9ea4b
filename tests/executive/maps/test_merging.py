"""Merging maps of one place: the newest poses, all other facts, and reports of conflicts."""

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.merging import Merged, merge
from executive.maps.semantic_map import seconds_of
from planlang.files import bundled
from planlang.ontology import load
from tests.support.examples import some

Write = Callable[..., str]
BOX = (0.4, 0.8, 0.8)
HEADER = """
Prefix: : <http://example.org/{name}.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/{name}.owl>
"""


@pytest.fixture
def merged(tmp_path: Path) -> Callable[..., tuple[SemanticMap, Merged]]:
    """Merges maps, each given as a list of frames; without ``names``, objects have the prefix of the first map."""

    def merge_all(*maps: list[str], names: tuple[str, ...] = ("a", "a", "a")) -> tuple[SemanticMap, Merged]:
        paths = [tmp_path / f"{number}.omn" for number in range(len(maps))]
        for path, frames, name in zip(paths, maps, names, strict=False):
            path.write_text(HEADER.format(name=name) + "\n".join(frames), encoding="utf-8")
        result = merge(paths)
        (tmp_path / "merged.omn").write_text(result.text, encoding="utf-8")
        return read_map(load(tmp_path / "merged.omn")), result

    return merge_all


Merge = Callable[..., tuple[SemanticMap, Merged]]


def place(semantic_map: SemanticMap, name: str) -> tuple[float, ...]:
    """The position of an object."""
    thing = semantic_map.find(name)
    assert thing
    assert thing.pose
    return thing.pose.position


def test_the_newest_pose_of_each_thing_counts_whichever_map_has_it(merged: Merge, thing: Write, seen: Write) -> None:
    times = [f"Individual: timepoint_{t}\n    Types: knowrob:TimePoint\n" for t in ("5", "90")]
    frames = [thing(name, "Cabinet-PieceOfFurniture", BOX) for name in ("one", "two")]
    first = [seen("one", (1, 0, 0), time="timepoint_90"), seen("two", (1, 2, 0), time="timepoint_5")]
    second = [seen("one", (2, 0, 0), time="timepoint_5"), seen("two", (2, 2, 0), time="timepoint_90")]
    semantic_map, result = merged([*frames, *first, *times], [*frames, *second, *times])
    assert (place(semantic_map, "one"), place(semantic_map, "two")) == ((1, 0, 0), (2, 2, 0))
    assert [d.code for d in result.diagnostics] == ["M022", "M022"]
    assert all("seen it later" in d.message for d in result.diagnostics)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("http://example.org/map.owl#timepoint_1271159865.50", 1271159865.5),
        ("2011-11-17T14:41:51", 1321540911.0),
        ("2011-11-17T15:41:51+01:00", 1321540911.0),
        ("timepoint_2011-11-17T14:41:51.5Z", 1321540911.5),
        ("2011-11-17T14:41:51.123456789", 1321540911.123456),
        ("2011-11-17T15:41:51+0100", 1321540911.0),
        ("2011-11-17 14:41", 1321540860.0),
        ("2011-11-17", 1321488000.0),
        ("2011-11-17+01:00", 1321484400.0),
        ("http://example.org/2011-11-17/map.owl#timepoint_5", 5.0),
        ("http://192.168.10.11:8080/2011/11/17/timepoint-5", 5.0),
        ("2011-13-17T14:41:51", None),
        ("2011-11-17T14:41:51 +0100", None),
        ("2011-11-17T14:41:51,5", None),
        ("2011-11-17T14", None),
        ("0001-01-01T00:00+23:59", -62135683140.0),
        ("timepoint_2011_11_17", None),
        ("2011-W46-4", None),
        ("2011-11", None),
        ("http://example.org/map.owl#2011/11/17", None),
        ("20111117T144151", None),
        ("14:41:51", None),
        ("timepoint_1e", None),
        ("9" * 400, None),
        ("", None),
    ],
)
def test_times_are_seconds_or_dates(text: str, seconds: float | None) -> None:
    assert seconds_of(text) == seconds


def test_perceptions_with_dates_and_with_seconds_are_compared_and_both_poses_reported(
    merged: Merge, thing: Write, seen: Write
) -> None:
    frames = [thing("one", "Cabinet-PieceOfFurniture", BOX)]
    point = "Individual: timepoint_1321540910\n    Types: knowrob:TimePoint\n"
    dated = seen("one", (2, 0, 0), time='"2011-11-17T14:41:51Z"')
    semantic_map, result = merged(
        [*frames, dated], [*frames, seen("one", (1, 0, 0), time="timepoint_1321540910"), point]
    )
    assert place(semantic_map, "one") == (2, 0, 0)
    (conflict,) = result.diagnostics
    assert (
        "at (2.000, 0.000, 0.000) in 0.omn and (1.000, 0.000, 0.000) in 1.omn: that of 0.omn counts" in conflict.message
    )


def test_without_times_the_map_that_is_named_later_counts(merged: Merge, thing: Write, seen: Write) -> None:
    frames = [thing("one", "Cabinet-PieceOfFurniture", BOX)]
    semantic_map, result = merged([*frames, seen("one", (1, 0, 0))], [*frames, seen("one", (2, 0, 0))])
    assert place(semantic_map, "one") == (2, 0, 0)
    assert ["is named later" in d.message for d in result.diagnostics] == [True]


def test_an_object_moves_with_the_newest_pose_of_what_it_is_relative_to(
    merged: Merge, thing: Write, seen: Write
) -> None:
    frames = [thing("cabinet1", "Cabinet-PieceOfFurniture", BOX), thing("door1", "Door", (0.02, 0.4, 0.6))]
    semantic_map, _ = merged(
        [*frames, seen("cabinet1", (1, 0, 0)), seen("door1", (0.2, 0, 0), relative_to="cabinet1")],
        [frames[0], seen("cabinet1", (3, 1, 0))],
    )
    assert place(semantic_map, "door1") == pytest.approx((3.2, 1, 0))


@pytest.mark.parametrize("later", [True, False])
def test_a_pose_relative_to_an_object_of_the_other_map_follows_its_newest_pose(
    merged: Merge, thing: Write, seen: Write, later: bool
) -> None:
    """Today's map has only the cup, relative to a table that yesterday's map places."""
    points = [f"Individual: timepoint_{t}\n    Types: knowrob:TimePoint\n" for t in ("5", "90")]
    times = ("timepoint_5", "timepoint_90") if later else ("timepoint_90", "timepoint_5")
    frames = [thing("table1", "Table-PieceOfFurniture", BOX), thing("cup1", "Cup", (0.08, 0.08, 0.1)), *points]
    cup2 = thing("cup2", "Cup", (0.08, 0.08, 0.1)), seen("cup2", (3, 3, 0))
    semantic_map, result = merged(
        [*frames, seen("table1", (1, 0, 0)), seen("cup1", (1, 0.1, 0.45), time=times[0])],
        [*frames[1:], seen("cup1", (0.2, 0, 0.45), time=times[1], relative_to="table1"), *cup2],
    )
    assert place(semantic_map, "cup1") == pytest.approx((1.2, 0, 0.45) if later else (1, 0.1, 0.45))
    assert [d.code for d in result.diagnostics] == ["M010", "M022"]


def test_a_merged_map_has_the_objects_of_both_with_all_their_facts(merged: Merge, thing: Write, seen: Write) -> None:
    semantic_map, result = merged(
        [thing("one", "Cabinet-PieceOfFurniture", BOX, "hingedTo two"), seen("one", (1, 0, 0))],
        [thing("two", "Door", (0.02, 0.4, 0.6)), seen("two", (2, 0, 0))],
    )
    assert result.diagnostics == ()
    one = semantic_map.find("one")
    assert one
    assert (one.size, one.hinged_to) == (BOX, ("http://example.org/a.owl#two",))


def test_conflicting_sizes_and_classes_are_reported_and_the_later_size_counts(
    merged: Merge, thing: Write, seen: Write
) -> None:
    semantic_map, result = merged(
        [thing("one", "Cabinet-PieceOfFurniture", BOX), seen("one", (1, 0, 0))],
        [thing("one", "Bottle", (0.4, 0.9, 0.8)), seen("one", (1, 0, 0))],
    )
    assert [d.message.split()[0] for d in result.diagnostics] == ["widthOfObject", "one"]
    assert semantic_map.objects[0].size == (0.4, 0.9, 0.8)


def test_objects_under_two_names_at_one_place_are_identified(merged: Merge, thing: Write, seen: Write) -> None:
    semantic_map, result = merged(
        [thing("one", "Cabinet-PieceOfFurniture", BOX), seen("one", (1, 0, 0))],
        [thing("other", "Cabinet-PieceOfFurniture", BOX), seen("other", (1.05, 0, 0))],
        names=("a", "b"),
    )
    assert [thing.name for thing in semantic_map.objects] == ["one"]
    assert place(semantic_map, "one") == (1.05, 0, 0)
    assert [d.code for d in result.diagnostics] == ["M023", "M022"]


def test_objects_of_one_name_at_different_places_stay_apart_with_a_note(
    merged: Merge, thing: Write, seen: Write
) -> None:
    semantic_map, result = merged(
        [thing("one", "Cabinet-PieceOfFurniture", BOX), seen("one", (1, 0, 0))],
        [thing("one", "Cabinet-PieceOfFurniture", BOX), seen("one", (3, 0, 0))],
        names=("a", "b"),
    )
    assert [thing.name for thing in semantic_map.objects] == ["one", "one_2"]
    assert [d.code for d in result.diagnostics] == ["M023"]


@pytest.mark.parametrize("name", some(["ias_hospital_room_with_objects@re_stack.owl.in", "ias_semantic_map@hydro.owl"]))
def test_a_real_map_merged_with_itself_is_the_same_world(corpus: Path, name: str, tmp_path: Path) -> None:
    path = corpus / "environments" / name
    result = merge([path, path])
    assert not [d for d in result.diagnostics if d.code in ("M022", "M023", "O050")]
    (tmp_path / "merged.omn").write_text(result.text, encoding="utf-8")
    before, after = (read_map(load(one)) for one in (path, tmp_path / "merged.omn"))
    again = {thing.iri: thing for thing in after.objects}
    assert len(again) == len(before.objects)
    for thing in before.objects:
        other = again[thing.iri]
        assert (thing.size, set(thing.parts), set(thing.types)) == (other.size, set(other.parts), set(other.types))
        if thing.pose is not None and other.pose is not None:
            assert thing.pose.distance(other.pose) < 1e-6
            assert thing.pose.turn(other.pose) < 1e-3
    assert {j.leaf for j in scene_of(before).joints} == {j.leaf for j in scene_of(after).joints}


def test_the_command_writes_a_map_and_its_conflicts_and_is_deterministic(tmp_path: Path) -> None:
    text = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")
    (tmp_path / "today.omn").write_text(text.replace('"3001"', '"3002"'), encoding="utf-8")
    output = tmp_path / "room.omn"
    arguments = ["merge", "hospital_room", str(tmp_path / "today.omn"), "-o", str(output)]
    written = []
    for _ in range(2):
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
        written.append(output.read_bytes())
    assert written[0] == written[1]
    assert "1 conflict" in result.stdout
    assert "M022 roomNumber of room1 is '3001' in hospital_room.omn" in result.stderr
    assert CliRunner().invoke(app, ["merge", "hospital_room"]).exit_code == 2


def test_a_thing_without_a_class_contradicts_none(merged: Callable[..., tuple[SemanticMap, Merged]]) -> None:
    placed = 'Individual: thing1\n    Facts: knowrob:translation "1 2 0.3", knowrob:boundingBoxSize "0.1 0.1 0.1"'
    typed = placed.replace("    Facts", "    Types: knowrob:Cup\n    Facts")
    semantic_map, result = merged([placed], [typed])
    assert [one.name for one in semantic_map.objects] == ["thing1"]
    assert [one.code for one in result.diagnostics if one.code == "M022"] == []
