"""state_machine: states, transitions and loops."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from enum import Enum
from functools import partial
from typing import Any

from planlang.closure import reached
from planlang.failures import BudgetExceeded, PlanFailure, TransitionMissing
from planlang.kernel import checkpoint
from planlang.kernel.primitives import called, node, record
from planlang.language.branches import Branch, evaporating
from planlang.language.recovery import matches
from planlang.misuse import Usage, WrongType, WrongValue, contrast, written

Outcome = str | Enum
"""The result of a state, which selects the next state."""
Case = Outcome | type[PlanFailure]
_STATE_MACHINE = Usage(
    "await state_machine",
    {
        "states": '{"look": look, "grasp": grasp}',
        "transitions": '{("look", "found"): "grasp"}',
        "start": '"look"',
        "end": '"grasp"',
    },
    {"max_visits": "3", "name": '"fetch"'},
)
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
    """Run one state after another up to an end state; return the result of the end state.

    A state is a branch that returns its outcome, a string or an Enum member; end states may return anything.
    ``transitions`` maps (state, outcome) and (state, failure class) to the next state. A failure takes the first
    transition of its state, in textual order, that matches its class; without one it propagates to the caller.
    ``max_visits`` limits the visits of each state: one more raises BudgetExceeded.

    Raises TransitionMissing for an outcome without a transition; ValueError, before any state starts, for a state that
    is not in ``states`` and for an end state that cannot be reached.
    """
    _STATE_MACHINE.mapping("states", states)
    _STATE_MACHINE.instance("transitions", transitions, Mapping, "a mapping (state, outcome) -> next state")
    if not isinstance(end, str):
        _STATE_MACHINE.iterable("end", end, "the name of an end state, or several names")
    ends = (end,) if isinstance(end, str) else tuple(end)
    cases = _cases(states, transitions, start, ends)
    if max_visits is not None:
        max_visits = _STATE_MACHINE.whole("max_visits", max_visits, 1, "times")
    if name is not None:
        _STATE_MACHINE.text("name", name)
    visiting = partial(_visit, states, cases, start, ends, max_visits)
    return await node("state_machine", name or "state_machine", visiting, start=start)


async def _visit(
    states: Mapping[str, Branch],
    cases: Mapping[str, Mapping[Case, str]],
    state: str,
    ends: Collection[str],
    max_visits: int | None,
) -> Any:
    """Run one state after another, from ``state`` to an end state."""
    visits: dict[str, int] = {}
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
            outcome = await node("state", state, partial(called, states[state]))
        except PlanFailure as failure:
            if evaporating():
                raise
            handled = (to for case, to in cases[state].items() if isinstance(case, type) and matches(failure, case))
            target = next(handled, None)
            if target is None:
                raise
            record("transition", state=state, failure=failure, to=target)
        else:
            if state in ends:
                return outcome
            target = _after(cases[state], state, outcome)
            record("transition", state=state, outcome=outcome, to=target)
        state = target
        await checkpoint()


def _after(cases: Mapping[Case, str], state: str, outcome: object) -> str:
    if not isinstance(outcome, (str, Enum)):
        message = f"state {state!r} returned {outcome!r}; it must return its outcome, a string or an Enum member"
        raise WrongType(contrast(message, "async def look(): ...", 'async def look(): ...; return "found"'))
    target = cases.get(outcome)
    if target is None:
        raise TransitionMissing(state=state, outcome=_word(outcome))
    return target


def _cases(
    states: Mapping[str, Branch], transitions: Transitions, start: str, ends: tuple[str, ...]
) -> dict[str, dict[Case, str]]:
    """Group the transitions by state; raises WrongValue for transitions that cannot work."""
    listed = f"states: {', '.join(states)}"
    if not ends:
        raise _STATE_MACHINE.refused("end", "a state machine needs an end state", ends)
    for role, state in (("start", start), *(("end", end) for end in ends)):
        if not isinstance(state, str) or state not in states:
            raise _STATE_MACHINE.refused(role, f"no {role} state {written(state)}; {listed}", state)
    cases: dict[str, dict[Case, str]] = {state: {} for state in states}
    for key, target in transitions.items():
        if not isinstance(key, tuple) or len(key) != 2:
            message = f"the key of a transition must be (state, outcome), not {written(key)}; {listed}"
            raise _refused(transitions, message)
        state, case = key
        text = f"transition ({_word(state)}, {_word(case)}) -> {_word(target)}"
        for name in (state, target):
            if not isinstance(name, str) or name not in states:
                raise _refused(transitions, f"{text}: no state {written(name)}; {listed}")
        if isinstance(case, type):
            if not issubclass(case, PlanFailure):
                raise _refused(transitions, f"{text}: {case.__name__} is not a subclass of PlanFailure")
        elif not isinstance(case, (str, Enum)):
            raise _refused(transitions, f"{text}: an outcome must be a string or an Enum member")
        elif state in ends:
            raise _refused(transitions, f"{text}: {state!r} is an end state, which can be left by a failure only")
        cases[state][case] = target
    reachable = {*reached((start,), lambda state: cases[state].values())}
    unreachable = [state for state in ends if state not in reachable]
    if unreachable:
        text = f"no transitions lead from {start!r} to the end state {', '.join(map(repr, unreachable))}"
        raise _refused(transitions, text)
    return cases


def _refused(transitions: Transitions, message: str) -> WrongValue:
    return _STATE_MACHINE.refused("transitions", message, transitions)


def _word(case: object) -> str:
    if isinstance(case, Enum):
        return case.name
    return case.__name__ if isinstance(case, type) else str(case)
