"""Recipes reach their goals in the simulator's truth.

Where a page shows what the command prints, the goal is asked of the same run by ``tests/repository``.
"""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from executive.modules.tools.motion_grounding import GroundedMotion
from executive.modules.tools.wiping import Wiping
from executive.runs.options import Outcome
from planlang.failures import ManipulationGoalInCollision
from planlang.protocols import Trajectory
from tests.support.extras import robot_marks
from tests.support.pages import shown_commands
from tests.support.scenarios import CORPUS, Scenario, judged, scenarios

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "published_recipes.md"
SHOWN = [shlex.split(command)[1:] for command in shown_commands() if command.startswith("planlang run")]
OTHERS = [one for one in scenarios().values() if not any(map(one.is_run_by, SHOWN))]


@pytest.mark.long
@pytest.mark.parametrize("scenario", [pytest.param(one, id=one.name, marks=robot_marks(one.command)) for one in OTHERS])
def test_a_recipe_reaches_its_goal(scenario: Scenario) -> None:
    if scenario.needs_corpus and not CORPUS.is_dir():
        pytest.skip("the corpus of real OWL files is not beside this checkout")
    found = judged(scenario)
    assert found.reached, (found.result.message, found.unmet)


def test_the_documentation_has_the_command_of_every_scenario() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert [one.command for one in scenarios().values() if one.command not in page] == []


@pytest.mark.long
@pytest.mark.pr2
def test_a_pancake_that_the_spatula_did_not_take_along_is_not_flipped(
    corpus: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sim.processes.NEAR_BLADE", -1.0)
    found = judged(scenarios()["flipping"])
    assert found.result.failures[0] == "ObjectNotTurned"


@pytest.mark.long
def test_a_lane_in_which_something_stops_the_hand_does_not_end_the_wiping(monkeypatch: pytest.MonkeyPatch) -> None:
    going, gone = Wiping.gone, []

    async def gone_but_once(self: Wiping, motion: GroundedMotion, trajectory: Trajectory) -> None:
        gone.append(trajectory)
        if len(gone) == 2:
            raise ManipulationGoalInCollision(arm=motion.arms[0].name, blocked_by="cup1")
        await going(self, motion, trajectory)

    monkeypatch.setattr(Wiping, "gone", gone_but_once)
    one = scenarios()["wipe_table"]
    found = judged(replace(one, arguments=tuple("amigo" if word == "pr2" else word for word in one.arguments)))
    assert found.result.outcome is Outcome.DONE, found.result.message
    assert len(gone) > 2
