"""Short form of the benchmark of two things in two hands."""

from __future__ import annotations

import pytest

from tests.benchmarks.homes.trial import task_of
from tests.benchmarks.two_hands import TEMPLATES, cases, counted, job, reordered


def test_half_of_the_tasks_bring_first_what_was_taken_last():
    one, other = (reordered(task_of(case), case.seed) for case in cases(2, robots=["amigo"]))
    assert len({step.facts[0] for step in one.steps}) == 2
    for seed in (0, 1):
        taken, brought = (reordered(other, seed).steps[:2], reordered(other, seed).steps[2:])
        order = [step.facts[0] for step in brought]
        assert [step.facts[0] for step in taken] == (order[::-1] if seed else order)


def test_forty_tasks_are_of_both_templates_and_robots_alike():
    drawn = list(cases(40))
    assert len({(case.template, case.seed, case.robot) for case in drawn}) == 40
    assert {sum(case.template == name for case in drawn) for name in TEMPLATES} == {20}


@pytest.mark.long
@pytest.mark.parametrize(("robot", "seed"), [("amigo", 2), pytest.param("pr2", 3, marks=pytest.mark.pr2)])
def test_two_things_are_carried_at_once_and_none_is_dropped(robot: str, seed: int):
    row = job({"template": "two_in_two_hands", "seed": seed, "robot": robot})
    assert (row["reached"], row["at_once"], row["dropped"]) == (True, 2, {}), row
    assert counted([row]).startswith(f"{robot}: 1 of 1 reached, 1 with both hands full at once, 0 dropped")
