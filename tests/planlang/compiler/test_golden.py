"""The plan of the bundled recipe, as a reviewer reads it.

Re-create it with ``planlang compile serve_a_drink --force -o tests/planlang/compiler/golden/serve_a_drink.py``.
"""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.diagnostics import Severity
from planlang.files import bundled

RECIPE = bundled("recipes") / "serve_a_drink.omn"
GOLDEN = Path(__file__).parent / "golden" / "serve_a_drink.py"


@pytest.fixture(scope="module")
def plan() -> CompiledPlan:
    return compile_recipe(RECIPE)


def test_bundled_recipe_compiles_to_the_golden_plan(plan: CompiledPlan) -> None:
    assert plan.source == GOLDEN.read_text(encoding="utf-8"), "see the docstring of this file for how to re-create it"


def test_bundled_recipe_has_neither_errors_nor_warnings(plan: CompiledPlan) -> None:
    assert [str(d) for d in plan.diagnostics if d.severity is not Severity.NOTE] == []


def test_functions_are_told_with_the_task_last(plan: CompiledPlan) -> None:
    assert plan.functions == ("grasp_bottle", "serve_a_drink")
    assert plan.task == "ServeADrink"


def test_steps_come_in_the_order_of_the_constraints_not_of_the_file(plan: CompiledPlan, read_plan: type[Any]) -> None:
    assert read_plan(plan.source).orders("serve_a_drink").steps == [
        "at grasping_place",
        "ApproachBottle",
        "OpenGripper",
        "ReachForBottle",
        "CloseGripper",
        "LiftBottle",
        "ParkArm",
        "at handover_place",
        "ReachToHandoverPose",
        "HandOverBottle",
    ]


def test_source_does_not_depend_on_the_hash_seed(plan: CompiledPlan) -> None:
    script = f"from planlang.compiler import compile_recipe as c; print(c(__import__('pathlib').Path({str(RECIPE)!r}))"
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", script + ".source, end='')"],
            capture_output=True,
            text=True,
            check=True,
            env={"PYTHONHASHSEED": seed, "PATH": ""},
        )
        assert done.stdout == plan.source


def test_golden_plan_is_formatted_linted_and_strictly_typed() -> None:
    for arguments in (
        ["ruff", "format", "--check", "--isolated"],
        ["ruff", "check", "--isolated", "--select", "E,F,W,I,B,UP,N,RUF"],
        ["mypy", "--strict", "--no-error-summary"],
    ):
        done = subprocess.run([sys.executable, "-m", *arguments, str(GOLDEN)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


def test_golden_plan_imports_planlang_only(plan: CompiledPlan) -> None:
    lines = [line for line in plan.source.splitlines() if line.startswith(("import ", "from "))]
    assert all(line.split()[1] in ("functools", "planlang", "planlang.failures") for line in lines)


def test_no_iri_stands_inside_a_function(plan: CompiledPlan) -> None:
    inside = [line for line in plan.source.splitlines() if line.startswith("    ")]
    assert not any("http://" in line for line in inside)
