"""The pytest plugin: installed is enough; fixtures, readable failures, task trees."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest

PLAN = """
    from functools import partial
    from planlang import *
    from planlang.failures import GraspMissed

    async def serve():
        close = partial(perform, action("ClosingAGripper"), name="CloseGripper")
        await with_failure_handling(close, Recovery(GraspMissed, retries=2))
        await par(look=partial(sleep, 1), listen=partial(sleep, 2))
        return "served"
"""


@pytest.mark.long
def test_installing_planlang_is_enough(pytester: pytest.Pytester) -> None:
    (found,) = [point for point in entry_points(group="pytest11") if point.name == "planlang"]
    assert found.value == "planlang.testing.plugin"
    pytester.makepyfile(PLAN + "    def test_it(scripted_run):\n        assert scripted_run(serve).value == 'served'\n")
    result = pytester.runpytest_subprocess("-W", "error", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=1)
    assert result.ret == 0


CHECKOUT = Path(__file__).resolve().parents[3]


def test_planlang_testing_works_without_pytest() -> None:
    code = (
        "import sys; sys.modules['pytest'] = None\n"
        "from planlang import action, perform\n"
        "from planlang.testing import run_plan\n"
        "print(run_plan(lambda: perform(action('Reaching'))).seconds)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.stdout, ran.stderr) == ("1.0\n", "")


def test_the_extra_test_brings_the_plugins_that_a_checkout_loads_and_the_pages_name_it() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
    loaded = re.findall(r"-p (\S+)", project["tool"]["pytest"]["ini_options"]["addopts"])
    assert loaded == ["xdist", "_hypothesis_pytestplugin", "planlang.testing.plugin", "pytester"]
    brought = {name.partition(">")[0] for name in project["project"]["optional-dependencies"]["test"]}
    assert brought == {"pytest", "pytest-xdist", "hypothesis"}
    for page in ("README.md", "docs/guides/testing.md"):
        assert ".venv/bin/pip install --editable '.[test]'" in (CHECKOUT / page).read_text(encoding="utf-8")


def test_fixtures_give_a_runner_and_its_script(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        PLAN
        + """
    def test_script(scripted_run, script):
        script.on("CloseGripper", fails=GraspMissed, times=1)
        run = scripted_run(serve, seed=3)
        assert run.attempts("CloseGripper") == 2
        assert run.events[0]["seed"] == 3

    def test_the_script_of_another_test_is_gone(scripted_run):
        assert scripted_run(serve).attempts("CloseGripper") == 1

    def test_another_script(scripted_run):
        from planlang.testing import Script
        assert scripted_run(serve, script=Script(takes=5)).seconds == 7
"""
    )
    pytester.runpytest_inprocess().assert_outcomes(passed=3)


FAILING = (
    PLAN
    + """
    def test_count(scripted_run, script):
        script.on("CloseGripper", fails=GraspMissed, times=1)
        assert scripted_run(serve).attempts("CloseGripper") == 3

    def test_order(scripted_run):
        assert scripted_run(serve).happened_before("look", "CloseGripper")

    def test_failure(scripted_run, script):
        script.on("CloseGripper", fails=GraspMissed)
        assert scripted_run(serve).value == "served"
