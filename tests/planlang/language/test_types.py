"""Plans are typed: what constructs return is known to mypy --strict."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any, assert_type

import pytest

from planlang import (
    Fluent,
    Policy,
    VirtualHost,
    budget,
    in_thread,
    par,
    par_each,
    partial_order,
    plan,
    pursue,
    race,
    retry_after_suspension,
    run,
    seq,
    tag,
    timeout,
    try_in_order,
    unwind_protect,
    wait_for,
    with_failure_handling,
    with_policies,
    with_requests,
)


async def number() -> int:
    return 1


async def word() -> str:
    return "a"


async def length(text: str) -> int:
    return len(text)


@plan
async def typed(*, times: int = 1) -> int:
    a, b = await par(number, word)
    assert_type(a, int)
    assert_type(b, str)
    x, y, z = await par(number, word, number)
    assert_type((x, y, z), tuple[int, str, int])
    assert_type(await seq(number, word), tuple[int, str])
    assert_type(await par(one=number, two=number), tuple[int, ...])
    assert_type(await seq(number, *[number, number], last=number), tuple[int, ...])
    assert_type(await partial_order({"one": number, "two": number}, [("one", "two")]), dict[str, int])
    assert_type(await partial_order({"text": word, "two": length}, [("text", "two")]), dict[str, Any])
    assert_type(await in_thread(number), int)
    assert_type(await in_thread(len, "abc", takes=1), int)
    assert_type(await wait_for(Fluent(1)), int)
    assert_type(await wait_for(Fluent(1), timeout=2), int | None)
    assert_type(await pursue(number, number), int)
    assert_type(await race(one=number, two=number), tuple[str, int])
    assert_type(await try_in_order(word, word), str)
    assert_type(await par_each(["a", "b"], length), list[int])
    for wrapped in (
        await timeout(1, number),
        await budget(number, seconds=1),
        await tag("number", number),
        await unwind_protect(number, word),
        await retry_after_suspension(number),
        await with_failure_handling(number),
        await with_policies([Policy("none")], number),
        await with_requests(number),
    ):
        assert_type(wrapped, int)
    return times


def test_typed_constructs_return_what_their_types_say() -> None:
    assert_type(run(partial(typed, times=3), host=VirtualHost()), int)
    assert run(partial(typed, times=3), host=VirtualHost()) == 3


@pytest.mark.long
@pytest.mark.skipif(importlib.util.find_spec("mypy") is None, reason="mypy is not installed")
def test_mypy_strict_agrees() -> None:
    root = Path(__file__).resolve().parents[3]
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(Path(__file__).resolve())],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout
