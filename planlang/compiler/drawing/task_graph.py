"""A task as groups of boxes and arrows, independent of the format; untrusted text is made safe to display."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import Enum
from itertools import count
from textwrap import wrap

from planlang.closure import grouped
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.recipe.model import (
    Constraint,
    Filler,
    Name,
    Ordering,
    Parameter,
    Part,
    Place,
    Reason,
    Recipe,
    RecipeSet,
    StateMachine,
    Step,
    Thing,
)
from planlang.recipe.order import recipe_order
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.visible import visible


class Order(Enum):
    """The origin of an arrow."""

    STATED = "stated"
    """Stated by the recipe, and not implied by other orders."""
    ADDED = "added"
    """Added by the compiler: steps at the same base pose are performed together."""
    TRANSITION = "transition"
    """Not an order: a transition from one state to another."""
    OVERLAP = "overlap"
    """Not an order: two steps overlap in time, and one begins or ends relative to the other."""


@dataclass(frozen=True, slots=True)
class Arrow:
    """One box comes before another; both are given by their keys. ``hover`` is the reason.

    ``label`` is the text beside it: the outcomes of a transition, the relation of an overlap.
    """

    before: str
    after: str
    order: Order
    hover: str
    label: str = ""


@dataclass(frozen=True, slots=True)
class Box:
    """A step; ``lines`` are its properties, ``groups`` its recipes: more than one if they are alternatives."""

    key: str
    name: str
    action: str
    lines: tuple[str, ...]
    hover: tuple[str, ...]
    line: int | None
    """Line of the file that states the step."""
    is_abstract: bool = False
    groups: tuple[Group, ...] = ()

    def text(self) -> tuple[str, ...]:
        """Lines of text in the box: the name, the class of the action, and its properties."""
        return (shown(self.name, LONGEST_LINE), *(part for line in (self.action, *self.lines) for part in broken(line)))


@dataclass(frozen=True, slots=True)
class Group:
    """A recipe: its steps in the order of the file."""

    key: str
    name: str
    boxes: tuple[Box, ...]
    arrows: tuple[Arrow, ...]

    def of(self, *orders: Order) -> tuple[Arrow, ...]:
        """Arrows of these kinds."""
        return tuple(arrow for arrow in self.arrows if arrow.order in orders)


@dataclass(frozen=True, slots=True)
class TaskGraph:
    """A task with everything below it. Keys are unique and consist of letters and digits only."""

    title: str
    subtitle: str
    group: Group

    def groups(self) -> Iterator[Group]:
        """Yield all groups, an outer one before those inside it."""
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
    """Build the graph of a task and all recipes below it, which must not be recursive.

    ``added`` maps a recipe (IRI) to the orders of steps (IRIs) that the compiler adds, ``recoveries`` a step of a
    recipe (both IRIs) to its recoveries. A recipe that several steps call is drawn in the first of them.
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
        return Group(key, shown(self._name(recipe.iri)), tuple(boxes), (*arrows, *_overlaps(recipe, keys)))

    def _name(self, iri: str) -> str:
        """Name of a recipe; an alternative has the name of its only step."""
        recipe = self._recipes.recipes[iri]
        return recipe.name if recipe.within is None or not recipe.steps else recipe.steps[0].name

    def _box(self, recipe: Recipe, step: Step) -> Box:
        key = f"s{next(self._numbers)}"
        lines = [_parameter(parameter) for parameter in step.parameters]
        if step.condition is not None:
            inside = ", ".join(map(_parameter, step.condition.parameters))
            lines.append(f"checks: {step.condition.name}" + (f" ({inside})" if inside else ""))
        if len(step.recipes) > 1:
            lines.append(f"tried in order: {', '.join(map(self._name, step.recipes))}")
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
        """Yield the orders of the transitive reduction, both stated and added ones."""
        stated = grouped(((ordering.before, ordering.after), ordering) for ordering in recipe.orderings)
        for before, after in recipe_order(recipe).reduction():
            yield _arrow(keys, before, after, Order.STATED, _why(stated[before, after]))
        for before, after in self._added.get(recipe.iri, ()):
            why = "added by the compiler: steps at one place are performed together"
            yield _arrow(keys, before, after, Order.ADDED, why)


def _role(machine: StateMachine, step: Step) -> str:
    """Role of a state, such as start or end."""
    roles = [*(["start"] if step.iri == machine.start else []), *(["end"] if step.iri in machine.ends else [])]
    return f"{' and '.join(roles)} state" if roles else ""


