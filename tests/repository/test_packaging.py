"""What a package index shows and installs: Python versions, packages with wheels, licences, a description."""

from __future__ import annotations

import re
import tomllib
from itertools import product
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

CHECKOUT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
USERS_EXTRAS = sorted(PROJECT["optional-dependencies"].keys() - {"dev", "bench", "docs"})
PYTHONS = ("3.11", "3.12", "3.13")


def names(requirements: list[str]) -> list[str]:
    """The packages that are required."""
    return sorted(Requirement(one).name for one in requirements)


def section(title: str) -> list[str]:
    """The packages at the margin of a section of NOTICE."""
    notice = (CHECKOUT / "NOTICE").read_text(encoding="utf-8")
    (start,) = re.finditer(rf"^{re.escape(title)}.*\n\n", notice, re.MULTILINE)
    return sorted(re.findall(r"^\S+", notice[start.end() :].partition("\n\n")[0], re.MULTILINE))


def test_notice_has_every_package_that_planlang_needs() -> None:
    assert section("Always installed") == names(PROJECT["dependencies"])


@pytest.mark.parametrize("extra", USERS_EXTRAS)
def test_notice_has_every_package_of_an_extra(extra: str) -> None:
    assert section(f"Extra [{extra}]") == names(PROJECT["optional-dependencies"][extra])


def test_the_supported_pythons_are_those_of_the_classifiers_and_of_make() -> None:
    supported = SpecifierSet(PROJECT["requires-python"])
    assert [f"3.{minor}" for minor in range(8, 20) if f"3.{minor}.0" in supported] == list(PYTHONS)
    stated = {one.rpartition(" :: ")[2] for one in PROJECT["classifiers"] if "Python :: 3." in one}
    assert stated == {*PYTHONS}
    makefile = (CHECKOUT / "Makefile").read_text(encoding="utf-8")
    assert "not (3, 11) <= sys.version_info[:2] <= (3, 13)" in makefile
    assert " ".join(f"python{version}" for version in PYTHONS) in makefile


@pytest.mark.parametrize(("version", "system"), [*product(PYTHONS, ("linux", "darwin", "win32"))])
def test_pybullet_comes_from_the_one_package_that_has_a_wheel(version: str, system: str) -> None:
    where = {"python_version": version, "sys_platform": system}
    wanted = [one for one in map(Requirement, PROJECT["dependencies"]) if one.name.startswith("pybullet")]
    chosen = [one.name for one in wanted if one.marker is not None and one.marker.evaluate(where)]
    assert chosen == ["pybullet" if (version, system) == ("3.11", "linux") else "pybullet-arm64"]


def test_the_description_for_an_index_has_no_links_into_the_repository() -> None:
    text = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    for one in PYPROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(one["pattern"], one["replacement"], text)
    assert re.findall(r"\]\((?!https?:)[^)]*\)", text) == []
    assert "docs/first_steps/installing.md lists the supported systems" in text
