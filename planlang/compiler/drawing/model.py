"""A task as groups of boxes and arrows, whatever they are drawn with."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import count

from planlang.compiler.drawing.text import LONGEST_LINE, broken, shown
from planlang.designators import RELATIONS, local_name
from planlang.diagnostics import Span
from planlang.recipe.model import (
    Description,
    Filler,
    Name,
    Ordering,
    Parameter,
    Place,
    Reason,
    Recipe,
    RecipeSet,
    StateMachine,
    Step,
    Thing,
    Transition,
)
from planlang.recipe.order.graph import Precedence, order_graph, recipe_graph, reduced, shortest_cycle

MOST_IMPLIED = 5000
"""Implied orders of one recipe; of a recipe with more only those that the file states are kept."""


class Order(Enum):
    """Where the order of an arrow comes from."""

    STATED = "stated"
    """The recipe states it, and it follows from no other."""
    ADDED = "added"
    """The compiler adds it: what is done from one place is done together."""
    IMPLIED = "implied"
    """It follows from others."""
    TRANSITION = "transition"
    """No order: the one state is left for the other."""
    OVERLAP = "overlap"
    """No order: the two run side by side, and the one begins or ends in relation to the other."""


@dataclass(frozen=True, slots=True)
class Arrow:
    """One box comes before another; both are told by their keys. ``hover`` says why.

    ``label`` is written beside it: the outcomes of a transition, the relation of an overlap.
    """

    before: str
    after: str
    order: Order
    hover: str
    label: str = ""


@dataclass(frozen=True, slots=True)
class Box:
    """A step: ``lines`` say what fills its properties. ``groups`` are its recipes, more than one if alternatives."""

    key: str
    name: str
    action: str
    lines: tuple[str, ...]
    hover: tuple[str, ...]
    line: int | None
    """Where the file states the step."""
    is_abstract: bool = False
    groups: tuple[Group, ...] = ()

    def text(self) -> tuple[str, ...]:
        """The lines to show in the box: the name, then what the step is and what fills its properties."""
        return (shown(self.name, LONGEST_LINE), *(part for line in (self.action, *self.lines) for part in broken(line)))


@dataclass(frozen=True, slots=True)
class Group:
    """A recipe: its steps in the order of the file."""

    key: str
    name: str
    boxes: tuple[Box, ...]
    arrows: tuple[Arrow, ...]

    def of(self, *orders: Order) -> tuple[Arrow, ...]:
        """The arrows of these kinds."""
        return tuple(arrow for arrow in self.arrows if arrow.order in orders)


@dataclass(frozen=True, slots=True)
class TaskGraph:
    """A task with everything below it. Keys are unique and made of letters and digits alone."""

    title: str
    subtitle: str
    group: Group

    def groups(self) -> Iterator[Group]:
        """All groups, an outer one before those inside of it."""
        waiting = [self.group]
        while waiting:
            group = waiting.pop(0)
            yield group
            waiting = [inner for box in group.boxes for inner in box.groups] + waiting


def task_graph(
    recipes: RecipeSet,
    added: Mapping[str, Iterable[tuple[str, str]]] | None = None,
    recoveries: Mapping[tuple[str, str], Sequence[str]] | None = None,
) -> TaskGraph:
    """The graph of a task and all recipes below it; nothing recurses.

    ``added`` gives for a recipe (IRI) the orders of steps (IRIs) that the compiler adds, ``recoveries`` for a step of a
    recipe (both IRIs) what is done when it fails. A recipe that several steps call is drawn in the first of them.
    """
    main = recipes.main
    subtitle = f"{main.label}, {recipes.source.file}" if main.label else recipes.source.file
    return TaskGraph(shown(main.name), shown(subtitle), _Builder(recipes, added or {}, recoveries or {}).group(main))


class _Builder:
    def __init__(
        self,
        recipes: RecipeSet,
        added: Mapping[str, Iterable[tuple[str, str]]],
        recoveries: Mapping[tuple[str, str], Sequence[str]],
    ) -> None:
        self._recipes = recipes
        self._added = added
        self._recoveries = recoveries
        self._numbers = count(1)
        self._drawn: dict[str, str] = {}

    def group(self, recipe: Recipe) -> Group:
        key = f"g{next(self._numbers)}"
        self._drawn[recipe.iri] = key
        keys: dict[str, str] = {}
        boxes = []
        for step in recipe.steps:
            box = self._box(recipe, step)
            keys[step.iri] = box.key
            boxes.append(box)
        arrows = _transitions(recipe, keys) if recipe.machine is not None else self._arrows(recipe, keys)
        return Group(key, shown(recipe.name), tuple(boxes), (*arrows, *_overlaps(recipe, keys)))

    def _box(self, recipe: Recipe, step: Step) -> Box:
        key = f"s{next(self._numbers)}"
        lines = [_parameter(parameter) for parameter in step.parameters]
        if step.condition is not None:
            lines.append(_condition(step.condition))
        again = [local_name(callee) for callee in step.recipes if callee in self._drawn]
        if again:
            lines.append(f"as drawn elsewhere: {', '.join(again)}")
        groups = tuple(
            self.group(self._recipes.recipes[callee]) for callee in step.recipes if callee not in self._drawn
        )
        action = local_name(step.action)
        if step.is_abstract:
            action += " (nothing performs it)"
        if recipe.machine is not None and (role := _role(recipe.machine, step)):
            lines.insert(0, role)
        lines += [
            f"{o.relation.value} the whole task"
            for o in recipe.overlaps
            if (o.first, o.second) == (step.iri, recipe.iri)
        ]
        recoveries = self._recoveries.get((recipe.iri, step.iri), ())
        hover = [step.name, *([step.label] if step.label else []), action, *lines, *recoveries, *_where(step.span)]
        return Box(
            key,
            shown(step.name),
            shown(action),
            tuple(map(shown, lines)),
            tuple(map(shown, hover)),
            step.span.line if step.span is not None else None,
            step.is_abstract,
            groups,
        )

    def _arrows(self, recipe: Recipe, keys: Mapping[str, str]) -> Iterator[Arrow]:
        graph = recipe_graph(recipe)
        stated: dict[tuple[str, str], list[Ordering]] = {}
        for ordering in recipe.orderings:
            stated.setdefault((ordering.before, ordering.after), []).append(ordering)
        if shortest_cycle(graph) is not None:
            solid = list(graph.edges)
            more: list[tuple[str, str]] = []
            everything = solid
        else:
            solid = list(reduced(graph).edges)
            more = list(self._added.get(recipe.iri, ()))
            order: Precedence[str] = Precedence(order_graph(graph.nodes, [*graph.edges, *more]))
            is_small = order.number_of_pairs() <= MOST_IMPLIED + len(solid) + len(more)
            everything = (
                [(a, b) for a in graph.nodes for b in order.members(order.later(a))] if is_small else list(stated)
            )
        for before, after in solid:
            yield _arrow(keys, before, after, Order.STATED, _why(stated[before, after]))
        for before, after in more:
            why = "added by the compiler: what is done from one place is done together"
            yield _arrow(keys, before, after, Order.ADDED, why)
        known = {*solid, *more}
        rank = {step: number for number, step in enumerate(graph.nodes)}
        implied = [edge for edge in everything if edge not in known and rank.keys() >= set(edge)]
        for before, after in sorted(implied, key=lambda edge: (rank[edge[0]], rank[edge[1]])):
            why = f"{_why(stated[before, after])}; " if (before, after) in stated else ""
            yield _arrow(keys, before, after, Order.IMPLIED, f"{why}follows from the others")


def _role(machine: StateMachine, step: Step) -> str:
    """What a state is besides being one."""
    roles = [*(["start"] if step.iri == machine.start else []), *(["end"] if step.iri in machine.ends else [])]
    return f"{' and '.join(roles)} state" if roles else ""


def _transitions(recipe: Recipe, keys: Mapping[str, str]) -> Iterator[Arrow]:
    """One arrow for each two states, with all the outcomes that lead from the one to the other."""
    assert recipe.machine is not None
    between: dict[tuple[str, str], list[Transition]] = {}
    for transition in recipe.machine.transitions:
        if transition.source in keys and transition.target in keys:
            between.setdefault((transition.source, transition.target), []).append(transition)
    for (source, target), found in between.items():
        outcomes = dict.fromkeys(local_name(one.outcome) if one.outcome else one.ending.value for one in found)
        said = dict.fromkeys(where for one in found for where in _where(one.span))
        hover = (
            f"{local_name(source)} to {local_name(target)}: {', '.join(outcomes)} {' '.join(f'({w})' for w in said)}"
        )
        yield Arrow(keys[source], keys[target], Order.TRANSITION, shown(hover), shown(", ".join(outcomes), 60))


def _overlaps(recipe: Recipe, keys: Mapping[str, str]) -> Iterator[Arrow]:
    for overlap in recipe.overlaps:
        if overlap.first in keys and overlap.second in keys:
            word = overlap.relation.value
            hover = f"{local_name(overlap.first)} {word} {local_name(overlap.second)}"
            where = " ".join(f"({place})" for place in _where(overlap.span))
            yield Arrow(keys[overlap.first], keys[overlap.second], Order.OVERLAP, shown(f"{hover} {where}"), word)


def _arrow(keys: Mapping[str, str], before: str, after: str, order: Order, why: str) -> Arrow:
    hover = f"{local_name(before)} before {local_name(after)}: {why}"
    return Arrow(keys[before], keys[after], order, shown(hover))


def _why(orderings: Iterable[Ordering]) -> str:
    said = []
    for ordering in orderings:
        name = local_name(ordering.iri) if ordering.iri else ordering.reason.value
        if ordering.reason is Reason.DATA_FLOW:
            name += " (data flow)"
        said.append(" ".join([name, *(f"({where})" for where in _where(ordering.span))]))
    return ", ".join(said)


def _where(span: Span | None) -> list[str]:
    """File name and line, without folders, as the same file should look the same everywhere."""
    return [f"{span.file.replace(chr(92), '/').rsplit('/', 1)[-1]} line {span.line}"] if span is not None else []


def _parameter(parameter: Parameter) -> str:
    return f"{local_name(parameter.property)}: {_filler(parameter.filler)}"


def _condition(condition: Description) -> str:
    inside = ", ".join(_parameter(parameter) for parameter in condition.parameters)
    return f"checks: {condition.name}" + (f" ({inside})" if inside else "")


def _filler(filler: Filler) -> str:
    match filler:
        case Thing():
            return filler.name if filler.iri is not None else f"any {filler.name}"
        case Place():
            said = " and ".join(
                f"{RELATIONS[relation]} {_reference(reference)}" for relation, reference in filler.relations
            )
            return f"{filler.name} ({said or 'posture'})"
        case Name():
            return local_name(filler.iri)
        case bool():
            return "true" if filler else "false"
        case _:
            return str(filler)


def _reference(reference: Thing | Place) -> str:
    return reference.name if isinstance(reference, Thing) else _filler(reference)
