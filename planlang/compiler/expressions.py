"""Names in the source of a plan, and expressions that use them.

Each OWL name gets a unique Python name, and the imports of the plan are collected. Expressions are actions, values,
conditions, recoveries, and calls as branches.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from itertools import groupby

from planlang.compiler.layout import INDENT, WIDTH, Expression, Remark, Sum, Text, call, one_or_several, sequence
from planlang.compiler.layout import Call as CallExpression
from planlang.compiler.tree import (
    ActionTerm,
    Condition,
    Described,
    FunctionCall,
    LatestProduct,
    PlaceUse,
    PlanTree,
    Recover,
    Resting,
    Series,
    StepResult,
    Value,
    uses_of_classes,
    uses_of_features,
    uses_of_places,
    uses_of_recoveries,
)
from planlang.designators import local_name, local_part, snake_case
from planlang.recipe.model import Constraint, Kind, Name, Part, Place, RecipeSet, Thing
from planlang.recoveries import registered_strategies

PLANLANG = frozenset(
    (
        *("Any", "Condition", "Fluent", "Recovery", "a_constraint", "a_feature", "achieve", "action", "action_class"),
        *("at_location", "give_turn", "given", "holding", "par", "partial", "partial_order", "perform", "plan"),
        *("state_machine", "try_in_order", "using", "wait_for", "with_failure_handling"),
    )
)
"""Names that a plan may import, besides designators, failures and recovery strategies."""

DESIGNATORS = frozenset(
    (
        *("Location", "Object", "Person", "a_device", "a_location", "a_person", "a_pose", "a_posture"),
        *("a_situation", "an_object", "label_iris", "resting_on"),
    )
)
"""Names for things and places that a plan imports from ``planlang.designators``."""


_GENERATED = re.compile(r"_[A-Za-z0-9]{8}$")
"""Suffix that ontology editors append to a name to make it unique."""


LONGEST_ACTION = WIDTH - len(3 * INDENT + ",")
"""Maximum length of an action that declares its class inline: it fits on one line as an argument of a call."""


class Symbols:
    """Names of all things, places, functions and namespaces of a plan, and its imports."""

    def __init__(self, tree: PlanTree, recipes: RecipeSet) -> None:
        functions = (one.origin[1] for one in registered_strategies() if one.origin is not None)
        self._claimed: set[str] = {*PLANLANG, *DESIGNATORS, *functions, "RECIPE"}
        self._names = Names(self._claimed)
        self._imports: dict[str, set[str]] = {}
        self._namespaces: dict[str, str] = {namespace(recipes.task): "RECIPE"}
        self._things: dict[Thing, tuple[str, str]] = {}
        """Thing -> names as a parameter (not used for devices) and as a constant."""
        self._postures: dict[str, tuple[Place, str]] = {}
        self._explained: set[str] = set()
        """Places and templates of constraints (IRIs) whose description has been written."""
        self._classes: dict[str, str] = {}
        self.readable: dict[str, tuple[Sum, str]] = {}
        """IRIs that the plan uses and that have readable names: their expressions and names."""
        self.devices = dict(tree.devices)
        self.stated = dict(tree.classes)
        uses = uses_of_classes(tree)
        self.stated_in_place = {cls for cls in self.stated if uses[cls] == 1}
        """Action classes that are declared inline, because the plan uses them once."""
        self.functions = {
            function.iri: self._claim(snake_case(local_name(function.iri))) for function in tree.functions
        }

    def use(self, name: str, module: str = "planlang") -> str:
        """Import the name from the module. Gives the name."""
        if name in DESIGNATORS:
            module = "planlang.designators"
        self._imports.setdefault(module, set()).add(name)
        return name

    def thing(self, thing: Thing) -> str:
        """Parameter name of an object or person, constant of a device."""
        return self._names_of(thing)[thing.kind is Kind.DEVICE]

    def constant(self, thing: Thing) -> str:
        """Constant that describes a thing."""
        return self._names_of(thing)[1]

    def _names_of(self, thing: Thing) -> tuple[str, str]:
        if thing not in self._things:
            for _, other in thing.where:  # constants are stated in this order
                self.constant(other)
            preferred = without_digits(snake_case(thing.name))
            name = preferred if thing.kind is Kind.DEVICE else self._claim(preferred)
            has_cases = preferred != preferred.upper() or thing.kind is Kind.DEVICE
            self._things[thing] = name, self._claim(preferred.upper()) if has_cases else name
        return self._things[thing]

    def posture(self, place: Place) -> str:
        """Constant of a posture."""
        if place.iri not in self._postures:
            self._postures[place.iri] = place, self._claim(without_digits(snake_case(place.name)).upper())
        return self._postures[place.iri][1]

    def explanation(self, subject: Place | Constraint) -> str | None:
        """Description of a place, or of the template of a constraint, the first time that it is requested."""
        iri = subject.iri if isinstance(subject, Place) else subject.template
        is_new = iri not in self._explained
        self._explained.add(iri)
        return subject.label if is_new else None

    def iri(self, iri: str) -> Sum:
        """Expression for an IRI: the constant of its namespace plus its local name."""
        start = namespace(iri)
        if start not in self._namespaces:
            stem = start.rstrip("#/").rsplit("/", 1)[-1].removesuffix(".owl")
            self._namespaces[start] = self._claim(without_digits(snake_case(stem)).upper())
        found = Sum(self._namespaces[start], quoted(iri[len(start) :]))
        if local_name(iri) != local_part(iri):
            self.readable.setdefault(iri, (found, quoted(local_name(iri))))
        return found

    def action_class(self, cls: str) -> str:
        """Constant of an action class that the plan declares."""
        if cls not in self._classes:
            self._classes[cls] = self._claim(snake_case(local_name(cls)).upper())
        return self._classes[cls]

    def stated_class(self, cls: str) -> Expression:
        """Expression for an action class: its constant, else its name or IRI."""
        if cls in self.stated_in_place:
            return self.statement_of_class(cls)
        if cls in self.stated:
            return Text(self.action_class(cls))
        return self.class_name(cls)

    def statement_of_class(self, cls: str) -> CallExpression:
        """Call that declares an action class."""
        return call(self.use("action_class"), self.class_name(cls), below=self.above(cls))

    def above(self, cls: str) -> Expression:
        """Direct superclasses of a class that the plan declares."""
        above = [self.stated_class(one) for one in self.stated[cls]]
        return one_or_several(above)

    def class_name(self, cls: str) -> Expression:
        """Expression for the IRI of a class, or for its name in the vocabulary."""
        return self.iri(cls) if is_iri(cls) else Text(quoted(cls))

    def local_names(self) -> Names:
        """Scope inside a function, in which all names of the module are taken."""
        return Names(self._claimed | set().union(*self._imports.values()))

    def reserve(self, name: str) -> None:
        """Prevent a name that a function uses from becoming a name of the module."""
        self._names.reserve(name)

    def things(self) -> tuple[Thing, ...]:
        """All things named so far, by first use."""
        return tuple(self._things)

    def postures(self) -> tuple[tuple[Place, str], ...]:
        """All postures named so far, by first use, each with its constant."""
        return tuple(self._postures.values())

    def namespaces(self) -> list[tuple[str, str]]:
        """Constants and the namespaces that they stand for, the recipe's first."""
        return [(constant, start) for start, constant in self._namespaces.items()]

    def imports(self) -> list[tuple[str, list[str]]]:
        """Modules and the names imported from them, sorted as a linter sorts them."""
        return [(module, sorted(names, key=_import_order)) for module, names in sorted(self._imports.items())]

    def _claim(self, preferred: str) -> str:
        name = self._names.claim(preferred)
        self._claimed.add(name)
        return name


