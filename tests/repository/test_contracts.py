"""Import contracts bite; no process module reaches into another; the table of facts names tests that exist."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGES = ("planlang", "executive", "sim")

BREACHES = {
    "planlang knows no robot and no physics": ("planlang/kernel", "import sim"),
    "geometry knows no robot, no world and no plan": ("planlang/geometry", "import planlang.designators"),
    "a state knows geometry and protocols only": ("planlang/state", "import planlang.designators"),
    "no file of geometry imports one that imports it": (
        "planlang/geometry/matrices.py",
        "from planlang.geometry.shapes import corners",
    ),
    "sim knows designators, protocols and diagnostics only": ("sim", "import planlang.kernel"),
    "no file of sim imports one that imports it": ("sim/robot.py", "import sim.contact"),
    "nobody inside imports the plan author's names": ("sim", "from planlang import run"),
    "the compiler reads recipes, recipes read ontologies": ("planlang/ontology", "import planlang.recipe"),
    "what was done is told without recipes and knowledge bases": ("planlang/experience", "import planlang.recipe"),
    "the language stands on recorded runs, these on the kernel": ("planlang/kernel", "import planlang.runs"),
    "phrases know designators and ontologies only": ("planlang/phrases", "import planlang.failures"),
    "the language does not know recipes": ("planlang/language", "import planlang.recipe"),
    "only tests use planlang.testing": ("executive/cli", "import planlang.testing"),
    "belief and places know no recipes": ("executive/robots/__init__.py", "import executive.robots.tasks"),
    "the executive imports one way": ("executive/api.py", "import executive.cli.console"),
    "no module imports one that imports it": (
        "planlang/lengths.py",
        "def late():\n    from importlib import import_module\n    return import_module('planlang.phrases.reading')",
    ),
}
"""Contract -> a package, or a file, and an import that it must not contain."""
CIRCLES = "no circles within a package"
CIRCLE = {
    "breach_one.py": "import {package}.breach_two",
    "breach_two.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from {package} import breach_one",
}
"""Files that import each other, one of them for a type only."""


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    """Check the contracts of the packages in a folder."""
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"]
    return subprocess.run(
        [*command, "--no-cache"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(folder)},
    )


def test_one_file_reads_plans_as_python() -> None:
    files = (path for package in PACKAGES for path in (CHECKOUT / package).rglob("*.py"))
    readers = [
        str(one.relative_to(CHECKOUT)) for one in files if re.search(r"^\s*(import|from) ast\b", one.read_text(), re.M)
    ]
    assert readers == ["planlang/language/source.py"]


def test_each_contract_is_broken_by_an_import_that_it_forbids(tmp_path: Path) -> None:
    configuration = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
    contracts = {contract["name"]: contract for contract in configuration["tool"]["importlinter"]["contracts"]}
    assert set(contracts) == {*BREACHES, CIRCLES}, "every contract needs an example that breaks it, here in the test"

    (tmp_path / "tests" / "support").mkdir(parents=True)
    for name in ("pyproject.toml", "tests/counts.py", "tests/support/contracts.py"):
        shutil.copy(CHECKOUT / name, tmp_path / name)
    for package in PACKAGES:
        shutil.copytree(CHECKOUT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    for place, statement in BREACHES.values():
        path = tmp_path / place if place.endswith(".py") else tmp_path / place / "breach.py"
        with path.open("a") as file:
            file.write(f"{statement}\n")
    packages = contracts[CIRCLES]["ancestors"]
    for package in packages:
        for name, text in CIRCLE.items():
            (tmp_path / package.replace(".", "/") / name).write_text(text.format(package=package))
    found = lint_imports(tmp_path)
    broken = set(re.findall(r"^(.+?) BROKEN", found.stdout, flags=re.MULTILINE))
    assert broken == set(contracts), found.stdout + found.stderr
    for package in packages:
        assert f"No cycles are allowed in {package}." in found.stdout


REGISTRY = "executive/modules/bundled.py"
"""The file that may name process modules: it registers those that come with planlang."""
REACHES_IN = (
    "from executive.modules.arm.reaching import Reaching",
    "def late():\n    from executive.modules.arm.reaching import Reaching as Drive",
    "from executive.modules.arm import reaching",
    "import executive.modules.arm.reaching",
    "import executive.modules.arm.reaching as bundled",
)
"""Statements that reach into a file for the process module in it."""


def process_modules_imported(folder: Path) -> list[tuple[str, str]]:
    """Return each import of a process module, or of all of its file, by another file of the executive.

    The registry may have a user's module for the same actions, which would be passed over.
    """
    trees = {path: _parsed(path.read_text(encoding="utf-8")) for path in sorted((folder / "executive").rglob("*.py"))}
    classes = {
        ".".join(path.relative_to(folder).with_suffix("").parts): {
            node.name for node in tree.body if isinstance(node, ast.ClassDef) and any(map(_marks, node.decorator_list))
        }
        for path, tree in trees.items()
    }
    forbidden = {module: {"", *names} for module, names in classes.items() if names}
    return [
        (path.relative_to(folder).as_posix(), f"{module}:{name}")
        for path, tree in trees.items()
        if path != folder / REGISTRY
        for module, name in _imported(tree)
        if name in forbidden.get(module, ())
    ]


@cache
def _parsed(text: str) -> ast.Module:
    """Return the syntax of a file; most files are the same in each copy of the checkout."""
    return ast.parse(text)


def _marks(decorator: ast.expr) -> bool:
    return isinstance(decorator, ast.Name) and decorator.id == "process_module"


def _imported(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield what a file imports: each module, with a name in it, or with "" for all of it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((one.name, "") for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            for one in node.names:
                yield from ((node.module or "", one.name), (f"{node.module}.{one.name}", ""))


@pytest.mark.long
def test_no_process_module_is_imported_but_by_the_registry() -> None:
    advice = "ask for the action by perform(), or move what is shared to a class that is no process module"
    assert process_modules_imported(CHECKOUT) == [], advice


@pytest.mark.parametrize("statement", REACHES_IN)
def test_reaching_for_a_process_module_is_found(tmp_path: Path, statement: str) -> None:
    modules = tmp_path / "executive" / "modules"
    shutil.copytree(CHECKOUT / "executive" / "modules", modules, ignore=shutil.ignore_patterns("__pycache__"))
    with (modules / "arm" / "hand_work.py").open("a") as file:
        file.write(f"{statement}\n")
    ((file, what),) = process_modules_imported(tmp_path)
    assert (file, what.partition(":")[0]) == ("executive/modules/arm/hand_work.py", "executive.modules.arm.reaching")


TRUTH = {"PyBulletWorld", "sim.world", "Truth", "sim.truth"}
"""What names the true world, and what is so in it."""
ASSEMBLED = tuple(f"executive/{name}/" for name in ("runs", "cli", "commands", "goals", "pictures", "report", "live"))
"""Where runs are put together, and what is so is shown."""


def true_worlds_imported(folder: Path) -> list[tuple[str, str]]:
    """Return each import of the true world by files of the executive that ground, plan or believe."""
    return [
        (file, f"{module}:{name}")
        for path in sorted((folder / "executive").rglob("*.py"))
        if not (file := path.relative_to(folder).as_posix()).startswith(ASSEMBLED)
        for module, name in _imported(_parsed(path.read_text(encoding="utf-8")))
        if module in TRUTH or (module == "sim" and name in TRUTH)
    ]


def test_what_grounds_plans_and_believes_does_not_know_the_true_world() -> None:
    assert true_worlds_imported(CHECKOUT) == [], (
        "ask for what planlang.protocols.RobotInterface and planlang.changes.Physics have"
    )


@pytest.mark.parametrize("room", ["modules", "locations", "belief"])
@pytest.mark.parametrize(
    "statement",
    [
        "from sim import PyBulletWorld",
        "import sim.world",
        "from sim import world",
        "from sim.truth import Truth",
        "from sim.truth import held_by",
        "from sim import truth",
    ],
)
def test_reaching_for_the_true_world_is_found(tmp_path: Path, statement: str, room: str) -> None:
    (tmp_path / "executive" / room).mkdir(parents=True)
    (tmp_path / "executive" / room / "cheating.py").write_text(f"{statement}\n")
    assert {file for file, _ in true_worlds_imported(tmp_path)} == {f"executive/{room}/cheating.py"}


TESTS = CHECKOUT / "tests" / "planlang"
TABLE = TESTS.parent / "CONFORMANCE.md"
NUMBERED = re.compile(r"test_[lkfp]\d+_")
FACTS = [
    f"{letter}{number}"
    for letter, last in (("L", 32), ("K", 11), ("F", 19), ("P", 16))
    for number in range(1, last + 1)
]


def rows() -> dict[str, str]:
    lines = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {row[0]: row[-1] for row in cells if row[0] != "fact"}


def defined() -> set[str]:
    return {
        f"{path.relative_to(TESTS).as_posix()}::{name}"
        for path in TESTS.rglob("test_*.py")
        for name in re.findall(r"^(?:def )?(test_\w+|Test\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
    }


def test_every_fact_has_a_line() -> None:
    assert [fact for fact in rows() if fact in FACTS] == FACTS


def test_every_test_in_the_table_exists() -> None:
    known = defined()
    assert [test for test in rows().values() if "::" in test and test not in known] == []


def test_a_fact_has_a_test_or_a_reason() -> None:
    assert [fact for fact, test in rows().items() if "::" not in test and len(test.split()) < 4] == []


def test_every_numbered_test_is_in_the_table() -> None:
    listed = set(rows().values())
    assert sorted(test for test in defined() if NUMBERED.search(test) and test not in listed) == []


def test_every_file_of_tests_that_a_file_names_exists() -> None:
    files = [CHECKOUT / name for name in ("README.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml")]
    for folder in (*PACKAGES, "docs", "tests"):
        files += [*(CHECKOUT / folder).rglob("*.py"), *(CHECKOUT / folder).rglob("*.md")]
    named = {
        (str(file.relative_to(CHECKOUT)), name)
        for file in files
        for name in re.findall(r"\btests/[\w/]+\.py\b", file.read_text(encoding="utf-8"))
    }
    assert len(named) > 20
    assert sorted((file, name) for file, name in named if not (CHECKOUT / name).is_file()) == []
