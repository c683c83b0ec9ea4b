"""Real recipes compile to plans that run, are explored in virtual time, or are refused at the right line."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from plan_text import unbroken

from planlang import a_location, an_object
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.drawing import svg, task_graph
from planlang.compiler.layout import WIDTH
from planlang.designators import a_posture
from planlang.diagnostics import BadInput, Diagnostic, Severity
from planlang.failures import ObjectNotFound
from planlang.language.loading import load_plan
from planlang.runs import RecordedRun
from planlang.testing import Script, explore, run_plan

HYDRO = "recipes/serve_drink@knowrob_hydro_2014-11.owl"


@pytest.fixture(scope="module")
def hydro(corpus: Path) -> CompiledPlan:
    return compile_recipe(corpus / HYDRO)


def problems(path: Path, **options: Any) -> tuple[Diagnostic, ...]:
    with pytest.raises(BadInput) as found:
        compile_recipe(path, **options)
    return found.value.diagnostics


def codes(diagnostics: tuple[Diagnostic, ...], severity: Severity = Severity.ERROR) -> list[tuple[str, int]]:
    return [(d.code, d.span.line if d.span else 0) for d in diagnostics if d.severity is severity]


def test_hydro_recipe_grasps_in_six_steps_at_one_place_and_hands_over_at_another(
    hydro: CompiledPlan, read_plan: type[Any]
) -> None:
    happening = read_plan(hydro.source).orders("serve_a_drink")
    assert happening.steps == [
        "at robot_pose_grasping",
        "ReachToApproachPose",
        "OpenGripperForGrasping",
        "ReachForObjectPose",
        "CloseGripperForGrasping",
        "LiftObjectToApproachPose",
        "ReachToParkingPose",
        "at robot_pose_handover",
        "HandoverObject",
        "OpenGripperForHandover",
    ]
    total = {(a, b) for index, a in enumerate(happening.steps) for b in happening.steps[index + 1 :]}
    assert happening.before == total


def test_hydro_recipe_gets_its_exchanged_fillers_the_right_way_round(hydro: CompiledPlan) -> None:
    grasp = "action(GRASP_OBJECT_WITH_RIGHT_GRIPPER, object_acted_on=bottle, device_used=ROBOT_RIGHT_GRIPPER)"
    assert grasp in unbroken(hydro.source)
    assert ("R030", 308) in codes(hydro.diagnostics, Severity.NOTE)


def test_tool_that_is_no_physical_device_stays_the_tool(corpus: Path) -> None:
    plan = compile_recipe(corpus / "recipes" / "pouring@hydro.owl")
    assert "object_acted_on=pancake_maker" in plan.source
    assert "device_used=pancake_mix_in_right_hand" in plan.source
    assert {d.code for d in plan.diagnostics if "deviceUsed" in d.message} == {"R032"}


def test_place_without_relations_is_a_posture(hydro: CompiledPlan) -> None:
    source = unbroken(hydro.source)
    assert "PARKINGPOSE = a_posture('parkingpose')" in source
    assert "action(REACH_TO_PARKING_POSE, to_location=PARKINGPOSE, device_used=ROBOT_RIGHT_GRIPPER)" in source


def test_step_outside_a_recipe_with_a_device_gets_none(hydro: CompiledPlan) -> None:
    source = unbroken(hydro.source)
    assert "perform(action(RECIPE + 'HandoverObject', below='Reaching', to_location=hand_pose_handover)" in source
    for name in ("OpenGripperForGrasping", "OpenGripperForHandover"):
        stated = f"RECIPE + '{name}', below='OpeningAGripper'"
        assert f"perform(action({stated}, device_used=ROBOT_RIGHT_GRIPPER)" in source


def test_cabinet_that_no_step_uses_is_left_out(hydro: CompiledPlan) -> None:
    assert "cabinet" not in hydro.source.lower()


def test_recipe_that_orders_what_is_no_step_is_refused_with_a_suggestion(corpus: Path) -> None:
    found = problems(corpus / "recipes" / "serve_drink@re_stack.owl")
    assert codes(found) == [("R020", 134), ("R010", 202)]
    undefined, stranger = (d for d in found if d.severity is Severity.ERROR)
    assert "`GraspObjectWithRightGripper`" in undefined.message
    assert "did you mean `GraspBottle`" in (undefined.help or "")
    assert "`GraspBottle` is ordered" in stranger.message
    assert "did you mean `GraspBottle` as the sub-action instead of `GraspObjectWith" in (stranger.help or "")


def test_recipe_without_orderings_gets_the_three_that_are_plausible(corpus: Path) -> None:
    found = compile_recipe(corpus / "recipes" / "serve_drink_new@re_stack.owl").diagnostics
    plausible = [d.message.split(": ")[0] for d in found if d.code == "R042"]
    assert sorted(plausible) == [
        "`MoveBaseToHandoverPose` should probably come before `ReachToHandoverPose`",
        "`PickUpBottle` should probably come before `MoveBaseToHandoverPose`",
        "`ReachToHandoverPose` should probably come before `OpenGripperForHandover`",
    ]
    assert "R021" not in {code for code, _ in codes(found, Severity.WARNING)}  # the library picks up


@pytest.mark.parametrize("file", ["knowrob@hydro.owl", "knowrob@2011-09_ias.owl"])
def test_putting_something_somewhere_picks_up_carries_and_puts_down(
    corpus: Path, file: str, read_plan: type[Any]
) -> None:
    plan = compile_recipe(corpus / "ontologies" / file, task="PuttingSomethingSomewhere")
    happening = read_plan(plan.source).orders("putting_something_somewhere")
    plain = {(a.replace("_", "").lower(), b.replace("_", "").lower()) for a, b in happening.before}
    carrying = "comenearplace"
    taking = ("at placeinreach", "approach", "opengripper", "reachforit", "closegripper", "lift", "park")
    releasing = ("openhand", "withdraw", "tuckarm")
    assert {(step, carrying) for step in ("reaching", *taking)} <= plain
    assert {(carrying, step) for step in ("loweringanobject", *releasing)} <= plain
    assert {*itertools.combinations(taking, 2), *itertools.combinations(releasing, 2)} <= plain


def test_chunk_of_a_table_is_an_action_also_where_the_class_of_chunks_is_known(corpus: Path) -> None:
    found = compiled(corpus, "acat-adt_example_pipetting@master.owl")
    performed = {step.name: step.action for step in found.recipes.main.steps}
    assert performed == {
        "ActionChunk_dsfg24375zd": "GraspingSomething",
        "ActionChunk_DGFri4u5fd": "PuttingDownAnObject",
    }
    assert "R021" not in {one.code for one in found.diagnostics}


def test_file_with_several_tasks_lists_them(corpus: Path) -> None:
    (found,) = (d for d in problems(corpus / "ontologies" / "knowrob@hydro.owl") if d.code == "R002")
    assert "PuttingSomethingSomewhere" in (found.help or "")
    assert "PickingUpAnObject" not in (found.help or "")  # a step of another task


@pytest.mark.parametrize(
    ("file", "functions"),
    [
        ("make_pancakes@hydro.owl", ("grasp", "pick_up", "pour", "make_pancakes")),
        ("GetFromRefrigerator@2010-11.owl", ("grasp", "pick_up", "get_object_from_refrigerator")),
        ("acat-adt_example_pipetting@master.owl", ("release", "put_down", "grasp", "pipetting_adt_sdfiuh436dsfg")),
        ("pancake@kinetic.owl", ("grasp", "pick_up", "pour", "making_pancakes_0")),
    ],
)
def test_recipes_of_other_dialects_become_plans(corpus: Path, file: str, functions: tuple[str, ...]) -> None:
    assert compile_recipe(corpus / "recipes" / file).functions == functions


POUR = (
    *("at place_in_reach", "Approach", "OpenGripper", "ReachForIt", "CloseGripper", "Lift", "Park"),
    *("HoldOver", "Tilt", "TiltBack"),
)
"""Steps of the library's recipes for pouring: take the vessel, then tilt it."""


