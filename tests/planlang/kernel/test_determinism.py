"""The same plan, seed and schedule give the same trace, byte for byte, in processes with different hash seeds."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

from planlang import VirtualHost, par, rng, run

PROGRAM = """
import sys
from functools import partial
from planlang import *

async def step(name):
    for _ in range(rng().randrange(1, 4)):
        await sleep(rng().random())
    if rng().random() < 0.2:
        raise PlanFailure(name)
    return {name, "set", "of", "words"}

async def attempts(name):
    return await with_failure_handling(partial(step, name), Recovery(PlanFailure, attempts=3, otherwise=Return(None)))

async def plan():
    await par_each([f"s{n}" for n in range(20)], attempts, limit=5)
    names = ["reach", "grasp", "lift", "carry", "place", "release"]
    steps = {name: partial(attempts, name) for name in names}
    await partial_order(steps, [("reach", "grasp"), ("grasp", "lift"), ("carry", "release")])
    await try_all(partial(attempts, "a"), partial(attempts, "b"))

trace = Trace()
run(plan, host=VirtualHost(), seed=int(sys.argv[1]), schedule=eval(sys.argv[2]), trace=trace)
sys.stdout.write(trace.text())
"""


def trace_of(hash_seed: str, seed: int = 7, schedule: int | None = None) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM, str(seed), str(schedule)],
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_the_trace_does_not_depend_on_the_hash_seed() -> None:
    traces = {trace_of(hash_seed) for hash_seed in ("0", "1", "12345")}
    assert len(traces) == 1
    assert len(traces.pop().splitlines()) > 100


def test_a_schedule_can_be_repeated() -> None:
    assert trace_of("1", schedule=3) == trace_of("2", schedule=3)
    assert trace_of("1", schedule=3) != trace_of("1", schedule=4)


def test_another_seed_is_another_run() -> None:
    assert trace_of("1", seed=8) != trace_of("1", seed=7)


def test_importing_planlang_loads_neither_numpy_nor_the_protocols() -> None:
    program = "import sys, planlang; print([m for m in ('numpy', 'planlang.protocols', 'lark') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]"


def test_inserting_a_line_changes_no_random_numbers_of_a_plan_with_lambdas() -> None:
    code = "async def body():\n    return await par(lambda: draw(), lambda: draw())\n"

    async def draw() -> float:
        return rng().random()

    def drawn(text: str) -> Any:
        space: dict[str, Any] = {"par": par, "draw": draw}
        exec(text, space)
        return run(space["body"], host=VirtualHost())

    first, second = drawn(code)
    assert first != second
    assert drawn(code.replace("par(", "par(\n\n")) == [first, second]
