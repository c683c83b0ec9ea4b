"""Every dialect in small: told by what is stated, mixed in one file, and read into the same model."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.designators import local_name
from planlang.diagnostics import Severity
from planlang.ontology import Literal, load
from planlang.recipe import (
    Actions,
    Allen,
    Ending,
    Ordering,
    Overlap,
    Reading,
    Recipe,
    Step,
    read_recipe,
    top_tasks,
)
from planlang.recipe.model import Point, Reason
from planlang.recipe.order import Intervals, implied_by_overlaps
from planlang.recipe.statements import ending_of

HEAD = """\
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Prefix: dul: <http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#>
Prefix: ease: <http://www.ease-crc.org/ont/EASE.owl#>
Prefix: soma: <http://www.ease-crc.org/ont/SOMA.owl#>
Prefix: obj: <http://www.ease-crc.org/ont/EASE-OBJ.owl#>
Prefix: acat: <http://knowrob.org/kb/acat-adt.owl#>
Prefix: unit: <http://qudt.org/vocab/unit#>
Ontology: <http://planlang.org/test>
"""
STEPS = "".join(f"\nClass: {name}\n    SubClassOf: k:Perceiving\n" for name in "ABCD")


def opened(folder: Path, text: str) -> Actions:
    path = folder / "r.omn"
    path.write_text(HEAD + text, encoding="utf-8")
    return Actions(load(path))


def read(folder: Path, text: str, task: str | None = None) -> Recipe:
    reading: Reading = read_recipe(opened(folder, text), task)
    assert reading.recipes is not None, reading.diagnostics
    return reading.recipes.main


def orders(recipe: Recipe, *reasons: Reason) -> set[tuple[str, str]]:
    wanted = reasons or tuple(Reason)
    return {(local_name(one.before), local_name(one.after)) for one in recipe.orderings if one.reason in wanted}


def test_a_task_in_an_equivalent_class_has_the_sub_actions_stated_there(tmp_path: Path) -> None:
    recipe = read(
        tmp_path, f"{STEPS}\nClass: T\n    EquivalentTo: k:Action and (k:subAction some B) and (k:subAction some A)\n"
    )
    assert (recipe.dialect.name, [step.name for step in recipe.steps]) == ("D1e", ["B", "A"])


def test_sub_events_and_sub_actions_of_one_class_are_all_steps(tmp_path: Path) -> None:
    recipe = read(tmp_path, f"{STEPS}\nClass: T\n    SubClassOf: k:Action, k:subEvents some B, k:subAction some A\n")
    assert {step.name for step in recipe.steps} == {"A", "B"}


def test_data_flow_orders_and_says_what_is_passed(tmp_path: Path) -> None:
    text = f"""{STEPS}
Class: T
    SubClassOf: k:Action, k:subAction some A, k:subAction some E, k:inputOutputConstraints value cups

Class: E
    SubClassOf: k:Perceiving, k:objectActedOn some k:Cup

Individual: cups
    Types: k:InputOutputMapping
    Facts: k:createsOutput A, k:requiresInput E, k:resourceType k:Cup
"""
    recipe = read(tmp_path, text)
    assert orders(recipe, Reason.DATA_FLOW) == {("A", "E")}
    (flow,) = recipe.flows
    assert (local_name(flow.producer), local_name(flow.resource or ""), flow.consumes) == ("A", "Cup", "objectActedOn")


def test_what_one_step_creates_by_name_another_uses_after_it_unless_orders_say_otherwise(tmp_path: Path) -> None:
    text = """
Class: E
    SubClassOf: k:Perceiving, k:outputsCreated value here

Class: F
    SubClassOf: k:Perceiving, k:objectActedOn value here
"""
    task = "\nClass: T\n    SubClassOf: k:Action, k:subAction some E, k:subAction some F"
    assert orders(read(tmp_path, f"{text}{task}\n")) == {("E", "F")}
    against = """, k:orderingConstraints value o

