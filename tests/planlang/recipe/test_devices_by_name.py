"""The device of a step is understood by its name, where nothing else says of which kind it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.ontology import load
from planlang.recipe import Actions, read_recipe
from planlang.recipe.model import Kind, Thing
from tests.support.small_recipes import HEAD, step, task

FETCH = step("Fetch", "k:FetchingAnObject", "k:objectActedOn value room:cup1", "k:deviceUsed value {}")


def read(folder: Path, declared: str, name: str) -> tuple[Thing, set[str]]:
    """Device of a step that uses an individual, and the codes of the diagnostics."""
    path = folder / "r.omn"
    path.write_text(HEAD + declared + FETCH.format(name) + task("Get", "Fetch"), encoding="utf-8")
    outcome = read_recipe(Actions(load(path)))
    assert outcome.recipes is not None
    (device,) = outcome.recipes.main.steps[0].fillers("deviceUsed")
    assert isinstance(device, Thing)
    return device, {one.code for one in outcome.diagnostics}


@pytest.mark.parametrize("name", ["leftArm", "right_gripper", "theLeftHand"])
@pytest.mark.parametrize("types", ["", "    Types: Tool1\nClass: Tool1\n"])
def test_an_individual_of_unknown_kind_that_is_called_an_arm_or_hand_is_a_device(
    tmp_path: Path, name: str, types: str
) -> None:
    device, codes = read(tmp_path, f"Individual: {name}\n{types}", name)
    assert (device.kind, device.iri) == (Kind.DEVICE, f"http://planlang.org/test#{name}")
    assert codes.isdisjoint({"R049", "R060"})


@pytest.mark.parametrize("name", ["sponge1", "harmonica", "handle1"])
def test_an_individual_with_another_name_is_still_an_object(tmp_path: Path, name: str) -> None:
    device, codes = read(tmp_path, f"Individual: {name}\n", name)
    assert device.kind is Kind.OBJECT
    assert codes >= {"R049", "R060"}