"""
)


def test_a_wrong_number_of_attempts_says_how_each_went(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILING)
    result = pytester.runpytest_inprocess("-k", "count")
    result.stdout.fnmatch_lines(
        [
            "*assert CloseGripper began 2 times: 2 == 3",
            "*CloseGripper, attempt 1: 0 to 1 s, failed with GraspMissed: the gripper closed on nothing",
            "*CloseGripper, attempt 2: 1 to 2 s, succeeded",
        ]
    )
    assert "plan trace" not in result.stdout.str()


def test_a_wrong_answer_says_why(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILING)
    result = pytester.runpytest_inprocess("-k", "order")
    result.stdout.fnmatch_lines(["*assert <no: look (1 to 2 s, succeeded); CloseGripper (0 to 1 s, succeeded)>"])


def test_plan_trace_shows_the_task_tree_of_a_failing_test(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILING)
    result = pytester.runpytest_inprocess("--plan-trace", "-k", "failure")
    result.stdout.fnmatch_lines(
        [
            "*plan trace*",
            "<run of serve: raised GraspMissed after 3 s>",
            "serve: 0 to 3 s, failed",
            "  with_failure_handling: 0 to 3 s, failed",
            "    CloseGripper, ClosingAGripper(): 0 to 1 s, failed with GraspMissed: *",
            "    CloseGripper#2, ClosingAGripper(): 1 to 2 s, failed with GraspMissed: *",
        ]
    )


def test_plan_trace_shows_only_the_runs_of_the_failing_test(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        PLAN
        + """
    def test_good(scripted_run):
        assert scripted_run(serve).value == "served"

    def test_two_runs(scripted_run, script):
        scripted_run(serve)
        script.on("CloseGripper", fails=GraspMissed)
        assert scripted_run(serve).failure is None

    def test_without_a_plan():
        assert 1 == 2

    def test_a_programming_error(scripted_run):
        async def wrong():
            await sleep(1)
            return 1 / 0
        scripted_run(wrong)
"""
    )
    result = pytester.runpytest_inprocess("--plan-trace")
    result.assert_outcomes(passed=1, failed=3)
    result.stdout.fnmatch_lines(["*plan trace 1 of 2*", "*plan trace 2 of 2*", "<run of wrong: raised ZeroDivision*"])
    assert result.stdout.str().count("plan trace") == 3


INSIDE = """
    from planlang import *
    from planlang.failures import GraspMissed
    from planlang.testing import run_plan

    async def grasp():
        await sleep(1)
        raise GraspMissed

    async def broken():
        return 1 / 0

    def test_failure():
        run_plan(lambda: par(lambda: timeout(5, grasp))).value

    def test_error():
        run_plan(lambda: par(lambda: timeout(5, broken)))

    def test_misuse():
        run_plan(lambda: par(grasp()))
"""


@pytest.mark.long
def test_tracebacks_show_the_lines_of_plan_and_test_only(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(INSIDE)
    shown = pytester.runpytest_inprocess("--tb=short").stdout.str()
    assert {"raise GraspMissed", "return 1 / 0"} <= {line.strip() for line in shown.splitlines()}
    assert "has to be a branch" in shown or "you called grasp()" in shown
    assert "planlang/kernel" not in shown
    assert "planlang/language" not in shown
    assert "planlang/kernel" in pytester.runpytest_inprocess("--tb=short", "--full-trace").stdout.str()


def test_an_error_of_planlang_itself_is_shown_with_all_its_frames(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planlang.language.budgets._TIMEOUT", None)
    pytester.makepyfile(INSIDE)
    shown = pytester.runpytest_inprocess("--tb=short", "-k", "test_failure").stdout.str()
    assert "planlang/language/budgets.py" in shown


def test_the_example_of_the_documentation_is_the_file_that_runs_and_short() -> None:
    example = (CHECKOUT / "tests" / "examples" / "test_serving.py").read_text(encoding="utf-8")
    page = (CHECKOUT / "docs" / "guides" / "testing.md").read_text(encoding="utf-8")
    assert f'```python title="test_serving.py"\n{example}```' in page
    assert len(example.splitlines()) < 60


def test_planlang_report_leaves_a_page_of_each_plan_of_a_failing_test(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(FAILING)
    result = pytester.runpytest_inprocess("--planlang-report", "pages", "-k", "failure")
    pages = sorted((pytester.path / "pages").iterdir())
    assert len(pages) == 1
    result.stdout.fnmatch_lines([f"*{pages[0].name}"])
    assert '"status":"failed"' in pages[0].read_text(encoding="utf-8")
