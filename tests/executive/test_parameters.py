"""Parameters of plans: what the option set binds them to, and what is said of those that have to be set."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from loaded_plans import loaded

from executive.maps import SemanticMap, read_map
from executive.runs.options import Outcome, RunOptions
from executive.runs.parameters import bound_parameters, not_in_map, plan_parameters
from executive.runs.plan_files import main_plan
from executive.runs.plan_run import Run, run_plan_file
from executive.runs.prepared import prepared
from executive.runs.traces import read_trace
from planlang.designators import Location, Object
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import bundled
from planlang.language.plans import Plan
from planlang.ontology import expand, load
from tests.support.refusals import refusal

ROOM = bundled("ontologies") / "environments" / "hospital_room.omn"
AMIGO = bundled("ontologies") / "robots" / "amigo.omn"
PLACED = "room1, bed1, bedside_table1, cabinet1, bottle1, cabinet2, chair1, door1"
PLAN = """
from typing import Annotated
from planlang import Location, Object, Person, an_object, plan

@plan("http://example.org/kitchen.owl#Put")
async def put(
    *,
    cup: Object = an_object("Cup"),
    put_to_location: Annotated[Location | Object, "Put.toLocation"],
    tell_recipient: Annotated[Person, "Tell.recipient"],
    thing: Object,
) -> None: ...
"""
RECIPE = """
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>
Class: Serve
    SubClassOf: k:PurposefulAction, k:subAction some Put
Class: Put
    SubClassOf: k:PuttingSomethingSomewhere
"""
MODULE = """
from planlang import sleep
from planlang import process_module
from executive.runs.prepared import prepared

@process_module
class Putting:
    name = "putting"
    actions = ("PuttingSomethingSomewhere",)
    failures = ()

    def __init__(self, platform): ...

    def resources(self, action):
        return ("arm",)

    async def execute(self, action):
        await sleep(1)
        return str(action)
