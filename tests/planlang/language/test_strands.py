"""Strands: what goes on beside what in a plan."""

from __future__ import annotations

from functools import partial

from planlang import VirtualHost, par, partial_order, run, seq, sleep, tag
from planlang.language.strands import Strand, strands


def paths() -> list[str]:
    return [strand.path for strand in strands()]


def test_there_is_no_strand_where_no_plan_runs() -> None:
    assert strands() == ()


def test_branches_of_par_are_strands_and_what_runs_in_turn_is_none() -> None:
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


def test_a_strand_is_over_when_its_task_is() -> None:
    kept: list[Strand] = []

    async def branch() -> None:
        kept.extend(strands()[:1])
        await sleep(1)
        assert not kept[0].over

    async def top() -> None:
        await par(branch, partial(sleep, 2))
        assert kept[0].over

    run(top, host=VirtualHost())
