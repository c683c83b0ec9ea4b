"""Lower recipes to the plan tree: functions, location scopes, steps, the constructs around them, recoveries.

A thing that a step acquired may be lost in any later step until it is released. Then the step that acquired it is run
again, and after it the step that lost it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace

from planlang.compiler.expressions import without_digits
from planlang.compiler.recoveries import Recoveries
from planlang.compiler.structure import Overlaps, arranged_by, machine
from planlang.compiler.terms import HandUse, Roles, Substitution, Terms, substituted_thing
from planlang.compiler.tree import (
    Achieve,
    Again,
    Alternatives,
    Call,
    Condition,
    Function,
    FunctionCall,
    Handle,
    Hold,
    Node,
    Parallel,
    PartialOrder,
    Perform,
    PlaceUse,
    PlanTree,
    Recover,
    Scope,
    Series,
)
from planlang.compiler.turns import Turns
from planlang.designators import snake_case
from planlang.diagnostics import Diagnostic, note
from planlang.effects import effects_of
from planlang.ontology import Ontology, shorten
from planlang.ontology.terms import OWL, UPPER
from planlang.recipe.actions import Actions
from planlang.recipe.checks import check
from planlang.recipe.checks.orderings import ordering_to_write
from planlang.recipe.fillers import action_class, is_vocabulary_class
from planlang.recipe.model import Kind, Place, Recipe, RecipeSet, Step, Thing
from planlang.recipe.order import Precedence, callees_first, recipe_order
from planlang.recipe.scopes import Unit, scopes_of, single_steps
from planlang.records import dataclass


class Lowering:
    """Lowers a checked set of recipes: without cycles, recursion, or unordered base motions."""

    def __init__(self, ontology: Ontology, recipes: RecipeSet, actions: Actions, *, scopes: bool = True) -> None:
        self._recipes = recipes
        self._actions = actions
        self._scopes = scopes
        self._terms = Terms(ontology, recipes, actions)
        self._roles = Roles(recipes, actions, self._terms)
        self._steps = Steps(recipes, actions, self._terms, self._roles)
        self._bases: list[tuple[PlaceUse, list[HandUse]]] = []
        self.diagnostics: list[Diagnostic] = []
        self.added: dict[str, tuple[tuple[str, str], ...]] = {}

    def tree(self) -> PlanTree:
        """Build the plan tree of all recipes."""
        functions = [self._function(recipe) for recipe in callees_first(self._recipes) if recipe.within is None]
        functions = [self._steps.turns.added(function) for function in functions]
        steps = (step for recipe in self._recipes.recipes.values() for step in self._terms.steps(recipe))
        steps = (step for step in steps if not step.is_choice)
        classes = stated_classes(self._actions.ontology, map(self._terms.performed_class, steps))
        return PlanTree(tuple(functions), self._terms.devices_of_places(self._bases), classes)

    @property
    def recoveries(self) -> Mapping[tuple[str, str], tuple[str, ...]]:
        """Recoveries of each step of a recipe (both IRIs), in words; complete once the tree is built."""
        return self._steps.recoveries_in_words

    def _function(self, recipe: Recipe) -> Function:
        body = self._machine(recipe) if recipe.machine is not None else self._ordered(recipe)
        if recipe.iri == self._recipes.task:
            things = [thing for thing in self._terms.parameters(recipe) if thing.kind is Kind.OBJECT]
            about = things[0] if things else None
            chooser = self._steps.recoveries
            recoveries = chooser.around_step(recipe.action_class, about, frozenset())
            recoveries += chooser.going_back(recipe.action_class, about)
            if recoveries:
                body = Series((Handle(body, recoveries),))
        self._steps.turns.bodies[recipe.iri] = body
        return Function(recipe.iri, recipe.label, self._terms.parameters(recipe), body)

    def _machine(self, recipe: Recipe) -> Series:
        """State machine of a recipe. It has no scopes, because states run one by one and a loop may leave any scope."""
        self.added[recipe.iri] = ()

        def state_node(step: Step) -> Node:
            return self._steps.with_looking(recipe, self._steps.node(recipe, step, frozenset()), [step])

        return Series((machine(recipe, state_node, lambda step: self._terms.products(recipe, step)),))

    def _ordered(self, recipe: Recipe) -> Series:
        order = recipe_order(recipe)
        scoping = scopes_of(self._actions, recipe, self._recipes, order) if self._scopes else single_steps(order)
        self.added[recipe.iri] = scoping.added
        self.diagnostics += added_orders(recipe, scoping.added)
        if scoping.added:
            order = order.extended(scoping.added)
        overlaps = Overlaps(recipe, order)
        holding = self._roles.held(recipe, order)

        def node(iri: str) -> Node:
            return self._steps.node(recipe, recipe.step(iri), holding)

        def unit_node(unit: Unit) -> Node:
            if unit.base is not None and unit.steps:
                return self._scope(recipe, unit, [overlaps.gated(iri, node(iri)) for iri in unit.steps])
            (iri,) = unit.members()
            inner = node(iri)
            # if the recipe does not move the base, the scope of its caller handles recoveries that look from elsewhere
            is_outermost = recipe.iri == self._recipes.task or self._actions.moves_the_base(recipe, self._recipes)
            if is_outermost:
                alone, step = unit.base is not None, recipe.step(iri)
                inner = self._steps.with_looking(recipe, inner, [step], in_scope=alone or not self._scopes, alone=alone)
            return overlaps.gated(iri, inner)

        nodes = [unit_node(unit) for unit in scoping.units]
        body = arranged_by(scoping.order, nodes, [recipe.step(unit.members()[0]).name for unit in scoping.units])
        steps = ([recipe.step(iri) for iri in unit.members()] for unit in scoping.units)
        return self._steps.with_going_back(recipe, body, zip(nodes, steps, strict=True))

    def _scope(self, recipe: Recipe, unit: Unit, nodes: list[Node]) -> Node:
        assert unit.base is not None
        base = recipe.step(unit.base)
        steps = [recipe.step(iri) for iri in unit.steps]
        order = recipe_order(recipe)
        inner = Precedence(unit.steps, ((one, other) for one in unit.steps for other in order.covers(one)))
        body = arranged_by(inner, nodes, [recipe.step(iri).name for iri in unit.steps])
        inside = frozenset(unit.steps)
        uses = list(self._terms.hand_uses(recipe, [s for s in self._terms.steps(recipe) if s.iri in inside]))
        use = self._terms.use(_destination(base))
        self._bases.append((use, uses))
        reaching = tuple(dict.fromkeys(where for where, _ in uses))
        attempts = self._steps.recoveries.attempts_at_places(base)
        where = self._terms.place(recipe, base, use.place)
        scope = Scope(base.name, shorten(base.action_class), where, reaching, attempts, body, base.label)
        return self._steps.with_looking(recipe, scope, [base, *steps])


def above_of(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """Direct superclasses of a class, or the class of actions of an individual.

    Of a class of SOMA or DUL only those in the vocabulary, if there are any: what is above it there, nothing performs.
    """
    cls = action_class(ontology, iri) if not ontology.is_class(iri) else None
    parents = ontology.parents(iri) if cls is None else (cls,)
    return (tuple(filter(is_vocabulary_class, parents)) if iri.startswith(UPPER) else ()) or parents


def stated_classes(ontology: Ontology, classes: Iterable[str]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Find the classes that a plan has to declare, superclasses first: (name, names of the direct superclasses).

    These are the classes (IRIs), and their ancestors, that are not in the bundled vocabulary. Names are local in the
    vocabulary's namespace. In a circle of subclasses the last one is left out.
    """
    declared: dict[str, tuple[str, ...]] = {}
    open_: dict[str, None] = {}
    waiting = list(dict.fromkeys(classes))[::-1]
    while waiting:
        cls = waiting[-1]
        above = [
            one
            for one in above_of(ontology, cls)
            if one != OWL.Thing and (one not in open_ or shorten(one) in declared)
        ]
        undeclared = [one for one in above if shorten(one) not in declared and not is_vocabulary_class(one)]
        if is_vocabulary_class(cls) or shorten(cls) in declared or not above:
            waiting.pop()
        elif undeclared and cls not in open_:
            open_[cls] = None
            waiting += reversed(undeclared)
        else:
            declared[shorten(cls)] = tuple(map(shorten, above))
            waiting.pop()
    return tuple(declared.items())


