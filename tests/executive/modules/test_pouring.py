"""Pouring: for how long a vessel flows in a motion, and that what has flowed is not poured once more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from executive.modules.tools import constrained_motions
from executive.modules.tools.pouring import Pouring
from executive.motion.constrained_motion import PhaseMotion
from executive.motion.errors import NoConstrainedPath
from planlang.designators import Action
from planlang.failures import AmountNotPoured
from planlang.protocols import Detection
from sim import PyBulletWorld
from sim.truth import held_by
from tests.support.scenarios import Judged, Scenario, Watched, judged

POUR = """
Prefix: : <http://example.org/pour.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/pour.owl>
Class: PourTheMix
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some PourIt
Class: PourIt
    SubClassOf: knowrob:PouringSomethingOnto, knowrob:objectActedOn some knowrob:Cup,
        knowrob:toLocation some knowrob:Skillet, knowrob:amount value 120.0
"""


@pytest.mark.long
@pytest.mark.parametrize("steps", [60, 161], ids=["held_over", "being_turned_back"])
@pytest.mark.pr2
def test_when_the_vessel_is_lost_in_mid_pour_only_the_rest_is_poured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    step, over = PyBulletWorld.step, [0]

    def stepped(world: PyBulletWorld) -> None:
        if held_by(world, "cup1") == "robot" and world.pose("cup1").rotation[2, 2] < 0:
            over[0] += 1
            if over[0] == steps:
                world.release("cup1")
        step(world)

    def poured(watched: Watched) -> Iterator[str]:
        """The amount is in the pan, and was poured in two parts."""
        amount = watched.world.matter.total("PancakeMix_on_pan1")
        if over[0] <= steps or abs(amount - 120.0) > 1.0:
            yield f"{amount:.1f} ml were poured in {over[0]} steps"

    monkeypatch.setattr(PyBulletWorld, "step", stepped)
    recipe = tmp_path / "pour.omn"
    recipe.write_text(POUR, encoding="utf-8")
    found = judged(Scenario("pour", (str(recipe), "--robot", "pr2", "--environment", "stove_kitchen"), poured))
    assert found.reached, (found.result.message, found.unmet)


KITCHEN = """
Prefix: : <http://example.org/home.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/home.owl>
Individual: home
    Types: knowrob:SemanticEnvironmentMap
Individual: table1
    Types: knowrob:KitchenTable
    Facts: knowrob:describedInMap home, knowrob:pose pose_table1,
        knowrob:depthOfObject 0.7, knowrob:widthOfObject 1.6, knowrob:heightOfObject 0.74
Individual: pose_table1
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "0.65 0.0 0.37", knowrob:quaternion "0 0 0 1"
Individual: bottle1
    Types: knowrob:DrinkingBottle
    Facts: knowrob:describedInMap home, knowrob:pose pose_bottle1,
        knowrob:depthOfObject 0.06, knowrob:widthOfObject 0.06, knowrob:heightOfObject 0.2
Individual: pose_bottle1
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "0.45 -0.15 0.84", knowrob:quaternion "0 0 0 1"
Individual: bowl1
    Types: knowrob:Bowl-Mixing
    Facts: knowrob:describedInMap home, knowrob:pose pose_bowl1, knowrob:capacity 500.0,
        knowrob:depthOfObject 0.2, knowrob:widthOfObject 0.2, knowrob:heightOfObject 0.1
Individual: pose_bowl1
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "0.45 0.2 0.79", knowrob:quaternion "0 0 0 1"
"""
WATER = """
Individual: water1
    Types: knowrob:Water
    Facts: knowrob:in-ContGeneric bottle1, knowrob:amount 400.0
"""
POUR_WATER = """
Prefix: : <http://example.org/pour_water.owl#>
Prefix: home: <http://example.org/home.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/pour_water.owl>
Individual: home:bottle1
    Types: knowrob:DrinkingBottle
Individual: home:bowl1
    Types: knowrob:Bowl-Mixing
Class: PourWater
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some PourIt
Class: PourIt
    SubClassOf: knowrob:FluidFlow-Translation, knowrob:objectActedOn value home:bottle1,
        knowrob:toLocation value home:bowl1, knowrob:amount value {amount}
