"""Maps that runs leave behind: things that were made, destroyed and handed over, and the next run in such a map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.belief import Belief
from executive.cli.app import app
from executive.maps import SemanticMap, read_map
from executive.runs.options import Outcome, RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.geometry import Pose
from planlang.ontology import load
from tests.executive.conftest import BUNDLED
from tests.support.cakes import ICER, ICING, ROOM

BESIDE = """
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/beside.owl>
    Import: <http://example.org/cakes.owl>

Individual: <http://example.org/beside.owl#cup1>
    Types: knowrob:Cup
    Facts: knowrob:pose <http://example.org/beside.owl#place_of_cup>,
        knowrob:depthOfObject 0.07, knowrob:widthOfObject 0.07, knowrob:heightOfObject 0.1
Individual: <http://example.org/beside.owl#place_of_cup>
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "1.5 0.4 0.79", knowrob:quaternion "0 0 0 1"
"""
PLAN = """
from planlang import action, an_object, perform, plan

CAKES = "http://example.org/cakes.owl#"


@plan
async def ice():
    frosting = an_object(CAKES + "Frosting")
    await perform(action(CAKES + "Icing", below="ActionOnObject", object_acted_on=frosting))
"""
AND_LOOK = """\
    await perform(action("LookingForSomething", object_acted_on=an_object(CAKES + "IcedCake")))
"""
LOOK = """
from planlang import action, an_object, perform, plan


@plan
async def look():
    cake = an_object("FoodOrDrink", "http://example.org/{}.owl#IcedCake_1")
    await perform(action("LookingForSomething", object_acted_on=cake))
"""


@pytest.mark.parametrize(("name", "plan"), [("cakes", PLAN), ("beside", PLAN + AND_LOOK)])
def test_what_was_made_is_in_the_map_as_any_other_thing_and_what_it_was_made_of_no_more(
    tmp_path: Path, name: str, plan: str
) -> None:
    files = {"cakes.omn": ROOM + ICING, "beside.omn": BESIDE, "icer.py": ICER, "plan.py": plan}
    files["next.py"] = LOOK.replace("{}", name)
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    after = tmp_path / "after.omn"
    options = RunOptions(recipe=tmp_path / "plan.py", robot="amigo", environment=tmp_path / f"{name}.omn")
    result = run_plan_file(replace(options, modules=[tmp_path / "icer.py"], update_map=after))
    assert result.outcome is Outcome.DONE, result.message
    left = read_map(load(after))
    things = {thing.iri: thing for thing in left.objects}
    assert f"http://example.org/{name}.owl#IcedCake_1" in things
    assert "http://example.org/cakes.owl#frosting1" not in {str(t.subject) for t in left.ontology.triples()}
    cake, table = things[f"http://example.org/{name}.owl#IcedCake_1"], left.find("table1")
    assert cake.types == ("http://example.org/cakes.owl#IcedCake",)
    assert cake.size == (0.06, 0.06, 0.08)
    assert cake.pose
    assert cake.pose.position == pytest.approx((1.5, 0, 0.78), abs=0.01)
    assert table
    assert table.pose
    assert table.pose.position == pytest.approx((1.6, 0, 0.37), abs=0.01)
    checked = CliRunner().invoke(app, ["check", str(after)])
    assert checked.exit_code == 0, checked.output
    following = RunOptions(recipe=tmp_path / "next.py", robot="amigo", environment=after)
    assert run_plan_file(following).outcome is Outcome.DONE


def believed_and_left(options: RunOptions, after: Path) -> tuple[Belief, SemanticMap]:
    """Run a scenario; what the robot believes at its end, and the map that it leaves behind."""
    beliefs: list[Belief] = []
    result = run_plan_file(
        replace(options, update_map=after, around=lambda executive: beliefs.append(executive.platform.belief))
    )
    assert result.outcome is Outcome.DONE, result.message
    return beliefs[0], read_map(load(after))


SCENARIOS = ("carry_the_tray", "fetch_from_cabinet", "pass_a_drink", "push_the_cup", "stir_soup", "wipe_table")


@pytest.mark.parametrize("name", ["serve_a_drink", *(pytest.param(one, marks=pytest.mark.long) for one in SCENARIOS)])
def test_the_map_of_a_bundled_run_is_accepted_and_gives_back_the_believed_poses(tmp_path: Path, name: str) -> None:
    after = tmp_path / "after.omn"
    belief, left = believed_and_left(RunOptions(recipe=name), after)
    checked = CliRunner().invoke(app, ["check", str(after)])
    assert checked.exit_code == 0, checked.output
    for thing in belief.things:
        if thing.name in belief.names():
            again = left.find(thing.iri)
            assert again, thing.name
            assert again.pose, thing.name
            assert again.pose.distance(belief.closed_pose(thing.name)) < 1e-6, thing.name


@pytest.mark.parametrize("seed", [1, pytest.param(5, marks=pytest.mark.long)])
def test_a_thing_handed_over_is_believed_in_the_persons_hand_where_the_next_run_takes_it_from(
    tmp_path: Path, seed: int
) -> None:
    true: list[Pose] = []
    options = replace(BUNDLED, seed=seed, watchers=(lambda world: true.append(world.pose("bottle1")),))
    belief, left = believed_and_left(options, tmp_path / "after.omn")
    bottle = left.find("bottle1")
    assert belief.pose("bottle1").distance(true[-1]) < 1e-3
    assert bottle
    assert bottle.pose
    assert bottle.pose.distance(true[-1]) < 1e-3
    following = run_plan_file(replace(BUNDLED, environment=tmp_path / "after.omn", seed=seed))
    assert following.outcome is Outcome.DONE, following.message
