"""From recipes to the plan tree: functions, location scopes, goals and recoveries."""

from __future__ import annotations

from collections.abc import Iterable

import networkx as nx

from planlang.compiler.naming import Names
from planlang.compiler.recoveries import Recoveries
from planlang.compiler.roles import Roles
from planlang.compiler.scopes import Scoping, Unit, scoping
from planlang.compiler.terms import HandUse, Renaming, Terms
from planlang.compiler.tree import (
    Achieve,
    Call,
    Condition,
    Function,
    FunctionCall,
    Handle,
    Hold,
    Node,
    Perform,
    PlaceUse,
    PlanTree,
    Recover,
    Scope,
    Series,
    Unordered,
)
from planlang.diagnostics import Diagnostic, note
from planlang.ontology import Ontology
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import ordering_to_write
from planlang.recipe.graph import blocks, closed, order_graph, recipe_graph, reduced
from planlang.recipe.model import Kind, Place, Recipe, RecipeSet, Step, Thing


class Lowering:
    """Lowers a checked set of recipes: orders are acyclic, nothing recurses, base motions are totally ordered."""

    def __init__(self, ontology: Ontology, recipes: RecipeSet, actions: Actions, *, scopes: bool = True) -> None:
        self._recipes = recipes
        self._actions = actions
        self._scopes = scopes
        self._terms = Terms(ontology, recipes, actions)
        self._roles = Roles(recipes, actions, self._terms)
        self._recoveries = Recoveries(actions)
        self._holding: dict[str, frozenset[str]] = {}
        self._bases: list[tuple[PlaceUse, list[HandUse]]] = []
        self.diagnostics: list[Diagnostic] = []
        self.added: dict[str, tuple[tuple[str, str], ...]] = {}

    def tree(self) -> PlanTree:
        """The plan tree of the whole set."""
        functions: dict[str, Function] = {}

        def visit(recipe: Recipe) -> None:
            for step in self._terms.steps(recipe):
                for callee in step.recipes:
                    if callee not in functions:
                        visit(self._recipes.recipes[callee])
            functions[recipe.iri] = self._function(recipe)

        visit(self._recipes.main)
        return PlanTree(tuple(functions.values()), self._terms.devices_of_places(self._bases))

    def scoping(self, recipe: Recipe) -> Scoping:
        """The units of a recipe, their graph, and the orders that its scopes add."""
        graph = recipe_graph(recipe)
        if not self._scopes:
            units = tuple(Unit(None, (step,)) for step in graph.nodes)
            index = {step: number for number, step in enumerate(graph.nodes)}
            return Scoping(units, order_graph(index.values(), ((index[a], index[b]) for a, b in graph.edges)), ())
        return scoping(graph, self._actions.movers(recipe, self._recipes), placed(recipe))

    def _function(self, recipe: Recipe) -> Function:
        found = self.scoping(recipe)
        self.added[recipe.iri] = found.added
        self.diagnostics += [_added(recipe, before, after) for before, after in found.added]
        graph = recipe_graph(recipe)
        self._holding[recipe.iri] = self._roles.held(
            recipe, closed(order_graph(graph.nodes, [*graph.edges, *found.added]))
        )
        nodes = [self._unit(recipe, unit) for unit in found.units]
        names = [_name(recipe, unit) for unit in found.units]
        body = self._series(found.graph, nodes, names)
        if recipe.iri == self._recipes.task:
            things = [thing for thing in self._terms.parameters(recipe) if thing.kind is Kind.OBJECT]
            recoveries = self._recoveries.around_step(recipe.iri, things[0] if things else None, frozenset())
            if recoveries:
                body = Series((Handle(body, recoveries),))
        return Function(recipe.iri, recipe.label, self._terms.parameters(recipe), body)

    def _series(self, graph: nx.DiGraph, nodes: list[Node], names: list[str]) -> Series:
        """What is totally ordered one after another, the rest as unordered blocks; the graph is one of indices."""
        known = Names()
        unique = [known.claim(name) for name in names]
        small = reduced(graph)
        series: list[Node] = []
        found: list[list[int]] = blocks(graph)
        for block in found:
            if len(block) == 1:
                series.append(nodes[block[0]])
                continue
            members = frozenset(block)
            pairs = tuple((unique[a], unique[b]) for a, b in small.edges if a in members and b in members)
            series.append(Unordered(tuple((unique[member], nodes[member]) for member in block), pairs))
        return Series(tuple(series))

    def _unit(self, recipe: Recipe, unit: Unit) -> Node:
        steps = [recipe.step(iri) for iri in unit.steps]
        base = recipe.step(unit.base) if unit.base is not None else None
        if base is None:
            node = self._step(recipe, steps[0])
            is_outermost = recipe.iri == self._recipes.task or self._actions.moves_the_base(recipe, self._recipes)
            return self._with_looking(recipe, node, steps) if is_outermost else node
        if not steps:
            return self._step(recipe, base)
        graph = recipe_graph(recipe)
        inner = closed(graph).subgraph(unit.steps)
        index = {step: number for number, step in enumerate(unit.steps)}
        body = self._series(
            order_graph(index.values(), ((index[a], index[b]) for a, b in inner.edges)),
            [self._step(recipe, step) for step in steps],
            [step.name for step in steps],
        )
        uses = list(self._terms.hand_uses(recipe, [step for step in self._terms.steps(recipe) if step in steps]))
        use = self._terms.use(_destination(base))
        self._bases.append((use, uses))
        reaching = tuple(dict.fromkeys(where for where, _ in uses))
        scope = Scope(base.name, use, reaching, self._recoveries.attempts_at_places(base), body, base.label)
        return self._with_looking(recipe, scope, [base, *steps])

    def _with_looking(self, recipe: Recipe, node: Node, steps: Iterable[Step]) -> Node:
        """The node with the recoveries that leave its place: those of all its steps, one for each failure."""
        found: dict[str, Recover] = {}
        for recovery in self._around_scope(recipe, steps, {}):
            found.setdefault(recovery.failure, recovery)
        if not found:
            return node
        if isinstance(node, Handle):
            return Handle(node.body, (*node.recoveries, *found.values()))
        return Handle(node, tuple(found.values()))

    def _around_scope(self, recipe: Recipe, steps: Iterable[Step], renaming: Renaming) -> Iterable[Recover]:
        for step in steps:
            about = self._recoveries.looked_at(step)
            yield from self._recoveries.around_scope(step, renaming.get(about, about) if about else None)
            for callee in step.recipes:
                below = self._recipes.recipes[callee]
                if not self._actions.moves_the_base(below, self._recipes):
                    inner = self._terms.renaming(recipe, step, callee)
                    mapping = {old: renaming.get(new, new) for old, new in inner.items()}
                    yield from self._around_scope(below, self._terms.steps(below), mapping)

    def _step(self, recipe: Recipe, step: Step) -> Node:
        node: Node
        if step.recipes:
            calls = tuple(
                FunctionCall(callee, tuple(self._terms.renaming(recipe, step, callee).items()))
                for callee in step.recipes
            )
            action = self._terms.action(recipe, step) if self._terms.is_performed(step) else None
            node = Call(step.name, action, calls)
        else:
            node = Perform(step.name, self._terms.action(recipe, step), step.label)
        condition = self._goal(step)
        if condition is not None:
            node = Achieve(condition, node)
        written = self._recoveries.names(recipe.iri)
        recoveries = self._recoveries.around_step(step.iri, self._about(recipe, step), written)
        if recoveries:
            node = Handle(node, recoveries)
        if step.iri in self._holding[recipe.iri]:
            node = Hold(step.name, self._roles.of(recipe, step), node)
        return node

    def _goal(self, step: Step) -> Condition | None:
        goal = self._actions.goal(step.iri)
        if goal is None:
            return None
        fillers = [next(iter(step.fillers(name)), None) for name in goal.properties]
        things = tuple(filler for filler in fillers if isinstance(filler, Thing))
        return Condition(goal.predicate, things) if len(things) == len(fillers) else None

    def _about(self, recipe: Recipe, step: Step) -> Thing | None:
        """What a recovery looks at: what the step handles, else what its recipe acts on, else the only object."""
        own = self._recoveries.looked_at(step)
        if own is not None:
            return own
        acted_on = [filler for filler in recipe.fillers("objectActedOn") if isinstance(filler, Thing)]
        objects = [thing for thing in self._terms.parameters(recipe) if thing.kind is Kind.OBJECT]
        known = [thing for thing in acted_on if thing in objects] or objects
        return known[0] if len(known) == 1 else None


def _destination(base: Step) -> Place:
    """Where a base motion goes: its place, or where the thing that it goes to is in reach."""
    filler = next(filler for filler in base.fillers("toLocation") if isinstance(filler, (Place, Thing)))
    if isinstance(filler, Place):
        return filler
    iri = filler.iri or filler.stated
    return Place(f"{iri.removesuffix(filler.name)}near-{filler.name}", (("in_reach_of", filler),))


def placed(recipe: Recipe) -> frozenset[str]:
    """The steps that have a location or an object."""
    return frozenset(
        step.iri
        for step in recipe.steps
        if any(isinstance(parameter.filler, (Thing, Place)) for parameter in step.parameters)
    )


def _added(recipe: Recipe, before: str, after: str) -> Diagnostic:
    first, second = recipe.step(before), recipe.step(after)
    message = f"`{first.name}` now comes before `{second.name}`: what is done from one place is done together"
    advice = f"write the order if that is meant: {ordering_to_write(recipe, before, after)}"
    return note("R041", message, first.span, advice)


def _name(recipe: Recipe, unit: Unit) -> str:
    return recipe.step(unit.base or unit.steps[0]).name
