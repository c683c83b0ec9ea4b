"""``planlang locate``: places for phrases, told to people and to machines, with the exit codes of the command."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from robot_files import cart_in

from executive.cli.app import app
from executive.pictures.floor_plan import OTHERS
from planlang.files import bundled
from planlang.outputs import is_replaceable
from tests.support.examples import some

WARD = ("--robot", "amigo", "--environment", "hospital_room")


def located(phrase: str, *options: str, code: int = 0, where: tuple[str, ...] = WARD) -> dict[str, Any]:
    """The JSON that the command prints."""
    result = CliRunner().invoke(app, ["locate", phrase, *where, "--json", *options])
    assert result.exit_code == code, result.output
    answer: dict[str, Any] = json.loads(result.stdout)
    assert answer["exit_code"] == code
    return answer


def codes(answer: dict[str, Any]) -> list[str]:
    """The codes of its diagnostics."""
    return [found["code"] for found in answer["diagnostics"]]


def test_places_come_with_the_arm_that_was_asked_for_and_different_from_each_other() -> None:
    answer = located("in reach of the patient with the right arm", "--count", "4")
    places = answer["solutions"]
    assert len(places) == 4
    assert {place["arm"] for place in places} == {"right"}
    assert answer["meant"] == {"Patient": "patient1"}
    assert all(math.dist((a["x"], a["y"]), (b["x"], b["y"])) > 0.04 for a, b in pairwise(places))


def test_people_read_the_phrase_and_a_line_for_each_place() -> None:
    result = CliRunner().invoke(app, ["locate", "visible from the bottle", *WARD, "--count", "2"])
    phrase, first, second, *_ = result.stdout.splitlines()
    assert phrase == "visible from the bottle"
    assert first.split()[:2] == ["1", "x"]
    assert second.split()[:2] == ["2", "x"]


def test_the_phrase_in_the_answer_is_read_as_the_same_location() -> None:
    first = located("in reach of a bottle with the left arm", "--count", "1")
    again = located(first["location"], "--count", "1")
    assert again["solutions"] == first["solutions"]


def test_a_thing_is_meant_by_its_name_and_of_several_the_nearest_is_taken_and_told() -> None:
    assert located("visible from cabinet2", "--count", "1")["meant"] == {"cabinet2": "cabinet2"}
    answer = located("visible from the cabinet", "--count", "1")
    assert answer["meant"] == {"Cabinet-PieceOfFurniture": "cabinet1"}
    assert codes(answer) == ["P009"]
    assert answer["diagnostics"][0]["message"] == "the cabinet is cabinet1, the nearest of 2"
    assert "cabinet2" in answer["diagnostics"][0]["help"]


def test_the_start_decides_which_is_the_nearest() -> None:
    answer = located("visible from the cabinet", "--count", "1", "--start=-1.5,1.5,0")
    assert answer["meant"] == {"Cabinet-PieceOfFurniture": "cabinet2"}


@pytest.mark.parametrize(
    ("phrase", "code"),
    [
        ("in raech of the bottle", "P001"),
        ("in reach of the botle", "P002"),
        ("in reach of the bathtub", "P008"),
        ("within 3 parsecs of the bed", "P004"),
    ],
)
def test_a_phrase_that_cannot_be_understood_is_bad_input(phrase: str, code: str) -> None:
    assert codes(located(phrase, code=2)) == [code]


def test_a_thing_is_put_where_a_phrase_says(tmp_path: Path) -> None:
    path = tmp_path / "where.png"
    answer = located("on the bedside table", "--of", "the bottle", "--count", "2", "--explain", str(path))
    assert answer["meant"] == {"BedsideTable": "bedside_table1", "Bottle": "bottle1"}
    assert [place["z"] for place in answer["solutions"]] == pytest.approx([0.7, 0.7], abs=0.01)
    assert path.is_file()


def test_what_is_put_somewhere_has_to_be_known() -> None:
    answer = located("on the bedside table", "--of", "the botle", code=2)
    assert codes(answer) == ["P002"]
    assert answer["diagnostics"][0]["span"]["file"] == "--of"


def test_robot_and_environment_have_no_default() -> None:
    assert codes(located("near the bed", code=2, where=())) == ["C008", "C008"]


def test_a_location_without_place_fails_with_its_reasons(tmp_path: Path) -> None:
    answer = located("in reach of the bottle and in front of the bed", "--explain", str(tmp_path / "no.png"), code=1)
    assert answer["failure"]["class"] == "LocationUnresolvable"
    assert sum(answer["counts"].values()) > 0
    assert answer["solutions"] == []
    pixels = np.asarray(Image.open(tmp_path / "no.png").convert("RGB")).astype(int)[100:, 100:900]
    refused = (np.abs(pixels - np.array(OTHERS[0])) < 30).all(axis=2)
    assert refused.sum() > 200, "where it was looked for"


def test_a_picture_as_svg_is_drawn_from_the_same_shapes(tmp_path: Path) -> None:
    path = tmp_path / "where.svg"
    located("in reach of the patient", "--count", "2", "--explain", str(path))
    root = ElementTree.parse(path).getroot()
    words = {one.text for one in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"in reach of the patient", "bed1", "patient1", "2 places, best first"} <= words
    assert is_replaceable(path), "it has a mark"


def test_an_arm_that_the_robot_does_not_have_is_a_missing_capability() -> None:
    panda = ("--robot", "panda", "--environment", "hospital_room")
    answer = located("in reach of the bottle with the left arm", code=3, where=panda)
    assert answer["failure"]["class"] == "MissingCapability"
    result = CliRunner().invoke(app, ["locate", "in reach of the bottle with the left arm", *panda])
    assert result.stdout.strip() == "MissingCapability: panda has no left arm; its arms: arm"


def test_a_camera_that_the_robot_does_not_have_is_a_missing_capability() -> None:
    panda = ("--robot", "panda", "--environment", "hospital_room")
    answer = located("visible from the bottle and near the bed", code=3, where=panda)
    assert answer["failure"]["class"] == "MissingCapability"
    assert answer["message"] == "the robot has no camera"
    assert located("not visible from the bottle and near the bed", "--count", "1", where=panda)["solutions"]


def test_the_picture_shows_the_places(tmp_path: Path) -> None:
    path = tmp_path / "where.png"
    answer = located("in reach of the patient", "--count", "2", "--explain", str(path))
    assert answer["picture"] == str(path)
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert pixels.shape[0] > 500
    green = (np.abs(pixels - np.array([0, 130, 60])) < 12).all(axis=2)
    place = answer["solutions"][0]
    # the first place's circle and disc are green around where the map has it: 900 pixels for the 6 m of the room
    u, v = 24 + (place["x"] + 3) * 150, 74 + (2.5 - place["y"]) * 150
    assert green[int(v) - 10 : int(v) + 10, int(u) - 10 : int(u) + 10].sum() > 50


def test_a_picture_that_cannot_be_written_is_told_before_the_search() -> None:
    assert codes(located("near the bed", "--explain", "/nowhere/where.png", code=2)) == ["C004"]
    assert codes(located("near the bed", "--explain", "where.jpg", code=2)) == ["C004"]


MAP = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")


def with_pose(rows: str) -> str:
    """The bundled map with the bottle at a matrix: three rows of four numbers."""
    begin = MAP.index("knowrob:m00", MAP.index("Individual: pose_bottle1"))
    numbers = iter(rows.split())
    told = ", ".join(f"knowrob:m{row}{column} {next(numbers)}" for row in range(3) for column in range(4))
    return f"{MAP[:begin]}{told},\n        {MAP[MAP.index('knowrob:m30', begin) :]}"


def with_size(name: str, size: float) -> str:
    """The bundled map with a thing that is so long, wide and high."""
    begin = MAP.index(f"Individual: {name}\n")
    end = MAP.index("Individual:", begin + 1)
    return MAP[:begin] + re.sub(r"(OfObject) [\d.]+", rf"\1 {size}", MAP[begin:end]) + MAP[end:]


@pytest.mark.parametrize(
    ("text", "code", "told", "said"),
    some(
        [
            (with_pose("-1.0 0.0 0.0 -2.72  0.0 1.0 0.0 -0.8  0.0 0.0 1.0 0.9"), 0, "M001", "is a reflection"),
            (with_pose("1.0 0.1 0.0 -2.72  0.0 1.05 0.0 -0.8  0.0 0.0 0.9 0.9"), 0, "M001", "is not orthonormal"),
            (with_pose("0.0 0.0 0.0 -2.72  0.0 0.0 0.0 -0.8  0.0 0.0 0.0 0.9"), 2, "M004", "is singular"),
            (
                with_pose('1.0 0.0 0.0 "NaN"^^xsd:double  0.0 1.0 0.0 -0.8  0.0 0.0 1.0 0.9'),
                2,
                "M002",
                "not a finite number",
            ),
            (with_pose("1.0 0.0 0.0 -2.8  0.0 1.0 0.0 -0.8  0.0 0.0 1.0 0.4"), 1, "M014", "inside cabinet1"),
            (with_size("bottle1", 0.0), 0, "M005", "default of DrinkingBottle"),
            (with_size("bottle1", -0.1), 2, "M007", "is negative"),
        ],
        every=2,
    ),
    ids=["reflected", "not orthonormal", "flat", "not a number", "inside of a cabinet", "of no size", "negative"],
)
def test_what_is_wrong_in_a_map_is_told_with_what_was_made_of_it(
    text: str, code: int, told: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / "map.omn").write_text(text)
    where = ("--robot", "amigo", "--environment", str(tmp_path / "map.omn"))
    answer = located("in reach of the bottle", "--count", "1", code=code, where=where)
    assert any(found["code"] == told and said in found["message"] for found in answer["diagnostics"]), answer


def test_a_bottle_inside_of_a_wall_is_out_of_reach_because_of_the_wall(tmp_path: Path) -> None:
    (tmp_path / "map.omn").write_text(with_pose("1.0 0.0 0.0 -3.05  0.0 1.0 0.0 -0.8  0.0 0.0 1.0 0.9"))
    where = ("--robot", "amigo", "--environment", str(tmp_path / "map.omn"))
    answer = located("in reach of the bottle", code=1, where=where)
    assert answer["counts"].keys() == {"in collision"}
    assert answer["blocking"].keys() == {"room1"}


def test_a_robot_without_arms_reaches_nothing_but_stands_near_things(tmp_path: Path) -> None:
    where = ("--robot", str(cart_in(tmp_path)), "--environment", "hospital_room")
    answer = located("in reach of the bottle", code=3, where=where)
    assert answer["failure"]["class"] == "MissingCapability"
    assert answer["message"] == "the robot has no arm that could reach there"
    assert len(located("near the bed", "--count", "2", where=where)["solutions"]) == 2
    assert (
        located("in reach of the bottle with the left arm", code=3, where=where)["failure"]["class"]
        == "MissingCapability"
    )


def of_no_place(phrase: str, of: str | None = None) -> dict[str, Any]:
    """The diagnostic of a phrase that cannot be used, which says nothing in Python's words."""
    answer = located(phrase, *(() if of is None else ("--of", of)), code=2)
    *_, found = answer["diagnostics"]
    assert found["code"] == "P010"
    assert not re.search(r"\w_|\w\(|-PieceOf", f"{found['message']} {found['help']}".replace("bedside_table1", ""))
    return dict(found)


