"""The pytest plugin: fixtures ``scripted_run`` and ``script``, readable counts, short tracebacks, and options.

``--plan-trace`` shows the task tree of each plan that a failing test ran; ``--planlang-report`` writes an HTML report.
``--planlang-worlds`` and ``--planlang-world`` choose worlds (:mod:`planlang.testing.worlds`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

from planlang.kernel.tracebacks import VARIABLE, without_internals
from planlang.testing import running, worlds
from planlang.testing.history import Count
from planlang.testing.running import PlanRun, run_plan
from planlang.testing.script import Script


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the plugin."""
    group = parser.getgroup("planlang")
    group.addoption("--plan-trace", action="store_true", help="show the task tree of the plans that a failing test ran")
    group.addoption(
        "--planlang-report", metavar="DIR", type=Path, help="write an HTML report of each plan that a failing test ran"
    )
    worlds.add_options(group)


def pytest_configure(config: pytest.Config) -> None:
    """Add what repeats tests over worlds."""
    config.pluginmanager.register(worlds.Worlds(config), "planlang-worlds")


@pytest.fixture
def script() -> Script:
    """Empty script: every action of the vocabulary succeeds after a second."""
    return Script()


@pytest.fixture
def scripted_run(script: Script) -> Callable[..., PlanRun[Any]]:
    """Function that runs a plan with the test's ``script``: ``run = scripted_run(serve)``; options as in run_plan."""

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
    running.recent_runs.clear()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, None]:
    """Hide planlang's own frames in the report of a failing test, and add the task trees."""
    if call.excinfo is not None:
        trimmed = without_internals(call.excinfo.value).__traceback__
        assert trimmed is not None  # the frame of the test remains
        call.excinfo.traceback = type(call.excinfo.traceback)(trimmed)
    outcome = yield
    report: pytest.TestReport = outcome.get_result()
    if report.when != "call" or not report.failed:
        return
    runs = running.recent_runs
    for number, ended in enumerate(runs, 1):
        which = "" if len(runs) == 1 else f" {number} of {len(runs)}"
        if item.config.getoption("--plan-trace"):
            report.sections.append((f"plan trace{which}", f"{ended!r}\n{ended.tree()}"))
        if (folder := item.config.getoption("--planlang-report")) is not None:
            report.sections.append((f"plan report{which}", str(_page(ended, folder, item.nodeid, number))))


def _page(ended: PlanRun[Any], folder: Path, test: str, number: int) -> Path:
    """Write the HTML report of a run into a folder; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', test)[-150:].strip('-')}-{number}.html"
    ended.report(file)
    return file


def pytest_assertrepr_compare(config: pytest.Config, op: str, left: object, right: object) -> list[str] | None:
    """Describe each attempt when a comparison of their number fails."""
    count = left if isinstance(left, Count) else right
    if not isinstance(count, Count):
        return None
    return [f"{count.step} began {int(count)} times: {left} {op} {right}", *count.explained()]