def _transitions(recipe: Recipe, keys: Mapping[str, str]) -> Iterator[Arrow]:
    """Yield one arrow for each pair of states, with all outcomes of the transitions between them."""
    assert recipe.machine is not None
    known = (one for one in recipe.machine.transitions if one.source in keys and one.target in keys)
    between = grouped(((one.source, one.target), one) for one in known)
    for (source, target), transitions in between.items():
        outcomes = dict.fromkeys(local_name(one.outcome) if one.outcome else one.ending.value for one in transitions)
        places = dict.fromkeys(where for one in transitions for where in _where(one.span))
        hover = (
            f"{local_name(source)} to {local_name(target)}: {', '.join(outcomes)} {' '.join(f'({w})' for w in places)}"
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
    reasons = []
    for ordering in orderings:
        name = local_name(ordering.iri) if ordering.iri else ordering.reason.value
        if ordering.reason is Reason.DATA_FLOW:
            name += " (data flow)"
        reasons.append(" ".join([name, *(f"({where})" for where in _where(ordering.span))]))
    return ", ".join(reasons)


def _where(span: Span | None) -> list[str]:
    """File name and line, without folders, so that the drawing does not depend on them."""
    return [f"{span.file.replace(chr(92), '/').rsplit('/', 1)[-1]} line {span.line}"] if span is not None else []


def _parameter(parameter: Parameter) -> str:
    return f"{local_name(parameter.property)}: {_filler(parameter.filler)}"


def _filler(filler: Filler) -> str:
    match filler:
        case Thing():
            return filler.name if filler.iri is not None else f"any {filler.name}"
        case Place():
            stated = " and ".join(
                f"{RELATIONS[relation].owl} "
                + " and ".join(_filler(one) if isinstance(one, Place) else one.name for one in references)
                for relation, references in filler.relations
            )
            return f"{filler.name} ({stated or 'posture'})"
        case Name():
            return local_name(filler.iri)
        case Part():
            return f"{filler.name} of {filler.of.name}" if filler.path else filler.name
        case Constraint():
            return _constraint(filler)
        case bool():
            return "true" if filler else "false"
        case _:
            return str(filler)


def _constraint(constraint: Constraint) -> str:
    """Describe a constraint by its features and limits, such as ``Height (Tip of knife to board, 0.1 to 0.2 m)``."""
    kind = constraint.kind.value
    low, high = (None if limit is None else f"{limit:g}" for limit in (constraint.lower, constraint.upper))
    limits = f"{low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}" if high else ""
    if limits and kind.unit:
        limits += f" {kind.unit}"
    features = f"{_filler(constraint.tool)} to {_filler(constraint.world)}"
    return f"{constraint.name} ({', '.join(filter(None, (features, limits)))})"


LONGEST_LINE = 56
"""Maximum length of a line inside a box; longer ones are broken. Three such boxes fit side by side on a screen."""

MOST_LINES = 3
"""Maximum number of lines of a broken text; the tooltip has the rest, so that one text does not crowd out others."""

INDENT = "\N{NO-BREAK SPACE}" * 4
"""Indentation of continuation lines."""

LONGEST_TEXT = 2000
"""Maximum length of a tooltip: labels in an untrusted file may have any length."""

_SPACE = re.compile(r"\s+")


def shown(text: str, longest: int = LONGEST_TEXT) -> str:
    """Put text on one line, with escapes for characters that are not displayed."""
    line = visible(_SPACE.sub(" ", text).strip())
    return line if len(line) <= longest else line[: longest - 1].rstrip() + "…"


def broken(text: str) -> list[str]:
    """Break text into the lines of a box, indented after the first; a bracket starts a line if necessary."""
    if len(text) <= LONGEST_LINE:
        return [text]
    head, bracket, tail = text.partition(" (")
    lines = [head, bracket.strip() + tail] if bracket else [text]
    parts = [part for line in lines for part in wrap(line, LONGEST_LINE - len(INDENT), break_on_hyphens=False)]
    if len(parts) > MOST_LINES:
        parts = [*parts[: MOST_LINES - 1], f"{parts[MOST_LINES - 1]} …"]
    return [*parts[:1], *(INDENT + part for part in parts[1:])]


_WIDTHS = (
    ("ijlI|'\\/:;,. \N{NO-BREAK SPACE}", 0.34),
    ("frt()[]!-", 0.41),
    ("csz*`J", 0.55),
    ("CRUHN", 0.75),
    ("DGOQw&", 0.82),
    ("M#+<=>^~", 0.86),
    ("mW%@\N{HORIZONTAL ELLIPSIS}", 1.02),
    ("EKPSYAVBXZ", 0.69),
)
"""Widths in DejaVu Sans, the widest of the usual sans-serif fonts: most Linux machines lack Helvetica."""

BOLD = 1.14
"""Width of bold letters relative to regular ones."""

_WIDTH_OF = {character: width for characters, width in _WIDTHS for character in characters}


def width(text: str, size: float) -> float:
    """Estimate the width of a line of sans-serif text of this size, rather too wide than too narrow [same unit]."""
    total = 0.0
    for character in text:
        if unicodedata.east_asian_width(character) in "WF":
            total += 1.05
        else:
            total += _WIDTH_OF.get(character, 0.64)
    return total * size
