"""The import contracts of pyproject.toml hold for something: each one notices an import that breaks it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGES = ("planlang", "executive", "sim")

BREACHES = {
    "planlang knows no robot and no physics": ("planlang/kernel", "import sim"),
    "geometry knows no robot, no world and no plan": ("planlang/geometry", "import planlang.designators"),
    "no file of geometry imports one that imports it": (
        "planlang/geometry/matrices.py",
        "from planlang.geometry.pose import Pose",
    ),
    "sim knows designators, protocols and diagnostics only": ("sim", "import planlang.kernel"),
    "no file of sim imports one that imports it": ("sim/robot.py", "import sim.contact"),
    "sim does not import the plan author's names": ("sim", "from planlang import run"),
    "the compiler reads recipes, recipes read ontologies": ("planlang/ontology", "import planlang.recipe"),
    "the language stands on recorded runs, these on the kernel": ("planlang/kernel", "import planlang.runs"),
    "phrases know designators and ontologies only": ("planlang/phrases", "import planlang.failures"),
    "the language does not know recipes": ("planlang/language", "import planlang.recipe"),
    "only tests use planlang.testing": ("executive/cli", "import planlang.testing"),
    "the executive imports one way": ("executive/robots", "import executive.belief"),
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


def test_each_contract_is_broken_by_an_import_that_it_forbids(tmp_path: Path) -> None:
    configuration = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
    contracts = {contract["name"]: contract for contract in configuration["tool"]["importlinter"]["contracts"]}
    assert set(contracts) == {*BREACHES, CIRCLES}, "every contract needs an example that breaks it, here in the test"

    shutil.copy(CHECKOUT / "pyproject.toml", tmp_path)
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
