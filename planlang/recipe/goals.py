"""Goals that a recipe declares: what its class, and its steps, bring about and no later step undoes.

Ontologies declare what actions bring about (:mod:`planlang.action_conditions`, :mod:`planlang.effects`). Only what a
state of the world decides is a goal: who holds a thing, where it rests, what is open, closed, on, off or clean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from planlang.action_conditions import Pattern, declared
from planlang.designators import Location, Object, Person, Relation, local_name
from planlang.effects import effects_of
from planlang.goals import CLOSED, OFF, ON, OPEN, At, Fact, Goal, HeldBy, InState, RestsAt
from planlang.ontology import Ontology
from planlang.recipe.model import Kind, Place, Recipe, RecipeSet, Step, Thing
from planlang.recipe.order import Precedence, recipe_order
from planlang.records import dataclass

Meant = Callable[[Object], Object | None]
"""Finds the thing that an individual of a recipe stands for in a run; None if none is known."""
DEVICE_STATES = {"DeviceStateOn": ON, "DeviceStateOff": OFF}
ACTED_ON = ("objectActedOn", "deviceUsed")
"""Properties of actions whose fillers are changed."""
RESTING = ("on", "in_")
"""Relations of a place that say where a thing rests."""


@dataclass(frozen=True, slots=True)
class Brought:
    """What a step brings about of a thing (IRI)."""

    step: str
    subject: Thing
    fact: Fact
    words: str


def declared_goals(ontology: Ontology, recipes: RecipeSet, meant: Meant) -> tuple[Goal, ...]:
    """List the goals of a task, in the order of its steps: none for a state machine, or for orders with a cycle."""
    lasting = [*_of(ontology, recipes.main, meant), *lasting_effects(ontology, recipes.main, meant)]
    goals: dict[tuple[Object, Fact], Goal] = {}
    for one in lasting:
        what = meant(_object(one.subject))
        if what is not None:
            goals.setdefault((what, one.fact), Goal(f"{local_name(what.iri or what.type)} {one.words}", what, one.fact))
    return tuple(goals.values())


def lasting_effects(ontology: Ontology, recipe: Recipe, meant: Meant = lambda what: what) -> Iterator[Brought]:
    """Yield what the steps of a recipe bring about that no step which may come later undoes."""
    if recipe.machine is not None:
        return
    try:
        order = recipe_order(recipe)
    except ValueError:
        return
    steps = {step.iri: step for step in recipe.steps}
    for iri in order.extension:
        step = steps[iri]
        if not (step.is_choice or step.is_abstract or step.times > 1):
            yield from (one for one in _of(ontology, step, meant) if not _is_undone(one, ontology, recipe, order))


def _of(ontology: Ontology, action: Step | Recipe, meant: Meant) -> Iterator[Brought]:
    """Yield what an action brings about, whatever comes later."""
    table, classes = declared(ontology), ontology.ancestors(action.action_class)
    for cls in classes:
        for pattern, given in table.effects.get(cls, ()):
            if not given:
                yield from _of_pattern(action, pattern, meant)
    for state in effects_of(ontology, action.action_class).states[:1]:
        properties = reversed(ACTED_ON) if local_name(state) in DEVICE_STATES else ACTED_ON
        subject = next(filter(None, (_thing(action, name) for name in properties)), None)
        if subject is not None:
            said = DEVICE_STATES.get(local_name(state), state)
            words = f"switched {said}" if said in (ON, OFF) else f"is {local_name(state)}"
            yield Brought(action.iri, subject, InState(said), words)


def _of_pattern(action: Step | Recipe, pattern: Pattern, meant: Meant) -> Iterator[Brought]:
    match pattern.predicate, pattern.properties:
        case ("open" | "closed") as state, (name,):
            if (subject := _thing(action, name)) is not None:
                yield Brought(action.iri, subject, InState(OPEN if state == "open" else CLOSED), state)
        case "holding", (name,):
            if (subject := _thing(action, name)) is not None:
                yield Brought(action.iri, subject, HeldBy(None), "held by robot")
        case "located", (where, name):
            subject, place = _thing(action, name), next(iter(action.fillers(where)), None)
            found = None if subject is None else _located(place, meant)
            if subject is not None and found is not None:
                yield Brought(action.iri, subject, *found)


def _located(place: object, meant: Meant) -> tuple[Fact, str] | None:
    """What is so of a thing at a place, and its words; None if no state of the world decides it."""
    if isinstance(place, Thing) and place.iri is not None:
        where = meant(_object(place))
        if where is None:
            return None
        if place.kind is Kind.PERSON:
            return HeldBy(where), f"held by {local_name(where.iri or where.type)}"
        return RestsAt(where), f"on or in {local_name(where.iri or where.type)}"
    if not isinstance(place, Place):
        return None
    relations, words = list[Relation](), list[str]()
    for name, references in place.relations:
        whats = [meant(_object(one)) for one in references if isinstance(one, Thing) and one.iri is not None]
        if name in RESTING and len(whats) == len(references) and None not in whats:
            relations.append(Relation(name, tuple(one for one in whats if one is not None)))
            words.append(f"{name.strip('_')} {' and '.join(local_name(one.iri or '') for one in whats if one)}")
    return (At(Location(tuple(relations))), " and ".join(words)) if relations else None


def _is_undone(brought: Brought, ontology: Ontology, recipe: Recipe, order: Precedence[str]) -> bool:
    """Check whether another step may change what a step brings about: one that acts on its thing, or opens a hand."""
    table = declared(ontology)
    for step in recipe.steps:
        if step.iri == brought.step or order.before(step.iri, brought.step):
            continue
        if any(_same(filler, brought.subject) for name in ACTED_ON for filler in step.fillers(name)):
            return True
        if step.is_choice or step.is_abstract:
            return True
        ended = [one for cls in ontology.ancestors(step.action_class) for one in table.ends.get(cls, ())]
        if (
            isinstance(brought.fact, HeldBy)
            and brought.fact.holder is None
            and any(
                one.predicate == "holding" and not any(step.fillers(name) for name in one.properties) for one in ended
            )
        ):
            return True
    return False


def _same(filler: object, thing: Thing) -> bool:
    return isinstance(filler, Thing) and filler.iri == thing.iri


def _thing(action: Step | Recipe, name: str) -> Thing | None:
    """The individual that fills a property, if it is one thing that is no arm or hand."""
    fillers = list(action.fillers(name))
    if len(fillers) == 1 and isinstance(fillers[0], Thing) and fillers[0].kind is Kind.OBJECT and fillers[0].iri:
        return fillers[0]
    return None


def _object(thing: Thing) -> Object:
    kind = Person if thing.kind is Kind.PERSON else Object
    return kind(thing.type, thing.iri)