"""


def poured(folder: Path, amount: float, content: str, goal: Callable[[Watched], Iterable[str]]) -> Judged:
    """Let Amigo pour out of a bottle into a bowl on the same table."""
    (folder / "pour.omn").write_text(POUR_WATER.format(amount=amount), encoding="utf-8")
    (folder / "home.omn").write_text(KITCHEN + content, encoding="utf-8")
    arguments = (str(folder / "pour.omn"), "--robot", "amigo", "--environment", str(folder / "home.omn"))
    return judged(Scenario("pour", arguments, goal))


@pytest.mark.long
def test_amigo_pours_the_amount_between_two_things_on_one_table(tmp_path: Path) -> None:
    def right(watched: Watched) -> Iterator[str]:
        if abs((amount := watched.world.matter.total("bowl1")) - 100.0) > 5.0:
            yield f"bowl1 holds {amount:.0f} ml"

    found = poured(tmp_path, 100.0, WATER, right)
    assert found.reached, (found.result.message, found.unmet)


@pytest.mark.long
def test_a_small_amount_is_poured_by_turning_the_vessel_over_less_far(tmp_path: Path) -> None:
    def right(watched: Watched) -> Iterator[str]:
        if abs((amount := watched.world.matter.total("bowl1")) - 20.0) > 5.0:
            yield f"bowl1 holds {amount:.0f} ml"

    found = poured(tmp_path, 20.0, WATER, right)
    assert found.reached, (found.result.message, found.unmet)


@pytest.mark.long
def test_where_a_vessel_would_be_turned_too_slowly_it_is_held_over_once_more_and_poured_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[str] = []

    def too_slow(pouring: Pouring, action: Action, *motion: Any) -> AmountNotPoured | None:
        if len(refused) < 2 and action.type.endswith("#Tilt"):  # also the motion that turns it over less far
            refused.append(action.type)
            return AmountNotPoured("slow")
        return whole(pouring, action, *motion)

    def right(watched: Watched) -> Iterator[str]:
        if abs((amount := watched.world.matter.total("bowl1")) - 100.0) > 5.0:
            yield f"bowl1 holds {amount:.0f} ml"

    whole = Pouring.too_slow
    monkeypatch.setattr(Pouring, "too_slow", too_slow)
    found = poured(tmp_path, 100.0, WATER, right)
    assert found.reached, (found.result.message, found.unmet)
    assert len(refused) == 2


@pytest.mark.long
def test_a_vessel_is_turned_back_as_it_was_turned_over_where_no_other_way_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_way(problem: Any, start: Any, phases: Any, before: Any = (), **options: Any) -> list[PhaseMotion]:
        if any(one.name == "VesselTilted" for one in before):
            raise NoConstrainedPath(0, (), ())
        return solved(problem, start, phases, before, **options)

    def right(watched: Watched) -> Iterator[str]:
        if abs((amount := watched.world.matter.total("bowl1")) - 100.0) > 5.0:
            yield f"bowl1 holds {amount:.0f} ml"

    solved = constrained_motions.solve_motion
    monkeypatch.setattr(constrained_motions, "solve_motion", one_way)
    found = poured(tmp_path, 100.0, WATER, right)
    assert found.reached, (found.result.message, found.unmet)


@pytest.mark.long
def test_the_camera_looks_for_nothing_while_a_vessel_is_turned_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[bool] = []

    def hidden(world: PyBulletWorld, camera_link: str) -> tuple[Detection, ...]:
        looks.append(held_by(world, "bottle1") == "robot" and world.pose("bottle1").rotation[2, 2] < 0)
        return tuple(shown for name, shown in world.shown(camera_link).items() if name != "bowl1")

    def right(watched: Watched) -> Iterator[str]:
        if abs((amount := watched.world.matter.total("bowl1")) - 100.0) > 5.0:
            yield f"bowl1 holds {amount:.0f} ml"

    monkeypatch.setattr(PyBulletWorld, "detect", hidden)
    found = poured(tmp_path, 100.0, WATER, right)
    assert found.reached, (found.result.message, found.unmet)
    assert looks
    assert not any(looks)


@pytest.mark.long
@pytest.mark.parametrize(
    ("amount", "content", "failure", "said"),
    [
        (100.0, "", "VesselEmpty", "nothing is known to be in bottle1"),
        (450.0, WATER, "AmountNotPoured", "450 ml were asked for, 0 ml were poured: bottle1 holds 400 ml"),
    ],
    ids=["empty", "too_much"],
)
def test_nothing_is_poured_if_the_amount_is_not_there(
    tmp_path: Path, amount: float, content: str, failure: str, said: str
) -> None:
    def untouched(watched: Watched) -> Iterator[str]:
        if watched.world.matter.total("bowl1") > 0:
            yield "something was poured"

    found = poured(tmp_path, amount, content, untouched)
    assert found.result.failures[0] == failure
    assert said in found.result.message
    assert not found.unmet
