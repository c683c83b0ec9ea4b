"""The bodies of plan functions: nodes of the plan tree as statements, and as branches for other constructs."""

from __future__ import annotations

import textwrap

from planlang.compiler.layout import INDENT, WIDTH, Display, Expression, Text, call, sequence, statement
from planlang.compiler.layout import Call as CallExpression
from planlang.compiler.naming import Names, snake_case
from planlang.compiler.symbols import Symbols, is_iri, quoted
from planlang.compiler.tree import (
    Achieve,
    ActionTerm,
    Call,
    Condition,
    FunctionCall,
    Handle,
    Hold,
    Node,
    Perform,
    PlaceUse,
    Recover,
    Scope,
    Series,
    Unordered,
    Value,
)
from planlang.designators import local_name
from planlang.recipe.model import Name, Thing


class Statements:
    """Writes the body of one plan function."""

    def __init__(self, symbols: Symbols, title: str) -> None:
        self._symbols = symbols
        self._names: Names = symbols.local_names()
        self._title = title

    def body(self, series: Series, depth: int) -> list[str]:
        """The statements of a series; at least one line."""
        lines: list[str] = []
        for node in series.nodes:
            written = self._statement(node, depth)
            comment = _comment(node, depth)
            written = [*comment, *written]
            is_definition = written[len(comment)].lstrip().startswith("async def ")
            if lines and is_definition:
                lines.append("")
            lines += written
        return lines

    def _statement(self, node: Node, depth: int) -> list[str]:
        if isinstance(node, Series):
            return self.body(node, depth)
        if isinstance(node, Hold):
            holding = call(self._symbols.use("using"), *map(quoted, node.roles))
            before, expression = self._awaited(node.body, depth)
            inside = statement(expression, depth=depth + 1, before="await ")
            return [*before, *statement(holding, depth=depth, before="async with ", after=":"), *inside]
        before, expression = self._awaited(node, depth)
        return [*before, *statement(expression, depth=depth, before="await ")]

    def _awaited(self, node: Node, depth: int) -> tuple[list[str], CallExpression]:
        """Local functions that a construct needs, and the call that is awaited."""
        use = self._symbols.use
        match node:
            case Perform(name, term, _):
                return [], call(use("perform"), self._action(term), name=quoted(name))
            case Call(_, None, (only,)):
                arguments = {self._symbols.thing(a): self._symbols.thing(b) for a, b in only.arguments}
                return [], call(self._symbols.functions[only.recipe], **arguments)
            case Call(_, None, calls):
                return [], call(use("try_in_order"), *map(self._function, calls))
            case Call(_, term, calls) if term is not None:
                return [], call(use("perform_or"), self._action(term), self._alternatives(calls))
            case Achieve(condition, body):
                before, branch = self._branch(body, depth)
                return before, call(use("achieve"), self._condition(condition), branch)
            case Handle(body, recoveries):
                before, branch = self._branch(body, depth)
                return before, call(use("with_failure_handling"), branch, *map(self._recovery, recoveries))
            case Scope():
                return self._scope(node, depth)
            case Unordered():
                return self._unordered(node, depth)
        raise TypeError(f"no statement for {node}")

    def _branch(self, node: Node, depth: int) -> tuple[list[str], Expression]:
        """Local functions that come first, and an expression for a zero-argument async callable."""
        if isinstance(node, (Series, Call, Hold)):
            title = self._title if isinstance(node, Series) else snake_case(node.name)
            name = self._local_name(f"{title}_{'in_turn' if isinstance(node, Hold) else 'once'}")
            return self._local_function(name, node if isinstance(node, Series) else Series((node,)), depth), Text(name)
        before, expression = self._awaited(node, depth)
        return before, _partial(self._symbols, expression)

    def _local_name(self, wanted: str) -> str:
        name = self._names.claim(wanted)
        self._symbols.reserve(name)
        return name

    def _local_function(self, name: str, body: Series, depth: int) -> list[str]:
        return [f"{INDENT * depth}async def {name}() -> None:", *self.body(body, depth + 1), ""]

    def _scope(self, scope: Scope, depth: int) -> tuple[list[str], CallExpression]:
        name = self._local_name(f"at_{self._symbols.place(scope.place.place)}")
        reaching = [self._value(where) for where in scope.reaching]
        more: dict[str, Expression | str] = {"attempts": str(scope.attempts)}
        if reaching:
            more["reaching"] = sequence(reaching)
        use = self._symbols.use("at_location")
        expression = call(use, self._value(scope.place), name, **more)
        return self._local_function(name, scope.body, depth), expression

    def _unordered(self, node: Unordered, depth: int) -> tuple[list[str], CallExpression]:
        before: list[str] = []
        branches: list[tuple[str, Expression]] = []
        for name, member in node.branches:
            if isinstance(member, Call):
                inner, expression = self._awaited(member, depth)
                branch: Expression = _partial(self._symbols, expression)
            elif isinstance(member, Perform):
                perform = call(self._symbols.use("perform"), self._action(member.action))
                inner, branch = [], _partial(self._symbols, perform)
            else:
                inner, branch = self._branch(member, depth)
            before += inner
            branches.append((name, branch))
        if not node.orderings:
            keywords = Names({"name", "limit"})
            named = {keywords.claim(snake_case(name)): branch for name, branch in branches}
            return before, call(self._symbols.use("par"), **named)
        steps = Display("{}", tuple(branch for _, branch in branches), tuple(quoted(name) for name, _ in branches))
        orderings = [sequence([Text(quoted(a)), Text(quoted(b))]) for a, b in node.orderings]
        return before, call(self._symbols.use("partial_order"), steps, sequence(orderings, "[]"))

    def _alternatives(self, calls: tuple[FunctionCall, ...]) -> Expression:
        if len(calls) == 1:
            return self._function(calls[0])
        return _partial(self._symbols, call(self._symbols.use("try_in_order"), *map(self._function, calls)))

    def _function(self, function: FunctionCall) -> Expression:
        name = self._symbols.functions[function.recipe]
        arguments = {self._symbols.thing(a): self._symbols.thing(b) for a, b in function.arguments}
        return _partial(self._symbols, call(name, **arguments)) if arguments else Text(name)

    def _action(self, term: ActionTerm) -> CallExpression:
        properties: dict[str, Expression | str] = {}
        for name, fillers in term.properties:
            values = [self._value(filler) for filler in fillers]
            properties[name] = values[0] if len(values) == 1 else sequence(values)
        action_class = self._symbols.iri(term.type) if is_iri(term.type) else quoted(term.type)
        return call(self._symbols.use("action"), action_class, **properties)

    def _value(self, value: Value) -> Expression:
        match value:
            case Thing():
                return Text(self._symbols.thing(value))
            case PlaceUse(place, arguments):
                if place.is_posture:
                    return Text(self._symbols.place(place))
                return call(self._symbols.place(place), *map(self._symbols.thing, arguments))
            case Name(iri):
                return Text(quoted(local_name(iri)))
            case str():
                return Text(quoted(value))
            case _:
                return Text(repr(value))

    def _condition(self, condition: Condition) -> Expression:
        things = [Text(self._symbols.thing(thing)) for thing in condition.things]
        if condition.predicate == "holding":
            return call(self._symbols.use("holding"), *things)
        return call(self._symbols.use("Condition"), quoted(condition.predicate), sequence(things))

    def _recovery(self, recovery: Recover) -> Expression:
        use = self._symbols.use
        arguments: list[Expression | str] = [use(recovery.failure, "planlang.failures")]
        attempts = recovery.attempts
        if recovery.about is not None:
            arguments.append(call(use(recovery.strategy), self._symbols.thing(recovery.about)))
        elif recovery.strategy == "escalate":
            attempts = 0
        elif recovery.strategy != "repeat":
            arguments.append(use(recovery.strategy))
        more: dict[str, Expression | str] = {"attempts": str(attempts)}
        if recovery.otherwise is not None:
            more["otherwise"] = use(recovery.otherwise, "planlang.failures")
        return call(use("Recovery"), *arguments, **more)


def _comment(node: Node, depth: int) -> list[str]:
    """What a step says in words, above it."""
    match node:
        case Perform(label=str(label)) | Scope(label=str(label)):
            text = " ".join(label.split())
            return textwrap.wrap(
                text, WIDTH, initial_indent=INDENT * depth + "# ", subsequent_indent=INDENT * depth + "# "
            )
        case Handle(body=body) | Achieve(body=body) | Hold(body=body):
            return _comment(body, depth)
        case _:
            return []


def _partial(symbols: Symbols, expression: CallExpression) -> Expression:
    """The call as a zero-argument callable: the function itself if it takes no arguments."""
    if not expression.arguments:
        return Text(expression.function)
    symbols.use("partial", "functools")
    return CallExpression("partial", ((None, Text(expression.function)), *expression.arguments))