@pytest.mark.parametrize(
    ("phrase", "said"),
    some(
        [
            ("near the bed and not near the bed", "requires and excludes 'near the bed'"),
            (
                "within 30 cm of the bed and not within 50 cm of the bed",
                "'within 50 cm of the bed' holds wherever 'within 30 cm of the bed' does",
            ),
            ("within 30 cm of the bed and beyond 1 m of the bed", "leave no possible distance"),
            ("left of the bed and right of the bed", "'left of the bed' and 'right of the bed' are opposite sides"),
            ("in reach of a place (above the bed and not above the bed)", "requires and excludes"),
        ],
        every=2,
    ),
)
def test_a_conjunction_that_contradicts_itself_cannot_be_used_and_is_told_so(phrase: str, said: str) -> None:
    message = of_no_place(phrase)["message"]
    assert "contradicts itself: " in message
    assert said in message


@pytest.mark.parametrize(
    ("phrase", "of", "said", "help"),
    some(
    [
        ("on the patient", "the bottle", "patient1 has no level top", None),
        ("above the bed", None, "means nothing for a base; relations that apply: in reach of, in, in front of", None),
        ("above the bed", None, "", '"in reach of a place above the bed"'),
        ("in cabinet1", None, "'in cabinet1' means nothing for a base", "--of THING"),
        ("on a bed", None, "'on the bed' means nothing", '--of THING searches poses of a thing; for a hand'),
        ("seeing the bed", "bottle1", "apply: in reach of, on, in, in front of", "leave out --of"),
        ("far from the bed", "bottle1", "where bottle1 rests: it needs on, in or in reach of a", None),
        ("in reach of a place near the bottle", None, "needs one of in reach of, above, on, in, in the", None),
        ("near a place on the bed", None, "near takes a thing or a person", None),
        ("on the bed and in cabinet1", "bottle1", "one place only, not in bed1 and cabinet1", None),
        ("on the bottle", "the bottle", "'on the bottle' relates bottle1 to itself", None),
        ("in the bottle", "the bottle", "relates bottle1 to itself", None),
        ("near bottle1", "the bottle", "'near bottle1' relates bottle1 to itself", None),
        ("on the bed and not left of the bottle", "bottle1", "'not left of the bottle' relates", None),
        ("in reach of the patient", "patient1", "relates patient1 to itself", None),
        ("in reach of the bottle", "bottle1", "bottle1 is not a person", None),
    ],
    every=4,
    ),
)  # fmt: skip
def test_a_phrase_that_is_of_no_place_cannot_be_used_and_is_told_why(
    phrase: str, of: str | None, said: str, help: str | None
) -> None:
    found = of_no_place(phrase, of)
    assert said in found["message"]
    assert help is None or help in found["help"]


