"""Checks are declared with their codes and with what suppresses them, and run in an order that makes this true."""

from __future__ import annotations

import importlib
import pkgutil
from collections import Counter
from collections.abc import Iterator
from types import ModuleType

import pytest

import planlang.compiler
import planlang.recipe
from planlang.diagnostics import CODES
from planlang.recipe import reading
from planlang.recipe.checks import Check

RUN = {name: value for name, value in vars(reading).items() if name.isupper() and isinstance(value, tuple)}
"""The lists of checks that reading a recipe goes through."""


def modules(package: ModuleType) -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        yield importlib.import_module(found.name)


def declared() -> list[Check[..., object]]:
    """All checks of recipe and compiler, each once."""
    inside = [*modules(planlang.recipe), *modules(planlang.compiler)]
    found = {id(value): value for module in inside for value in vars(module).values() if isinstance(value, Check)}
    return list(found.values())


def test_every_code_of_recipes_is_declared_by_exactly_one_check() -> None:
    codes = Counter(code for one in declared() for code in one.codes)
    assert codes == {code: 1 for code in CODES if code.startswith("R")}


def test_a_check_is_suppressed_only_by_codes_that_another_one_reports() -> None:
    codes = {code for one in declared() for code in one.codes}
    for one in declared():
        assert one.unless <= codes - set(one.codes), one.codes


@pytest.mark.parametrize("name", RUN)
def test_a_check_runs_after_those_that_suppress_it(name: str) -> None:
    reported = {code for one in reading.FILE_CHECKS for code in one.codes} if name != "FILE_CHECKS" else set()
    if name in ("ORDERED_STEPS", "FINITE_STATE"):
        reported |= {code for one in reading.ANY_RECIPE for code in one.codes}
    for one in RUN[name]:
        assert one.unless <= reported, one.codes
        reported |= set(one.codes)


def test_every_check_of_a_recipe_runs() -> None:
    listed = {id(one) for checks in RUN.values() for one in checks}
    called = {"R001", "R030", "R041", "R043", "R058"}
    """First codes of those that are called where they make or choose something, not only judge."""
    assert {one.codes[0] for one in declared() if id(one) not in listed} == called
