"""What is said of a capability or component that a task requires and nothing defines (R046)."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Rename, Severity

RECIPE = """
Prefix: : <http://example.org/fly.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Ontology: <http://example.org/fly.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Class: Watch
    SubClassOf: knowrob:Action, knowrob:subAction some Look, {required}
Class: Look
    SubClassOf: knowrob:LookingForSomething
"""


@pytest.fixture
def said(tmp_path: Path, request: pytest.FixtureRequest) -> Diagnostic:
    """What is said of one requirement that nothing defines."""
    kind = "cap:dependsOnCapability" if "Capab" in request.param else "comp:dependsOnComponent"
    space = kind.partition(":")[0]
    path = tmp_path / "watch.omn"
    path.write_text(RECIPE.format(required=f"srdl2-{kind} some srdl2-{space}:{request.param}"), encoding="utf-8")
    (found,) = (one for one in compile_recipe(path).diagnostics if one.code == "R046")
    return found


@pytest.mark.parametrize(
    "said", ["FlyingCapability", "FlyingCapabilty", "PushingCapability", "FlyingComponent"], indirect=True
)
def test_names_that_are_alike_only_in_what_all_of_them_end_with_are_not_taken_for_each_other(said: Diagnostic) -> None:
    assert said.suggestion is None
    assert said.help == "import the file that defines it, or correct the name"


@pytest.mark.parametrize(
    ("said", "meant", "is_sure"),
    [
        ("ArmMotnCapability", "ArmMotionCapability", True),
        ("GraspCapability", "GraspingCapability", False),
        ("NavigatingComponnt", "NavigationComponent", True),
        ("Tilting2DLaserScan", "Tilting2DLaserScanner", True),
    ],
    indirect=["said"],
)
def test_a_name_that_is_like_another_in_what_tells_it_apart_is_a_guess(
    said: Diagnostic, meant: str, is_sure: bool
) -> None:
    assert isinstance(said.suggestion, Rename)
    assert (local_name(said.suggestion.meant), said.suggestion.is_sure) == (meant, is_sure)


@pytest.mark.parametrize("said", ["FlyingCapability"], indirect=True)
def test_whether_a_robot_has_what_nothing_defines_is_not_known(said: Diagnostic) -> None:
    assert (said.severity, "no robot" in said.message) == (Severity.WARNING, False)
    assert said.message == "`Watch` depends on `FlyingCapability`, which is not defined"