Individual: o
    Types: k:PartialOrdering-Strict
    Facts: k:occursBeforeInOrdering F, k:occursAfterInOrdering E
"""
    recipe = read(tmp_path, f"{text}{task}{against}")
    assert orders(recipe) == {("F", "E")}
    assert len(recipe.flows) == 1


MACHINE = """
Class: M
    SubClassOf: k:Action, k:taskStartState value A, k:taskEndState value B, k:stateTransition value t

Individual: t
    Types: k:IntrinsicStateChangeEvent
    Facts: k:fromState A, k:toState B, k:causedBy k:COMPLETED_OK, k:causedBy k:TIMEOUT
"""


def test_a_transition_with_two_outcomes_is_two_and_states_need_not_be_sub_actions(tmp_path: Path) -> None:
    recipe = read(tmp_path, STEPS + MACHINE)
    assert recipe.machine is not None
    assert {one.ending for one in recipe.machine.transitions} == {Ending.DONE, Ending.FAILED}
    assert {step.name for step in recipe.steps} == {"A", "B"}
    assert recipe.orderings == ()


@pytest.mark.parametrize(
    ("outcome", "ending"),
    [
        ("COMPLETED_OK", Ending.DONE),
        ("CONDITION_TRUE", Ending.TRUE),
        ("CONDITION_FALSE", Ending.FALSE),
        ("COMPLETED_FAILED", Ending.FAILED),
        ("ActionAborted", Ending.FAILED),
        ("NOT_OK", Ending.FAILED),
        ("doorSeen", Ending.OTHER),
    ],
)
def test_words_of_an_outcome_tell_what_it_means(outcome: str, ending: Ending) -> None:
    assert ending_of(f"http://planlang.org/test#{outcome}") is ending


TABLE = """
Individual: pipetting
    Types: acat:ADT
    Facts: k:subAction chunk1

Individual: chunk1
    Types: acat:ActionChunk, k:GraspingSomething
    Facts: k:nextAction chunk2

Individual: chunk2
    Types: acat:ActionChunk, k:PuttingDownAnObject

Individual: chunk3
    Types: acat:ActionChunk, k:Perceiving
    Facts: k:previousAction chunk2
"""


def test_a_chain_is_followed_whichever_end_names_the_other(tmp_path: Path) -> None:
    recipe = read(tmp_path, TABLE)
    assert orders(recipe) == {("chunk1", "chunk2"), ("chunk2", "chunk3")}
    assert [step.action for step in recipe.steps] == ["GraspingSomething", "PuttingDownAnObject", "Perceiving"]
    assert all(local_name(step.action_class) == step.action for step in recipe.steps)


WORKFLOW = """
Individual: wf
    Types: dul:Workflow
    Facts: dul:definesTask cook, ease:hasStep stir, ease:hasStep heat, ease:hasStep serve

Individual: cook
    Types: k:Action

Individual: stir
    Types: k:Perceiving
    Facts: ease:during heat

Individual: heat
    Types: k:Perceiving
    Facts: ease:meets serve

Individual: serve
    Types: k:Perceiving

Individual: wf2
    Types: dul:Workflow
    Facts: dul:definesTask serve, ease:hasStep plate

Individual: plate
    Types: k:Perceiving
"""


def test_workflows_nest_and_their_relations_order_or_overlap(tmp_path: Path) -> None:
    actions = opened(tmp_path, WORKFLOW)
    reading = read_recipe(actions)
    assert reading.recipes is not None
    recipe = reading.recipes.main
    assert {local_name(iri): one.dialect.name for iri, one in reading.recipes.recipes.items()} == {
        "cook": "D5",
        "serve": "D5",
    }
    assert orders(recipe, Reason.CONSTRAINT) == {("heat", "serve")}
    assert orders(recipe, Reason.OVERLAP) == {("stir", "serve")}  # it ends before heating ends
    assert [(local_name(one.first), one.relation) for one in recipe.overlaps] == [("stir", Allen.DURING)]


TEA = """
Individual: wf_tea
    Types: dul:Workflow
    Facts: soma:isPlanFor tea, soma:hasStep prepare, soma:hasStep brew

