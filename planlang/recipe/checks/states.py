"""Checks of finite-state recipes: states that exist, are reached, and are left however they end."""

from __future__ import annotations

from collections.abc import Iterator

import networkx as nx

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, warning
from planlang.ontology import Ontology
from planlang.recipe.actions import Actions
from planlang.recipe.checks import CheckedRecipe, check, listing
from planlang.recipe.checks.misspellings import guess
from planlang.recipe.model import Ending, Transition
from planlang.recipe.statements import Statements


@check("R050")
def undefined_states(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report names of states that nothing defines."""
    ontology, statements, recipe = checked.ontology, checked.statements, checked.recipe
    known = [name for name in statements.names if ontology.defined(name)]
    for name in statements.mentioned():
        if name not in statements.names and not ontology.defined(name):
            meant = guess(name, known)
            advice = f"did you mean {meant}?" if meant else f"define it, and add `subAction some {local_name(name)}`"
            message = f"the state `{local_name(name)}` of `{recipe.name}` is not defined"
            yield error("R050", message, _where(ontology, statements, name) or recipe.span, advice, meant)


@check("R051")
def unlisted_sub_actions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report states that are no sub-actions though others are: they are taken as such."""
    recipe = checked.recipe
    for name, where in unlisted_states(checked.ontology, checked.statements):
        message = f"`{local_name(name)}` is a state of `{recipe.name}`, but not a sub-action: it is treated as one"
        advice = f"add `subAction some {local_name(name)}` to `{recipe.name}`"
        yield warning("R051", message, where or recipe.span, advice)


def unlisted_states(ontology: Ontology, statements: Statements) -> Iterator[tuple[str, Span | None]]:
    """Yield the states (IRIs) of a finite-state recipe that are defined but no sub-actions, and their first mention."""
    for name in statements.mentioned() if statements.states is not None else ():
        if name not in statements.names and ontology.defined(name):
            yield name, _where(ontology, statements, name)


@check("R052")
def starts_and_ends(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report a recipe that does not begin in exactly one state, or has no end."""
    states, recipe = checked.statements.states, checked.recipe
    if states is None:
        return
    if not states.starts:
        advice = "add `taskStartState value S`"
        yield error("R052", f"`{recipe.name}` has no start state", recipe.span, advice)
    elif len(states.starts) > 1:
        names = ", ".join(f"`{local_name(name)}`" for name in states.starts)
        advice = "keep one; parallel parts belong in a recipe of their own"
        yield error("R052", f"`{recipe.name}` has several start states: {names}", recipe.span, advice)
    if not states.ends:
        advice = "add `taskEndState value S`"
        yield error("R052", f"`{recipe.name}` has no end state", recipe.span, advice)


@check("R057")
def orders_of_states(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report ordering constraints of a finite-state recipe, where only transitions count."""
    orderings = checked.statements.orderings
    if checked.statements.states is not None and orderings:
        message = f"`{checked.recipe.name}` has states and ordering constraints: only the transitions count"
        yield warning("R057", message, orderings[0].span, "remove the constraints, or write transitions")


@check("R053")
def ambiguous_transitions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report transitions that leave a state in the same case for different ones."""
    machine, recipe = checked.recipe.machine, checked.recipe
    first: dict[tuple[str, str | Ending], Transition] = {}
    for one in machine.transitions if machine is not None else ():
        earlier = first.setdefault((one.source, _case(one)), one)
        if earlier.target != one.target:
            message = (
                f"from `{local_name(one.source)}`, {_word(one)} leads to two states:"
                f" `{local_name(earlier.target)}` and `{local_name(one.target)}`"
            )
            advice = "give them different outcomes (causedBy), or keep one"
            yield error("R053", message, _later(earlier, one) or recipe.span, advice)


@check("R054", unless=("R052",))
def unreachable_states(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report states to which no transitions lead from the start."""
    machine, recipe = checked.recipe.machine, checked.recipe
    if machine is None:
        return
    graph = nx.DiGraph((one.source, one.target) for one in machine.transitions)
    graph.add_node(machine.start)
    reached = {machine.start, *nx.descendants(graph, machine.start)}
    lost = [step for step in recipe.steps if step.iri not in reached]
    for step in lost:
        if step.iri in machine.ends and not reached & set(machine.ends):
            continue
        message = f"the state `{step.name}` cannot be reached from `{local_name(machine.start)}`"
        advice = f"add a transition with `toState {step.name}`, or remove the state"
        yield warning("R054", message, step.span, advice)
    if not reached & set(machine.ends):
        names = ", ".join(f"`{local_name(end)}`" for end in machine.ends)
        message = f"no end of `{recipe.name}` ({names}) can be reached from `{local_name(machine.start)}`"
        yield error("R054", message, recipe.span, "add the missing transitions")


@check("R055", unless=("R052",))
def uncovered_endings(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report endings of states that no transition covers, and transitions that are never taken, such as out of ends."""
    machine, recipe, actions = checked.recipe.machine, checked.recipe, checked.actions
    for step in recipe.steps if machine is not None else ():
        assert machine is not None
        own = [one for one in machine.transitions if one.source == step.iri]
        endings = {one.ending for one in own}
        if step.iri in machine.ends:
            regular = [one for one in own if one.ending is not Ending.FAILED]
            if regular:
                message = f"`{step.name}` is an end of `{recipe.name}`: the transition out of it is never taken"
                yield warning("R055", message, regular[0].span, "remove the transition, or the taskEndState")
            continue
        checks = endings & {Ending.TRUE, Ending.FALSE}
        yield from _unsaid(actions, step.name, own, checked=bool(checks))
        missing: list[str] = []
        if len(checks) == 1:
            missing = ["CONDITION_FALSE" if Ending.TRUE in checks else "CONDITION_TRUE"]
        elif not checks and not endings & {Ending.DONE, Ending.OTHER}:
            is_check = actions.is_a(step, "CheckingWhetherConditionObtains")
            missing = ["CONDITION_TRUE", "CONDITION_FALSE"] if is_check else ["COMPLETED_OK"]
        if missing:
            names = " and ".join(missing)
            message = f"no transition covers {names} of `{step.name}`, which is not an end of `{recipe.name}`"
            advice = f"add a transition with `fromState {step.name}, causedBy {missing[0]}`"
            yield warning("R055", message, step.span, advice)


def _unsaid(actions: Actions, state: str, own: list[Transition], *, checked: bool) -> Iterator[Diagnostic]:
    """Report outcomes whose names do not show what they mean: what performs the state has to give them by name."""
    for one in own:
        if one.ending is not Ending.OTHER or one.outcome is None:
            continue
        if checked:
            message = f"`{state}` checks a condition: its transition with `{_word(one)}` is never taken"
            yield warning("R055", message, one.span, "write `causedBy CONDITION_TRUE`, or CONDITION_FALSE")
        elif not actions.ontology.defined(one.outcome):
            message = f"the outcome `{_word(one)}` is not defined: it occurs only if it is the result of `{state}`"
            advice = (
                "write `causedBy` CONDITION_TRUE, CONDITION_FALSE, COMPLETED_OK or COMPLETED_FAILED;"
                f" or define it: `Individual: {_word(one)}` with `Types: ActionResult`"
            )
            yield warning("R055", message, one.span, advice)


@check("R056", unless=("R052",))
def unhandled_failures(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report a recipe without a transition for any failure: a failure ends it, and a loop may go on for ever."""
    machine, recipe = checked.recipe.machine, checked.recipe
    if machine is None or any(one.ending is Ending.FAILED for one in machine.transitions):
        return
    graph = nx.DiGraph((one.source, one.target) for one in machine.transitions)
    looping = sorted({state for part in nx.strongly_connected_components(graph) if len(part) > 1 for state in part})
    message = f"no transition of `{recipe.name}` handles failures: any failure ends the recipe"
    if looping:
        message += f", and {listing(looping)} may loop for ever"
    advice = "add transitions with `causedBy` a failed ActionResult, such as COMPLETED_FAILED, to a state that gives up"
    yield warning("R056", message, recipe.span, advice)


def _case(transition: Transition) -> str | Ending:
    is_named = transition.ending in (Ending.OTHER, Ending.FAILED) and transition.outcome is not None
    return transition.outcome if is_named and transition.outcome else transition.ending


def _word(transition: Transition) -> str:
    return local_name(transition.outcome) if transition.outcome else "any outcome"


def _later(first: Transition, second: Transition) -> Span | None:
    spans = [one.span for one in (first, second) if one.span is not None]
    return max(spans, default=None)


def _where(ontology: Ontology, statements: Statements, name: str) -> Span | None:
    """Return where a state is mentioned first: in a transition, else as start or end."""
    transitions = statements.states.transitions if statements.states is not None else ()
    events = {one.iri for one in transitions}
    mentions = list(ontology.triples(o=name))
    spans = [triple.span for triple in mentions if str(triple.subject) in events]
    return min(spans or [triple.span for triple in mentions], default=None)
