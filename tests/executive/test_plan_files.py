"""Which plan of a file is run, and what its parameters are bound to."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.belief import SemanticMap, read_map
from executive.belief.semantic_map import default_environment
from executive.runs.plan_files import bound_parameters, import_plan, main_plan
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import bundled
from planlang.ontology import load

CHOSEN = "the environment visiting_hours is chosen, as hospital_room has no cup2"

SOURCE = """
from planlang import plan

@plan("http://example.org/kitchen.owl#FillGlass")
async def fill_glass() -> None: ...

@plan("http://example.org/kitchen.owl#ServeGlass")
async def serve_glass() -> None: ...
"""


def plan_named(folder: Path, task: str | None) -> str:
    """Name of the plan that is run for a task."""
    path = folder / "kitchen.py"
    path.write_text(SOURCE, encoding="utf-8")
    return main_plan(import_plan(path), task).name


@pytest.mark.parametrize("task", ["fill_glass", "FillGlass", "http://example.org/kitchen.owl#FillGlass"])
def test_task_is_a_name_or_an_iri(tmp_path: Path, task: str) -> None:
    assert plan_named(tmp_path, task) == "fill_glass"


def test_without_a_task_the_last_plan_is_run(tmp_path: Path) -> None:
    assert plan_named(tmp_path, None) == "serve_glass"


def test_task_that_is_not_in_the_plan_is_refused_and_nothing_else_is_run(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        plan_named(tmp_path, "FillCup")
    (found,) = caught.value.diagnostics
    assert (found.code, found.help) == ("R001", "this file defines fill_glass, serve_glass")


PARAMETERS = """
from planlang import Object, Person, a_person, an_object, plan

ROOM = "http://planlang.org/kb/hospital_room.owl#"

@plan("http://example.org/kitchen.owl#Serve")
async def serve(
    *,
    bottle: Object = an_object("DrinkingBottle", ROOM + "bottle1"),
    any_bottle: Object = an_object("DrinkingBottle"),
    patient: Person = a_person("Patient", ROOM + "patient1"),
) -> None: ...
"""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> SemanticMap:
    """The bundled room with a cup2, a bottle2 and a visitor1 where the bottle and the patient are."""
    text = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")

    def copied(name: str, new: str, kind: str, other: str) -> str:
        heads = tuple(f"Individual: {before}{name}\n" for before in ("", "perception_", "pose_"))
        blocks = [block for block in text.split("\n\n") if any(head in block for head in heads)]
        return "\n\n".join(blocks).replace(name, new).replace(f"knowrob:{kind}\n", f"knowrob:{other}\n")

    more = [
        copied("bottle1", "cup2", "DrinkingBottle", "Cup"),
        copied("bottle1", "bottle2", "DrinkingBottle", "DrinkingBottle"),
        copied("patient1", "visitor1", "Patient", "Person"),
    ]
    path = tmp_path_factory.mktemp("room") / "room.omn"
    path.write_text("\n\n".join([text, *more]), encoding="utf-8")
    return read_map(load(path))


def bound(folder: Path, room: SemanticMap, **bindings: str) -> tuple[dict[str, str], list[Diagnostic]]:
    """What the parameters are bound to, and warnings."""
    path = folder / "serve.py"
    path.write_text(PARAMETERS, encoding="utf-8")
    found: list[Diagnostic] = []
    parameters = bound_parameters(main_plan(import_plan(path), None), bindings, room, found)
    return {name: f"{thing.type} {thing.name}" for name, thing in parameters.items()}, found


@pytest.mark.parametrize("name", ["bottle2", "http://planlang.org/kb/hospital_room.owl#bottle2"])
def test_a_parameter_is_bound_by_local_name_or_iri(tmp_path: Path, room: SemanticMap, name: str) -> None:
    parameters, found = bound(tmp_path, room, bottle=name, any_bottle=name)
    assert parameters["bottle"] == parameters["any_bottle"] == "DrinkingBottle bottle2"
    assert found == []


def test_a_thing_of_a_class_beside_that_of_the_recipes_individual_will_do_with_a_warning(
    tmp_path: Path, room: SemanticMap
) -> None:
    parameters, found = bound(tmp_path, room, bottle="cup2", patient="visitor1")
    assert (parameters["bottle"], parameters["patient"]) == ("Cup cup2", "Person visitor1")
    assert [(str(one.severity.value), one.code) for one in found] == [("warning", "X006")] * 2


@pytest.mark.parametrize(
    ("bindings", "code", "said"),
    [
        ({"botle": "bottle2"}, "X004", "did you mean bottle? its parameters: bottle, any_bottle, patient"),
        (
            {"bottle": "botle1"},
            "X005",
            "did you mean bottle1? bottle may be bottle1, cup2, bottle2; the map also has room1, bed1, patient1,"
            " bedside_table1, cabinet1, cabinet2, chair1, door1, visitor1",
        ),
        ({"any_bottle": "cup2"}, "X006", "any_bottle may be bottle1, bottle2"),
        ({"patient": "bed1"}, "X006", "patient may be patient1, visitor1"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_would(
    tmp_path: Path, room: SemanticMap, bindings: dict[str, str], code: str, said: str
) -> None:
    with pytest.raises(BadInput) as caught:
        bound(tmp_path, room, **bindings)
    assert [(one.code, one.help) for one in caught.value.diagnostics] == [(code, said)]


def test_of_a_thing_that_another_bundled_environment_has_that_is_told(tmp_path: Path) -> None:
    room = read_map(load(bundled("ontologies") / "environments" / "hospital_room.omn"))
    with pytest.raises(BadInput) as caught:
        bound(tmp_path, room, bottle="cup2", patient="visitor7")
    cup, visitor = (one.help or "" for one in caught.value.diagnostics)
    assert cup.endswith("; cup2 is in a bundled environment: --environment visiting_hours")
    assert "--environment" not in visitor


def test_a_thing_without_a_place_is_not_said_to_be_missing(tmp_path: Path, room: SemanticMap) -> None:
    with pytest.raises(BadInput) as caught:
        bound(tmp_path, room, bottle="hospital1")
    assert [one.message for one in caught.value.diagnostics] == ["'hospital1' has no place in the map"]


@pytest.mark.parametrize(
    ("things", "environment", "told"),
    [
        ([], "hospital_room", []),
        (["bottle1"], "hospital_room", []),
        (
            ["cup2", "patient1"],
            "visiting_hours",
            ["the environment visiting_hours is chosen, as hospital_room has no cup2"],
        ),
        (["cup2", "nobody"], "hospital_room", []),
    ],
)
def test_the_default_environment_is_the_only_one_that_has_what_is_named(
    things: list[str], environment: str, told: list[str]
) -> None:
    notes: list[Diagnostic] = []
    assert default_environment(things, notes) == environment
    assert [one.message for one in notes] == told
