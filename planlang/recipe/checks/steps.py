"""Checks of sub-actions and states.

Sub-actions have to be defined, executable, stated once, not recursive, and able to have the capabilities they require;
states have to exist, be reachable, and have a transition for each way in which they can end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from planlang import graphs as nx
from planlang.closure import grouped, reached
from planlang.designators import local_name, told_apart
from planlang.diagnostics import Diagnostic, Span, error, note, warning
from planlang.kept import kept
from planlang.ontology import BNode, Ontology, Restriction, expand, shorten
from planlang.recipe.actions import Actions
from planlang.recipe.checks import CheckedFile, CheckedRecipe, check, listing
from planlang.recipe.guesses import LIKE, SURE, Known, classes_beside, nearest_action
from planlang.recipe.model import Ending, Recipe, RecipeSet, Step, Transition
from planlang.recipe.statements import Statements, SubAction, is_word
from planlang.spelling import Spellings
from planlang.words import Text, calling

MOST_ABOVE = 2
"""Number of superclasses in the advice on a module: one for classes farther up would do very different things."""

DEEPEST = 50
"""Maximum nesting of recipes. Hand-written ones nest a few levels; deeper ones are reported here, because a plan with
that many nested calls might exceed Python's recursion limit."""


@check("R020")
def undefined_sub_actions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report sub-actions that are not defined, or that name no class."""
    ontology, name = checked.ontology, checked.recipe.name
    within = checked.recipe.within
    article, kind = ("a", "sub-action") if within is None else ("an", "alternative")
    name = name if within is None else local_name(within)
    listed = {*checked.statements.names}
    strangers = (one for one in checked.statements.mentioned() if one not in listed and ontology.defined(one))
    stranger = next(strangers, None)
    for sub_action in _once(checked):
        iri = sub_action.iri
        if sub_action.alternatives:
            continue  # each of them is checked as the step of a recipe
        if iri is None:
            message = f"{article} {kind} of `{name}` is an expression without a named action class"
            yield error("R020", message, sub_action.span, "name an action class in it")
        elif within is not None and ontology.defined(iri) and not _is_action(checked, iri):
            message = f"`{local_name(iri)}` is an alternative of a step of `{name}`, but not a class of actions"
            advice = f"name a subclass of knowrob:Action, or give `{local_name(iri)}` sub-actions"
            yield error("R020", message, sub_action.span, advice)
        elif not ontology.defined(iri):
            message = f"{kind} `{local_name(iri)}` of `{name}` is not defined"
            suggestion = nearest_action(ontology, iri) if stranger is None else None
            if stranger is not None:
                advice = f"did you mean `{local_name(stranger)}`, which is ordered but is not a sub-action?"
            elif suggestion:
                advice = f"did you mean {suggestion}?"
            else:
                advice = f"define `{local_name(iri)}` as a subclass of an action class"
            yield error("R020", message, sub_action.span, advice, suggestion)


def _is_action(checked: CheckedRecipe, iri: str) -> bool:
    ontology = checked.ontology
    return _leads_to_actions(ontology, iri) or checked.actions.statements(iri) is not None


@check("R024")
def repeated_sub_actions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report sub-actions that are stated twice, or with a number of repetitions."""
    name, first = checked.recipe.name, _once(checked)
    for sub_action in checked.statements.sub_actions:
        short = local_name(sub_action.iri or "")
        if sub_action not in first:
            yield note("R024", f"`{short}` is a sub-action of `{name}` twice", sub_action.span)
        elif sub_action.iri is not None and sub_action.times > 1:
            message = f"`{name}` requires `{short}` {sub_action.times} times, but a step is performed once"
            yield error("R024", message, sub_action.span, f"add subclasses of it: {short}1, {short}2, ...")


def _once(checked: CheckedRecipe) -> dict[SubAction, None]:
    """First statements of the sub-actions, and all anonymous ones."""
    first: dict[str, SubAction] = {}
    subs = checked.statements.sub_actions
    return dict.fromkeys(sub for sub in subs if sub.iri is None or first.setdefault(sub.iri, sub) is sub)