@pytest.mark.parametrize(
    ("phrase", "of", "said"),
    [
        ("on the door", "the bottle", "too small for the object"),
        ("in cabinet1", "the bottle", "no room for the object; in the way: a wall of room1 1, cabinet1"),
        ("in reach of the bed from the top", None, "not by a top grasp"),
    ],
)
def test_what_cannot_be_in_this_room_is_told_with_the_reason(phrase: str, of: str | None, said: str) -> None:
    answer = located(phrase, *(() if of is None else ("--of", of)), code=1)
    assert said in answer["message"]
    assert re.match(r"no place found.*[ (][1-9]", answer["message"])


@pytest.mark.parametrize(
    ("phrase", "of", "idle", "used"),
    some(
        [
            ("near the bed with the left arm", None, "with the left arm", "near the bed"),
            ("near the bed from the top", None, "from the top", "near the bed"),
            ("on the bed with the left arm from the top", "bottle1", "with the left arm from the top", "on the bed"),
            ("in reach of patient1 from the top", None, "from the top", "in reach of patient1"),
            (
                "in reach of a place (above the bed with the left arm) with the right arm",
                None,
                "with the right arm",
                "in reach of a place (above the bed with the left arm)",
            ),
        ],
        every=3,
    ),
)
def test_an_arm_or_a_grasp_that_nothing_uses_is_left_out_with_a_warning(
    phrase: str, of: str | None, idle: str, used: str
) -> None:
    answer = located(phrase, "--count", "1", *(() if of is None else ("--of", of)))
    (found,) = answer["diagnostics"]
    assert (found["severity"], found["code"]) == ("warning", "P011")
    assert found["message"].startswith(f"{idle!r} has no effect here")
    assert answer["location"] == used


