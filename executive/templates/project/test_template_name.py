"""Tests of the plan compiled from template_name.omn; a scripted robot performs the actions."""

from planlang.failures import GraspMissed
from planlang.testing import compiled

PLAN = compiled("template_name.omn")


def test_the_cup_ends_on_the_cabinet(scripted_run):
    run = scripted_run(PLAN)
    assert run.belief.at == {"cup1": "cabinet1"}


def test_a_missed_grasp_is_tried_again(scripted_run, script):
    script.on("ClosingAGripper", fails=GraspMissed, times=1, after=1.5)
    run = scripted_run(PLAN)
    assert run.attempts("ClosingAGripper") == 2
    assert run.belief.at == {"cup1": "cabinet1"}