@pytest.mark.parametrize(
    ("file", "order"),
    [
        (
            "pancake-making@hydro.owl",
            ["CrackingAnEgg", "MixFlourAndMilk", "MixEggAndDough", *POUR, "FlippingAPancake"],
        ),
        ("pouring@hydro.owl", ["MoveAbovePan", "TiltBottle", "TiltBack"]),
    ],
)
def test_other_real_recipes_keep_their_total_order(
    corpus: Path, file: str, order: list[str], read_plan: type[Any]
) -> None:
    plan = compile_recipe(corpus / "recipes" / file)
    assert read_plan(plan.source).orders(plan.functions[-1]).steps == order


@pytest.mark.long
def test_plans_of_real_recipes_are_formatted_linted_and_typed(corpus: Path, tmp_path: Path) -> None:
    recipes = [
        (HYDRO, None),
        ("recipes/pancake-making@hydro.owl", None),
        ("recipes/pancake-making-constr@hydro.owl", None),
        ("recipes/pouring@hydro.owl", None),
        ("recipes/ChocolateCakeBaking@2011-03.owl", None),
        ("recipes/serve_drink_new@re_stack.owl", None),
        ("recipes/object-search-recipe@hydro.owl", None),
        ("recipes/pancake@kinetic.owl", None),
        ("recipes/acat-adt_example_pipetting@master.owl", None),
        ("recipes/make_pancakes@hydro.owl", None),
        ("recipes/GetFromRefrigerator@2010-11.owl", None),
        ("ontologies/knowrob@hydro.owl", "PuttingSomethingSomewhere"),
        ("ontologies/knowrob@hydro.owl", "AddingAnEgg"),
    ]
    for number, (file, task) in enumerate(recipes):
        source = compile_recipe(corpus / file, task=task).source
        assert not any("http://" in line for line in source.splitlines() if line.startswith("    "))
        # what ruff calls E501, but for one parameter or argument with a long name: no formatter breaks that
        long = [line for line in source.splitlines() if len(line) > WIDTH]
        assert [line for line in long if not re.fullmatch(r" +(\w+: \w+ = |\w+=|\"[^\"]+\": )\w+,", line)] == []
        (tmp_path / f"plan{number}.py").write_text(source, encoding="utf-8")
    for arguments in (
        ["ruff", "format", "--diff", "--isolated", f"--line-length={WIDTH}"],
        ["ruff", "check", "--isolated", f"--line-length={WIDTH}", "--select", "E,F,W,I,B,UP,N,RUF", "--ignore", "E501"],
        ["mypy", "--strict", "--no-error-summary"],
    ):
        done = subprocess.run([sys.executable, "-m", *arguments, str(tmp_path)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


SHELF = a_location(in_reach_of=an_object("Cupboard"))


def compiled(corpus: Path, file: str) -> CompiledPlan:
    return compile_recipe(corpus / "recipes" / file, folders=[corpus / "ontologies"])


def plan_of(found: CompiledPlan) -> Any:
    return getattr(load_plan(found.plan_source), found.functions[-1])


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
    found = compile_recipe(path)
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
    assert "action(CHECK_IF_FOUND, object_acted_on=bottle)" in search.source
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


def test_recipes_of_the_library_are_about_what_a_table_names_though_its_class_is_unknown(corpus: Path) -> None:
    source = unbroken(compile_recipe(corpus / "recipes" / "acat-adt_example_pipetting@master.owl").source)
    assert "partial(grasp, thing=action_object_description_dfg_i_niret8h)" in source
    assert "action_object_description_ften8db_fgsd, thing=action_object_description_dfg_i_niret8h)" in source


def test_facts_of_a_table_that_no_plan_uses_are_told_with_their_lines(corpus: Path) -> None:
    found = compiled(corpus, "acat-adt_example_pipetting@master.owl")
    told = {one.message.split()[0]: one.span.line for one in found.diagnostics if one.code == "R038" and one.span}
    assert {"adtChunkTrajectory": 173, "adtAmount": 86, "taskSuccess": 163}.items() <= told.items()
    assert not {"taskContext", "instruction", "adtMainObject", "nextAction", "startTime"} & set(told)


def test_things_of_dul_and_of_ease_are_objects_that_a_caller_may_choose(corpus: Path) -> None:
    found = compiled(corpus, "pancake@kinetic.owl")
    assert "egg: Object = EGG" in found.source
    assert 'SPATULA = an_object("Spatula")' in found.source  # EASE's class is KnowRob's
    assert [one for one in found.diagnostics if one.code == "R049"] == []
