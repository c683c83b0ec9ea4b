"""Tests of template_name.py: a scripted robot performs the actions, in milliseconds."""

from template_name import template_name

from planlang.failures import GraspMissed


def test_the_bottle_is_taken(scripted_run):
    run = scripted_run(template_name)
    assert run.belief.holding == ["DrinkingBottle"]


def test_a_missed_grasp_is_tried_again(scripted_run, script):
    script.on("Close", fails=GraspMissed, times=2, after=1.5)
    run = scripted_run(template_name)
    assert run.attempts("Close") == 3
    assert run.belief.holding == ["DrinkingBottle"]
