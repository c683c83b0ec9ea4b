"""Random suspensions, wake-ups and evaporations in a tree of tags, against a model that only counts.

A leaf works for some steps. A task above others ends when all below it are over, evaporated ones included, and when
it is not held. Deeds happen at steps 4 n + 1, ends of work at multiples of 4, so that no schedule makes a difference.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from planlang import VirtualHost, evaporate, par, run, sleep, suspend, tag, task, wake_up
from planlang.failures import BranchEvaporated
from planlang.kernel import Trace

RATE = 240
Shape = int | list[Any]
Deed = tuple[int, str, int]


@dataclass
class Part:
    """A tagged task in the model."""

    number: int
    left: int
    below: list[Part] = field(default_factory=list)
    count: int = 0
    over: str | None = None

    def all(self) -> list[Part]:
        return [self, *(one for part in self.below for one in part.all())]

    def status(self, held: bool = False) -> dict[int, str]:
        held = held or self.count > 0
        found = {self.number: self.over or ("suspended" if held else "running")}
        for part in self.below:
            found.update(part.status(held and self.over is None))
        return found

    def work(self, steps: int, held: bool = False) -> None:
        held = held or self.count > 0
        for part in self.below:
            part.work(steps, held)
        if self.over is None and not held:
            self.left -= steps
            if self.left <= 0 and all(part.over for part in self.below):
                self.over = "succeeded"

    def do(self, deed: str) -> bool:
        """True if it changes something."""
        if self.over:
            return False
        if deed == "suspend":
            self.count += 1
        elif deed == "wake_up":
            if not self.count:
                return False
            self.count -= 1
        else:
            for part in self.all():
                part.over = part.over or "evaporated"
                part.count = 0
        return True


def part_of(shape: Shape, numbers: list[int]) -> Part:
    number = len(numbers)
    numbers.append(number)
    if isinstance(shape, int):
        return Part(number, 4 * shape)
    return Part(number, 0, [part_of(one, numbers) for one in shape])


async def work(part: Part) -> None:
    if part.below:
        await par(*[partial(guarded, one) for one in part.below])
    else:
        await sleep(part.left / RATE)


async def guarded(part: Part) -> None:
    with suppress(BranchEvaporated):
        await tag(f"part{part.number}", partial(work, part))


DEEDS = {"suspend": suspend, "wake_up": wake_up, "evaporate": evaporate}


async def played(shape: Shape, deeds: list[Deed]) -> None:
    numbers: list[int] = []
    whole = part_of(shape, numbers)
    model = part_of(shape, [])
    parts = model.all()

    async def play() -> None:
        await sleep(1 / RATE)
        for pause, deed, number in deeds:
            chosen = number % len(parts)
            assert DEEDS[deed](task(f"part{chosen}")) == parts[chosen].do(deed), (deed, chosen)
            await sleep(1 / RATE)
            model.work(0)
            seen = {one: task(f"part{one}").status.value.value for one in numbers}
            assert seen == model.status()
            await sleep((4 * pause - 1) / RATE)
            model.work(4 * pause)
        evaporate(task("part0"))

    await par(partial(guarded, whole), play)


shapes: st.SearchStrategy[Any] = st.recursive(
    st.integers(1, 6), lambda below: st.lists(below, min_size=1, max_size=3), max_leaves=6
)
sequences = st.lists(
    st.tuples(
        st.integers(1, 3),
        st.sampled_from(["suspend", "suspend", "wake_up", "wake_up", "evaporate"]),
        st.integers(0, 30),
    ),
    max_size=12,
)


@settings(max_examples=max(10, round(0.15 * int(os.environ.get("PLANLANG_EXAMPLES", "5000")))), deadline=None)
@given(shapes, sequences, st.one_of(st.none(), st.integers(0, 99)))
def test_suspensions_are_counted_and_reach_the_subtree_as_in_the_model(
    shape: Shape, deeds: list[Deed], schedule: int | None
) -> None:
    trace = Trace()
    run(partial(played, shape, deeds), host=VirtualHost(RATE), schedule=schedule, trace=trace)
    assert sum(one["event"] == "started" for one in trace.events) == sum(
        one["event"] == "ended" for one in trace.events
    )
