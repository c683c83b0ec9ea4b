"""Tracebacks show the lines of a plan and of whoever runs it; planlang's own frames on request."""

from __future__ import annotations

import traceback
from functools import partial
from pathlib import Path

import pytest

from planlang import *
from planlang.failures import GraspMissed, ObjectUnfetchable
from planlang.testing import run_plan


async def grasp() -> None:
    await sleep(1)
    raise GraspMissed


async def wrong() -> float:
    await sleep(1)
    return 1 / 0


def raised(body: object) -> BaseException:
    """Run a plan in which the body stands in several constructs; return what the run raises."""
    with pytest.raises(BaseException) as caught:  # noqa: PT011 - of any class
        run(partial(par, partial(timeout, 5, body), partial(sleep, 9)), host=VirtualHost())
    return caught.value


def files(error: BaseException | None) -> list[str]:
    """The files of the frames below the call of run, in order."""
    assert error is not None
    return [Path(frame.filename).name for frame in traceback.extract_tb(error.__traceback__)]


@pytest.mark.parametrize(("body", "line"), [(grasp, "raise GraspMissed"), (wrong, "return 1 / 0")])
def test_a_failing_plan_shows_its_own_lines_and_the_call_of_run(body: object, line: str) -> None:
    error = raised(body)
    assert files(error) == ["test_tracebacks.py", "test_tracebacks.py"]
    assert traceback.extract_tb(error.__traceback__)[-1].line == line
    assert len("".join(traceback.format_exception(error)).splitlines()) <= 10


async def times_backwards() -> None:
    await timeout(-1, grasp)


async def recovers_without_the_failure() -> None:
    Recovery(GraspMissed, grasp)  # type: ignore[arg-type]


@pytest.mark.parametrize("misuses", [times_backwards, recovers_without_the_failure])
def test_misuse_ends_in_the_line_of_the_plan(misuses: object) -> None:
    assert files(raised(misuses)) == ["test_tracebacks.py", "test_tracebacks.py"]


def test_causes_show_lines_of_the_plan_only() -> None:
    body = partial(with_failure_handling, grasp, Recovery(GraspMissed, otherwise=ObjectUnfetchable))
    error = raised(body)
    assert isinstance(error, ObjectUnfetchable)
    assert files(error) == ["test_tracebacks.py"]
    assert files(error.__cause__) == ["test_tracebacks.py"]


def test_a_deadlock_shows_who_ran_the_plan() -> None:
    assert files(raised(partial(wait_for, Fluent(False)))) == ["test_tracebacks.py"]


def test_a_run_in_a_test_shows_the_lines_of_test_and_plan() -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        run_plan(partial(par, wrong))
    assert files(caught.value) == ["test_tracebacks.py", "running.py", "test_tracebacks.py"]


def test_an_error_inside_planlang_keeps_all_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.language.budgets._TIMEOUT", None)
    assert "event_loop.py" in files(raised(grasp))


def test_all_frames_are_kept_where_the_environment_asks_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLANLANG_TRACEBACK", "1")
    assert "event_loop.py" in files(raised(grasp))
