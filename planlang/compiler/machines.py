"""Finite-state recipes: states, what they return, and where that leads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from planlang.compiler.naming import Names, snake_case
from planlang.compiler.tree import Case, Handle, Machine, Node, State
from planlang.designators import local_name
from planlang.failures import ObjectNotFound, PlanFailure
from planlang.recipe.model import Ending, Recipe, Step, Transition

DONE, TRUE, FALSE = "done", "true", "false"

NOT_SEEN = ObjectNotFound.__name__
"""The failure by which a step that checks whether something is seen says that it is not."""


def machine(
    recipe: Recipe, node_of: Callable[[Step], Node], kept: Callable[[Step], tuple[str, ...]] = lambda step: ()
) -> Machine:
    """The state machine of a finite-state recipe; ``node_of`` says what is done in a state.

    ``kept`` are the names under which other states find what a state has made.
    """
    assert recipe.machine is not None
    steps = {step.iri: step for step in recipe.steps}
    known = Names()
    names = {iri: known.claim(snake_case(step.name), is_key=True) for iri, step in steps.items()}
    ends = [end for end in recipe.machine.ends if end in steps]
    leaving: dict[str, list[Transition]] = {iri: [] for iri in steps}
    for transition in recipe.machine.transitions:
        if transition.source in steps and transition.target in steps:
            leaving[transition.source].append(transition)
    states, cases = [], []
    for iri, step in steps.items():
        if iri in ends:
            leaves = [transition for transition in leaving[iri] if transition.ending is Ending.FAILED]
            states.append(State(names[iri], node_of(step)))
        else:
            leaves = leaving[iri]
            states.append(replace(_state(names[iri], node_of(step), leaves), keeps=kept(step)))
        cases += _cases(names, iri, leaves)
    reached = _reached(names[recipe.machine.start], cases)
    final = tuple(names[end] for end in ends if names[end] in reached)
    return Machine(tuple(states), tuple(cases), names[recipe.machine.start], final)


def _state(name: str, body: Node, leaving: list[Transition]) -> State:
    endings = {transition.ending for transition in leaving}
    if endings & {Ending.TRUE, Ending.FALSE}:
        return State(name, _not_cured(body) if Ending.FALSE in endings else body, checks=True)
    others = dict.fromkeys(
        local_name(transition.outcome or "") for transition in leaving if transition.ending is Ending.OTHER
    )
    return State(name, body, outcomes=tuple(others))


def _not_cured(body: Node) -> Node:
    """What is done when nothing is seen is for the machine to say, not for a recovery."""
    if not isinstance(body, Handle):
        return body
    kept = tuple(recovery for recovery in body.recoveries if recovery.failure != NOT_SEEN)
    return Handle(body.body, kept) if kept else body.body


def _cases(names: Mapping[str, str], state: str, leaving: list[Transition]) -> list[Case]:
    """One case for each outcome of a state; a transition for any outcome stands for those that have no other."""
    endings = {transition.ending for transition in leaving}
    checks = bool(endings & {Ending.TRUE, Ending.FALSE})
    found: dict[tuple[str, bool], str] = {}
    for transition in leaving:
        target = names[transition.target]
        match transition.ending:
            case Ending.TRUE:
                found.setdefault((TRUE, False), target)
            case Ending.FALSE:
                found.setdefault((FALSE, False), target)
                found.setdefault((NOT_SEEN, True), target)
            case Ending.OTHER:
                found.setdefault((local_name(transition.outcome or ""), False), target)
            case Ending.FAILED:
                found.setdefault((PlanFailure.__name__, True), target)
            case _ if not checks:
                found.setdefault((DONE, False), target)
    for transition in leaving:
        if checks and transition.ending is Ending.DONE:
            for outcome in (TRUE, FALSE):
                found.setdefault((outcome, False), names[transition.target])
    by_kind = sorted(found.items(), key=lambda item: (item[0][1], item[0][0] == PlanFailure.__name__))
    return [Case(names[state], outcome, target, is_failure) for (outcome, is_failure), target in by_kind]


def _reached(start: str, cases: list[Case]) -> set[str]:
    after: dict[str, list[str]] = {}
    for case in cases:
        after.setdefault(case.state, []).append(case.target)
    reached, waiting = {start}, [start]
    while waiting:
        for target in after.get(waiting.pop(), ()):
            if target not in reached:
                reached.add(target)
                waiting.append(target)
    return reached