"""
GIVEN = {"Put.objectActedOn": "bottle1", "Put.toLocation": "on bedside_table1 and near bed1"}


@pytest.fixture
def put(tmp_path: Path) -> Plan[..., object]:
    path = tmp_path / "put.py"
    path.write_text(PLAN, encoding="utf-8")
    return main_plan(loaded(path), None)


@pytest.fixture(scope="module")
def room() -> SemanticMap:
    return read_map(load(ROOM))


def options(folder: Path, bindings: dict[str, str], trace: Path | None = None) -> RunOptions:
    recipe, module = folder / "put.omn", folder / "putting.py"
    recipe.write_text(RECIPE, encoding="utf-8")
    module.write_text(MODULE, encoding="utf-8")
    return RunOptions(recipe=recipe, modules=[module], robot=AMIGO, environment=ROOM, set=bindings, trace=trace)


def test_a_parameter_is_set_by_the_names_of_step_and_property_or_by_its_own(
    put: Plan[..., object], room: SemanticMap
) -> None:
    assert [one.setting for one in plan_parameters(put).values()] == [
        "cup",
        "Put.toLocation",
        "Tell.recipient",
        "thing",
    ]
    given = {"put_to_location": "bed1", "Tell.recipient": "patient1", "thing": "bottle1"}
    bound = bound_parameters(put, given, room, [])
    assert {name: str(value) for name, value in bound.items()} == {
        "cup": "Cup",
        "put_to_location": "bed1",
        "tell_recipient": "patient1",
        "thing": "bottle1",
    }


def test_a_place_may_be_told_by_a_phrase(put: Plan[..., object], room: SemanticMap) -> None:
    given = {"Put.toLocation": "on bedside_table1 and near bed1", "Tell.recipient": "patient1", "thing": "bottle1"}
    place = bound_parameters(put, given, room, [])["put_to_location"]
    assert isinstance(place, Location)
    assert str(place) == "on(bedside_table1) and near(bed1)"


@pytest.mark.parametrize(
    ("setting", "value", "code", "said"),
    [
        ("Put.toLocation", "on the", "P003", None),
        ("Put.toLocation", "on the refrigerator", "P008", None),
        ("Put.toLocation", "cabinet3", "X005", 'did you mean set={"Put.toLocation": "cabinet'),
        ("Tell.recipient", "bed1", "X006", "Tell.recipient may be patient1"),
        ("Tell.recipient", "on the bed", "X005", None),
        ("thing", "patient1", "X006", f"thing may be {PLACED}"),
        (
            "Put.toLocatoin",
            "bed1",
            "X004",
            'did you mean set={"Put.toLocation": "bed1"}? its parameters: cup,',
        ),
        (
            "Fetch.objectActedOn",
            "bed1",
            "X004",
            "its parameters: cup, Put.toLocation, Tell.recipient, thing; what the recipe states of a step is bound",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_what_would(
    put: Plan[..., object], room: SemanticMap, setting: str, value: str, code: str, said: str | None
) -> None:
    given = {"Put.toLocation": "bed1", "Tell.recipient": "patient1", "thing": "bottle1"}
    with pytest.raises(BadInput) as caught:
        bound_parameters(put, given | {setting: value}, room, [])
    assert [one.code for one in caught.value.diagnostics] == [code]
    assert (caught.value.diagnostics[0].help or "").startswith(said or "")


def test_all_that_is_not_set_is_told_with_what_of_the_map_fits(put: Plan[..., object], room: SemanticMap) -> None:
    with pytest.raises(BadInput) as caught:
        bound_parameters(put, {}, room, [])
    found = caught.value.diagnostics
    assert [(one.code, one.message.partition("needs ")[2]) for one in found] == [
        ("X014", 'set={"Put.toLocation": X}'),
        ("X014", 'set={"Tell.recipient": X}'),
        ("X014", 'set={"thing": X}'),
    ]
    assert [one.help for one in found] == [
        f'Put.toLocation may be {PLACED}; or a phrase such as set={{"Put.toLocation": "on the table"}}',
        "Tell.recipient may be patient1",
        f"thing may be {PLACED}",
    ]


@pytest.mark.parametrize(
    ("cls", "said"),
    [
        ("DrinkingBottle", ("note", "bottle1, its only DrinkingBottle", None)),
        (
            "Cabinet-PieceOfFurniture",
            ("warning", "nearest to the robot, of cabinet1, cabinet2", 'choose one: set={"thing": "cabinet1"}'),
        ),
        ("Refrigerator", None),
    ],
)
def test_what_stands_for_an_individual_that_the_map_lacks_is_told(
    room: SemanticMap, cls: str, said: tuple[str, str, str | None] | None
) -> None:
    thing = Object(cls, "http://test/elsewhere#bottle1")
    found = list(not_in_map({"thing": thing}, room, ()))
    assert len(found) == (said is not None)
    if said is not None:
        assert (found[0].severity.value, found[0].help) == (said[0], said[2])
        assert found[0].message.startswith("bottle1 of the recipe (http://test/elsewhere#bottle1) is not in the map")
        assert found[0].message.endswith(said[1])
    assert not list(not_in_map({"thing": thing}, room, ("thing",))), "the plan makes it"
    there = room.find("bottle1")
    assert there is not None
    assert not list(not_in_map({"thing": Object("DrinkingBottle", there.iri), "time": 3.0}, room, ()))


def test_nothing_stands_for_what_lacks_in_the_map_of_which_the_recipe_names_other_things(room: SemanticMap) -> None:
    there = room.find("cabinet1")
    assert there is not None
    gone = Object("DrinkingBottle", there.iri.replace("cabinet1", "bottle7"))
    (found,) = not_in_map({"thing": gone, "place": Object("Cabinet-PieceOfFurniture", there.iri)}, room, ())
    assert (found.severity.value, found.help) == ("error", 'choose one: set={"thing": "bottle1"}')
    assert found.message == (
        f"bottle7 of the recipe ({gone.iri}) is not in the map, which has other things of the recipe; it has bottle1"
    )


NAMED = """
from typing import Annotated
from planlang import Object, plan

