"""Plans that are disturbed while they run, against the reference model, as a state machine.

A plan is a random tree of constructs. Between its steps tagged parts of it are suspended, woken up and evaporated, and
the fluents that it looks at change. The model says what each disturbance returns and which states the tagged parts
have afterwards, when the plan ends and how; the plan is then run and has to do the same, on every schedule.

Durations are multiples of one slot. The k-th disturbance comes 2 ** (k + 1) steps into a slot, so that whatever it
sets off never meets a later disturbance in one step: no order of tasks makes a difference.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule
from random_trees import FLUENTS, SLOT, TAGS, Grower, outcome_of, tags_of
from reference_model import Tree, World

from planlang import Fluent, evaporate, now, sleep, suspend, task, wait_for, wake_up

# a cleanup that fails makes try_in_order go on in a task that is being evaporated, which is warned of, rightly
pytestmark = pytest.mark.filterwarnings("ignore::planlang.kernel.errors.CutShort")

STEPS = 9
"""Disturbances of a plan; three more let go of it in the end."""


@dataclass(frozen=True)
class Disturbance:
    """Something done at a moment, and what is to be seen: what it returns, and the states of the parts afterwards."""

    moment: int
    deed: Callable[[list[Fluent[bool]]], object]
    expected: tuple[object, dict[int, str]] | None
    """None if the plan is expected to be over."""


async def disturb(disturbances: list[Disturbance], parts: list[int], fluents: list[Fluent[bool]]) -> None:
    for one in disturbances:
        await sleep(one.moment - now())
        returned = one.deed(fluents)
        await sleep(1)
        seen = {number: task(f"part {number}").status.value.value for number in parts}
        assert (returned, seen) == one.expected, f"at {one.moment}"
    await wait_for(Fluent(False))


class DisturbedPlan(RuleBasedStateMachine):
    """Disturbances of the model, each with what it changes; at the end the plan itself has to do the same."""

    @initialize(
        source=st.binary(min_size=24, max_size=80),
        values=st.tuples(*[st.sampled_from([False, False, False, True])] * FLUENTS),
    )
    def begin(self, source: bytes, values: tuple[bool, ...]) -> None:
        self.tree = Tree("tag", (Grower(source).tree(),), 0)
        self.values = values
        self.parts = tags_of(self.tree)
        self.world = World(self.tree, list(values))
        self.slot = 0
        self.disturbances: list[Disturbance] = []

    def disturb(self, pause: int, deed: Callable[[list[Fluent[bool]]], Any], in_the_model: Callable[[], Any]) -> None:
        self.slot += pause
        moment = self.slot * SLOT + 2 ** (len(self.disturbances) + 1)
        self.world.advance(moment)
        expected = None
        if not self.over:
            returned = in_the_model()
            self.world.rest()
            if not self.over:
                expected = (returned, {number: self.world.tags[number].state for number in self.parts})
                self.world.advance(moment + 1)
        self.disturbances.append(Disturbance(moment, deed, expected))

    @property
    def over(self) -> bool:
        return self.world.root.outcome is not None

    @rule(
        pause=st.integers(0, 3),
        number=st.integers(0, TAGS - 1),
        deed=st.sampled_from(["suspend", "suspend", "wake_up", "wake_up", "evaporate"]),
    )
    def disturb_a_part(self, pause: int, number: int, deed: str) -> None:
        chosen = self.parts[number % len(self.parts)]
        do = {"suspend": suspend, "wake_up": wake_up, "evaporate": evaporate}[deed]
        part = self.world.tags
        self.disturb(pause, lambda _: do(task(f"part {chosen}")), lambda: getattr(part[chosen], deed)())

    @rule(
        pause=st.integers(0, 3),
        number=st.integers(0, FLUENTS - 1),
        values=st.sampled_from([(True,), (False,), (True, False), (False, True)]),
    )
    def change_a_fluent(self, pause: int, number: int, values: tuple[bool, ...]) -> None:
        def change(fluents: list[Fluent[bool]]) -> None:
            for value in values:
                fluents[number].set(value)

        def in_the_model() -> None:
            for value in values:
                self.world.set(number, value)

        self.disturb(pause, change, in_the_model)

    def teardown(self) -> None:
        """Let go of everything, and run the plan, on two schedules."""
        if not hasattr(self, "tree"):
            return

        def wake_all(_: object) -> None:
            for number in self.parts:
                while wake_up(task(f"part {number}")):
                    pass

        def wake_all_in_the_model() -> None:
            for number in self.parts:
                while self.world.tags[number].wake_up():
                    pass

        self.disturb(1, wake_all, wake_all_in_the_model)
        self.disturb(10, lambda _: evaporate(task("part 0")), lambda: self.world.tags[0].evaporate())
        self.disturb(10_000, lambda _: None, lambda: None)  # all that has an end has ended by then
        expected = (self.world.now, self.world.root.outcome) if self.over else (-1, ("deadlock", None))
        beside = partial(disturb, self.disturbances, self.parts)
        for schedule in (None, len(self.disturbances)):
            assert outcome_of(self.tree, self.values, beside=beside, schedule=schedule) == expected


TestDisturbedPlan = DisturbedPlan.TestCase
TestDisturbedPlan.settings = settings(
    max_examples=max(10, int(os.environ.get("PLANLANG_EXAMPLES", "5000"))),
    stateful_step_count=STEPS,
    deadline=None,
)
