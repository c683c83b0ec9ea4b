"""A call without await fails a run that went well, with the line that made the coroutine."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from planlang import *
from planlang.failures import GraspMissed
from planlang.kernel import CutShort


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


async def reach() -> None:
    await sleep(1)


@plan
async def serve(cup: str) -> None:
    await sleep(1)


async def dropped() -> None:
    reach()
    await sleep(1)


async def kept_in_a_name() -> None:
    x = reach()  # noqa: F841
    await sleep(1)


async def of_a_plan() -> None:
    serve("a")


async def of_a_construct() -> None:
    par(reach, reach)


async def in_a_branch() -> None:
    await pursue(dropped, partial(sleep, 9))


async def in_a_list() -> None:
    [reach()]


@pytest.mark.parametrize(
    ("body", "line", "name"),
    [
        (dropped, "reach()", "reach"),
        (kept_in_a_name, "x = reach()  # noqa: F841", "reach"),
        (of_a_plan, 'serve("a")', "serve"),
        (of_a_construct, "par(reach, reach)", "par"),
        (in_a_branch, "reach()", "reach"),
        (in_a_list, "[reach()]", "reach"),
    ],
)
def test_a_call_without_await_is_an_error_with_its_line(body: Callable[[], Any], line: str, name: str) -> None:
    with pytest.raises(PlanStructureError) as caught:
        go(body)
    first, wrong, right = str(caught.value).splitlines()
    assert first.startswith("test_unawaited.py:")
    assert first.endswith(f"calls {name}() without await, so nothing was done")
    assert (wrong, right) == (f"  wrong: {line}", f"  right: await {name}(...)")


def test_all_lines_are_named() -> None:
    async def body() -> None:
        reach()
        serve("b")

    with pytest.raises(PlanStructureError, match=r"calls reach\(\)") as caught:
        go(body)
    assert [note.rpartition(" calls ")[2] for note in caught.value.__notes__] == ["serve() without await"]


def test_code_without_a_source_is_named_by_file_and_line() -> None:
    space: dict[str, Any] = {"reach": reach}
    exec(compile("async def body():\n    reach()\n", "nowhere.py", "exec"), space)
    with pytest.raises(PlanStructureError, match=r"nowhere\.py:2 calls reach\(\)(.|\n)*wrong: reach\(\.\.\.\)"):
        go(space["body"])


def test_what_the_run_fails_with_comes_first_and_nothing_is_printed() -> None:
    async def body() -> None:
        reach()
        raise GraspMissed

    with pytest.raises(GraspMissed):
        go(body)


def test_what_outlives_the_run_is_pythons_warning() -> None:
    kept: list[Any] = []

    async def body() -> None:
        kept.append(reach())
        await sleep(1)

    go(body)
    with pytest.warns(RuntimeWarning, match="'reach' was never awaited"):
        kept.clear()


def test_what_was_made_before_the_run_is_pythons_warning() -> None:
    kept = [reach()]

    async def body() -> None:
        kept.clear()
        await sleep(1)

    with pytest.warns(RuntimeWarning, match="'reach' was never awaited"):
        go(body)


def test_other_warnings_and_those_of_other_threads_are_told_as_ever() -> None:
    def reading() -> None:
        reach()

    async def body() -> None:
        warnings.warn("mind the gap", UserWarning, stacklevel=1)
        await in_thread(reading)

    with pytest.warns() as told:
        go(body)
    assert [one.category for one in told] == [UserWarning, RuntimeWarning]


def test_a_run_leaves_filters_and_tracking_as_they_were() -> None:
    before = warnings.filters[:], warnings.showwarning, sys.get_coroutine_origin_tracking_depth()
    within: list[int] = []

    async def body() -> None:
        within.append(sys.get_coroutine_origin_tracking_depth())
        await in_thread(partial(go, partial(sleep, 1)))

    go(body)
    assert within[0] > 0
    assert (warnings.filters[:], warnings.showwarning, sys.get_coroutine_origin_tracking_depth()) == before


def test_a_cleanup_that_was_cut_short_is_warned_of_in_the_same_run() -> None:
    async def body() -> None:
        try:
            await sleep(9)
        finally:
            await sleep(1)

    with pytest.warns(CutShort):
        go(partial(pursue, body, partial(sleep, 1)))


def test_a_branch_that_returns_a_coroutine_is_told_what_to_return() -> None:
    async def body() -> Any:
        return reach()

    with pytest.raises(PlanStructureError) as caught:
        go(partial(par, body))
    assert str(caught.value).splitlines() == [
        "branch par/par/body returned a call of reach() that was not awaited, so nothing was done",
        "  wrong: return reach(...)",
        "  right: return await reach(...)",
    ]
