"""Tests of worlds: repeated, counted, and failed if too few worlds are reached, with the commands that repeat these."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

TEST = """
    import pytest

    @pytest.mark.planlang_worlds(reached=0.8)
    def test_serving(world):
        assert world % 4, f"no way in {world}"
"""
"""Worlds 4, 8, 12 and so on are not reached."""


def test_worlds_that_are_too_few_fail_with_interval_causes_and_commands(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    result = pytester.runpytest_inprocess("--planlang-worlds", "12", "--junitxml=results.xml", "--strict-markers")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    test = "test_worlds_that_are_too_few_fail_with_interval_causes_and_commands.py::test_serving"
    result.stdout.fnmatch_lines(
        [
            f"{test}: 9 of 12 worlds reached, 75.0 % (95 %: 46.8 to 91.1 %); at least 80 % required",
            "not reached:",
            "  world 4: AssertionError: no way in 4",
            f"    pytest {test} --planlang-world 4",
            "  world 8: *",
            "*= worlds =*",
            f"{test}: 9 of 12 worlds *; not reached: 4, 8, 12",
            "*1 failed, 9 passed*3 not reached*",
        ]
    )
    cases = list(ElementTree.parse(pytester.path / "results.xml").iter("testcase"))
    assert [one.attrib["name"] for one in cases if one.find("failure") is not None] == ["test_serving"]
    assert len(cases) == 13


def test_worlds_that_are_enough_pass_and_say_which_were_not_reached(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    result = pytester.runpytest_inprocess()
    assert result.ret == pytest.ExitCode.OK
    result.stdout.fnmatch_lines(["*.py::test_serving: 8 of 10 worlds *; at least 80 % required; not reached: 4, 8"])


def test_one_world_is_a_usual_test(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    for words, failed in ((("--planlang-world", "4"), 1), (("--planlang-world", "44"), 1), (("-k", "world4"), 1)):
        result = pytester.runpytest_inprocess(*words)
        result.assert_outcomes(failed=failed)
        assert "no way in 4" in result.stdout.str()
        assert "worlds reached" not in result.stdout.str()
    pytester.runpytest_inprocess("--planlang-world", "5").assert_outcomes(passed=1)


def test_plan_failures_count_and_mistakes_skips_and_other_tests_are_as_ever(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
        import pytest
        from planlang import *
        from planlang.failures import GraspMissed

        async def grasp(world):
            if world == 2:
                raise GraspMissed("too wide")

        @pytest.mark.parametrize("robot", ["amigo", "pr2"])
        @pytest.mark.planlang_worlds(reached=1, worlds=3)
        def test_grasp(scripted_run, world, robot):
            if robot == "amigo":
                scripted_run(lambda: grasp(world)).value

        @pytest.mark.planlang_worlds(reached=0, worlds=3, first=0)
        def test_mistake(world):
            if world == 1:
                pytest.skip("not this one")
            1 / world

        def test_other():
            assert 1 == 2
    """)
    result = pytester.runpytest_inprocess("--plan-trace")
    result.assert_outcomes(passed=6, failed=3, skipped=1)
    result.stdout.fnmatch_lines(
        [
            "*::test_grasp[[]amigo]: 2 of 3 worlds reached*",
            "  world 2: planlang.failures.*GraspMissed: too wide",
            "    pytest 'test_*.py::test_grasp[[]world2-amigo]' --planlang-world 2",
            "*::test_grasp[[]pr2]: 3 of 3 worlds reached, 100.0 % (95 %: 43.9 to 100.0 %); at least 100 % required",
            "*::test_mistake: 1 of 1 worlds*",
        ]
    )
    assert "ZeroDivisionError" in result.stdout.str()


@pytest.mark.long
def test_worlds_are_counted_over_the_workers_of_xdist(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST)
    result = pytester.runpytest_subprocess("-p", "xdist", "-n", "2", "--planlang-worlds", "9")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*::test_serving: 7 of 9 worlds reached*", "*1 failed, 7 passed*2 not reached*"])


@pytest.mark.parametrize(
    ("mark", "told"),
    [
        ("()", "write planlang_worlds(reached=0.9), and worlds=20 or first=1 if wanted"),
        ("(0.9)", "write planlang_worlds(reached=0.9)"),
        ("(reached=90)", "reached=90 is no share from 0 to 1"),
        ("(reached=0.9, worlds=0)", "worlds is an integer from 1 on"),
        ("(reached=0.9, word=1)", "write planlang_worlds(reached=0.9)"),
    ],
)
def test_a_wrong_mark_is_told(mark: str, told: str, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST.replace("(reached=0.8)", mark))
    result = pytester.runpytest_inprocess()
    assert result.ret == pytest.ExitCode.INTERRUPTED
    assert told in result.stdout.str()


def test_a_test_of_worlds_takes_its_world_and_numbers_of_worlds_are_checked(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TEST.replace("(world)", "()"))
    assert "write def test_serving(world), which gets the seed" in pytester.runpytest_inprocess().stdout.str()
    assert "'0' is no integer from 1 on" in pytester.runpytest_inprocess("--planlang-worlds=0").stderr.str()