@check("R041")
def added_orders(recipe: Recipe, added: Iterable[tuple[str, str]]) -> Iterator[Diagnostic]:
    """Report the orders of steps (IRIs) that location scopes add to a recipe."""
    for before, after in added:
        first, second = recipe.step(before), recipe.step(after)
        message = f"`{first.name}` now comes before `{second.name}`: steps at the same base pose are performed together"
        advice = f"state the order if it is intended: {ordering_to_write(recipe, before, after)}"
        yield note("R041", message, first.span, advice)


def _destination(base: Step) -> Place:
    """Destination of a base motion: its place, or a place from which its thing is in reach."""
    filler = next(filler for filler in base.fillers("toLocation") if isinstance(filler, (Place, Thing)))
    if isinstance(filler, Place):
        return filler
    iri = filler.iri or filler.stated if filler.slot is None else filler.name
    return Place(f"{iri.removesuffix(filler.name)}near-{filler.name}", (("in_reach_of", (filler,)),))


class Steps:
    """Builds the nodes of steps; called recipes have to be processed before their callers."""

    def __init__(self, recipes: RecipeSet, actions: Actions, terms: Terms, roles: Roles) -> None:
        self._recipes = recipes
        self._actions = actions
        self._terms = terms
        self._roles = roles
        self.recoveries = Recoveries(actions)
        self._around: dict[tuple[str, bool], tuple[Recover, ...]] = {}
        """(Recipe without base motion, whether in a scope) -> recoveries that move the base, one per failure."""
        self._open: dict[str, Keeping] = {}
        """Recipe -> things that it holds at its end, with the recoveries from losing them in later steps."""
        self._unrepeatable: dict[str, bool] = {}
        """Recipe (IRI) -> whether it has a step that must not be repeated, directly or in a recipe below it."""
        self.turns = Turns()
        self.recoveries_in_words: dict[tuple[str, str], tuple[str, ...]] = {}
        """(Recipe, step) (IRIs) -> recoveries, in words."""

    def node(self, recipe: Recipe, step: Step, holding: AbstractSet[str]) -> Node:
        """Build the node of a step; it holds its resources if it is one of ``holding`` (IRIs)."""
        node: Node
        if step.is_choice:
            node = Alternatives(step.name, tuple(self._alternatives(step)), step.iri, step.label)
        elif step.recipes:
            calls = tuple(self._call(recipe, step, callee) for callee in step.recipes)
            label = step.label if self._actions.is_standard(step) else None  # other recipes have labels of their own
            node = Call(step.name, self._terms.action(recipe, step), calls, step.iri, label, step.times)
        else:
            once = step.is_abstract and recipe.machine is None
            node = Perform(step.name, self._terms.action(recipe, step), step.label, step.iri, once, step.times)
        # nobody knows whether the goal of an abstract step suffices; alternatives have their own goals and recoveries
        condition = None if step.is_abstract or step.is_choice else self._goal(step)
        if condition is not None:
            node = Achieve(condition, node)
        outer_rules = self.recoveries.names(recipe.action_class)
        recoveries = self.recoveries.around_step(step.action_class, self._about(recipe, step), outer_rules)
        recoveries = () if step.is_choice else recoveries
        if recoveries:
            node = Handle(node, recoveries)
        leaving = self.recoveries.around_scope(step)
        self.recoveries_in_words[recipe.iri, step.iri] = tuple(map(_in_words, (*recoveries, *leaving)))
        if step.iri in holding:
            node = Hold(step.name, self._roles.of(recipe, step), node, self.turns.among(step.recipes))
        return node

    def _alternatives(self, step: Step) -> Iterator[tuple[str, Node]]:
        """Yield the alternatives of a step, each with its name."""
        for name in step.recipes:
            recipe = self._recipes.recipes[name]
            yield from ((inner.name, self.node(recipe, inner, frozenset())) for inner in recipe.steps)

    def with_looking(
        self, recipe: Recipe, node: Node, steps: Iterable[Step], *, in_scope: bool = True, alone: bool = False
    ) -> Node:
        """Add the recoveries of steps that move the base, one per failure; none if a step must not be repeated."""
        steps = tuple(steps)
        is_once = any(self._is_unrepeatable(step) for step in steps)
        chosen = () if is_once else self._leaving(recipe, steps, in_scope=in_scope, alone=alone)
        if not chosen:
            return node
        if not isinstance(node, Handle):
            return Handle(node, chosen)
        known = {one.failure for one in node.recoveries}
        inner = Handle(node.body, (*node.recoveries, *(one for one in chosen if one.failure not in known)))
        after = tuple(one for one in chosen if one.failure in known)  # what these try comes once the others have failed
        return Handle(inner, after) if after else inner

    def with_going_back(self, recipe: Recipe, body: Series, units: Iterable[tuple[Node, list[Step]]]) -> Series:
        """Add the recoveries that run an earlier step again; for things still held at the end, callers add them, too.

        Steps that must not be repeated get none.
        """
        keeping = {id(node): self._keeping_of(recipe, steps) for node, steps in units}
        handled, self._open[recipe.iri] = going_back(body, keeping)
        assert isinstance(handled, Series)
        return handled

    def _keeping_of(self, recipe: Recipe, steps: Iterable[Step]) -> Keeping:
        steps = tuple(steps)
        kept = Keeping(once=any(map(self._is_unrepeatable, steps)))
        for step in steps:
            own = self.recoveries.going_back(step.iri, self.recoveries.looked_at(step))
            if own:
                kept |= Keeping(own, name=_fetching(own[0], step))
                continue
            if self._actions.releases(step):
                kept |= Keeping(let_go=self._actions.released(step))
            for callee in step.recipes:
                substitution = self._terms.substitution(recipe, step, callee)
                below = self._recipes.recipes[callee]
                kept_inside = (
                    self._open.get(callee, Keeping()) if not step.is_choice else self._keeping_of(below, below.steps)
                )
                let_go = frozenset(
                    substituted_thing(thing, substitution) if thing else None for thing in kept_inside.let_go
                )
                lasting = tuple(_renamed(recovery, substitution) for recovery in kept_inside.lasting)
                kept |= Keeping(lasting, let_go, kept_inside.name)
        return kept

    def _is_unrepeatable(self, step: Step) -> bool:
        """True for a step with lasting effects, an abstract step, or a step that calls a recipe with such a step.

        What has been poured, mixed or turned over stays so, whatever is lost afterwards.
        """
        if effects_of(self._actions.ontology, step.action_class).lasts:
            return True
        for callee in step.recipes:
            if callee not in self._unrepeatable:
                self._unrepeatable[callee] = any(map(self._is_unrepeatable, self._recipes.recipes[callee].steps))
        return step.is_abstract or any(self._unrepeatable[callee] for callee in step.recipes)

    def _leaving(
        self, recipe: Recipe, steps: Iterable[Step], *, in_scope: bool, alone: bool = False
    ) -> tuple[Recover, ...]:
        recoveries: dict[str, Recover] = {}
        for recovery in self._around_scope(recipe, steps, in_scope, alone):
            recoveries.setdefault(recovery.failure, recovery)
        return tuple(recoveries.values())

    def _around_scope(self, recipe: Recipe, steps: Iterable[Step], in_scope: bool, alone: bool) -> Iterator[Recover]:
        for step in steps:
            yield from self.recoveries.around_scope(step, in_scope=in_scope, alone=alone)
            for callee in step.recipes:
                below = self._recipes.recipes[callee]
                if not self._actions.moves_the_base(below, self._recipes):
                    key = callee, in_scope
                    if key not in self._around:
                        self._around[key] = self._leaving(below, self._terms.steps(below), in_scope=in_scope)
                    substitution = self._terms.substitution(recipe, step, callee)
                    yield from (_renamed(recovery, substitution) for recovery in self._around[key])

    def _call(self, recipe: Recipe, step: Step, callee: str) -> FunctionCall:
        substitution = self._terms.substitution(recipe, step, callee)
        return FunctionCall(
            callee,
            tuple((own, self._terms.resolved_argument(recipe, step, given)) for own, given in substitution.items()),
        )

    def _goal(self, step: Step) -> Condition | None:
        goal = self._actions.goal(step.action_class)
        if goal is None:
            return None
        fillers = [next(iter(step.fillers(name)), None) for name in goal.properties]
        things = tuple(filler for filler in fillers if isinstance(filler, Thing))
        return Condition(goal.predicate, things) if len(things) == len(fillers) else None

    def _about(self, recipe: Recipe, step: Step) -> Thing | None:
        """Object that a recovery looks at: the step's, else its recipe's, else the only object."""
        own = self.recoveries.looked_at(step)
        if own is not None:
            return own
        acted_on = [filler for filler in recipe.fillers("objectActedOn") if isinstance(filler, Thing)]
        objects = [thing for thing in self._terms.parameters(recipe) if thing.kind is Kind.OBJECT]
        candidates = [thing for thing in acted_on if thing in objects] or objects
        return candidates[0] if len(candidates) == 1 else None