@plan("http://example.org/kitchen.owl#Open")
async def open_it(*, what: Annotated[Object, "{step}.objectActedOn"]) -> None: ...
"""


@pytest.mark.parametrize(("step", "thing"), [("MovingABed", "bed1"), ("OpeningACabinet", None), ("Opening", None)])
def test_a_step_that_names_a_class_acts_on_the_only_thing_of_it(
    tmp_path: Path, room: SemanticMap, step: str, thing: str | None
) -> None:
    (tmp_path / "open.py").write_text(NAMED.format(step=step), encoding="utf-8")
    found: list[Diagnostic] = []
    opening = main_plan(loaded(tmp_path / "open.py"), None)
    if thing is None:  # there are two cabinets
        with refusal("X014"):
            bound_parameters(opening, {}, room, found)
    else:
        assert str(bound_parameters(opening, {}, room, found)["what"]) == thing
        assert [one.code for one in found] == ["X028"]


@pytest.mark.parametrize(
    ("step", "things"),
    [
        ("PickingUpAnObject", "bottle1"),
        ("OpeningACabinet", "cabinet1, cabinet2"),
        ("OpeningSomething", PLACED.replace(", bottle1", "")),
    ],
)
def test_what_can_be_grasped_is_proposed_to_steps_that_handle_it(
    tmp_path: Path, room: SemanticMap, step: str, things: str
) -> None:
    (tmp_path / "open.py").write_text(NAMED.format(step=step), encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        bound_parameters(main_plan(loaded(tmp_path / "open.py"), None), {}, room, [])
    assert [one.help for one in caught.value.diagnostics] == [f"{step}.objectActedOn may be {things}"]


@pytest.mark.parametrize(
    ("step", "advice"),
    [
        ("PickingUpAnObject", "nothing in the map is graspable; add a map with such a thing: environment=MAP"),
        ("LookingForSomething", "LookingForSomething.objectActedOn may be bed1, cabinet1"),
    ],
)
def test_what_is_to_be_taken_is_no_furniture_and_nothing_is_done_to_joints(
    tmp_path: Path, room: SemanticMap, step: str, advice: str
) -> None:
    furniture = [one for one in room.objects if one.name in ("bed1", "cabinet1")]
    hinge = replace(furniture[0], iri="http://test#hinge", name="hinge", types=(expand("HingedJoint"),), size=None)
    (tmp_path / "open.py").write_text(NAMED.format(step=step), encoding="utf-8")
    opening = main_plan(loaded(tmp_path / "open.py"), None)
    with pytest.raises(BadInput) as caught:
        bound_parameters(opening, {}, replace(room, objects=(*furniture, hinge)), [])
    assert [one.help for one in caught.value.diagnostics] == [advice]


@pytest.mark.parametrize(
    ("kind", "needed"),
    [
        ("float", 'a number, such as set={"amount": 30}; times are in seconds'),
        ("str", "give the parameter a default in the plan"),
    ],
)
def test_a_parameter_that_no_thing_can_fill_needs_a_number_or_a_default(
    tmp_path: Path, room: SemanticMap, kind: str, needed: str
) -> None:
    path = tmp_path / "wait.py"
    path.write_text(f"from planlang import plan\n@plan\nasync def wait(*, amount: {kind}) -> None: ...\n")
    with pytest.raises(BadInput) as caught:
        bound_parameters(main_plan(loaded(path), None), {}, room, [])
    assert [(one.code, one.help) for one in caught.value.diagnostics] == [("X014", needed)]


@pytest.mark.parametrize("annotation", ["1 / 0", "unknown.Type", "[][0]", "int("])
def test_an_annotation_that_cannot_be_evaluated_says_nothing_of_a_parameter(tmp_path: Path, annotation: str) -> None:
    file = tmp_path / "plan.py"
    source = PLAN.replace("thing: Object", f"thing: {annotation!r}")
    file.write_text(source, encoding="utf-8")
    found = plan_parameters(main_plan(loaded(file), None))
    assert "thing" in found
    assert found["thing"].types == ()


def test_a_recipe_without_places_is_refused_before_the_robot_is_read(tmp_path: Path) -> None:
    recipe = options(tmp_path, {}).recipe
    (robot := tmp_path / "none.toml").touch()
    with pytest.raises(BadInput) as caught:
        run_plan_file(RunOptions(recipe=recipe, robot=robot, environment=ROOM))
    assert [one.code for one in caught.value.diagnostics] == ["X014", "X014"]


def test_a_module_gets_what_was_set_and_the_run_is_replayed_with_it(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    chosen = options(tmp_path, GIVEN, trace)
    result = run_plan_file(chosen)
    assert result.outcome is Outcome.DONE
    assert "on(bedside_table1) and near(bed1)" in trace.read_text(encoding="utf-8")
    recorded, _ = read_trace(trace)
    with Run(prepared(chosen)) as again:
        assert again.replay(recorded).equal
