"""The expressions of plans: actions, values, conditions, recoveries, calls as branches."""

from __future__ import annotations

from planlang.compiler.layout import Call as CallExpression
from planlang.compiler.layout import Expression, Text, call, sequence
from planlang.compiler.names import Symbols, is_iri, quoted
from planlang.compiler.tree import (
    ActionTerm,
    Condition,
    Described,
    FunctionCall,
    Kept,
    Passed,
    PlaceUse,
    Recover,
    Value,
)
from planlang.designators import local_name
from planlang.recipe.model import Name, Thing


class Expressions:
    """Writes expressions with the names of one module.

    ``variables`` hold the results of steps (IRIs), ``kept`` what states have made last, by name.
    """

    def __init__(self, symbols: Symbols, variables: dict[str, str], kept: dict[str, str]) -> None:
        self._symbols = symbols
        self._variables = variables
        self._kept = kept

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

    def value(self, value: Value) -> Expression:
        """Return the expression of a filler."""
        match value:
            case Thing():
                return Text(self._symbols.thing(value))
            case PlaceUse(place, arguments):
                if place.is_posture:
                    return Text(self._symbols.place(place))
                return call(self._symbols.place(place), *map(self._symbols.thing, arguments))
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

    def _described(
        self, maker: str, type: str, properties: tuple[tuple[str, tuple[Value, ...]], ...]
    ) -> CallExpression:
        """Return a call that describes something by its class and properties."""
        written: dict[str, Expression | str] = {}
        for name, fillers in properties:
            values = [self.value(filler) for filler in fillers]
            written[name] = values[0] if len(values) == 1 else sequence(values)
        cls = self._symbols.iri(type) if is_iri(type) else quoted(type)
        return call(self._symbols.use(maker), cls, **written)

    def condition(self, condition: Condition) -> Expression:
        """Return a condition that the executive evaluates."""
        things = [Text(self._symbols.thing(thing)) for thing in condition.things]
        if condition.predicate == "holding":
            return call(self._symbols.use("holding"), *things)
        return call(self._symbols.use("Condition"), quoted(condition.predicate), sequence(things))

    def recovery(self, recovery: Recover) -> Expression:
        """Return a recovery."""
        use = self._symbols.use
        arguments: list[Expression | str] = [use(recovery.failure, "planlang.failures")]
        attempts = recovery.attempts if recovery.strategy.function is not None else 0
        if recovery.strategy.origin is not None:
            module, function = recovery.strategy.origin
            do = use(function, module)
            arguments.append(do if recovery.about is None else call(do, self._symbols.thing(recovery.about)))
        more: dict[str, Expression | str] = {"attempts": str(attempts)}
        if recovery.otherwise is not None:
            more["otherwise"] = use(recovery.otherwise, "planlang.failures")
        return call(use("Recovery"), *arguments, **more)


def partial_call(symbols: Symbols, expression: CallExpression) -> Expression:
    """Return the call as a zero-argument callable: the function itself if it takes no arguments."""
    if not expression.arguments:
        return Text(expression.function)
    symbols.use("partial", "functools")
    return CallExpression("partial", ((None, Text(expression.function)), *expression.arguments))