@check("R005")
def foreign_words(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report words of the recipe vocabulary in another namespace."""
    for filling in checked.statements.foreign:
        word = local_name(filling.property)
        message = f"{word} is in another namespace ({filling.property}): it is read as KnowRob's"
        yield note("R005", message, filling.span, f"write knowrob:{word}")


@check("R021")
def abstract_steps(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps that nothing performs; a process module registered by a program still may."""
    for step in checked.recipe.steps:
        is_known = checked.recipe.within is None or _is_action(checked, step.iri)
        if not step.is_abstract or not is_known or _is_performed(checked, step.action_class):
            continue
        unknown = _undefined_class(checked.ontology, step.action_class)
        if unknown is None:
            message = f"nothing performs `{step.name}` yet: it is not a primitive and has no recipe"
            yield warning("R021", message, step.span, _performers_to_add(checked, step.action_class))
        elif unknown != step.iri:  # otherwise it is a sub-action, which is reported as such
            message = f"nothing performs `{step.name}`: `{local_name(unknown)}` ({unknown}) is not defined"
            near = nearest_action(checked.ontology, unknown)
            listed = Text("name a class of actions (", calling("list", "actions"), ")")
            advice = f"did you mean {near}?" if near else listed
            yield error("R020", message, step.span, advice, near)


def _undefined_class(ontology: Ontology, cls: str) -> str | None:
    """Find the class for which a step's class is no action: a name that its vocabulary, which was read, does not have.

    None if there is none. A name of a vocabulary that was not read may be one of an action.
    """
    if _leads_to_actions(ontology, cls):
        return None
    undefined = (one for one in ontology.ancestors(cls) if not ontology.defined(one))
    return next((one for one in undefined if classes_beside(ontology, one)), None)


def _leads_to_actions(ontology: Ontology, cls: str) -> bool:
    return ontology.any_is_a((cls,), ("Action", "Event"))


@check("R022", "R023")
def recursion(checked: CheckedFile) -> list[Diagnostic]:
    """Report each step through which a recipe performs itself, with the whole cycle, and recipes nested too deeply."""
    recipes = checked.recipes
    diagnostics: list[Diagnostic] = []
    done: set[str] = set()
    path = [recipes.task]
    waiting = [_calls(recipes, recipes.task)]
    while waiting:
        call = next(waiting[-1], None)
        if call is None:
            waiting.pop()
            done.add(path.pop())
            continue
        step, callee = call
        if callee in path:
            circle = (*path[path.index(callee) :], callee)
            through = f" (`{step.name}` inherits the recipe of its superclass)" if step.iri != callee else ""
            message = "the recipe performs itself: " + " > ".join(f"`{local_name(name)}`" for name in circle)
            advice = f"give `{step.name}` a recipe of its own, or make it a primitive"
            diagnostics.append(error("R022", message + through, step.span, advice))
        elif len(path) > DEEPEST:
            message = f"`{step.name}` is nested in more than {DEEPEST} recipes"
            return [*diagnostics, error("R023", message, step.span, "flatten the recipes in between")]
        elif callee not in done:
            path.append(callee)
            waiting.append(_calls(recipes, callee))
    return diagnostics


def _calls(recipes: RecipeSet, iri: str) -> Iterator[tuple[Step, str]]:
    for step in recipes.recipes[iri].steps:
        for callee in step.recipes:
            yield step, callee


@check("R048")
def same_names(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps that a reader of the plan cannot tell apart."""
    recipe = checked.recipe
    first: dict[str, Step] = {}
    for step in recipe.steps:
        for name in dict.fromkeys((step.name, step.label or step.name)):
            earlier = first.setdefault(name.lower(), step)
            if earlier is not step:
                one, other = told_apart(earlier.iri, step.iri)
                message = f"two steps of `{recipe.name}` are called {name!r}: `{one}` and `{other}`"
                yield warning("R048", message, step.span, "give one of them another name or label")
                break


def _is_performed(checked: CheckedRecipe, cls: str) -> bool:
    """True if a process module performs a class (IRI) or an ancestor of it."""
    performed = checked.actions.performed()
    return bool(performed) and any(
        not performed.isdisjoint((one, shorten(one), local_name(one))) for one in checked.ontology.ancestors(cls)
    )


def _performers_to_add(checked: CheckedRecipe, cls: str) -> str:
    """Suggest how to perform a class (IRI): a process module, sub-actions, or a similar class that is performed."""
    ontology, actions = checked.ontology, checked.actions
    if len(ontology.ancestors(cls)) == 1:
        return f"`{local_name(cls)}` has no known superclass: import the ontology that defines it"
    near = checked.file.performed.guess(cls, LIKE)
    below = f", or make it a subclass of `{local_name(near.meant)}`" if near else ""
    above = [f"`{local_name(one)}`" for one in ontology.ancestors(cls)[1:] if not actions.is_any(one)][:MOST_ABOVE]
    module = " or ".join([f"`{local_name(cls)}`", *above])
    for known in map(local_name, checked.ontology.ancestors(cls)):
        if not actions.is_any(expand(known)) and (misspelt := checked.file.modules.similar(known, least=SURE)):
            return f"a process module performs `{misspelt[0]}`: did you mean `{known}` in its actions?"
    return f"register a process module for {module} (docs/guides/modules.md), or add sub-actions{below}"


_WORDS = ("dependsOnCapability", "dependsOnComponent", "hasCapabilityDependency")
_UPPER = {"dependsOnCapability": "Capability", "hasCapabilityDependency": "Capability"}
_ENDINGS = Spellings(("Capability", "Component"))
_NO_COMPONENTS = ("Capability", "Action", "Event")
_LAST_PART = re.compile(r"(?<=.)[A-Z][a-z]+$")
_DISJOINT = "http://www.w3.org/2002/07/owl#disjointWith"


@check("R046")
def requirements(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report direct and indirect dependencies of tasks and steps that are undefined, impossible or circular."""
    ontology, recipes = checked.ontology, checked.recipes
    classes: dict[str, None] = {}
    for recipe in recipes.recipes.values():
        owners: tuple[Recipe | Step, ...] = (recipe, *recipe.steps)
        for owner in owners:
            classes |= dict.fromkeys(ontology.ancestors(owner.action_class))

    def needed(cls: str) -> Iterator[str]:
        fillers = (one.filler for one in _requirements(ontology, cls))
        return (above for filler in fillers if isinstance(filler, str) for above in ontology.ancestors(filler))

    seen = list(reached(classes, needed))
    for cls in seen:
        for restriction in _requirements(ontology, cls):
            yield from _dependency(ontology, cls, restriction)
    yield from _circles(ontology, seen)


def _requirements(ontology: Ontology, cls: str) -> list[Restriction]:
    return [one for one in ontology.restrictions(cls) if is_word(one.property, *_WORDS)]


def _dependency(ontology: Ontology, cls: str, restriction: Restriction) -> Iterator[Diagnostic]:
    needed, word = restriction.filler, local_name(restriction.property)
    if not isinstance(needed, (str, BNode)) or restriction.kind in ("max", "only"):
        return
    if isinstance(needed, str) and not ontology.defined(needed):
        suggestion = _alternatives(ontology, word, _ending(needed)).guess(needed, LIKE)
        advice = f"did you mean {suggestion}?" if suggestion else "import the file that defines it, or correct the name"
        message = f"`{local_name(cls)}` depends on `{local_name(needed)}`, which is not defined"
        yield warning("R046", message, restriction.span, advice, suggestion)
        return
    both = _excluded(ontology, needed)
    if both is not None:
        names = " and ".join(f"`{local_name(name)}`" for name in both)
        message = f"`{local_name(cls)}` depends on something that is both {names}, which exclude each other"
        yield error("R046", message, restriction.span, "depend on each of them, or on one")


@kept
def _alternatives(ontology: Ontology, word: str, ending: str) -> Known:
    """Classes to suggest: capabilities or components with the same uninformative ending, if any."""
    upper = _UPPER.get(word)
    if upper:
        names = ontology.subclasses(expand(upper))[1:]
    else:
        others = {name for top in _NO_COMPONENTS for name in ontology.subclasses(expand(top))}
        names = tuple(name for name in ontology.class_names() if name not in others)
    return Known((name for name in names if not ending or _ending(name) == ending), _telling)


def _ending(name: str) -> str:
    """Uninformative ending of a name, such as Capability, even if misspelt; empty for other names."""
    last = _LAST_PART.search(local_name(name))
    return next(iter(_ENDINGS.similar(last[0], least=0.8)), "") if last else ""


def _telling(name: str) -> str:
    """Local name without its uninformative ending."""
    short = local_name(name)
    return _LAST_PART.sub("", short) if _ending(name) else short


def _excluded(ontology: Ontology, needed: str | BNode) -> tuple[str, str] | None:
    """Find two disjoint classes above a required class or expression; None if there are none."""
    named = [one for one in ontology.members(needed) if isinstance(one, str)]
    above = dict.fromkeys(ancestor for name in named for ancestor in ontology.ancestors(name))
    for cls in above:
        for triple in ontology.triples(s=cls, p=_DISJOINT):
            if isinstance(triple.object, str) and triple.object in above and triple.object != cls:
                return cls, triple.object
    return None


def _circles(ontology: Ontology, classes: list[str]) -> Iterator[Diagnostic]:
    """Report capabilities that depend on themselves: only robots that state them explicitly have them."""
    below = {
        cls: {one.filler: one for one in _requirements(ontology, cls) if isinstance(one.filler, str)} for cls in classes
    }
    for cls in classes:
        path, seen = [cls], {cls}
        waiting = [(other, [cls, other]) for other in below[cls]]
        while waiting:
            name, path = waiting.pop(0)
            if name == cls:
                circle = " > ".join(f"`{local_name(one)}`" for one in path)
                if cls == min(path):
                    message = f"`{local_name(cls)}` depends on itself: {circle}"
                    yield warning("R046", message, below[cls][path[1]].span, "remove one of these dependencies")
                break
            if name not in seen:
                seen.add(name)
                waiting += [(other, [*path, other]) for other in below.get(name, {})]


@check("R050")
def undefined_states(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report undefined names of states."""
    ontology, statements, recipe = checked.ontology, checked.statements, checked.recipe
    defined = Known(name for name in statements.names if ontology.defined(name))
    for name in statements.mentioned():
        if not ontology.defined(name) and name not in statements.names:
            other = defined.guess(name)
            advice = f"did you mean {other}?" if other else f"define it, and add `subAction some {local_name(name)}`"
            message = f"the state `{local_name(name)}` of `{recipe.name}` is not defined"
            yield error("R050", message, _where(ontology, statements, name) or recipe.span, advice, other)


@check("R051")
def unlisted_sub_actions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report states that are not listed as sub-actions although others are; they are treated as such."""
    recipe = checked.recipe
    for name, where in unlisted_states(checked.ontology, checked.statements):
        message = f"`{local_name(name)}` is a state of `{recipe.name}`, but not a sub-action: it is treated as one"
        advice = f"add `subAction some {local_name(name)}` to `{recipe.name}`"
        yield warning("R051", message, where or recipe.span, advice)


def unlisted_states(ontology: Ontology, statements: Statements) -> Iterator[tuple[str, Span | None]]:
    """Yield the defined states (IRIs) of a finite-state recipe that are not sub-actions, with their first mention."""
    listed = {*statements.names}
    for name in statements.mentioned() if statements.states is not None else ():
        if name not in listed and ontology.defined(name):
            yield name, _where(ontology, statements, name)


@check("R052")
def starts_and_ends(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report a recipe without exactly one start state, or without an end state."""
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
    """Report ordering constraints of a finite-state recipe, which have no effect."""
    orderings = checked.statements.orderings
    if checked.statements.states is not None and orderings:
        message = f"`{checked.recipe.name}` has states and ordering constraints: only the transitions count"
        yield warning("R057", message, orderings[0].span, "remove the constraints, or write transitions")


@check("R053")
def ambiguous_transitions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report transitions from one state with the same outcome to different states."""
    machine, recipe = checked.recipe.machine, checked.recipe
    first: dict[tuple[str, str | Ending], Transition] = {}
    for one in machine.transitions if machine is not None else ():
        is_named = one.ending in (Ending.OTHER, Ending.FAILED) and one.outcome
        earlier = first.setdefault((one.source, one.outcome if is_named and one.outcome else one.ending), one)
        if earlier.target != one.target:
            message = (
                f"from `{local_name(one.source)}`, {_word(one)} leads to two states:"
                f" `{local_name(earlier.target)}` and `{local_name(one.target)}`"
            )
            advice = "give them different outcomes (causedBy), or keep one"
            spans = (each.span for each in (earlier, one) if each.span is not None)
            yield error("R053", message, max(spans, default=recipe.span), advice)


@check("R054", unless=("R052",))
def unreachable_states(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report states that no transitions from the start lead to."""
    machine, recipe = checked.recipe.machine, checked.recipe
    if machine is None:
        return
    follows = grouped((one.source, one.target) for one in machine.transitions)
    entered = set(reached((machine.start,), lambda state: follows.get(state, ())))
    lost = [step for step in recipe.steps if step.iri not in entered]
    for step in lost:
        if step.iri in machine.ends and not entered & set(machine.ends):
            continue
        message = f"the state `{step.name}` cannot be reached from `{local_name(machine.start)}`"
        advice = f"add a transition with `toState {step.name}`, or remove the state"
        yield warning("R054", message, step.span, advice)
    if not entered & set(machine.ends):
        names = ", ".join(f"`{local_name(end)}`" for end in machine.ends)
        message = f"no end of `{recipe.name}` ({names}) can be reached from `{local_name(machine.start)}`"
        yield error("R054", message, recipe.span, "add the missing transitions")


@check("R055", unless=("R052",))
def uncovered_endings(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report outcomes of states without a transition, and transitions that are never taken, such as those from end
    states.
    """
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
        yield from _never_taken(step, own) if checks else _unknown_outcomes(actions, step, own)
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


def _never_taken(state: Step, own: list[Transition]) -> Iterator[Diagnostic]:
    """Report outcomes without a known meaning of a state that checks a condition."""
    for one in own:
        if one.ending is Ending.OTHER and one.outcome is not None:
            message = f"`{state.name}` checks a condition: its transition with `{_word(one)}` is never taken"
            yield warning("R055", message, one.span, "write `causedBy CONDITION_TRUE`, or CONDITION_FALSE")


def _unknown_outcomes(actions: Actions, state: Step, own: list[Transition]) -> Iterator[Diagnostic]:
    """Report outcomes without a known meaning: they occur only if the performer of the state returns their name."""
    for one in own:
        if one.ending is Ending.OTHER and one.outcome is not None and not actions.ontology.defined(one.outcome):
            message = f"the outcome `{_word(one)}` is not defined: it occurs only if it is the result of `{state.name}`"
            advice = (
                "write `causedBy` CONDITION_TRUE, CONDITION_FALSE, COMPLETED_OK or COMPLETED_FAILED;"
                f" or define it: `Individual: {_word(one)}` with `Types: ActionResult`"
            )
            yield warning("R055", message, one.span, advice)


@check("R056", unless=("R052",))
def unhandled_failures(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report a recipe that handles no failure: any failure ends it, and a loop may never end."""
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


def _word(transition: Transition) -> str:
    return local_name(transition.outcome) if transition.outcome else "any outcome"


def _where(ontology: Ontology, statements: Statements, name: str) -> Span | None:
    """First mention of a state: in a transition, else as start or end."""
    transitions = statements.states.transitions if statements.states is not None else ()
    events = {one.iri for one in transitions}
    mentions = list(ontology.triples(o=name))
    spans = [triple.span for triple in mentions if str(triple.subject) in events]
    return min(spans or [triple.span for triple in mentions], default=None)
