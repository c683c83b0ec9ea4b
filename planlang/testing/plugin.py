"""The pytest plugin: fixtures ``plan`` and ``script``, readable counts, and ``--plan-trace``."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

import pytest

from planlang.testing import running
from planlang.testing.running import PlanRun, run_plan
from planlang.testing.script import Script
from planlang.testing.verdicts import Count


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--plan-trace``."""
    group = parser.getgroup("planlang")
    group.addoption("--plan-trace", action="store_true", help="show the task tree of the plans that a failing test ran")


@pytest.fixture
def script() -> Script:
    """An empty script: every ordinary action succeeds after a second."""
    return Script()


@pytest.fixture
def plan(script: Script) -> Callable[..., PlanRun[Any]]:
    """``plan(serve_a_drink)`` runs a plan in virtual time with the test's ``script``; see planlang.testing.run_plan."""

    def run(plan: Callable[[], Any], **options: Any) -> PlanRun[Any]:
        if "executive" not in options:
            options.setdefault("script", script)
        return run_plan(plan, **options)

    return run


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Runs are shown with the test that made them."""
    running.made.clear()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, None]:
    """Add the task trees to the report of a failing test."""
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