@pytest.mark.parametrize(
    "phrase",
    some(["in reach of the bed with the left arm", "in reach of the bottle with the left arm from the side",
     "not in reach of the bottle with the left arm", "in reach of a place above the bed with the left arm",
     "in reach of a place (in front of the bottle from the side)",
     "in reach of a place in front of the bottle from the side"], every=3),
)  # fmt: skip
def test_an_arm_or_a_grasp_that_is_used_is_no_matter_of_a_warning(phrase: str) -> None:
    answer = located(phrase, "--count", "1")
    assert answer["diagnostics"] == []
    assert "left" in answer["location"] or "from the side" in answer["location"]
    assert all(place.get("arm", "left") == "left" for place in answer["solutions"] if "left" in phrase)


SEEN = "as seen from the robot at x 0.100  y 0.200"


@pytest.mark.parametrize(
    ("phrase", "of", "frame"),
    some(
        [
            ("left of the bottle", None, {"left of bottle1": SEEN}),
            (
                "next to the bed, not behind bottle1",
                None,
                {"next to bed1": "in its own frame", "not behind bottle1": SEEN},
            ),
            ("right of the bed", "bottle1", {"right of bed1": "in its own frame"}),
            ("in reach of a place (above cabinet1 and left of the bottle)", None, {"left of bottle1": SEEN}),
            ("in reach of a place in front of the bottle", None, {}),
            ("near the bed", "bottle1", {}),
        ],
        every=3,
    ),
)
def test_whose_left_and_right_is_meant_is_stated(phrase: str, of: str | None, frame: dict[str, str]) -> None:
    options = ("--count", "1", "--start=0.1,0.2,0", *(() if of is None else ("--of", of)))
    _, *lines = CliRunner().invoke(app, ["locate", phrase, *WARD, *options]).stdout.splitlines()
    assert lines[: len(frame)] == [f"  {side}: {whose}" for side, whose in frame.items()]
    assert lines[len(frame)].startswith("  1  x ")
    (place,) = located(phrase, *options)["solutions"]
    short = {side: "the viewer's" if whose == SEEN else "its own" for side, whose in frame.items()}
    assert place.get("frame", {}) == short


