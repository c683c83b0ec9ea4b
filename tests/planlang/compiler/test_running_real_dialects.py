"""Real recipes of states, workflows and action data tables, run and explored in virtual time."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from planlang import a_location, an_object
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.drawing import svg, task_graph
from planlang.designators import a_posture
from planlang.failures import ObjectNotFound
from planlang.runs import RecordedRun
from planlang.testing import Script, explore, run_plan

SHELF = a_location(in_reach_of=an_object("Cupboard"))


def compiled(corpus: Path, file: str) -> CompiledPlan:
    return compile_recipe(corpus / "recipes" / file, folders=[corpus / "ontologies"], allow_abstract=True)


def plan_of(found: CompiledPlan) -> Any:
    module = ModuleType("compiled_plan")
    exec(compile(found.source, "<plan>", "exec"), module.__dict__)
    return getattr(module, found.functions[-1])


def script_for(found: CompiledPlan) -> Script:
    script = Script()
    script.performs(*(step.action for step in found.recipes.main.steps))
    return script


@pytest.fixture(scope="module")
def search(corpus: Path) -> CompiledPlan:
    return compiled(corpus, "object-search-recipe@hydro.owl")


def noting(seen: list[Any], property_name: str) -> Any:
    return lambda belief, wanted: seen.append(wanted.get(property_name))


def test_search_goes_where_the_inferring_state_says_until_the_bottle_is_seen(search: CompiledPlan) -> None:
    went: list[Any] = []
    looked: list[Any] = []
    script = script_for(search).on("infer-likely-locations", returns=SHELF)
    script.on("go-to-next-best-pose", does=noting(went, "to_location"))
    script.on("check-if-found", fails=ObjectNotFound, times=2)
    script.on("check-if-found", does=noting(looked, "object_acted_on"))
    done = run_plan(plan_of(search), script=script)
    assert done.value is None
    assert went == [SHELF, SHELF, SHELF]
    assert [str(one) for one in looked] == ["Bottle"]


def test_search_goes_to_what_the_recipe_names_where_nothing_was_inferred(search: CompiledPlan) -> None:
    went: list[Any] = []
    script = script_for(search).on("go-to-next-best-pose", does=noting(went, "to_location"))
    run_plan(plan_of(search), script=script)
    assert went == [a_posture("nextBestPose")]


def test_resumed_search_still_knows_what_an_earlier_state_made(search: CompiledPlan) -> None:
    went: list[Any] = []
    script = script_for(search).on("infer-likely-locations", returns=SHELF)
    script.on("go-to-next-best-pose", does=noting(went, "to_location"))
    whole = run_plan(plan_of(search), script=script, resumable=True)
    went.clear()
    events = whole.trace.events
    inferred = [number for number, event in enumerate(events, 1) if event["event"] == "completed"][1]
    resumed = run_plan(plan_of(search), script=script, resume=RecordedRun.of(events[:inferred]))
    assert resumed.value is None
    assert went == [SHELF]


def test_exploration_runs_when_the_pose_that_its_file_forgets_is_made_by_a_state(corpus: Path, tmp_path: Path) -> None:
    text = (corpus / "recipes" / "exploration-recipe@hydro.owl").read_text(encoding="utf-8")
    made = '<owl:onProperty rdf:resource="&knowrob;outputsCreated"/>\n<owl:hasValue rdf:resource="&roboearth;{}"/>'
    restriction = "<rdfs:subClassOf><owl:Restriction>" + made + "</owl:Restriction></rdfs:subClassOf>"
    anchor = '<rdfs:subClassOf rdf:resource="&roboearth;re_explore"/>'
    path = tmp_path / "exploration.owl"
    path.write_text(text.replace(anchor, anchor + restriction.format("next-best-pose")), encoding="utf-8")
    found = compile_recipe(path, allow_abstract=True)
    went: list[Any] = []
    script = script_for(found).on("explore-environment", returns=SHELF).on("check-finished", returns=False, times=1)
    script.on("move-to-nbv", does=noting(went, "to_location"))
    done = run_plan(plan_of(found), script=script)
    assert done.value is None
    assert went == [SHELF]
    assert 'condition_evaluated="COMPLETED_OK"' in found.source


FINDING = """
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
Class: Tidy
    SubClassOf: k:PurposefulAction, k:subAction some FindPlace, k:subAction some Drive, k:subAction some Look,
        k:subAction some Check, k:orderingConstraints value o1, k:orderingConstraints value o2