Individual: tea
    Types: k:Action
    Facts: soma:startedBy prepare, soma:finishedBy brew

Individual: prepare
    Types: k:Action
    Facts: soma:before brew

Individual: wf_prepare
    Types: dul:Workflow
    Facts: soma:isPlanFor prepare, soma:hasStep fetch

Individual: fetch
    Types: k:Perceiving
    Facts: soma:during prepare

Individual: brew
    Types: k:Action
    Facts: soma:after prepare, soma:finishedBy steeping, soma:startedBy boil

Individual: wf_brew
    Types: dul:Workflow
    Facts: soma:isPlanFor brew, soma:hasPhase steeping, soma:hasStep boil, soma:hasStep pour, soma:hasStep stir

Individual: boil
    Types: k:Perceiving
    Facts: soma:before pour

Individual: pour
    Types: k:Perceiving
    Facts: soma:after boil, soma:starts steeping

Individual: stir
    Types: k:Perceiving
    Facts: soma:after pour, soma:during steeping

Individual: steeping
    Types: soma:Creation
    Facts: soma:startedBy pour
"""


def nested(folder: Path, text: str) -> tuple[dict[str, set[tuple[str, str]]], list[str]]:
    """Return the orders of each recipe below the task, by its name, and the codes of the errors."""
    reading = read_recipe(opened(folder, text), "tea")
    assert reading.recipes is not None
    found = {local_name(iri): orders(recipe) for iri, recipe in reading.recipes.recipes.items()}
    return found, [one.code for one in reading.diagnostics if one.severity is Severity.ERROR]


def test_roles_are_filled_by_what_has_them_from_either_side_and_those_of_no_task_are_told(tmp_path: Path) -> None:
    text = """
Individual: flow
    Types: soma:Workflow
    Facts: dul:definesTask serve, dul:hasStep take, dul:hasStep put, dul:definesRole forgotten
Individual: serve
    Types: soma:Task
Individual: take
    Types: k:PickingUpAnObject
    Facts: dul:isTaskOf taken, soma:before put
Individual: put
    Types: k:PuttingDownAnObject
Individual: taken
    Types: soma:Patient
    Facts: dul:isRoleOf cup1, dul:hasTask put
Individual: place
    Types: soma:Destination
    Facts: dul:hasTask put
Individual: forgotten
    Types: soma:Tool
Individual: cup1
    Types: k:Cup
Individual: table1
    Types: k:Table-PieceOfFurniture
    Facts: dul:hasRole place
