"""CONTRIBUTING.md, "How to add a recovery", done: a package with a strategy, and a recipe whose recovery uses it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

GUIDE = (Path(__file__).resolve().parents[2] / "CONTRIBUTING.md").read_text().partition("## How to add a recovery")[2]
RECIPE = """
Prefix: : <http://example.org/recipe#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/recipe>
    Import: <http://knowrob.org/kb/knowrob.owl>

Class: Grasp
    SubClassOf: knowrob:GraspingSomething, knowrob:subAction some Close

Class: Close
    SubClassOf: knowrob:ClosingAGripper
"""
RUN = """
from planlang.failures import GraspMissed
from planlang.testing import Script, compiled, run_plan
run = run_plan(compiled("recipe.omn"), script=Script().on("ClosingAGripper", fails=GraspMissed, times=2))
print(run.value, run.seconds, len(run.steps("ClosingAGripper")))
"""


def block(language: str) -> str:
    """The guide's example in a language."""
    found = re.search(rf"```{language}\n(.*?)```", GUIDE, flags=re.DOTALL)
    assert found is not None
    return found[1]


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={"PYTHONPATH": str(folder), "HOME": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with the guide's package, as if it were installed, and a recipe that states the guide's recovery."""
    (tmp_path / "my_robot").mkdir()
    (tmp_path / "my_robot" / "__init__.py").touch()
    (tmp_path / "my_robot" / "recoveries.py").write_text(re.sub("(?m)^   ", "", block("python")))
    installed = tmp_path / "my_robot-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: my_robot\nVersion: 1.0\n")
    (installed / "entry_points.txt").write_text(
        re.sub(r'\[project.entry-points."(.*)"\]', r"[\1]", re.sub("(?m)^   ", "", block("toml"))).replace('"', "")
    )
    facts = re.sub("(?m)^   ", "", block("manchester")).replace("knowrob:GraspingSomething", "Close")
    (tmp_path / "recipe.omn").write_text(RECIPE + facts)
    return tmp_path


@pytest.mark.long
def test_a_strategy_of_a_package_is_written_into_the_plan_and_used(package: Path) -> None:
    compiled = python(package, "-m", "executive", "compile", "recipe.omn")
    assert compiled.returncode == 0, compiled.stderr
    assert "from my_robot.recoveries import wait_a_moment" in compiled.stdout
    text = "".join(compiled.stdout.split())
    assert "Recovery(GraspMissed,wait_a_moment,retries=3,otherwise=ObjectUnfetchable" in text
    run = python(package, "-c", RUN)
    assert run.stdout.split() == ["None", "7.0", "3"], run.stderr  # three attempts of 1 s, and two waits of 2 s


@pytest.mark.long
def test_a_strategy_that_nobody_registers_is_an_error_that_says_so(package: Path) -> None:
    (package / "my_robot-1.0.dist-info" / "entry_points.txt").unlink()
    refused = python(package, "-m", "executive", "compile", "recipe.omn")
    assert refused.returncode == 2
    assert "names an unknown strategy WaitAMoment" in refused.stderr


@pytest.mark.long
def test_a_package_that_cannot_be_imported_is_named(package: Path) -> None:
    (package / "my_robot" / "recoveries.py").write_text("import a_module_that_is_not_there\n")
    refused = python(package, "-m", "executive", "compile", "recipe.omn")
    assert refused.returncode == 2
    assert "the strategy WaitAMoment of the recovery `waitAndGraspAgain` cannot be loaded" in refused.stderr
    assert "my_robot.recoveries, an entry point of the group planlang.recoveries" in " ".join(refused.stderr.split())
