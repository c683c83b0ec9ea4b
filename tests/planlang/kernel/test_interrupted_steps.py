"""Code between two steps of a world, such as a gate that holds the run, learns that Ctrl-C came."""

from __future__ import annotations

import signal

import pytest

from planlang import SimulationHost, plan, run, sleep
from planlang.kernel.runner import is_interrupted


class Interrupting:
    """A world in whose second step Ctrl-C is pressed."""

    rate = 240

    def __init__(self) -> None:
        self.seen: list[bool] = []

    def step(self) -> None:
        """Take a step."""
        if len(self.seen) == 1:
            signal.raise_signal(signal.SIGINT)
        self.seen.append(is_interrupted())


@plan
async def wait() -> None:
    await sleep(1)


def test_a_step_learns_that_ctrl_c_came_and_that_no_run_is_interrupted_outside_of_one() -> None:
    world = Interrupting()
    with pytest.raises(KeyboardInterrupt):
        run(wait, host=SimulationHost(world))
    assert world.seen[:2] == [False, True]
    assert not is_interrupted()
