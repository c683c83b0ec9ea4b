"""``planlang locate``: places for phrases, told to people and to machines, with the exit codes of the command."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from executive.cli import app

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
    assert phrase == "visible from the drinking bottle"
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
    assert answer["meant"] == {"BedsideTable": "bedside_table1", "DrinkingBottle": "bottle1"}
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
    assert answer["failure"] == ["LocationUnresolvable"]
    assert sum(answer["counts"].values()) > 0
    assert answer["solutions"] == []
    assert (tmp_path / "no.png").is_file()


def test_an_arm_that_the_robot_does_not_have_is_a_missing_capability() -> None:
    panda = ("--robot", "panda", "--environment", "hospital_room")
    answer = located("in reach of the bottle with the left arm", code=3, where=panda)
    assert answer["failure"] == ["MissingCapability"]


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
