"""Real recipes compile to plans that can run, or are refused for the right reason at the right line."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from plan_text import unbroken

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.layout import WIDTH
from planlang.diagnostics import BadInput, Diagnostic, Severity

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
    grasp = "action('GraspingSomething', object_acted_on=bottle, device_used=ROBOT_RIGHT_GRIPPER)"
    assert grasp in unbroken(hydro.source)
    assert ("R030", 308) in codes(hydro.diagnostics, Severity.NOTE)


def test_tool_that_is_no_physical_device_stays_the_tool(corpus: Path) -> None:
    plan = compile_recipe(corpus / "recipes" / "pouring@hydro.owl", allow_abstract=True)
    assert "object_acted_on=pancake_maker" in plan.source
    assert "device_used=pancake_mix_in_right_hand" in plan.source
    assert {d.code for d in plan.diagnostics if "deviceUsed" in d.message} == {"R032"}


def test_place_without_relations_is_a_posture(hydro: CompiledPlan) -> None:
    source = unbroken(hydro.source)
    assert "PARKINGPOSE = a_posture('parkingpose')" in source
    assert "action('Reaching', to_location=PARKINGPOSE, device_used=ROBOT_RIGHT_GRIPPER)" in source


def test_step_outside_a_recipe_with_a_device_gets_none(hydro: CompiledPlan) -> None:
    source = unbroken(hydro.source)
    assert "perform(action('Reaching', to_location=hand_pose_handover(bed)), name='HandoverObject')" in source
    for name in ("OpenGripperForGrasping", "OpenGripperForHandover"):
        assert f"perform(action('OpeningAGripper', device_used=ROBOT_RIGHT_GRIPPER), name='{name}')" in source


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
    found = problems(corpus / "recipes" / "serve_drink_new@re_stack.owl")
    plausible = [d.message.split(": ")[0] for d in found if d.code == "R042"]
    assert sorted(plausible) == [
        "`MoveBaseToHandoverPose` should probably come before `ReachToHandoverPose`",
        "`PickUpBottle` should probably come before `MoveBaseToHandoverPose`",
        "`ReachToHandoverPose` should probably come before `OpenGripperForHandover`",
    ]
    assert codes(found) == [("R021", 111)]


@pytest.mark.parametrize("file", ["knowrob@hydro.owl", "knowrob@2011-09_ias.owl"])
def test_putting_something_somewhere_picks_up_carries_and_puts_down(
    corpus: Path, file: str, read_plan: type[Any]
) -> None:
    plan = compile_recipe(corpus / "ontologies" / file, task="PuttingSomethingSomewhere", allow_abstract=True)
    happening = read_plan(plan.source).orders("putting_something_somewhere")
    plain = {(a.replace("_", "").lower(), b.replace("_", "").lower()) for a, b in happening.before}
    carrying = "carryingwhilelocomoting"
    assert {(step, carrying) for step in ("reaching", "takingsomething")} <= plain
    assert {(carrying, step) for step in ("loweringanobject", "releasinggraspofsomething")} <= plain


def test_file_with_several_tasks_lists_them(corpus: Path) -> None:
    (found,) = (d for d in problems(corpus / "ontologies" / "knowrob@hydro.owl") if d.code == "R002")
    assert "PuttingSomethingSomewhere" in (found.help or "")
    assert "PickingUpAnObject" not in (found.help or "")  # a step of another task


@pytest.mark.parametrize(
    ("file", "functions"),
    [
        ("make_pancakes@hydro.owl", ("make_pancakes",)),
        ("GetFromRefrigerator@2010-11.owl", ("get_object_from_refrigerator",)),
        ("acat-adt_example_pipetting@master.owl", ("pipetting_adt_sdfiuh436dsfg",)),
        ("pancake@kinetic.owl", ("making_pancakes_0",)),
    ],
)
def test_recipes_of_other_dialects_become_plans(corpus: Path, file: str, functions: tuple[str, ...]) -> None:
    assert compile_recipe(corpus / "recipes" / file, allow_abstract=True).functions == functions


@pytest.mark.parametrize(
    ("file", "order"),
    [
        (
            "pancake-making@hydro.owl",
            ["CrackingAnEgg", "MixFlourAndMilk", "MixEggAndDough", "PourDoughOntoPancakeMaker", "FlippingAPancake"],
        ),
        ("pouring@hydro.owl", ["MoveAbovePan", "TiltBottle", "TiltBack"]),
    ],
)
def test_other_real_recipes_keep_their_total_order(
    corpus: Path, file: str, order: list[str], read_plan: type[Any]
) -> None:
    plan = compile_recipe(corpus / "recipes" / file, allow_abstract=True)
    assert read_plan(plan.source).orders(plan.functions[-1]).steps == order


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
        source = compile_recipe(corpus / file, task=task, allow_abstract=True).source
        assert not any("http://" in line for line in source.splitlines() if line.startswith("    "))
        # what ruff calls E501, but for one parameter with a long name: no formatter breaks that
        long = [line for line in source.splitlines() if len(line) > WIDTH]
        assert [line for line in long if not re.fullmatch(r" {4}\w+: \w+ = \w+,", line)] == []
        (tmp_path / f"plan{number}.py").write_text(source, encoding="utf-8")
    for arguments in (
        ["ruff", "format", "--diff", "--isolated"],
        ["ruff", "check", "--isolated", "--select", "E,F,W,I,B,UP,N,RUF", "--ignore", "E501"],
        ["mypy", "--strict", "--no-error-summary"],
    ):
        done = subprocess.run([sys.executable, "-m", *arguments, str(tmp_path)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