def namespace(iri: str) -> str:
    """Everything before the local name of an IRI."""
    return iri[: len(iri) - len(local_part(iri))]


def quoted(text: str) -> str:
    """String literal, in double quotes unless these need more escapes."""
    literal = repr(text)
    if literal.startswith("'") and '"' not in text:
        return f'"{literal[1:-1]}"'
    return literal


def is_iri(name: str) -> bool:
    """True for an IRI, False for a local name of the vocabulary."""
    return ":" in name


def _import_order(name: str) -> tuple[int, str]:
    if name.isupper() and len(name) > 1:
        return 0, name
    return (1 if name[0].isupper() else 2), name


def without_digits(name: str) -> str:
    """Name without trailing digits and their separator (``bottle`` for ``bottle1``), unless nothing would be left."""
    return re.sub(r"[_\-]*\d+$", "", name) or name


class Names:
    """A scope of unique names: the second ``bottle`` becomes ``bottle_2``."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._last: dict[str, int] = {}
        """Greatest number used with a name, so that the search for the next one does not start at 2."""

    def claim(self, wanted: str) -> str:
        """Claim ``wanted``, or the first of ``wanted_2``, ``wanted_3``, ... that is free."""
        name, number = wanted, self._last.get(wanted, 1)
        while not self.is_free(name):
            number += 1
            name = f"{wanted}_{number}"
        self._last[wanted] = number
        self._taken.add(name)
        return name

    def is_free(self, name: str) -> bool:
        """True for a name that is not claimed and no keyword or builtin of Python."""
        is_python = keyword.iskeyword(name) or keyword.issoftkeyword(name) or hasattr(builtins, name)
        return name not in self._taken and not is_python

    def reserve(self, name: str) -> None:
        """Prevent a name from being claimed."""
        self._taken.add(name)


class Expressions:
    """Writes the expressions of one function.

    ``variables`` maps steps (IRIs) to variables with their results, ``products`` names of products of states to fluents
    with the latest one, ``repeats`` names of steps to branches that run them again. ``claim`` makes unique names inside
    the function, whose body is ``body``.
    """

    def __init__(
        self,
        symbols: Symbols,
        variables: dict[str, str],
        products: dict[str, str],
        repeats: dict[str, str],
        body: Series,
        claim: Callable[[str], str],
    ) -> None:
        self._symbols = symbols
        self._variables = variables
        self._products = products
        self._repeats = repeats
        self._places = uses_of_places(body)
        self._features = frozenset(part for part, uses in uses_of_features(body).items() if uses > 1)
        """Features that are assigned to variables, because several values use them."""
        self._things_of = Counter(name for name, _ in {(part.name, part.of) for part in self._features})
        """Name of a feature -> number of things with such a feature."""
        self._claim = claim
        self._variable_of: dict[Hashable, str] = {}
        """Place, feature, constraint or recoveries -> variable that holds it."""
        self._shared = frozenset(several for several, uses in uses_of_recoveries(body).items() if uses > 1)
        """Recoveries that several steps share; several of them are assigned to a variable."""
        self._undefined: list[tuple[str, str | None, Expression]] = []

    def take_variables(self) -> list[tuple[str, str | None, Expression]]:
        """Variables first used since the last call, each with a comment and its value, in order of dependence."""
        taken, self._undefined = self._undefined, []
        return taken

    def alternatives(self, calls: tuple[FunctionCall, ...]) -> Expression:
        """Called functions as one branch."""
        if len(calls) == 1:
            return self.function(calls[0])
        return partial_call(self._symbols, call(self._symbols.use("try_in_order"), *map(self.function, calls)))

    def function(self, function: FunctionCall) -> Expression:
        """Called function as a branch."""
        name = self._symbols.functions[function.recipe]
        arguments = self.arguments(function)
        return partial_call(self._symbols, call(name, **arguments))

    def arguments(self, function: FunctionCall) -> dict[str, Expression | str]:
        """Keyword arguments of a call."""
        return {self._symbols.thing(own): self.value(given) for own, given in function.arguments}

    def action(self, term: ActionTerm) -> CallExpression:
        """Action designator."""
        return self._described("action", term.type, term.properties)

    def goal(self, where: PlaceUse | Thing | Resting) -> Expression:
        """Goal of a hand."""
        if isinstance(where, Resting):
            return call(self._symbols.use("resting_on"), self.value(where.support))
        return self.value(where)

    def value(self, value: Value) -> Expression:
        """Expression of a filler."""
        match value:
            case Thing():
                return Text(self._symbols.thing(value))
            case PlaceUse():
                return Text(self.place(value))
            case Part():
                return self._feature(value)
            case Constraint():
                return self._constraint(value)
            case StepResult(producer, otherwise):
                return call(self._symbols.use("given"), self._variables[producer], self.value(otherwise))
            case LatestProduct(name, otherwise):
                return call(self._symbols.use("given"), f"{self._products[name]}.value", self.value(otherwise))
            case Described(type, properties):
                return self._described("a_situation", type, properties)
            case Name(iri):
                return Text(quoted(local_name(iri)))
            case str():
                return Text(quoted(value))
            case _:
                return Text(repr(value))

    def place(self, use: PlaceUse) -> str:
        """Variable that holds a place, or constant of a posture."""
        if use.place.is_posture:
            return self._symbols.posture(use.place)
        key = use.place.iri, *use.arguments
        return self._variable(key, use.place.name, use.place, lambda: self._location(use))

    def standing(self, use: PlaceUse) -> tuple[str, Expression]:
        """Name for the pose of the base, and the expression of the place: inline if nothing else uses it."""
        if use.place.is_posture or self._places[use.place.iri] > 1:
            name = self.place(use)
            return name, Text(name)
        described, explanation = self._location(use), self._symbols.explanation(use.place)
        name = without_digits(snake_case(use.place.name))
        return name, described if explanation is None else Remark(described, explanation)

    def _variable(
        self, key: Hashable, preferred: str, subject: Place | Constraint | None, build: Callable[[], Expression]
    ) -> str:
        """Variable that holds an expression, which is built first, so that its own variables come before."""
        if key not in self._variable_of:
            expression = build()
            self._variable_of[key] = self._claim(without_digits(snake_case(preferred)))
            explanation = None if subject is None else self._symbols.explanation(subject)
            self._undefined.append((self._variable_of[key], explanation, expression))
        return self._variable_of[key]

    def _location(self, use: PlaceUse) -> CallExpression:
        """Call that describes a place by its relations."""
        own = dict(zip(use.place.changeable(), use.arguments, strict=True))
        relations: dict[str, list[Expression]] = {}
        for relation, references in use.place.relations:
            referred = [
                own.get(one, one)
                if isinstance(one, Thing)
                else PlaceUse(one, tuple(own[thing] for thing in one.changeable()))
                for one in references
            ]
            relations.setdefault(relation, []).append(one_or_several([*map(self.value, referred)]))
        written: dict[str, Expression | str] = {name: one_or_several(each) for name, each in relations.items()}
        if (device := self._symbols.devices.get(use.place.iri)) is not None:
            written["using"] = self._symbols.thing(device)
        return call(self._symbols.use("a_location"), quoted(use.place.name), **written)

    def _feature(self, part: Part) -> Expression:
        """Feature, or the variable that holds it; its name mentions the hand if the hand identifies the thing."""
        if part not in self._features:
            return self._described_feature(part)
        preferred = part.name if part.held_by is None else f"{part.name}_in_{part.held_by.name}"
        if self._things_of[part.name] > 1:
            preferred = f"{preferred}_of_{part.of.name}"
        return Text(self._variable(part, preferred, None, lambda: self._described_feature(part)))

    def _described_feature(self, part: Part) -> CallExpression:
        """Call that describes a feature; a thing that a hand identifies is written as a constant, not a parameter."""
        thing = self._symbols.constant(part.of) if part.held_by is not None else self._symbols.thing(part.of)
        more: dict[str, Expression | str] = {"of": thing}
        if part.path:
            more["path"] = sequence([self._symbols.iri(one) if is_iri(one) else Text(quoted(one)) for one in part.path])
        if part.held_by is not None:
            more["held_by"] = self._symbols.thing(part.held_by)
        return call(self._symbols.use("a_feature"), **more)

    def _constraint(self, constraint: Constraint) -> Expression:
        """Constraint: the variable that holds its template, with limits."""
        template = local_name(constraint.template)
        key = constraint.template, constraint.tool, constraint.world
        preferred = _GENERATED.sub("", template) or template
        related = self._variable(key, preferred, constraint, lambda: self._related(constraint))
        more: dict[str, Expression | str] = {}
        if constraint.weight != 1.0:
            more["weight"] = repr(constraint.weight)
        if constraint.speed is not None:
            more["speed"] = quoted(constraint.speed.name)
        if not constraint.iri.startswith(constraint.template):
            more["name"] = quoted(local_name(constraint.iri))
        return call(f"{related}.within", repr(constraint.lower), repr(constraint.upper), **more)

    def _related(self, constraint: Constraint) -> CallExpression:
        """Call that describes the template of a constraint, without limits."""
        features = [self._feature(part) for part in (constraint.tool, constraint.world)]
        more: dict[str, Expression | str] = {} if constraint.frame is None else {"frame": quoted(constraint.frame)}
        more["name"] = quoted(local_name(constraint.template))
        return call(self._symbols.use("a_constraint"), quoted(constraint.kind.name), *features, **more)

    def _described(
        self, maker: str, type: str, properties: tuple[tuple[str, tuple[Value, ...]], ...]
    ) -> CallExpression:
        """Call that describes something by its class and properties."""
        written: dict[str, Expression | str] = {}
        for name, fillers in properties:
            values = [self.value(filler) for filler in fillers]
            written[name] = one_or_several(values)
        if type in self._symbols.stated_in_place:
            own, below = self._symbols.class_name(type), self._symbols.above(type)
            whole = call(self._symbols.use(maker), own, below=below, **written)
            if len(whole.flat()) <= LONGEST_ACTION:
                return whole
            self._symbols.stated_in_place.remove(type)
        return call(self._symbols.use(maker), self._symbols.stated_class(type), **written)

    def condition(self, condition: Condition) -> Expression:
        """Condition that the executive evaluates."""
        things = [Text(self._symbols.thing(thing)) for thing in condition.things]
        if condition.predicate == "holding":
            return call(self._symbols.use("holding"), *things)
        return call(self._symbols.use("Condition"), quoted(condition.predicate), sequence(things))

    def recoveries(self, recoveries: tuple[Recover, ...], *, is_outermost: bool) -> Expression:
        """Recoveries as one argument; a list if they may refer to names of an inner function."""

        def written() -> Expression:
            return sequence(self.each_recovery(recoveries), "[]")

        if recoveries in self._variable_of or (is_outermost and len(recoveries) > 1 and recoveries in self._shared):
            return Text(self._variable(recoveries, "recoveries", None, written))
        return written()

    def each_recovery(self, recoveries: tuple[Recover, ...]) -> list[Expression]:
        """Each recovery; neighbours that differ only in the failure become one for several failures."""
        groups = groupby(recoveries, key=lambda one: replace(one, failure=""))
        return [self._recovery([one.failure for one in group], recovery) for recovery, group in groups]

    def _recovery(self, failures: Sequence[str], recovery: Recover) -> Expression:
        use = self._symbols.use
        kinds = [Text(use(failure, "planlang.failures")) for failure in failures]
        arguments: list[Expression | str] = [one_or_several(kinds)]
        retries = recovery.attempts if recovery.strategy.function is not None else 0
        if recovery.strategy.origin is not None:
            module, function = recovery.strategy.origin
            do = use(function, module)
            about = [] if recovery.about is None else [self._symbols.thing(recovery.about)]
            again = [] if recovery.again is None else [self._repeats[recovery.again]]
            arguments.append(call(do, *about, *again) if about else do)
        more: dict[str, Expression | str] = {"retries": str(retries)}
        if recovery.within is not None:
            more["within"] = f"{recovery.within:g}"
        declared = recovery.strategy.otherwise
        if recovery.otherwise != (declared and declared.__name__):
            more["otherwise"] = use(recovery.otherwise, "planlang.failures") if recovery.otherwise else "None"
        return call(use("Recovery"), *arguments, **more)


def partial_call(symbols: Symbols, expression: CallExpression) -> Expression:
    """Call as a zero-argument callable: the function itself if it takes no arguments."""
    if not expression.arguments:
        return Text(expression.function)
    symbols.use("partial", "functools")
    return CallExpression("partial", ((None, Text(expression.function)), *expression.arguments))
