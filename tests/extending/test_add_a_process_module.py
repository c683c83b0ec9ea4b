"""Add a process module without changing planlang: in a file, or in a package of one's own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.modules.bundled import bundled_registry
from planlang import process_module
from planlang.diagnostics import Diagnostic
from tests.support.refusals import refusal

STIRRING = '''"""Stirs, with a spoon that may get lost."""

from planlang import sleep
from planlang.failures import ManipulationFailure
from planlang import process_module


class SpoonLost(ManipulationFailure):
    """The spoon is not in the hand."""


@process_module
class Stirring:
    """Moves a spoon for two seconds."""

    name = "stirring"
    actions = ("Stirring",)
    failures = (SpoonLost,)

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        return (self.platform.scene.arms.all[0].name,)

    async def execute(self, action):
        if action.get("tool") is not None:
            raise SpoonLost(what="spoon")
        await sleep(2.0)
        return "stirred"
'''
RECIPE = """
Prefix: : <http://example.org/tea.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/tea.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
    Import: <http://knowrob.org/kb/primitives.owl>

Individual: stirringPrimitive
    Types: knowrob:Primitive
    Facts: knowrob:performsAction knowrob:Stirring, knowrob:processModule "stirring", knowrob:usesResource "arm"

Class: MakeTea
    SubClassOf: knowrob:Action, knowrob:subAction some StirTea
Class: StirTea
    SubClassOf: knowrob:Stirring
"""
PLAN = """
from planlang import a_device, action, given, perform, plan, with_failure_handling


@plan
async def stir() -> None:
    await perform(action("{action}", tool=a_device("Spoon")))
"""
WHERE = ("--robot", "amigo", "--environment", "hospital_room")


def answer(*arguments: str | Path) -> dict[str, Any]:
    """The command's answer as JSON."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    assert "Traceback" not in result.output, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def codes(found: dict[str, Any]) -> list[str]:
    """Codes of the diagnostics."""
    return [one["code"] for one in found["diagnostics"]]


@pytest.fixture
def kitchen(tmp_path: Path) -> Path:
    """A folder with a recipe that nothing bundled performs, a plan, and a file with a module for both."""
    (tmp_path / "tea.omn").write_text(RECIPE)
    (tmp_path / "stir.py").write_text(PLAN.format(action="Stirring"))
    (tmp_path / "stirring.py").write_text(STIRRING)
    return tmp_path


def test_a_module_in_a_file_performs_the_steps_of_a_recipe(kitchen: Path) -> None:
    assert answer("run", kitchen / "tea.omn", *WHERE)["failure"]["class"] == "ActionUnresolvable"
    modules, trace = ("--modules", kitchen / "stirring.py"), kitchen / "run.jsonl"
    found = answer("run", kitchen / "tea.omn", *WHERE, *modules, "--trace", trace)
    assert (found["exit_code"], found["duration"]) == (0, 2.0)
    header = json.loads(trace.read_text().splitlines()[0])
    assert list(header["modules"]) == ["stirring.py"]

    assert answer("replay", trace, kitchen / "tea.omn", *modules)["equal"]
    without = answer("replay", trace, kitchen / "tea.omn")
    assert codes(without) == ["X022"]
    assert without["diagnostics"][0]["help"] == "add --modules stirring.py"


@pytest.mark.long
def test_a_run_is_resumed_only_with_the_same_modules(kitchen: Path) -> None:
    plan, trace = kitchen / "stir.py", kitchen / "run.jsonl"
    modules = ("--modules", kitchen / "stirring.py")
    failed = answer("run", plan, *WHERE, *modules, "--trace", trace)
    assert failed["failure"]["class"] == "SpoonLost", "a failure of one's own"
    assert answer("replay", trace, plan, *modules)["equal"]
    trace.write_text("".join(trace.read_text().splitlines(keepends=True)[:-1]))  # killed before it had ended
    assert codes(answer("run", plan, *WHERE, "--resume", trace)) == ["X022"]
    assert answer("run", plan, *WHERE, *modules, "--resume", trace)["failure"]["class"] == "SpoonLost"