def _in_words(recovery: Recover) -> str:
    about = f" ({recovery.about.name})" if recovery.about is not None else ""
    what = f"{snake_case(recovery.strategy.name).replace('_', ' ')}{about}"
    times = "once" if recovery.attempts == 1 else f"up to {recovery.attempts} times"
    tried = f"{what}, {times}" if recovery.attempts else what
    return f"on {recovery.failure}: {tried}" + (f", else {recovery.otherwise}" if recovery.otherwise else "")


def _renamed(recovery: Recover, substitution: Substitution) -> Recover:
    """Translate a recovery of a called function to the terms of its caller."""
    about = substituted_thing(recovery.about, substitution) if recovery.about is not None else None
    return replace(recovery, about=about, again=None)


def _fetching(recovery: Recover, step: Step) -> str:
    """Name for a function that acquires the object of a recovery."""
    return f"fetch_{snake_case(without_digits(recovery.about.name))}" if recovery.about else snake_case(step.name)


@dataclass(frozen=True, slots=True)
class Keeping:
    """What the steps of a node acquire, with the recoveries from losing it, and what they release."""

    lasting: tuple[Recover, ...] = ()
    let_go: frozenset[Thing | None] = frozenset()
    """Released things; None stands for whatever is held."""
    name: str = ""
    """Name of the function that runs the first of these steps again."""
    once: bool = False
    """True if the node must not be run again."""

    def ends(self, recovery: Recover) -> bool:
        """True if the thing of a recovery is released."""
        return not self.let_go.isdisjoint({recovery.about, None})

    def __or__(self, other: Keeping) -> Keeping:
        lasting, once = (*self.lasting, *other.lasting), self.once or other.once
        return Keeping(lasting, self.let_go | other.let_go, self.name or other.name, once)


