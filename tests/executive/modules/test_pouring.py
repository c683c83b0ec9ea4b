"""Pouring: for how long a vessel flows in a motion, and that what has flowed is not poured once more."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.modules.pouring import Flow
from planlang.geometry import Pose
from sim.world import PyBulletWorld, held_by
from tests.support.extras import skip_without_pr2
from tests.support.scenarios import Scenario, Watched, judged

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


@given(st.lists(st.booleans(), min_size=1, max_size=30), st.integers(0, 60))
def test_a_vessel_flows_while_it_is_turned_over_and_after_the_motion_if_it_ends_so(
    turned: list[bool], steps: int
) -> None:
    flow = Flow("cup1", cast(Any, SimpleNamespace()), Pose((0.0, 0.0, 0.0)), np.array(turned))
    states = turned + [turned[-1]] * 60
    assert flow.steps(steps) == sum(states[:steps])


@pytest.mark.long
def test_when_the_vessel_is_lost_in_mid_pour_only_the_rest_is_poured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    skip_without_pr2("--robot pr2")
    step, over = PyBulletWorld.step, [0]

    def stepped(world: PyBulletWorld) -> None:
        if held_by(world, "cup1") == "robot" and world.pose("cup1").rotation[2, 2] < 0:
            over[0] += 1
            if over[0] == 60:
                world.release("cup1")
        step(world)

    def poured(watched: Watched) -> Iterator[str]:
        """The amount is in the pan, and was poured in two parts."""
        amount = watched.world.changes.matter.total("PancakeMix_on_pan1")
        if over[0] <= 60 or abs(amount - 120.0) > 1.0:
            yield f"{amount:.1f} ml were poured in {over[0]} steps"

    monkeypatch.setattr(PyBulletWorld, "step", stepped)
    recipe = tmp_path / "pour.omn"
    recipe.write_text(POUR, encoding="utf-8")
    found = judged(Scenario("pour", (str(recipe), "--robot", "pr2", "--environment", "stove_kitchen"), poured))
    assert found.reached, (found.result.message, found.unmet)
