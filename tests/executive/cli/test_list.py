"""``planlang list``: what there is to name, all of it and what has a word."""

from __future__ import annotations

import json
from typing import Any

import pytest
from cli_runs import invoke

from planlang.files import Bundled
from planlang.relations import RELATIONS


def listed(*arguments: str) -> list[dict[str, Any]]:
    found: dict[str, Any] = json.loads(invoke("list", *arguments, "--json").stdout)
    entries: list[dict[str, Any]] = found["entries"]
    return entries


@pytest.mark.parametrize(
    ("kind", "of"), [("robots", Bundled.ROBOT), ("rooms", Bundled.ENVIRONMENT), ("recipes", Bundled.RECIPE)]
)
def test_bundled_files_are_listed_with_a_sentence_and_their_place(kind: str, of: Bundled) -> None:
    found = {one["name"]: one for one in listed(kind)}
    for name in of.names():
        assert found[name]["file"] == str(of.find(name))
        assert len(found[name]["words"]) > 10, name


def test_recipes_of_the_library_are_among_the_recipes() -> None:
    assert "library/put_down" in [one["name"] for one in listed("recipes")]


def test_a_word_is_looked_for_in_names_labels_and_other_names_whatever_its_case() -> None:
    assert [one["name"] for one in listed("recipes", "A DRINK")] == ["pass_a_drink", "serve_a_drink"]
    assert [one["name"] for one in listed("classes", "drinking bottle")] == ["DrinkingBottle"]
    assert [one["name"] for one in listed("classes", "batter")] == ["Dough"], "also called Batter"


@pytest.mark.parametrize("word", ["toy", "parcel", "key", "newspaper", "plant", "remote", "hallway", "balcony", "sofa"])
def test_an_everyday_word_finds_a_class(word: str) -> None:
    assert listed("classes", word)


def test_classes_are_a_tree_with_what_is_above_and_below_a_word() -> None:
    shown = invoke("list", "classes", "OpeningABottle").stdout.splitlines()
    marked = [line.split()[1] for line in shown if line.startswith("* ")]
    assert marked == ["OpeningABottleCapability", "OpeningABottle"], "not their ancestors"
    lines = [line[2:] for line in shown]
    names = [line.split()[0] for line in lines]
    depth = {line.split()[0]: len(line) - len(line.lstrip()) for line in lines}
    assert depth["OpeningABottle"] == depth["OpeningAContainerArtifact"] + 2
    assert names.index("Action") < names.index("OpeningABottle")
    assert "Vehicle" not in names


def test_all_classes_are_listed_once_and_what_has_two_places_is_open_at_the_first() -> None:
    lines = invoke("list", "classes").stdout.splitlines()
    assert {one["name"] for one in listed("classes")} == {line.split()[0] for line in lines}
    repeated = [line.split()[0] for line in lines if line.split()[1:2] == ["..."]]
    assert repeated
    assert all(sum(line.split()[0] == name for line in lines) > 1 for name in repeated)


def test_relations_are_listed_as_they_are_spoken_and_written() -> None:
    found = listed("relations")
    assert [one["python"] for one in found] == list(dict.fromkeys(row.name for row in RELATIONS.values()))
    assert "in reach of | within reach of" in invoke("list", "relations").stdout


def test_failures_are_a_tree_with_their_first_sentences() -> None:
    lines = [line[2:] for line in invoke("list", "failures", "GraspMissed").stdout.splitlines()]
    assert [line.split()[0] for line in lines] == [
        "PlanFailure",
        "LowLevelFailure",
        "ManipulationFailure",
        "GripperFailure",
        "GraspMissed",
    ]
    assert lines[-1] == "        GraspMissed  The gripper closed on nothing"


def test_a_word_that_nothing_has_ends_with_1_and_a_suggestion() -> None:
    result = invoke("list", "classes", "DrinkingBotle")
    assert (result.exit_code, result.stdout.rstrip().endswith("did you mean DrinkingBottle?")) == (1, True)
    assert listed("rooms", "zzz") == []
    assert "did you mean" not in invoke("list", "classes", "song").stdout, "Tongs is no help"


def test_a_misspelt_everyday_word_suggests_its_class() -> None:
    said = invoke("list", "classes", "sidebord").stdout
    assert said.rstrip().endswith("did you mean Cabinet-PieceOfFurniture?")


def test_a_word_is_looked_for_at_beginnings_of_words() -> None:
    assert listed("classes", "waving") == []
    assert "DrinkingBottle" in [one["name"] for one in listed("classes", "bottle")]


def test_files_are_listed_by_name_and_with_their_paths_if_verbose() -> None:
    path = str(Bundled.ENVIRONMENT.folder)
    assert path not in invoke("list", "rooms").stdout
    assert path in invoke("list", "rooms", "--verbose").stdout


def test_lists_are_the_same_each_time() -> None:
    assert invoke("list", "classes").stdout == invoke("list", "classes").stdout
