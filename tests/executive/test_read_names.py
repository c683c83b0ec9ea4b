"""Names that a plan reads: a parameter that only replaced plans read need not be in the map."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.runs.importing import import_plan
from executive.runs.plan_files import main_plan, read_names

SOURCE = """
from functools import partial
from planlang import Object, Recovery, action, an_object, fetch_again, perform, plan
from planlang.failures import ObjectLost

SPOON, POT = an_object("Spoon"), an_object("Pot")

@plan("http://example.org/kitchen.owl#Stir")
async def stir(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(action("CirclingMotion", object_acted_on=pot, device_used=spoon))

@plan("http://example.org/kitchen.owl#Cook")
async def cook(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(
        action("Stirring", object_acted_on=pot),
        otherwise=partial(stir, spoon=spoon, pot=pot),
        recoveries=[Recovery(ObjectLost, fetch_again(spoon))],
    )

@plan("http://example.org/kitchen.owl#Serve")
async def serve(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(action("Serving"), otherwise=partial(cook, spoon=spoon, pot=pot))
"""


@pytest.mark.parametrize(
    ("task", "modules", "expected"),
    [
        ("Stir", ["Stirring"], {"spoon", "pot"}),
        ("Cook", [], {"spoon", "pot"}),
        ("Cook", ["Stirring"], {"pot"}),
        ("Serve", [], {"spoon", "pot"}),
        ("Serve", ["Stirring"], {"pot"}),
        ("Serve", ["Serving"], set()),
    ],
)
def test_what_only_plans_need_that_modules_stand_in_for_is_not_read(
    tmp_path: Path, task: str, modules: list[str], expected: set[str]
) -> None:
    path = tmp_path / "kitchen.py"
    path.write_text(SOURCE, encoding="utf-8")
    module = import_plan(path)
    read = read_names(module, main_plan(module, task), lambda cls, otherwise: cls in modules)
    assert read & {"spoon", "pot"} == expected
