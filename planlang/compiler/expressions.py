"""Names of a plan, and expressions made of them.

Python names for OWL names are each given out once, and what a plan imports is noted. Expressions are actions, values,
conditions, recoveries, calls as branches.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from itertools import groupby

from planlang.compiler.layout import INDENT, WIDTH, Expression, Remark, Sum, Text, call, sequence
from planlang.compiler.layout import Call as CallExpression
from planlang.compiler.tree import (
    ActionTerm,
    Condition,
    Described,
    FunctionCall,
    Kept,
    Passed,
    PlaceUse,
    PlanTree,
    Recover,
    Resting,
    Series,
    Value,
    uses_of_classes,
    uses_of_features,
    uses_of_places,
    uses_of_recoveries,
)
from planlang.designators import local_name, snake_case
from planlang.recipe.model import Constraint, Kind, Name, Part, Place, RecipeSet, Thing
from planlang.recoveries import registered_strategies

PLANLANG = frozenset(
    (
        *("Any", "Condition", "Fluent", "Recovery", "a_constraint", "a_feature", "achieve", "action", "action_class"),
        *("at_location", "given", "holding", "par", "partial", "partial_order", "perform", "plan", "state_machine"),
        *("try_in_order", "using", "wait_for", "with_failure_handling"),
    )
)
"""Names that a plan may import, besides designators, failures and strategies of recovery."""

DESIGNATORS = frozenset(
    (
        *("Location", "Object", "Person", "a_device", "a_location", "a_person", "a_pose", "a_posture"),
        *("a_situation", "an_object", "resting_on"),
    )
)
"""Names for the things and places that a plan is about, which it imports from ``planlang.designators``."""


_GENERATED = re.compile(r"_[A-Za-z0-9]{8}$")
"""The end that ontology editors append to a name to make it unique."""


LONGEST_ACTION = WIDTH - len(3 * INDENT + ",")
"""Characters of an action in which its class is stated: so it fits on one line as an argument of a call."""


class Symbols:
    """Gives every thing, place, function and namespace of a plan one name, and remembers what must be imported."""

    def __init__(self, tree: PlanTree, recipes: RecipeSet) -> None:
        functions = (one.origin[1] for one in registered_strategies() if one.origin is not None)
        self._claimed: set[str] = {*PLANLANG, *DESIGNATORS, *functions, "RECIPE"}
        self._names = Names(self._claimed)
        self._imports: dict[str, set[str]] = {}
        self._namespaces: dict[str, str] = {namespace(recipes.task): "RECIPE"}
        self._things: dict[Thing, tuple[str, str]] = {}
        """Name as a parameter, which a device is not, and as a constant."""
        self._postures: dict[str, tuple[Place, str]] = {}
        self._explained: set[str] = set()
        """The places and templates of constraints (IRIs) whose description stands in the plan."""
        self._classes: dict[str, str] = {}
        self.devices = dict(tree.devices)
        self.stated = dict(tree.classes)
        uses = uses_of_classes(tree)
        self.stated_in_place = {cls for cls in self.stated if uses[cls] == 1}
        """The classes of actions that are stated where they are used, as that is one place."""
        self.functions = {
            function.iri: self._claim(snake_case(local_name(function.iri))) for function in tree.functions
        }

    def use(self, name: str, module: str = "planlang") -> str:
        """Import the name from the module and return it."""
        if name in DESIGNATORS:
            module = "planlang.designators"
        self._imports.setdefault(module, set()).add(name)
        return name

    def thing(self, thing: Thing) -> str:
        """Return the parameter name of an object or person, the constant of a device."""
        return self._names_of(thing)[thing.kind is Kind.DEVICE]

    def constant(self, thing: Thing) -> str:
        """Return the constant that describes a thing."""
        return self._names_of(thing)[1]

    def _names_of(self, thing: Thing) -> tuple[str, str]:
        if thing not in self._things:
            wanted = without_digits(snake_case(thing.name))
            name = wanted if thing.kind is Kind.DEVICE else self._claim(wanted)
            has_cases = wanted != wanted.upper() or thing.kind is Kind.DEVICE
            self._things[thing] = name, self._claim(wanted.upper()) if has_cases else name
        return self._things[thing]

    def posture(self, place: Place) -> str:
        """Return the constant of a posture."""
        if place.iri not in self._postures:
            self._postures[place.iri] = place, self._claim(without_digits(snake_case(place.name)).upper())
        return self._postures[place.iri][1]

    def explanation(self, what: Place | Constraint) -> str | None:
        """Return the description of a place, or of what constraints relate, the first time that it is asked for."""
        iri = what.iri if isinstance(what, Place) else what.template
        is_new = iri not in self._explained
        self._explained.add(iri)
        return what.label if is_new else None

    def iri(self, iri: str) -> Sum:
        """Return an expression for an IRI: the constant of its namespace and its local name."""
        start = namespace(iri)
        if start not in self._namespaces:
            self._namespaces[start] = self._claim(_stem(start).upper())
        return Sum(self._namespaces[start], quoted(iri[len(start) :]))

    def action_class(self, cls: str) -> str:
        """Return the constant of a class of actions that the plan states."""
        if cls not in self._classes:
            self._classes[cls] = self._claim(snake_case(local_name(cls)).upper())
        return self._classes[cls]

    def stated_class(self, cls: str) -> Expression:
        """Return the expression for a class of actions: its constant, or else its name or IRI."""
        if cls in self.stated_in_place:
            return self.statement_of_class(cls)
        if cls in self.stated:
            return Text(self.action_class(cls))
        return self.class_name(cls)

    def statement_of_class(self, cls: str) -> CallExpression:
        """Return the call that states a class of actions."""
        return call(self.use("action_class"), self.class_name(cls), below=self.above(cls))

    def above(self, cls: str) -> Expression:
        """Return the classes directly above one that the plan states."""
        above = [self.stated_class(one) for one in self.stated[cls]]
        return above[0] if len(above) == 1 else sequence(above)

    def class_name(self, cls: str) -> Expression:
        """Return the expression for the IRI of a class, or for its name in the vocabulary."""
        return self.iri(cls) if is_iri(cls) else Text(quoted(cls))

    def local_names(self) -> Names:
        """Return a scope inside a function, in which all names of the module are taken."""
        return Names(self._claimed | set().union(*self._imports.values()))

    def reserve(self, name: str) -> None:
        """Keep a name that a function uses inside from becoming one of the module."""
        self._names.reserve(name)

    def things(self) -> tuple[Thing, ...]:
        """Return all things named so far, by first use."""
        return tuple(self._things)

    def postures(self) -> tuple[tuple[Place, str], ...]:
        """Return all postures named so far, by first use, each with its constant."""
        return tuple(self._postures.values())

    def namespaces(self) -> list[tuple[str, str]]:
        """Return constants and the namespaces they stand for, that of the recipe first."""
        return [(constant, start) for start, constant in self._namespaces.items()]

    def imports(self) -> list[tuple[str, list[str]]]:
        """Return modules and the names imported from them, sorted as a linter sorts them."""
        return [(module, sorted(names, key=_import_order)) for module, names in sorted(self._imports.items())]

    def _claim(self, wanted: str) -> str:
        name = self._names.claim(wanted)
        self._claimed.add(name)
        return name


def namespace(iri: str) -> str:
    """Return everything of an IRI before its local name."""
    return iri[: len(iri) - len(local_name(iri))]


def quoted(text: str) -> str:
    """Return a string literal, in double quotes unless they need more escapes."""
    literal = repr(text)
    if literal.startswith("'") and '"' not in text:
        return f'"{literal[1:-1]}"'
    return literal


def is_iri(name: str) -> bool:
    """Return True for an IRI, False for a local name of the vocabulary."""
    return ":" in name


def _stem(start: str) -> str:
    name = start.rstrip("#/").rsplit("/", 1)[-1]
    return without_digits(snake_case(name.removesuffix(".owl")))


def _import_order(name: str) -> tuple[int, str]:
    if name.isupper() and len(name) > 1:
        return 0, name
    return (1 if name[0].isupper() else 2), name


def without_digits(name: str) -> str:
    """Return a name without trailing digits and what joins them, ``bottle`` of ``bottle1``, unless it is all digits."""
    return re.sub(r"[_\-]*\d+$", "", name) or name


class Names:
    """A scope of names, each given out once: the second ``bottle`` is ``bottle_2``."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._last: dict[str, int] = {}
        """The greatest number given out with a name, so that the next is not searched from the start."""

    def claim(self, wanted: str) -> str:
        """Return ``wanted``, or the first of ``wanted_2``, ``wanted_3``, ... that is free and no word of Python."""
        name, number = wanted, self._last.get(wanted, 1)
        while not self.is_free(name):
            number += 1
            name = f"{wanted}_{number}"
        self._last[wanted] = number
        self._taken.add(name)
        return name

    def is_free(self, name: str) -> bool:
        """Return True for a name that is not given out and no word of the language."""
        return name not in self._taken and _is_free(name)

    def reserve(self, name: str) -> None:
        """Keep a name from being given out."""
        self._taken.add(name)


