"""Concurrent branches: what goes on beside what in a plan."""

from __future__ import annotations

from functools import partial

from planlang import VirtualHost, par, partial_order, run, seq, sleep, tag
from planlang.language.parallel import concurrent_branches


def paths() -> list[str]:
    return [branch.path for branch in concurrent_branches()]


def test_there_is_no_concurrent_branch_where_no_plan_runs() -> None:
    assert concurrent_branches() == ()


def test_branches_of_par_are_concurrent_and_what_runs_in_turn_is_not() -> None:
    found: dict[str, list[str]] = {}

    async def look(name: str) -> None:
        await sleep(0.1)
        found[name] = paths()

    async def top() -> None:
        await look("top")
        await seq(partial(look, "in turn"), partial(tag, "part", partial(look, "tagged")))
        await partial_order({"first": partial(look, "step")}, [])
        await par(left=partial(look, "left"), right=partial(par, inner=partial(look, "inner")))

    run(top, host=VirtualHost())
    for name in ("top", "in turn", "tagged", "step"):
        assert found[name] == ["top"], name
    assert found["left"] == ["top/par/left", "top"]
    assert found["inner"] == ["top/par/right/par/inner", "top/par/right", "top"]