Class: FindPlace SubClassOf: k:LookingForSomething, k:objectActedOn value cup1, k:outputsCreated value somePlace
Class: Drive SubClassOf: k:Translation-LocationChange, k:toLocation value somePlace
Class: Look SubClassOf: k:Perceiving, k:objectActedOn value cup1
Class: Check SubClassOf: k:Perceiving, k:conditionEvaluated some (k:StaticSituation and (k:near value bed1))
Individual: o1 Types: k:PartialOrdering-Strict Facts: k:occursBeforeInOrdering Drive, k:occursAfterInOrdering Look
Individual: o2 Types: k:PartialOrdering-Strict Facts: k:occursBeforeInOrdering Look, k:occursAfterInOrdering Check
Individual: somePlace Types: k:Point2D
Individual: cup1 Types: k:Cup
Individual: bed1 Types: k:Bed-PieceOfFurniture
"""


def test_a_scope_is_where_an_earlier_step_has_found_the_place(tmp_path: Path) -> None:
    path = tmp_path / "finding.omn"
    path.write_text(FINDING, encoding="utf-8")
    found = compile_recipe(path)
    assert found.diagnostics == ()
    asked: list[Any] = []
    script = script_for(found).on("FindPlace", returns=SHELF).on("Check", does=noting(asked, "condition_evaluated"))
    done = run_plan(plan_of(found), script=script)
    assert done.value is None
    assert [
        event["location"] for event in done.events if event.get("kind") == "at_location" and "location" in event
    ] == [str(SHELF)]
    assert [str(one) for one in asked] == ["StaticSituation(near=bed1)"]


def test_what_a_step_checks_is_told_to_its_module(search: CompiledPlan) -> None:
    assert 'action("Perceiving", object_acted_on=bottle)' in search.source
    assert "checks: VisualPerception (detectedObject: any Bottle)" in svg(task_graph(search.recipes, search.added))
    assert "find_bottle(*, bottle: Object = BOTTLE)" in search.source


def test_workflow_hands_what_it_makes_from_task_to_task_under_every_schedule(corpus: Path) -> None:
    found = compiled(corpus, "pancake@kinetic.owl")
    used: list[Any] = []
    dough = an_object("Dough", "http://planlang.org/test#dough1")
    script = script_for(found).on("Mixing_0", returns=dough).on("Pouring_0", does=noting(used, "object_acted_on"))
    done = run_plan(plan_of(found), script=script)
    assert done.value is None
    assert used == [dough]
    order = ["Cracking_0", "Mixing_0", "Pouring_0", "FlippingAPancake_0"]

    def check(run: Any) -> None:
        assert all(run.happened_before(a, b) for a, b in itertools.pairwise(order))

    explore(plan_of(found), 10, script=script, check=check)


def test_action_data_table_performs_its_chunks_in_the_order_of_the_chain(corpus: Path) -> None:
    found = compiled(corpus, "acat-adt_example_pipetting@master.owl")
    done = run_plan(plan_of(found), script=script_for(found))
    assert done.value is None
    assert done.happened_before("ActionChunk_dsfg24375zd", "ActionChunk_DGFri4u5fd")
    assert "# Hand moves towards pipette and grasps it" in found.source


def test_facts_of_a_table_that_no_plan_uses_are_told_with_their_lines(corpus: Path) -> None:
    found = compiled(corpus, "acat-adt_example_pipetting@master.owl")
    told = {one.message.split()[0]: one.span.line for one in found.diagnostics if one.code == "R038" and one.span}
    assert {"adtChunkTrajectory": 173, "adtAmount": 86, "taskSuccess": 163}.items() <= told.items()
    assert not {"taskContext", "instruction", "adtMainObject", "nextAction", "startTime"} & set(told)


def test_things_of_dul_and_of_unknown_classes_are_objects_that_a_caller_may_choose(corpus: Path) -> None:
    found = compiled(corpus, "pancake@kinetic.owl")
    assert "egg: Object = EGG" in found.source
    told = [one for one in found.diagnostics if one.code == "R049"]
    assert ["`Spatula`" in one.message for one in told] == [True]