def test_a_module_of_an_installed_package_is_found_by_its_entry_point(
    kitchen: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = kitchen / "site-packages"
    information = installed / "teatime-1.2.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: teatime\nVersion: 1.2\n")
    (information / "entry_points.txt").write_text("[planlang.modules]\nstirring = teatime:Stirring\n")
    (installed / "teatime.py").write_text(STIRRING)
    monkeypatch.syspath_prepend(installed)
    found = answer("run", kitchen / "tea.omn", *WHERE, "--trace", kitchen / "run.jsonl")
    assert found["exit_code"] == 0, found
    header = json.loads((kitchen / "run.jsonl").read_text().splitlines()[0])
    assert header["modules"] == {"planlang.modules: stirring": "teatime 1.2"}

    (information / "entry_points.txt").write_text("[planlang.modules]\nstirring = teatime:SpoonLost\n")
    assert codes(answer("run", kitchen / "tea.omn", *WHERE)) == ["X011"]


def test_of_two_modules_the_one_of_the_more_specific_class_is_used(kitchen: Path) -> None:
    (kitchen / "stir.py").write_text(PLAN.format(action="Stirring-Beating"))
    (kitchen / "beating.py").write_text(
        STIRRING.replace('("Stirring",)', '("Stirring-Beating",)').replace("SpoonLost", "WhiskLost")
    )
    both = ("--modules", kitchen / "stirring.py", "--modules", kitchen / "beating.py")
    assert answer("run", kitchen / "stir.py", *WHERE, *both)["failure"]["class"] == "WhiskLost"


def test_attributes_of_earlier_versions_are_noted_once_for_each_module(kitchen: Path) -> None:
    before = "    physical = by_hand = True\n\n    def resources"
    (kitchen / "before.py").write_text(STIRRING.replace("    def resources", before, 1))
    registry, found = bundled_registry(), list[Diagnostic]()
    registry.add_file(kitchen / "before.py")
    registry.resolve(found)
    assert [(one.code, one.message) for one in found] == [
        ("X034", "Stirring of before.py sets physical and by_hand, which is no longer needed")
    ]


def test_a_file_outranks_planlang_with_a_note_and_another_file_is_a_conflict(kitchen: Path) -> None:
    (kitchen / "mine.py").write_text(STIRRING.replace('("Stirring",)', '("Stirring", "Perceiving")'))
    registry = bundled_registry()
    registry.add_file(kitchen / "mine.py")
    found: list[Diagnostic] = []
    assert registry.resolve(found)[0].__name__ == "Stirring"  # type: ignore[attr-defined]
    assert [str(one) for one in found] == [
        "note X012 Perceiving is performed by Stirring of mine.py, not by Perception of planlang"
    ]
    registry.add_file(kitchen / "stirring.py")
    with refusal("X012", naming=("Stirring", "mine.py")):
        registry.resolve([])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "this file has no process module"),
        ("import planlang\n\nplanlang.nothing\n", "cannot be imported: AttributeError"),
        ("def (:\n", "cannot be imported: SyntaxError"),
        (STIRRING.replace('    name = "stirring"\n', ""), "process module Stirring lacks name"),
        (STIRRING.replace('("Stirring",)', '"Stirring"'), "actions of Stirring has to be a tuple"),
        (STIRRING.replace("(SpoonLost,)", "(3,)"), "failures of Stirring has to be a tuple"),
        ("from planlang.modules import process_module\n", "from planlang import process_module"),
        ("from planlang.protocols import World\n", "from planlang.protocols import RobotInterface"),
    ],
)
def test_a_file_that_cannot_be_used_is_bad_input_with_its_reason(kitchen: Path, text: str, message: str) -> None:
    (kitchen / "wrong.py").write_text(text)
    found = answer("run", "serve_a_drink", "--modules", kitchen / "wrong.py")
    assert (found["exit_code"], codes(found)) == (2, ["X011"])
    assert message in f"{found['diagnostics'][0]['message']} {found['diagnostics'][0]['help']}"


def test_a_class_that_is_derived_from_a_module_is_marked_itself_or_is_none() -> None:
    @process_module
    class Whistling:
        name, actions, failures = "whistling", ("Whistling",), ()

        def resources(self, action: object) -> tuple[str, ...]:
            return ()

        async def execute(self, action: object) -> None: ...

    class Humming(Whistling):
        actions = ("Humming",)

    registry = bundled_registry()
    space = type(registry)  # any object with these names
    module = type("Space", (), {"Whistling": Whistling, "Humming": Humming, "space": space})
    module.__name__ = __name__
    from planlang.registry import Rank

    assert registry.add(module, "here", Rank.NAMED) == 1  # type: ignore[arg-type]