def going_back(node: Node, keeping: Mapping[int, Keeping]) -> tuple[Node, Keeping]:
    """Add the recoveries that run an earlier step again, and find what a node still holds at its end.

    ``keeping`` maps the nodes of steps, by identity. In a series a recovery is added to the node that acquires a thing
    and to each later one, up to the first that releases it; if none does, the enclosing series continues.
    """
    match node:
        case Series(nodes):
            handled, whole = _series([going_back(inner, keeping) for inner in nodes])
            return Series(handled), whole
        case Parallel(branches):
            named, whole = _branches(branches, keeping)
            return Parallel(named), whole
        case PartialOrder(branches, orderings):
            named, whole = _branches(branches, keeping)
            return PartialOrder(named, orderings), whole
    return node, keeping.get(id(node), Keeping())


def _series(parts: Sequence[tuple[Node, Keeping]]) -> tuple[tuple[Node, ...], Keeping]:
    nodes, whole = [node for node, _ in parts], Keeping()
    for first, (node, keeping) in enumerate(parts):
        whole |= Keeping(let_go=keeping.let_go, name=keeping.name, once=keeping.once)
        later: dict[int, list[Recover]] = {}
        for recovery in () if keeping.once else keeping.lasting:
            ends = [number for number in range(first, len(parts)) if parts[number][1].ends(recovery)]
            for number in range(first + 1, ends[0] + 1 if ends else len(parts)):
                if not parts[number][1].once:
                    later.setdefault(number, []).append(replace(recovery, again=keeping.name))
            if not ends:
                whole |= Keeping((recovery,), name=keeping.name)
        # branches inside parallel nodes have these recoveries already
        if not isinstance(node, (Parallel, PartialOrder)) and not keeping.once:
            nodes[first] = _handled(nodes[first], keeping.lasting)
        if later:
            nodes[first] = Again(keeping.name, nodes[first])
        for number, recoveries in later.items():
            nodes[number] = _handled(nodes[number], recoveries)
    return tuple(nodes), whole


def _handled(node: Node, recoveries: Sequence[Recover]) -> Node:
    """Add recoveries. A second one for the same failure surrounds the first, so that a failure can propagate to it."""
    for recovery in recoveries:
        if isinstance(node, Handle) and recovery.failure not in {other.failure for other in node.recoveries}:
            node = Handle(node.body, (*node.recoveries, recovery))
        else:
            node = Handle(node, (recovery,))
    return node


def _branches(
    branches: Sequence[tuple[str, Node]], keeping: Mapping[int, Keeping]
) -> tuple[tuple[tuple[str, Node], ...], Keeping]:
    handled, whole = [], Keeping()
    for name, branch in branches:
        node, after = going_back(branch, keeping)
        handled.append((name, node))
        whole |= after
    return tuple(handled), whole
