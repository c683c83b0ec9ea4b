"""The pytest plugin: fixtures ``scripted_run`` and ``script``, readable counts, short tracebacks, ``--plan-trace``."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

import pytest

from planlang.kernel.tracebacks import VARIABLE, without_internals
from planlang.testing import running
from planlang.testing.history import Count
from planlang.testing.running import PlanRun, run_plan
from planlang.testing.script import Script


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--plan-trace``."""
    group = parser.getgroup("planlang")
    group.addoption("--plan-trace", action="store_true", help="show the task tree of the plans that a failing test ran")


@pytest.fixture
def script() -> Script:
    """Return an empty script: every ordinary action succeeds after a second."""
    return Script()


@pytest.fixture
def scripted_run(script: Script) -> Callable[..., PlanRun[Any]]:
    """Run plans in virtual time with the test's ``script``: ``run = scripted_run(serve)``; options as in run_plan."""

    def run(plan: Callable[[], Any], **options: Any) -> PlanRun[Any]:
        if "executive" not in options:
            options.setdefault("script", script)
        return run_plan(plan, **options)

    return run


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, None, None]:
    """Keep planlang's own frames in tracebacks with ``pytest --full-trace``."""
    with pytest.MonkeyPatch.context() as patch:
        if item.config.getoption("fulltrace"):
            patch.setenv(VARIABLE, "1")
        yield


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Forget the runs of earlier tests."""
    running.made.clear()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, None]:
    """Hide planlang's own frames in the report of a failing test, and add the task trees."""
    if call.excinfo is not None:
        shown = without_internals(call.excinfo.value).__traceback__
        assert shown is not None  # of the test, at least
        call.excinfo.traceback = type(call.excinfo.traceback)(shown)
    outcome = yield
    report: pytest.TestReport = outcome.get_result()
    if report.when == "call" and report.failed and item.config.getoption("--plan-trace"):
        for number, ended in enumerate(running.made, 1):
            title = "plan trace" if len(running.made) == 1 else f"plan trace {number} of {len(running.made)}"
            report.sections.append((title, f"{ended!r}\n{ended.tree()}"))


def pytest_assertrepr_compare(config: pytest.Config, op: str, left: object, right: object) -> list[str] | None:
    """Say how each attempt went when their number is not the expected one."""
    count = left if isinstance(left, Count) else right
    if not isinstance(count, Count):
        return None
    return [f"{count.step} began {int(count)} times: {left} {op} {right}", *count.explained()]