def test_near_the_bed_a_thing_is_on_the_floor_and_not_on_the_top_of_the_room() -> None:
    (place,) = located("near the bed", "--of", "the bottle", "--count", "1")["solutions"]
    assert place["z"] == pytest.approx(0.1, abs=0.01)


def test_bounds_of_a_height_count() -> None:
    (place,) = located("in reach of a place at least 30 cm above the bed", "--count", "1")["solutions"]
    assert place["reaches"][0].startswith("above bed1")


TOOLS = (("Hammer", 0.815), ("Wrench", 0.806), ("Pliers", 0.81), ("PowerDrill", 0.895), ("TapeMeasure", 0.835))
"""Classes, with the heights of their centres on a workbench [m]."""


@pytest.mark.parametrize(("tool", "height"), TOOLS)
def test_a_tool_of_default_size_that_lies_on_a_workbench_is_in_reach(tool: str, height: float, tmp_path: Path) -> None:
    where = tmp_path / "workshop.omn"
    where.write_text(
        f"""Prefix: : <http://example.org/workshop.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/workshop.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: map1
    Types: knowrob:SemanticEnvironmentMap
Individual: workbench1
    Types: knowrob:Workbench
    Facts: knowrob:translation "2 0 0.4", knowrob:boundingBoxSize "0.7 1.6 0.8"
Individual: tool1
    Types: knowrob:{tool}
    Facts: knowrob:translation "1.85 0 {height}"
"""
    )
    assert located("in reach of tool1", "--count", "1", where=("--robot", "amigo", "--environment", str(where)))
