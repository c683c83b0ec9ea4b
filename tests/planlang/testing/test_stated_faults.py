"""A scripted test states faults of steps in the grammar of all faults."""

from __future__ import annotations

import pytest

from planlang import perform, plan
from planlang.designators import action
from planlang.faults.named import WrongFault
from planlang.testing import UnusedRule, run_plan


@plan
async def reach() -> None:
    await perform(action("Reaching"))


def test_the_step_fails_as_stated() -> None:
    run = run_plan(reach, faults=["step.Reaching:fails=ManipulationGoalNotReached"])
    assert type(run.failure).__name__ == "ManipulationGoalNotReached"


def test_a_stated_fault_that_did_not_happen_is_an_error() -> None:
    with pytest.raises(UnusedRule, match=r"step\.Reaching:fails=GraspMissed@2"):
        run_plan(reach, faults=["step.Reaching:fails=GraspMissed@2"])
    assert run_plan(reach, faults=["step.Reaching:fails=GraspMissed@2"], allow_unused=True).failure is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gripper:misses", "only steps fail"),
        ("step.Reaching:fails=GraspMised", "did you mean GraspMissed?"),
        ("step.Reaching:fails=GraspMissed@3s-8s", "state a number"),
        ("step:fails=GraspMissed", "name a step and its failure"),
    ],
)
def test_what_cannot_go_wrong_in_a_scripted_run_is_refused(text: str, said: str) -> None:
    with pytest.raises(WrongFault, match=said.replace("?", r"\?")):
        run_plan(reach, faults=[text])