def _is_free(name: str) -> bool:
    return not (keyword.iskeyword(name) or keyword.issoftkeyword(name) or hasattr(builtins, name))


class Expressions:
    """Writes expressions with the names of one module.

    ``variables`` hold the results of steps (IRIs), ``kept`` what states have made last, by name, and ``again`` runs
    steps again, by name. ``claim`` gives out names inside of the function that the expressions stand in, whose body is
    ``body``.
    """

    def __init__(
        self,
        symbols: Symbols,
        variables: dict[str, str],
        kept: dict[str, str],
        again: dict[str, str],
        body: Series,
        claim: Callable[[str], str],
    ) -> None:
        self._symbols = symbols
        self._variables = variables
        self._kept = kept
        self._again = again
        self._places = uses_of_places(body)
        self._features = frozenset(part for part, uses in uses_of_features(body).items() if uses > 1)
        """The features that variables hold, as more than one value names them."""
        self._things_of = Counter(name for name, _ in {(part.name, part.of) for part in self._features})
        """The number of things that have a feature of a name."""
        self._claim = claim
        self._held: dict[Hashable, str] = {}
        """The variables that hold places and constraints."""
        self._shared = frozenset(several for several, uses in uses_of_recoveries(body).items() if uses > 1)
        """The recoveries that several steps have; variables hold them if there is more than one."""
        self._undefined: list[tuple[str, str | None, Expression]] = []

    def take_variables(self) -> list[tuple[str, str | None, Expression]]:
        """Return the variables that have been used since the last call, each with a comment and its value.

        One whose value refers to another stands after it.
        """
        taken, self._undefined = self._undefined, []
        return taken

    def alternatives(self, calls: tuple[FunctionCall, ...]) -> Expression:
        """Return called functions as one branch."""
        if len(calls) == 1:
            return self.function(calls[0])
        return partial_call(self._symbols, call(self._symbols.use("try_in_order"), *map(self.function, calls)))

    def function(self, function: FunctionCall) -> Expression:
        """Return a called function as a branch."""
        name = self._symbols.functions[function.recipe]
        arguments = self.arguments(function)
        return partial_call(self._symbols, call(name, **arguments))

    def arguments(self, function: FunctionCall) -> dict[str, Expression | str]:
        """Return the keyword arguments of a call."""
        return {self._symbols.thing(own): self.value(given) for own, given in function.arguments}

    def action(self, term: ActionTerm) -> CallExpression:
        """Return an action designator."""
        return self._described("action", term.type, term.properties)

    def goal(self, where: PlaceUse | Thing | Resting) -> Expression:
        """Return the expression of a goal of a hand."""
        if isinstance(where, Resting):
            return call(self._symbols.use("resting_on"), self.value(where.support))
        return self.value(where)

    def value(self, value: Value) -> Expression:
        """Return the expression of a filler."""
        match value:
            case Thing():
                return Text(self._symbols.thing(value))
            case PlaceUse():
                return Text(self.place(value))
            case Part():
                return self._feature(value)
            case Constraint():
                return self._constraint(value)
            case Passed(producer, otherwise):
                return call(self._symbols.use("given"), self._variables[producer], self.value(otherwise))
            case Kept(name, otherwise):
                return call(self._symbols.use("given"), f"{self._kept[name]}.value", self.value(otherwise))
            case Described(type, properties):
                return self._described("a_situation", type, properties)
            case Name(iri):
                return Text(quoted(local_name(iri)))
            case str():
                return Text(quoted(value))
            case _:
                return Text(repr(value))

    def place(self, use: PlaceUse) -> str:
        """Return the variable that holds a place, the constant of a posture."""
        if use.place.is_posture:
            return self._symbols.posture(use.place)
        key = use.place.iri, *use.arguments
        return self._variable(key, use.place.name, use.place, lambda: self._location(use))

    def standing(self, use: PlaceUse) -> tuple[str, Expression]:
        """Return a name for where the base stands, and the place: described there if nothing else names it."""
        if use.place.is_posture or self._places[use.place.iri] > 1:
            name = self.place(use)
            return name, Text(name)
        described, explanation = self._location(use), self._symbols.explanation(use.place)
        name = without_digits(snake_case(use.place.name))
        return name, described if explanation is None else Remark(described, explanation)

    def _variable(
        self, key: Hashable, wanted: str, what: Place | Constraint | None, described: Callable[[], Expression]
    ) -> str:
        """Return the variable that holds what is described; what that refers to is described before it."""
        if key not in self._held:
            description = described()
            self._held[key] = self._claim(without_digits(snake_case(wanted)))
            explanation = None if what is None else self._symbols.explanation(what)
            self._undefined.append((self._held[key], explanation, description))
        return self._held[key]

    def _location(self, use: PlaceUse) -> CallExpression:
        """Return the call that describes a place by its relations."""
        own = dict(zip(use.place.changeable(), use.arguments, strict=True))
        relations: dict[str, list[Expression]] = {}
        for relation, reference in use.place.relations:
            if isinstance(reference, Thing):
                referred: Value = own.get(reference, reference)
            else:
                referred = PlaceUse(reference, tuple(own[thing] for thing in reference.changeable()))
            relations.setdefault(relation, []).append(self.value(referred))
        written: dict[str, Expression | str] = {
            relation: references[0] if len(references) == 1 else sequence(references)
            for relation, references in relations.items()
        }
        if (device := self._symbols.devices.get(use.place.iri)) is not None:
            written["using"] = self._symbols.thing(device)
        return call(self._symbols.use("a_location"), quoted(use.place.name), **written)

    def _feature(self, part: Part) -> Expression:
        """Return a feature, or the variable that holds it; ``front_side_in_left_arm`` if it is found by the hand."""
        if part not in self._features:
            return self._described_feature(part)
        wanted = part.name if part.held_by is None else f"{part.name}_in_{part.held_by.name}"
        if self._things_of[part.name] > 1:
            wanted = f"{wanted}_of_{part.of.name}"
        return Text(self._variable(part, wanted, None, lambda: self._described_feature(part)))

    def _described_feature(self, part: Part) -> CallExpression:
        """Return the call that describes a feature, of a constant if that is what the hand holds that finds it."""
        thing = self._symbols.constant(part.of) if part.held_by is not None else self._symbols.thing(part.of)
        more: dict[str, Expression | str] = {"of": thing}
        if part.path:
            more["path"] = sequence([self._symbols.iri(one) if is_iri(one) else Text(quoted(one)) for one in part.path])
        if part.held_by is not None:
            more["held_by"] = self._symbols.thing(part.held_by)
        return call(self._symbols.use("a_feature"), **more)

    def _constraint(self, constraint: Constraint) -> Expression:
        """Return a constraint: the variable that holds what its template relates, with limits."""
        template = local_name(constraint.template)
        key = constraint.template, constraint.tool, constraint.world
        wanted = _GENERATED.sub("", template) or template
        related = self._variable(key, wanted, constraint, lambda: self._related(constraint))
        more: dict[str, Expression | str] = {}
        if constraint.weight != 1.0:
            more["weight"] = repr(constraint.weight)
        if constraint.speed is not None:
            more["speed"] = quoted(constraint.speed.name)
        if not constraint.iri.startswith(constraint.template):
            more["name"] = quoted(local_name(constraint.iri))
        return call(f"{related}.within", repr(constraint.lower), repr(constraint.upper), **more)

    def _related(self, constraint: Constraint) -> CallExpression:
        """Return the call that describes what a constraint relates, without limits."""
        features = [self._feature(part) for part in (constraint.tool, constraint.world)]
        more: dict[str, Expression | str] = {} if constraint.frame is None else {"frame": quoted(constraint.frame)}
        more["name"] = quoted(local_name(constraint.template))
        return call(self._symbols.use("a_constraint"), quoted(constraint.kind.name), *features, **more)

    def _described(
        self, maker: str, type: str, properties: tuple[tuple[str, tuple[Value, ...]], ...]
    ) -> CallExpression:
        """Return a call that describes something by its class and properties."""
        written: dict[str, Expression | str] = {}
        for name, fillers in properties:
            values = [self.value(filler) for filler in fillers]
            written[name] = values[0] if len(values) == 1 else sequence(values)
        if type in self._symbols.stated_in_place:
            own, below = self._symbols.class_name(type), self._symbols.above(type)
            whole = call(self._symbols.use(maker), own, below=below, **written)
            if len(whole.flat()) <= LONGEST_ACTION:
                return whole
            self._symbols.stated_in_place.remove(type)
        return call(self._symbols.use(maker), self._symbols.stated_class(type), **written)

    def condition(self, condition: Condition) -> Expression:
        """Return a condition that the executive evaluates."""
        things = [Text(self._symbols.thing(thing)) for thing in condition.things]
        if condition.predicate == "holding":
            return call(self._symbols.use("holding"), *things)
        return call(self._symbols.use("Condition"), quoted(condition.predicate), sequence(things))

    def recoveries(self, recoveries: tuple[Recover, ...], *, is_outermost: bool) -> Expression:
        """Return recoveries as one argument; where they may name what only an inner function knows, a list."""

        def written() -> Expression:
            return sequence(self.each_recovery(recoveries), "[]")

        if recoveries in self._held or (is_outermost and len(recoveries) > 1 and recoveries in self._shared):
            return Text(self._variable(recoveries, "recoveries", None, written))
        return written()

    def each_recovery(self, recoveries: tuple[Recover, ...]) -> list[Expression]:
        """Return each recovery; neighbours that differ in the failure alone are one for several failures."""
        groups = groupby(recoveries, key=lambda one: replace(one, failure=""))
        return [self._recovery([one.failure for one in group], alike) for alike, group in groups]

    def _recovery(self, failures: Sequence[str], recovery: Recover) -> Expression:
        use = self._symbols.use
        kinds = [Text(use(failure, "planlang.failures")) for failure in failures]
        arguments: list[Expression | str] = [kinds[0] if len(kinds) == 1 else sequence(kinds)]
        attempts = recovery.attempts if recovery.strategy.function is not None else 0
        if recovery.strategy.origin is not None:
            module, function = recovery.strategy.origin
            do = use(function, module)
            about = [] if recovery.about is None else [self._symbols.thing(recovery.about)]
            again = [] if recovery.again is None else [self._again[recovery.again]]
            arguments.append(call(do, *about, *again) if about else do)
        more: dict[str, Expression | str] = {"attempts": str(attempts)}
        declared = recovery.strategy.otherwise
        if recovery.otherwise != (declared and declared.__name__):
            more["otherwise"] = use(recovery.otherwise, "planlang.failures") if recovery.otherwise else "None"
        return call(use("Recovery"), *arguments, **more)


def partial_call(symbols: Symbols, expression: CallExpression) -> Expression:
    """Return the call as a zero-argument callable: the function itself if it takes no arguments."""
    if not expression.arguments:
        return Text(expression.function)
    symbols.use("partial", "functools")
    return CallExpression("partial", ((None, Text(expression.function)), *expression.arguments))