"""
    reading = read_recipe(opened(tmp_path, text), None)
    assert reading.recipes is not None, reading.diagnostics
    found = {
        (step.name, local_name(one.property), str(getattr(one.filler, "name", one.filler)))
        for step in reading.recipes.main.steps
        for one in step.parameters
    }
    assert {one[:2] for one in found} == {
        ("take", "objectActedOn"),
        ("put", "objectActedOn"),
        ("put", "toLocation"),
    }
    told = [one.message for one in reading.diagnostics if one.code in ("R039", "R059")]
    assert told == ["the role `forgotten` is ignored: no task has it"]


def test_relations_of_steps_belong_to_the_workflow_that_has_both(tmp_path: Path) -> None:
    ordered = {"tea": {("prepare", "brew")}, "prepare": set(), "brew": {("boil", "pour"), ("pour", "stir")}}
    assert nested(tmp_path, TEA) == (ordered, [])


def test_a_step_in_a_workflow_is_ordered_with_one_outside_by_the_steps_that_hold_them(tmp_path: Path) -> None:
    text = TEA.replace("    Facts: soma:before brew\n", "").replace("soma:after prepare, ", "")
    assert "brew" not in nested(tmp_path, text)[0]["tea"]
    text = text.replace("soma:during prepare", "soma:before pour")
    assert nested(tmp_path, text)[0]["tea"] == {("prepare", "brew")}


def test_a_phase_orders_the_steps_around_it(tmp_path: Path) -> None:
    text = TEA.replace("soma:after pour, soma:during steeping", "soma:after steeping")
    assert ("pour", "stir") in nested(tmp_path, text.replace("soma:finishedBy steeping, ", ""))[0]["brew"]


@pytest.mark.parametrize(
    ("written", "wrong"),
    [("soma:during prepare", "soma:before nothing"), ("soma:during prepare", "soma:overlaps pour")],
    ids=["of no workflow", "overlap across workflows"],
)
def test_a_relation_that_no_workflow_can_keep_is_an_error(tmp_path: Path, written: str, wrong: str) -> None:
    text = TEA.replace(written, wrong) + "\nIndividual: nothing\n    Types: k:Perceiving\n"
    assert "R010" in nested(tmp_path, text)[1]


@pytest.mark.parametrize("number", [2**53 + 1, -(2**63) - 1, 10**26 - 1])
def test_whole_numbers_are_read_exactly(tmp_path: Path, number: int) -> None:
    serial = f"k:subAction some Look\n\nDataProperty: serial\n\nClass: Look\n    SubClassOf: serial value {number}"
    (step,) = read(tmp_path, f"\nClass: T\n    SubClassOf: k:Action, {serial}, k:Perceiving\n").steps
    assert [(one.filler, type(one.filler)) for one in step.parameters] == [(number, int)]
    assert Literal(str(number)).number() != Literal(str(number + 1)).number()


def test_one_file_may_mix_dialects_and_hold_several_tasks(tmp_path: Path) -> None:
    task = "\nClass: T\n    SubClassOf: k:Action, k:subAction some M, k:subAction some C\n"
    actions = opened(tmp_path, f"{STEPS}{MACHINE}{WORKFLOW}{TABLE}{task}")
    assert {local_name(task) for task in top_tasks(actions)} == {"T", "cook", "pipetting"}
    recipes = read_recipe(actions, "T").recipes
    assert recipes is not None
    assert {local_name(iri): one.dialect.name for iri, one in recipes.recipes.items()} == {"T": "D1f", "M": "D3"}


NAMES = ("a", "b", "c", "d")


@st.composite
def schedules(draw: st.DrawFn) -> dict[str, tuple[int, int]]:
    """Beginnings and ends of steps."""
    return {name: (begin := draw(st.integers(0, 6)), begin + draw(st.integers(1, 6))) for name in NAMES}


def relation(first: tuple[int, int], second: tuple[int, int]) -> tuple[Allen | None, bool]:
    """The relation of two intervals, and whether it is the inverse; None if one is before the other."""
    for allen in Allen:
        for is_inverse, pair in ((False, (first, second)), (True, (second, first))):
            at = {Point(name, is_end): pair[name == "2"][is_end] for name in "12" for is_end in (False, True)}
            points = Overlap("1", allen, "2").endpoints()
            if all(at[a] < at[b] if is_strict else at[a] == at[b] for a, is_strict, b in points):
                return allen, is_inverse
    return None, second[1] <= first[0]


@given(schedules())
def test_what_holds_in_a_schedule_is_no_contradiction_and_implies_only_what_holds(
    schedule: dict[str, tuple[int, int]],
) -> None:
    orderings, overlaps = [], []
    for index, first in enumerate(NAMES):
        for second in NAMES[index + 1 :]:
            allen, is_inverse = relation(schedule[first], schedule[second])
            ends = (second, first) if is_inverse else (first, second)
            if allen is None:
                orderings.append(Ordering(*ends))
            else:
                overlaps.append(Overlap(ends[0], allen, ends[1]))
    steps = tuple(Step(name, "Perceiving") for name in NAMES)
    recipe = Recipe("task", "Action", steps, tuple(orderings), overlaps=tuple(overlaps))
    assert Intervals(recipe).contradiction() == ()
    for before, after in implied_by_overlaps(recipe):
        assert schedule[before][1] <= schedule[after][0]
    for one in orderings:
        against = Recipe(
            "task", "Action", steps, (*orderings, Ordering(one.after, one.before)), overlaps=tuple(overlaps)
        )
        assert len(Intervals(against).contradiction()) >= 2


def test_a_value_with_a_unit_is_a_number_in_si_units(tmp_path: Path) -> None:
    text = "\nClass: T\n    SubClassOf: k:Action, k:subAction some E\n\nClass: E\n    SubClassOf: k:Perceiving, "
    recipe = read(tmp_path, text + 'k:duration value "2"^^unit:MinuteTime\n')
    assert recipe.steps[0].fillers("duration") == (120.0,)
    assert Literal("2", "http://qudt.org/vocab/unit#MinuteTime").number() == 2.0


def test_an_amount_in_any_unit_of_volume_is_in_millilitres(tmp_path: Path) -> None:
    text = "\nClass: T\n    SubClassOf: k:Action, k:subAction some E\n\nClass: E\n    SubClassOf: k:Pouring, "
    recipe = read(tmp_path, text + 'k:amount value "0.25"^^unit:Liter\n')
    assert recipe.steps[0].fillers("amount") == (250.0,)


@pytest.mark.parametrize(
    ("written", "value"), [('"0.3"', 0.3), ('" 2 "^^xsd:string', 2.0), ("7", 7), ('"0.3"@en', 0.3)]
)
def test_text_in_a_property_of_numbers_is_the_number_that_it_spells(tmp_path: Path, written: str, value: float) -> None:
    text = "\nClass: T\n    SubClassOf: k:Action, k:subAction some E\n\nClass: E\n    SubClassOf: k:Reaching, "
    recipe = read(tmp_path, text + f"k:linearVelocity value {written}\n")
    assert recipe.steps[0].fillers("linearVelocity") == (value,)


ACTED_ON = """
Individual: table
    Types: k:Action
    Facts: k:subAction grasp, acat:adtMainObject bottle1, acat:adtSecondaryObject table1

