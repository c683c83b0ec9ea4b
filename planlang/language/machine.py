"""state_machine: recipes with states and loops."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Any

from planlang.failures import BudgetExceeded, PlanFailure, TransitionMissing, matches
from planlang.kernel import checkpoint
from planlang.kernel.journal import taken_over
from planlang.kernel.primitives import inside, record
from planlang.language.branches import Branch, check

Outcome = str | Enum
"""What a state returns to say how it ended."""
Case = Outcome | type[PlanFailure]
Transitions = Mapping[tuple[str, Case], str]


async def state_machine(
    states: Mapping[str, Branch],
    transitions: Transitions,
    start: str,
    end: str | Iterable[str],
    max_visits: int | None = None,
    *,
    name: str | None = None,
) -> Any:
    """Run states one after another until an end state has run; returns what that one returned.

    A state is a branch that returns its outcome, a string or an Enum member; end states may return anything.
    ``transitions`` maps (state, outcome) and (state, failure class) to the next state. A failure takes the first case
    of its state, in textual order, that is for its class; without one it goes outward as itself. ``max_visits``
    bounds the visits of each state: one more is BudgetExceeded.

    Raises TransitionMissing for an outcome without a case; ValueError, before anything starts, for a state that is
    not in ``states`` and for an end state to which no transitions lead.
    """
    check("state_machine", states.values())
    ends = (end,) if isinstance(end, str) else tuple(end)
    cases = _cases(states, transitions, start, ends)
    if max_visits is not None and max_visits < 1:
        raise ValueError(f"max_visits is a number of times, at least 1, not {max_visits}")
    if (before := taken_over("state_machine", name or "state_machine")) is not None:
        return await before
    with inside("state_machine", name or "state_machine", start=start) as machine:
        visits: dict[str, int] = {}
        state = start
        while True:
            visits[state] = visits.get(state, 0) + 1
            if max_visits is not None and visits[state] > max_visits:
                visits[state] -= 1
                raise BudgetExceeded(
                    f"state {state!r} would be visited more than {max_visits} times; visits: "
                    + ", ".join(f"{visited} {number}" for visited, number in visits.items()),
                    attempts=max_visits,
                    used=visits,
                )
            try:
                if (before := taken_over("state", state)) is not None:
                    outcome = await before
                else:
                    with inside("state", state) as visit:
                        outcome = visit.result = await states[state]()
            except PlanFailure as failure:
                target = _after_failure(cases[state], failure)
                if target is None:
                    raise
                record("transition", state=state, failure=failure, to=target)
            else:
                if state in ends:
                    machine.result = outcome
                    return outcome
                target = _after(cases[state], state, outcome)
                record("transition", state=state, outcome=outcome, to=target)
            state = target
            await checkpoint()


def _after(cases: Mapping[Case, str], state: str, outcome: object) -> str:
    if not isinstance(outcome, (str, Enum)):
        raise TypeError(
            f"state {state!r} returned {outcome!r}; a state returns its outcome, a string or an Enum member\n"
            "  wrong: async def look(): ...\n"
            '  right: async def look(): ...; return "found"'
        )
    target = cases.get(outcome)
    if target is None:
        raise TransitionMissing(state=state, outcome=_word(outcome))
    return target


def _after_failure(cases: Mapping[Case, str], failure: PlanFailure) -> str | None:
    return next((to for case, to in cases.items() if isinstance(case, type) and matches(failure, case)), None)


def _cases(
    states: Mapping[str, Branch], transitions: Transitions, start: str, ends: tuple[str, ...]
) -> dict[str, dict[Case, str]]:
    """The cases of each state; refuses what cannot work."""
    known = f"states: {', '.join(states)}"
    if not ends:
        raise ValueError("a state machine needs an end state")
    for role, state in (("start", start), *(("end", one) for one in ends)):
        if state not in states:
            raise ValueError(f"no {role} state {state!r}; {known}")
    cases: dict[str, dict[Case, str]] = {state: {} for state in states}
    for (state, case), target in transitions.items():
        text = f"transition ({state}, {_word(case)}) -> {target}"
        for one in (state, target):
            if one not in states:
                raise ValueError(f"{text}: no state {one!r}; {known}")
        if isinstance(case, type):
            if not issubclass(case, PlanFailure):
                raise ValueError(f"{text}: a state can be left by plan failures, which {case.__name__} is not")
        elif not isinstance(case, (str, Enum)):
            raise ValueError(f"{text}: an outcome is a string or an Enum member")
        elif state in ends:
            raise ValueError(f"{text}: {state!r} is an end state, which is left by failures only")
        cases[state][case] = target
    reached = {start: None}
    stack = [start]
    while stack:
        for target in cases[stack.pop()].values():
            if target not in reached:
                reached[target] = None
                stack.append(target)
    lost = [state for state in ends if state not in reached]
    if lost:
        raise ValueError(f"no transitions lead from {start!r} to the end state {', '.join(map(repr, lost))}")
    return cases


def _word(case: object) -> str:
    if isinstance(case, Enum):
        return case.name
    return case.__name__ if isinstance(case, type) else str(case)
