"""Questions about action classes that need the taxonomy and the tables: primitives, base motions, hands, goals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from planlang.action_conditions import Declared, Pattern, declared, text_of, texts
from planlang.closure import grouped, reached
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error
from planlang.ontology import Literal, Ontology, expand, shorten
from planlang.recipe.fillers import action_class, fillings, read_filler
from planlang.recipe.model import Filler, Kind, Parameter, Place, Recipe, RecipeSet, Slot, Step, Thing
from planlang.recipe.readers import statements_of
from planlang.recipe.slots import read_slots
from planlang.recipe.statements import Statements
from planlang.records import dataclass

Performed = Callable[[], frozenset[str]]


@dataclass(frozen=True, slots=True)
class Movers:
    """Steps that move the base: ``opening`` ones start a location scope, ``ending`` ones only end the previous one."""

    opening: frozenset[str]
    ending: frozenset[str] = frozenset()


_ANY = "PurposefulAction"
"""The class of all deliberate actions; this class and those above it do not say which action is meant."""

_HANDLED = ("in_center_of", "in_front_of")
"""Relations between a goal of the hand and the thing that it handles there."""
SIDED = frozenset({"arm", "gripper"})
"""Resources that exist once per side of a robot."""
_DEPENDS = expand("dependsOnCapability")
_BASE_MOTION = expand("BaseMotionCapability")


class Actions:
    """The action classes of one ontology.

    ``performed`` returns the classes (IRIs, or local names of the vocabulary) that process modules outside the ontology
    perform. It is called only for steps that nothing in the ontology performs, because importing modules is slow.
    """

    def __init__(self, ontology: Ontology, performed: Performed | None = None) -> None:
        self.ontology = ontology
        self.performed: Performed = performed or frozenset
        self.primitives: dict[str, Primitive] = read_primitives(ontology)
        self.declared: Declared = declared(ontology)
        self._letting_go = self.declared.ending("holding")
        self.library: dict[str, list[str]] = read_library(ontology)
        """Class of actions (IRI) -> recipes of the library that perform it if the file states none."""
        self._standard = frozenset().union(*self.library.values())
        self.declared_slots, self.slot_problems = read_slots(ontology)
        self.recoveries: tuple[RecoveryRule, ...] = read_recoveries(ontology)
        self.performers: dict[str, tuple[tuple[str, ...], str | None]] = {}
        """Action (IRI) -> its performers, cached results of :func:`recipes_for`."""
        self._statements: dict[str, Statements | None] = {}
        self._slots: dict[tuple[str, ...], dict[str, Slot]] = {}
        self._last_moving: tuple[RecipeSet, tuple[frozenset[str], frozenset[str]]] | None = None

    def statements(self, iri: str) -> Statements | None:
        """Recipe that a class or an individual states; None if it states none. Each is read once."""
        if iri not in self._statements:
            statements = self._statements[iri] = statements_of(self.ontology, iri)
            for sub in statements.sub_actions if statements is not None else ():
                for name, member in sub.alternatives:
                    assert statements is not None
                    self._statements[name] = Statements(name, statements.dialect, (member,))
        return self._statements[iri]

    def is_a(self, step: Step | Recipe, *classes: str) -> bool:
        """True if the class of the step is a subclass of one of the classes (local names of the vocabulary)."""
        return self.ontology.any_is_a((step.action_class,), classes)

    def is_any(self, cls: str) -> bool:
        """True for a class (IRI, or local name of the vocabulary) that is no more specific than "some action"."""
        return self.ontology.is_a(expand(_ANY), expand(cls))

    def primitive(self, step: Step) -> Primitive | None:
        """Primitive that performs the step, if any."""
        return self.primitives[step.primitive] if step.primitive is not None else None

    def is_standard(self, step: Step) -> bool:
        """True unless a recipe of the file performs the step; otherwise the slots of its class apply."""
        return self.is_of_library(step.recipes)

    def is_of_library(self, recipes: Iterable[str]) -> bool:
        """True if all recipes (IRIs) belong to the library."""
        return self._standard.issuperset(recipes)

    def is_base_motion(self, step: Step) -> bool:
        """True for a primitive step that depends on BaseMotionCapability and states a destination."""
        if step.primitive is None or not any(isinstance(goal, (Place, Thing)) for goal in step.fillers("toLocation")):
            return False
        return any(
            restriction.property == _DEPENDS
            and isinstance(restriction.filler, str)
            and self.ontology.is_a(restriction.filler, _BASE_MOTION)
            for ancestor in self.ontology.ancestors(step.action_class)
            for restriction in self.ontology.restrictions(ancestor)
        )

    def moves_the_base(self, recipe: Recipe, recipes: RecipeSet) -> bool:
        """True if the recipe contains a base motion, directly or in a recipe below it."""
        return recipe.iri in self._moving(recipes)[0]

    def movers(self, recipe: Recipe, recipes: RecipeSet) -> Movers:
        """Find the steps of a recipe that move the base, directly or in a recipe below them.

        Recipes of the library do not count: they replace a process module, and the base returns to the pose of the
        caller's scope afterwards.
        """
        _, moving = self._moving(recipes)
        opening = frozenset(step.iri for step in recipe.steps if self.is_base_motion(step))
        ending = frozenset(step.iri for step in recipe.steps if not moving.isdisjoint(step.recipes))
        return Movers(opening, ending)

    def _moving(self, recipes: RecipeSet) -> tuple[frozenset[str], frozenset[str]]:
        """Recipes (IRIs) that move the base, directly or in a recipe below them; then those that do so without the
        library.
        """
        if self._last_moving is None or self._last_moving[0] is not recipes:
            every = recipes.recipes.values()
            callers = grouped(
                (callee, recipe.iri) for recipe in every for step in recipe.steps for callee in step.recipes
            )
            own = [recipe.iri for recipe in every if any(map(self.is_base_motion, recipe.steps))]
            stated = [iri for iri in own if iri not in self._standard]
            self._last_moving = recipes, (_with_callers(own, callers), _with_callers(stated, callers))
        return self._last_moving[1]

    def finds_its_place(self, step: Step, recipes: RecipeSet) -> bool:
        """True if recipes perform the step that drive to where it is possible, all of them of the library."""
        moving, by_themselves = self._moving(recipes)
        return not moving.isdisjoint(step.recipes) and by_themselves.isdisjoint(step.recipes)

    def brings(self, step: Step, recipes: RecipeSet) -> bool:
        """True if a recipe that performs the step takes a thing at one place and lets it go at another."""
        moving = self._moving(recipes)[0]
        for recipe in (recipes.recipes[iri] for iri in step.recipes if iri in moving):
            inner = [one for one in recipe.steps if not moving.isdisjoint(one.recipes)]
            if any(map(self.takes, inner)) and any(map(self.releases, inner)):
                return True
        return False

    def takes(self, step: Step) -> bool:
        """True if a thing is in the hand after the step."""
        goal = self.goal(step.action_class)
        return goal is not None and goal.predicate == "holding"

    def uses_hand(self, step: Step) -> bool:
        """True for a primitive that needs an arm or a gripper."""
        primitive = self.primitive(step)
        return primitive is not None and not SIDED.isdisjoint(primitive.resources)

    def hand_goals(self, step: Step) -> tuple[Place | Thing, ...]:
        """Goals of the hand in a primitive step, without named postures."""
        if not self.uses_hand(step):
            return ()
        return tuple(
            filler
            for filler in step.fillers("toLocation")
            if isinstance(filler, Thing) or (isinstance(filler, Place) and not filler.is_posture)
        )

    def properties(self, cls: str) -> frozenset[str]:
        """Properties (IRIs) that the vocabulary lists for an action class or its ancestors."""
        return frozenset(self.ontology.valid_properties(cls))

    def slots(self, cls: str) -> Mapping[str, Slot]:
        """Slots of an action class by property; the nearest class that declares a property wins."""
        declaring = tuple(filter(self.declared_slots.__contains__, self.ontology.ancestors(cls)))
        slots = self._slots.get(declaring)
        if slots is None:
            slots = {}
            for above in declaring:
                for name, slot in self.declared_slots[above].items():
                    slots.setdefault(name, slot)
            self._slots[declaring] = slots
        return slots

    def goal(self, cls: str) -> Pattern | None:
        """Goal declared for the class or its nearest ancestor that has one."""
        goals = self.declared.goals
        return next((goals[ancestor] for ancestor in self.ontology.ancestors(cls) if ancestor in goals), None)

    def releases(self, step: Step) -> bool:
        """True if the step releases something."""
        return not self._letting_go.keys().isdisjoint(self.ontology.ancestors(step.action_class))

    def released(self, step: Step) -> frozenset[Thing | None]:
        """Things that a step releases; {None} if it does not state which."""
        names = [name for cls in self.ontology.ancestors(step.action_class) for name in self._letting_go.get(cls, ())]
        things = {filler for name in names for filler in step.fillers(name) if isinstance(filler, Thing)}
        return frozenset(things) if things else frozenset({None})


def gone_to(filler: Filler) -> Iterator[Thing]:
    """Yield the things to see before a hand moves to a location: the thing itself, or the one to handle there.

    A person is always included, whatever the relation: people move.
    """
    if isinstance(filler, Thing):
        yield filler
    elif isinstance(filler, Place):
        for relation, references in filler.relations:
            things = (one for one in references if isinstance(one, Thing))
            yield from (one for one in things if relation in _HANDLED or one.kind is Kind.PERSON)


def _with_callers(recipes: Iterable[str], callers: Mapping[str, Sequence[str]]) -> frozenset[str]:
    """Recipes together with their direct and indirect callers."""
    return frozenset(reached(recipes, lambda one: callers.get(one, ())))


@dataclass(frozen=True, slots=True)
class Primitive:
    """An action class that a process module performs.

    ``resources`` are roles (base, head, torso, arm, gripper); ``implies`` are classes of actions that it performs as a
    side effect.
    """

    action: str
    module: str
    resources: tuple[str, ...] = ()
    implies: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RecoveryRule:
    """A recovery from a failure of an action: a strategy, its attempts, and the failure raised after the last."""

    name: str
    actions: tuple[str, ...]
    failures: tuple[str, ...]
    strategy: str
    attempts: int
    escalates_to: str | None
    rank: int
    transient: bool = False
    """True if the failure may pass by itself."""
    within: float | None = None
    """Time since the start of the action after which nothing more is attempted [s]."""
    span: Span | None = None
    problems: tuple[Diagnostic, ...] = ()
    """Errors (R043) of malformed numbers; the rule uses the default instead."""


def read_primitives(ontology: Ontology) -> dict[str, Primitive]:
    """Read all primitives, by the IRI of their action class."""
    return {
        action: Primitive(
            action,
            next(iter(texts(ontology, individual, "processModule")), ""),
            texts(ontology, individual, "usesResource"),
            ontology.iris(individual, "impliesAction"),
        )
        for individual in ontology.individuals(expand("Primitive"))
        for action in ontology.iris(individual, "performsAction")
    }


def read_library(ontology: Ontology) -> dict[str, list[str]]:
    """Map action classes (IRIs) to the recipes (IRIs) that declare themselves the standard recipe for them."""
    return grouped((action, recipe) for recipe, action in ontology.links(expand("standardRecipeOf")))


def read_recoveries(ontology: Ontology) -> tuple[RecoveryRule, ...]:
    """Read all recovery rules, in the order of the files."""
    rules = []
    for individual in ontology.individuals(expand("Recovery")):
        problems: list[Diagnostic] = []
        for strategy in texts(ontology, individual, "strategy")[:1]:
            rule = RecoveryRule(
                local_name(individual),
                ontology.iris(individual, "recoversAction"),
                texts(ontology, individual, "recoversFailure"),
                strategy,
                _count(ontology, individual, "attempts", 1, problems),
                next(iter(texts(ontology, individual, "escalatesTo")), None),
                _count(ontology, individual, "rank", 0, problems),
                next(iter(texts(ontology, individual, "transient")), "") in ("true", "1"),
                _count(ontology, individual, "within", 0, problems) or None,
                ontology.span(individual),
            )
            rules.append(replace(rule, problems=tuple(problems)))
    return tuple(rules)


def recoveries_of(ontology: Ontology, rules: tuple[RecoveryRule, ...], cls: str) -> list[tuple[str, RecoveryRule]]:
    """List the rules that apply to an action class as pairs (failure, rule), nearest class first, then by rank.

    For the same failure the rules of a nearer class replace those of a farther one; ``attempts 0`` disables them. Of a
    class there may be several for one failure: some strategies stay in place, and others move the base.
    """
    chosen: dict[str, list[RecoveryRule]] = {}
    for ancestor in ontology.ancestors(cls):
        nearer = set(chosen)
        for rule in sorted(rules, key=lambda rule: rule.rank):
            if ancestor in rule.actions:
                for failure in rule.failures:
                    if failure not in nearer:
                        chosen.setdefault(failure, []).append(rule)
    return [(failure, rule) for failure, some in chosen.items() for rule in some if rule.attempts > 0]


def _count(ontology: Ontology, subject: str, property_name: str, default: int, problems: list[Diagnostic]) -> int:
    for triple in ontology.triples(subject, expand(property_name)):
        try:
            number = triple.object.number() if isinstance(triple.object, Literal) else -1
        except ValueError:
            number = -1
        if number >= 0 and number == int(number):
            return int(number)
        stated = triple.object.value if isinstance(triple.object, Literal) else text_of(triple.object)
        message = f"{property_name} of the recovery `{local_name(subject)}` is {stated!r}, not a whole number from 0 on"
        problems.append(error("R043", message, triple.span, f"write a whole number, such as {default}"))
    return default


def recipes_for(actions: Actions, iri: str) -> tuple[tuple[str, ...], str | None]:
    """Find the performers of an action: recipes (IRIs), or else a primitive (IRI).

    The nearest class wins; an individual's own recipe is nearer than any of its class. At equal distance a primitive
    wins over recipes, and the recipes of the file over those of the library. Several recipes at equal distance are
    alternatives.
    """
    if iri not in actions.performers:
        actions.performers[iri] = _performers(actions, iri)
    return actions.performers[iri]


def best_recipes(actions: Actions, recipes: tuple[str, ...], parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """Choose among several recipes of the library the one that fits the parameters of an action best.

    The best recipe states the fewest properties that the action does not state, then the most that it does. Recipes of
    the file are all kept, because they are alternatives.
    """
    if len(recipes) < 2 or not actions.is_of_library(recipes):
        return recipes
    given = {(one.property, isinstance(one.filler, Place)) for one in parameters}

    def misfit(recipe: str) -> tuple[int, int]:
        own = _stated(actions.ontology, recipe)
        return len(own - given), -len(own & given)

    return (min(recipes, key=misfit),)


def _stated(ontology: Ontology, recipe: str) -> set[tuple[str, bool]]:
    """Pairs (property, whether a place fills it) that a recipe states, without the object acted on."""
    levels = [filling for level in fillings(ontology, recipe) for filling in level]
    read = ((shorten(one.property), read_filler(ontology, one.term, one.property)) for one in levels)
    return {(name, isinstance(filler, Place)) for name, filler in read if name != "objectActedOn"}


def recipes_of_task(actions: Actions, iri: str) -> tuple[str, ...]:
    """Recipes of a task: its own, even if a primitive performs it where it is a step of another recipe."""
    return (iri,) if actions.statements(iri) is not None else recipes_for(actions, iri)[0]


def statements_for(actions: Actions, iri: str) -> Statements:
    """Statements about a task that has a recipe, or about the class that it inherits the recipe from."""
    statements = actions.statements(recipes_of_task(actions, iri)[0])
    assert statements is not None
    return statements


def _performers(actions: Actions, iri: str) -> tuple[tuple[str, ...], str | None]:
    for level in _levels(actions.ontology, iri):
        for ancestor in level:
            if ancestor in actions.primitives:
                return (), ancestor
        recipes = tuple(ancestor for ancestor in level if actions.statements(ancestor) is not None)
        recipes = recipes or tuple(recipe for ancestor in level for recipe in actions.library.get(ancestor, ()))
        if recipes:
            return recipes, None
    return (), None


def _levels(ontology: Ontology, iri: str) -> Iterator[tuple[str, ...]]:
    """Yield the individual, its class, the direct superclasses, theirs, ...: each class at its smallest distance."""
    cls = iri
    if not ontology.is_class(iri):
        yield (iri,)
        cls = action_class(ontology, iri) or iri
    ancestors = set(ontology.ancestors(cls))
    seen = {cls, iri}
    level: tuple[str, ...] = (cls,) if cls != iri or ontology.is_class(iri) else ()
    while level:
        yield level
        above: list[str] = []
        for member in level:
            for ancestor in ontology.parents(member):
                if ancestor in ancestors and ancestor not in seen:
                    seen.add(ancestor)
                    above.append(ancestor)
        level = tuple(above)