Individual: grasp
    Types: k:GraspingSomething
    Facts: {grasp}k:nextAction look

Individual: look
    Types: k:LookingForSomething
    Facts: k:nextAction put

Individual: put
    Types: k:PuttingDownAnObject
    Facts: {put}k:nextAction think

Individual: think
    Types: k:Reasoning

Individual: plane
    Types: k:SupportingPlane
    Facts: k:supportedObject cup1

Individual: bottle1
    Types: k:DrinkingBottle

Individual: cup1
    Types: k:Cup

Individual: table1
    Types: k:Table-PieceOfFurniture
"""


def test_chunks_act_on_the_main_object_of_their_table_unless_they_say_something_else(tmp_path: Path) -> None:
    def acted_on(**facts: str) -> dict[str, list[str]]:
        recipe = read(tmp_path, ACTED_ON.format(**({"grasp": "", "put": ""} | facts)), "table")
        return {step.name: [thing.name for thing in step.fillers("objectActedOn")] for step in recipe.steps}

    assert acted_on() == {"grasp": ["bottle1"], "look": ["bottle1"], "put": ["bottle1"], "think": []}
    assert acted_on(put="k:objectActedOn cup1, ")["put"] == ["cup1"]
    assert acted_on(grasp="acat:adtChunkSupport plane, ")["grasp"] == ["cup1"], "it stood on the plane"
    assert acted_on(put="acat:adtMainObject cup1, ")["put"] == ["cup1"]


def test_a_supporting_plane_is_found_by_its_name_in_the_namespace_of_a_log(corpus: Path) -> None:
    path = corpus / "recipes" / "acat-adt_example_pipetting@master.owl"
    reading = read_recipe(Actions(load(path)))
    assert reading.recipes is not None
    (pipette,) = {thing for step in reading.recipes.main.steps for thing in step.fillers("objectActedOn")}
    assert pipette.name == "ActionObjectDescription_dfgINiret8h"
