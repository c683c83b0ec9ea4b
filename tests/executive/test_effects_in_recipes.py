"""Effects that a recipe declares, itself or in a file that it imports, in a map that knows nothing of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.maps import read_map
from planlang.ontology import load
from tests.support.cakes import ICER, ICING, ROOM

RECIPE = """
Prefix: : <http://example.org/cakes.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/cake_recipe.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Class: MakeCake
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some IceIt, knowrob:subAction some LookAtIt,
        knowrob:orderingConstraints value ice_first
Individual: ice_first
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering IceIt, knowrob:occursAfterInOrdering LookAtIt
Class: IceIt
    SubClassOf: Icing, knowrob:objectActedOn value frosting1, knowrob:outputsCreated value cake
Class: LookAtIt
    SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn value cake
Individual: frosting1
    Types: Frosting
Individual: cake
    Types: IcedCake
"""
DECLARING = """
Prefix: : <http://example.org/cakes.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/icing.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
"""
IMPORT = "    Import: <http://example.org/icing.owl>\n\nClass: MakeCake"


def planlang(*words: object) -> str:
    result = CliRunner().invoke(app, [*map(str, words)])
    assert result.exit_code == 0, result.output
    return result.output


def written(folder: Path, files: dict[str, str]) -> None:
    for name, text in {"room.omn": ROOM, "icer.py": ICER, **files}.items():
        (folder / name).write_text(text)


@pytest.mark.parametrize(
    ("files", "plan"),
    [
        ({"recipe.omn": RECIPE + ICING}, "recipe.omn"),
        ({"recipe.omn": RECIPE.replace("\nClass: MakeCake", IMPORT), "icing.omn": DECLARING + ICING}, "recipe.omn"),
        ({"recipe.omn": RECIPE + ICING}, "compiled.py"),
    ],
    ids=["itself", "import", "compiled"],
)
def test_an_effect_that_a_recipe_or_its_import_declares_counts_in_a_run(
    tmp_path: Path, files: dict[str, str], plan: str
) -> None:
    written(tmp_path, files)
    if plan == "compiled.py":
        planlang("compile", tmp_path / "recipe.omn", "-o", tmp_path / plan)
    world = ["--robot", "amigo", "--environment", tmp_path / "room.omn", "--modules", tmp_path / "icer.py"]
    outputs = ["--trace", tmp_path / "run.jsonl", "--update-map", tmp_path / "after.omn"]
    shown = planlang("run", tmp_path / plan, *world, *outputs)
    assert "IcedCake_1: at rest on table1" in shown
    told = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    changed = [(one["change"], one["name"]) for one in told if one["event"] == "belief"]
    assert changed[:2] == [("destroyed", "frosting1"), ("created", "IcedCake_1")]
    left = {thing.name: thing for thing in read_map(load(tmp_path / "after.omn")).objects}
    assert [one.rpartition("#")[2] for one in left["IcedCake_1"].types] == ["IcedCake", "FoodOrDrink"]


def test_of_a_compiled_plan_without_its_recipe_a_warning_says_that_the_effects_do_not_count(tmp_path: Path) -> None:
    written(tmp_path, {"recipe.omn": RECIPE + ICING})
    planlang("compile", tmp_path / "recipe.omn", "-o", tmp_path / "compiled.py")
    (tmp_path / "recipe.omn").unlink()
    world = ["--robot", "amigo", "--environment", tmp_path / "room.omn", "--modules", tmp_path / "icer.py"]
    result = CliRunner().invoke(app, ["run", *map(str, (tmp_path / "compiled.py", *world))])
    assert "C011" in result.output
    assert "effects do not count" in result.output
