"""Tests of plans in many worlds, which pass if the share of worlds that are reached is at least a bound.

A test with the mark ``planlang_worlds(reached=0.9)`` runs once for each world and takes its seed as ``world``. Each
world is a test of its own, so that pytest-xdist runs them in parallel. A world is not reached if its test fails by an
assertion or a plan failure; that alone fails nothing. Once all worlds of a test have run, the process that started
pytest counts them, and reports a failed test if they are too few.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Generator, Iterator, Sequence
from typing import Any

import pytest

from planlang.plan_failure import PlanFailure
from planlang.proportions import wilson
from planlang.records import dataclass

MARK, ARGUMENT = "planlang_worlds", "world"
"""The mark of a test, and the argument that has the seed."""
NUMBER = 10
"""Number of worlds unless the mark or the command states it."""
MOST_LISTED = 10
"""Maximum number of worlds that a message lists with their commands."""
_LONGEST = 300
"""Maximum length of a reason [characters]."""
_RESULT = "planlang_world"
"""Attribute of a report that has the result of a world, as JSON: reports pass from process to process."""
_NOT_REACHED = (AssertionError, PlanFailure, pytest.fail.Exception)
"""What fails in a world that is not reached; anything else is a mistake in the test, whatever the world."""


@dataclass(frozen=True, slots=True)
class Bound:
    """What a test requires of its worlds."""

    reached: float
    """Least share of worlds."""
    worlds: int
    first: int

    @classmethod
    def of(cls, mark: pytest.Mark, number: int | None) -> Bound:
        """Read the mark; ``number`` is that of the command. Fails the collection of the test if it is wrong."""
        known = {"reached": None, "worlds": NUMBER, "first": 1}
        if mark.args or "reached" not in mark.kwargs or not mark.kwargs.keys() <= known.keys():
            pytest.fail(f"write {MARK}(reached=0.9), and worlds=20 or first=1 if wanted", pytrace=False)
        values: dict[str, Any] = {**known, **mark.kwargs}
        share, worlds, first = values["reached"], values["worlds"], values["first"]
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share <= 1:
            pytest.fail(f"{MARK}: reached={share!r} is no share from 0 to 1", pytrace=False)
        if not isinstance(worlds, int) or worlds < 1 or not isinstance(first, int) or first < 0:
            pytest.fail(f"{MARK}: worlds is an integer from 1 on, first one from 0 on", pytrace=False)
        return cls(float(share), worlds if number is None else number, first)


@dataclass(frozen=True, slots=True)
class _World:
    """Result of a test in a world."""

    seed: int
    is_reached: bool
    reason: str
    node: str
    """Identifier of the test in this world."""


class _Results:
    """Results of a test in its worlds."""

    def __init__(self, test: str, bound: float, location: tuple[str, int | None, str]) -> None:
        self.test, self.bound, self.location = test, bound, location
        self.worlds: list[_World] = []

    @property
    def missed(self) -> Sequence[_World]:
        """Worlds that were not reached, by their seeds."""
        return sorted((one for one in self.worlds if not one.is_reached), key=lambda one: one.seed)

    @property
    def is_enough(self) -> bool:
        """True if the share of worlds is at least the bound."""
        return len(self.worlds) - len(self.missed) >= self.bound * len(self.worlds) - 1e-9

    def line(self) -> str:
        """The share with its interval, and the bound."""
        total = len(self.worlds)
        count = total - len(self.missed)
        low, high = (f"{100 * end:.1f}" for end in wilson(count, total))
        share = f"{count} of {total} worlds reached, {100 * count / total:.1f} % (95 %: {low} to {high} %)"
        return f"{self.test}: {share}; at least {100 * self.bound:g} % required"

    def lines(self) -> Iterator[str]:
        """All that a failed test says: also worlds that were not reached, with the commands that repeat them."""
        yield self.line()
        yield "not reached:"
        for one in self.missed[:MOST_LISTED]:
            yield f"  world {one.seed}: {one.reason}"
            yield f"    pytest {shlex.quote(one.node if '[' in self.test else self.test)} --planlang-world {one.seed}"
        if rest := self.missed[MOST_LISTED:]:
            yield f"  and {len(rest)} more: {', '.join(str(one.seed) for one in rest)}"


def add_options(group: pytest.OptionGroup) -> None:
    """Add ``--planlang-worlds`` and ``--planlang-world``."""
    group.addoption(
        "--planlang-worlds",
        metavar="N",
        type=_number(1),
        help=f"run tests of worlds in N worlds each, instead of as many as their mark says (default: {NUMBER})",
    )
    group.addoption(
        "--planlang-world", metavar="SEED", type=_number(0), help="run tests of worlds in this world, and in no other"
    )


def _number(least: int) -> Any:
    def number(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is no integer from {least} on")
        return int(text)

    return number


class Worlds:
    """The part of the plugin that repeats tests over worlds, and counts."""

    def __init__(self, config: pytest.Config) -> None:
        self._number: int | None = config.getoption("--planlang-worlds")
        self._only: int | None = config.getoption("--planlang-world")
        self._bounds: dict[str, Bound] = {}
        """Tests of which all worlds are run."""
        self._results: dict[str, _Results] = {}
        self._is_worker = hasattr(config, "workerinput")
        """True in a worker of pytest-xdist, which sees some of the worlds."""
        text = f"{MARK}(reached, worlds={NUMBER}, first=1): run in many worlds; pass if this share of them is reached"
        config.addinivalue_line("markers", text)

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Repeat a marked test over its worlds."""
        mark = metafunc.definition.get_closest_marker(MARK)
        if mark is None:
            return
        bound = Bound.of(mark, self._number)
        if ARGUMENT not in metafunc.fixturenames:
            name = metafunc.function.__name__
            pytest.fail(f"{MARK}: write def {name}({ARGUMENT}), which gets the seed of a world", pytrace=False)
        seeds = range(bound.first, bound.first + bound.worlds) if self._only is None else (self._only,)
        metafunc.parametrize(ARGUMENT, seeds, ids=[_named(seed) for seed in seeds])

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Find the tests of which all worlds run; where ``-k`` or an identifier chose some, each is a usual test."""
        found: dict[str, list[pytest.Mark]] = {}
        for item in items:
            mark = item.get_closest_marker(MARK)
            if mark is not None and self._only is None:
                found.setdefault(_test_of(item), []).append(mark)
        bounds = {test: (Bound.of(marks[0], self._number), len(marks)) for test, marks in found.items()}
        self._bounds = {test: bound for test, (bound, number) in bounds.items() if number == bound.worlds}

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Add the result of a world to its report; a world that is not reached fails nothing."""
        report = yield
        if report.when != "call" or report.skipped or item.get_closest_marker(MARK) is None:
            return report
        bound, reason = self._bounds.get(_test_of(item)), ""
        if bound is None:
            return report
        if call.excinfo is not None:
            if not isinstance(call.excinfo.value, _NOT_REACHED):
                return report
            reason = " ".join(call.excinfo.exconly().partition("\n")[0].split())[:_LONGEST]
            report.outcome = "skipped"
            report.wasxfail = reason
        world = {"seed": _seed_of(item), "is_reached": call.excinfo is None, "reason": reason, "node": item.nodeid}
        setattr(report, _RESULT, {"test": _test_of(item), "bound": bound.reached, "world": world})
        return report

    @pytest.hookimpl(tryfirst=True)
    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """Call a world that is not reached by this name."""
        result = getattr(report, _RESULT, None)
        return None if result is None or report.passed else ("not reached", "n", "NOT REACHED")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the result of a world."""
        result = getattr(report, _RESULT, None)
        if result is not None and not self._is_worker:
            file, line, name = report.location
            name = name.partition("[")[0] + "".join(result["test"].partition("[")[1:])
            new = _Results(result["test"], result["bound"], (file, line, name))
            self._results.setdefault(result["test"], new).worlds.append(_World(**result["world"]))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtestloop(self, session: pytest.Session) -> Generator[None, object, object]:
        """Report a failed test for each whose share of worlds is below its bound."""
        result = yield
        failed = [one for one in self._results.values() if not one.is_enough]
        session.testscollected += len(failed)  # for the progress in the terminal
        for one in failed:
            report = pytest.TestReport(one.test, one.location, {}, "failed", "\n".join(one.lines()), "call")
            session.config.hook.pytest_runtest_logreport(report=report)
        return result

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the share of each test, and the worlds that were not reached."""
        if not self._results:
            return
        terminalreporter.section("worlds")
        for one in self._results.values():
            missed = ", ".join(str(world.seed) for world in one.missed)
            terminalreporter.line(f"{one.line()}; not reached: {missed}" if missed else one.line())


def _seed_of(item: pytest.Item) -> int:
    seed: int = item.callspec.params[ARGUMENT]  # type: ignore[attr-defined]
    return seed


def _named(seed: int) -> str:
    return f"world{seed}"


def _test_of(item: pytest.Item) -> str:
    """Identifier of the test without its world."""
    identifier: str = item.callspec.id  # type: ignore[attr-defined]
    rest = identifier.split("-")
    rest.remove(_named(_seed_of(item)))
    return item.nodeid.removesuffix(f"[{identifier}]") + (f"[{'-'.join(rest)}]" if rest else "")
