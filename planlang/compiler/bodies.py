"""Bodies of plan functions: nodes of the plan tree written as statements, or as branches of other constructs."""

from __future__ import annotations

from collections.abc import Mapping

from planlang.compiler.expressions import Expressions, Names, Symbols, partial_call, quoted
from planlang.compiler.layout import (
    INDENT,
    Display,
    Expression,
    Item,
    Text,
    assignment,
    call,
    comment,
    one_or_several,
    return_statement,
    sequence,
    signature,
    statement,
    with_comment,
)
from planlang.compiler.layout import Call as CallExpression
from planlang.compiler.structure import DONE, FALSE, TRUE
from planlang.compiler.tree import (
    Achieve,
    Again,
    Alternatives,
    Call,
    Case,
    DataFlow,
    Event,
    Gate,
    Handle,
    Hold,
    Machine,
    Node,
    Parallel,
    PartialOrder,
    Perform,
    PlaceUse,
    Scope,
    Series,
    State,
    StepResult,
    Turn,
    uses_latest_products,
)
from planlang.designators import local_name, snake_case
from planlang.language.location import ATTEMPTS

MOST_UNPACKED = 4
"""Maximum number of branches whose results are unpacked by position. Results of more branches are indexed in a list,
because a reader would have to count underscores."""

LONGEST_VARIABLE = 40
"""Maximum length of a variable that is named after a step. A longer name would not fit on one line with its call; the
variable then has a generic name."""


class BodyWriter:
    """Writes the body of one plan function."""

    def __init__(self, symbols: Symbols, title: str, body: Series) -> None:
        self._symbols = symbols
        self._names: Names = symbols.local_names()
        self._title = title
        self._body = body
        self._data_flow = DataFlow(body)
        self._variables: dict[str, str] = {}
        """Step (IRI) -> variable with its result, if the result is used."""
        self._events: dict[Event, str] = {}
        self._passed_steps: dict[str, tuple[str, ...]] = {}
        """Branch of a partial order -> steps whose results it passes to other branches."""
        self._products: dict[str, str] = {}
        """Name of a product of states -> fluent with its latest value."""
        self._repeats: dict[str, str] = {}
        """Name of a step -> branch that runs it again."""
        self._write = Expressions(symbols, self._variables, self._products, self._repeats, body, self._local_name)

    def lines(self) -> list[str]:
        """Write the statements of the function."""
        return _spaced(self.body(self._body, 1))

    def body(self, series: Series, depth: int) -> list[str]:
        """Write the statements of a series; at least one line."""
        lines: list[str] = []
        for event in self._data_flow.events(series):
            moment = snake_case(event.moment)
            preferred = f"{snake_case(local_name(event.step))}_{moment}"
            self._events[event] = self._local_name(preferred if len(preferred) <= LONGEST_VARIABLE else moment)
            fluent = call(self._symbols.use("Fluent"), "False")
            lines += assignment([Text(self._events[event])], fluent, depth=depth)
        for node in series.nodes:
            written = self._statement(node, depth)
            used = self._variables_used() if depth == 1 else []
            if used and lines and any(line.startswith(f"{INDENT}async def ") for line in written):
                lines.append("")
            lines += [*used, *_comment(node, depth), *written]
        leaving = self._data_flow.leaving(series)
        if leaving:
            lines += return_statement(self._targets(leaving), depth=depth)
        return lines or [f"{INDENT * depth}pass"]

    def _variables_used(self) -> list[str]:
        """Write assignments of places and constraints that the following statements use for the first time."""
        lines: list[str] = []
        for name, explanation, value in self._write.take_variables():
            described = assignment([Text(name)], value, depth=1)
            lines += with_comment(described, explanation, 1) if explanation else described
        return lines

    def _statement(self, node: Node, depth: int) -> list[str]:
        if isinstance(node, Series):
            return self.body(node, depth)
        if isinstance(node, Gate):
            return self._gate(node, depth)
        if isinstance(node, Hold):
            more: dict[str, str] = {"in_turns": "True"} if node.in_turns else {}
            holding = call(self._symbols.use("using"), *map(quoted, node.roles), **more)
            before, expression = self._awaited(node.body, depth)
            inside = self._bound(node, expression, depth + 1)
            return [*before, *statement(holding, depth=depth, before="async with ", after=":"), *inside]
        if isinstance(node, Again):
            before, branch = self._branch(node.body, depth, None if isinstance(node.body, Perform) else node.name)
            if not isinstance(branch, Text):
                name = self._local_name(node.name)
                before, branch = [*before, *assignment([Text(name)], branch, depth=depth)], Text(name)
            self._repeats[node.name] = branch.text
            return [*before, *self._bound(node, call(branch.text), depth)]
        before, expression = self._awaited(node, depth)
        if isinstance(node, Turn) and node.again is not None:
            asked = statement(expression, depth=depth, before="if await ", after=":")
            return [*asked, *statement(call(self._repeats[node.again]), depth=depth + 1, before="await ")]
        return [*before, *self._bound(node, expression, depth)]

    def _bound(self, node: Node, expression: Expression, depth: int) -> list[str]:
        """Write statements that await a node, and assign or unpack its result if others use it."""
        leaving = self._data_flow.leaving(node)
        if not leaving:
            return statement(expression, depth=depth, before="await ")
        if not isinstance(node, (Parallel, PartialOrder)):
            return assignment(self._targets(leaving), expression, depth=depth, before="await ")
        giving = [
            (key, branch, self._data_flow.leaving(branch)) for key, branch in node.branches if self._is_giving(branch)
        ]
        if isinstance(node, Parallel) and len(node.branches) <= MOST_UNPACKED:
            by_key = {key: one_or_several(self._targets(steps)) for key, _, steps in giving}
            targets = [by_key.get(key, Text("_")) for key, _ in node.branches]
            return assignment(targets, expression, depth=depth, before="await ")
        results = self._local_name("results")
        lines = assignment([Text(results)], expression, depth=depth, before="await ")
        for key, _, steps in giving:
            place = str([name for name, _ in node.branches].index(key)) if isinstance(node, Parallel) else quoted(key)
            targets = [Text(self._variable(step) if step in leaving else "_") for step in steps]
            if any(step in leaving for step in steps):
                lines += assignment(targets, Item(results, place), depth=depth)
        return lines

    def _is_giving(self, node: Node) -> bool:
        return bool(self._data_flow.leaving(node))

    def _targets(self, steps: tuple[str, ...]) -> list[Expression]:
        return [Text(self._variable(step)) for step in steps]

    def _variable(self, step: str) -> str:
        """Variable for the result of a step."""
        if step not in self._variables:
            preferred = f"result_of_{snake_case(local_name(step))}"
            self._variables[step] = self._local_name(preferred if len(preferred) <= LONGEST_VARIABLE else "result")
        return self._variables[step]

    def _gate(self, gate: Gate, depth: int) -> list[str]:
        """Write the waits and signals of a gate around its step."""
        lines = self._passages(gate.opens, depth)
        lines += self._statement(gate.body, depth)
        return lines + self._passages(gate.closes, depth)

    def _passages(self, entries: tuple[Event | tuple[Event, ...], ...], depth: int) -> list[str]:
        lines = []
        for entry in entries:
            if isinstance(entry, Event):
                lines += statement(call(f"{self._events[entry]}.set", "True"), depth=depth)
            else:
                lines += [
                    line
                    for event in entry
                    for line in statement(
                        call(self._symbols.use("wait_for"), self._events[event]), depth=depth, before="await "
                    )
                ]
        return lines

    def _awaited(self, node: Node, depth: int) -> tuple[list[str], CallExpression]:
        """Local functions that a construct needs, and the call to await."""
        use = self._symbols.use
        match node:
            case Perform() | Call():
                return [], self._performed(node)
            case Turn():
                return [], call(use("give_turn"))
            case Achieve(condition, Perform() | Call() as step):
                _, performed = self._awaited(step, depth)
                return [], performed.extended(until=self._write.condition(condition))
            case Achieve(condition, body):
                before, branch = self._branch(body, depth)
                return before, call(use("achieve"), self._write.condition(condition), branch)
            case Handle(Perform() | Call() | Achieve(body=Perform() | Call()) as body, recoveries):
                before, handled = self._awaited(body, depth)
                several = self._write.recoveries(recoveries, is_outermost=depth == 1)
                return before, handled.extended(recoveries=several)
            case Handle(Achieve() | Scope() as body, recoveries):
                before, handled = self._awaited(body, depth)
                return before, handled.further(*self._write.each_recovery(recoveries))
            case Handle(body, recoveries):
                before, branch = self._branch(body, depth)
                return before, call(use("with_failure_handling"), branch, *self._write.each_recovery(recoveries))
            case Scope():
                return self._scope(node, depth)
            case Parallel(branches):
                before, named = self._branches(branches, depth)
                return before, call(use("par"), **named)
            case Alternatives(_, branches):
                before, named = self._branches(branches, depth)
                return before, call(use("try_in_order"), *named.values())
            case PartialOrder():
                return self._partial_order(node, depth)
            case Machine():
                return self._machine(node, depth)
        raise TypeError(f"no statement for {node}")

    def _performed(self, node: Perform | Call) -> CallExpression:
        """Call that performs a step; with a name if it differs from the class of the action."""
        more: dict[str, Expression | str] = {}
        if node.name != local_name(node.action.type):
            more["name"] = quoted(node.name)
        if isinstance(node, Call):
            more["otherwise"] = self._write.alternatives(node.calls)
        elif node.once:
            more["once"] = "True"
        if node.times > 1:
            more["times"] = str(node.times)
        return call(self._symbols.use("perform"), self._write.action(node.action), **more)

    def _branch(self, node: Node, depth: int, key: str | None = None) -> tuple[list[str], Expression]:
        """Local functions that come first, and an expression for a zero-argument async callable.

        ``key`` is the name of the branch, if it has one.
        """
        is_giving_several = isinstance(node, (Parallel, PartialOrder)) and self._is_giving(node)
        is_body = isinstance(node, (Series, Hold, Gate, Again)) or is_giving_several
        if not is_body:
            before, expression = self._awaited(node, depth)
            return before, partial_call(self._symbols, expression)
        name = self._local_name(snake_case(key) if key else self._function_name(node))
        return self._local_function(name, node, depth), Text(name)

    def _function_name(self, node: Node) -> str:
        """Name of the local function of an anonymous branch."""
        match node:
            case Hold(name=name):
                return f"{snake_case(name)}_in_turn"
            case Gate(name=name):
                return f"{snake_case(name)}_once"
            case _:
                return f"{self._title}_once"

    def _local_name(self, preferred: str) -> str:
        name = self._names.claim(preferred)
        self._symbols.reserve(name)
        return name

    def _local_function(self, name: str, node: Node, depth: int, taken: tuple[str, ...] = ()) -> list[str]:
        """Write a local function; ``taken`` are the branches whose results are its parameters."""
        # a parameter must not hide a function or a Python keyword
        names = {key: snake_case(key) for key in taken}
        parameters = {key: name if self._names.is_free(name) else f"{name}_" for key, name in names.items()}
        lines = self._unpacked(parameters, depth + 1)
        if isinstance(node, Series):
            lines += self.body(node, depth + 1)
        else:
            lines += [*_comment(node, depth + 1), *self._statement(node, depth + 1)]
            leaving = self._data_flow.leaving(node)
            if leaving:
                lines += return_statement(self._targets(leaving), depth=depth + 1)
        arguments = [f"{name}: {self._symbols.use('Any', 'typing')}" for name in parameters.values()]
        return [*signature(f"async def {name}", arguments, self._returned(node), depth=depth), *lines, ""]

    def _returned(self, node: Node) -> str:
        number = len(self._data_flow.leaving(node))
        if not number:
            return "None"
        anything = self._symbols.use("Any", "typing")
        several = [anything] * number if number <= MOST_UNPACKED else [anything, "..."]
        return anything if number == 1 else f"tuple[{', '.join(several)}]"

    def _unpacked(self, parameters: Mapping[str, str], depth: int) -> list[str]:
        """Write statements that unpack parameters with several results."""
        lines = []
        for key, name in parameters.items():
            steps = self._passed_steps[key]
            if len(steps) == 1:
                self._variables[steps[0]] = name
            else:
                lines += assignment(self._targets(steps), Text(name), depth=depth)
        return lines

    def _scope(self, scope: Scope, depth: int) -> tuple[list[str], CallExpression]:
        where = scope.place.otherwise if isinstance(scope.place, StepResult) else scope.place
        assert isinstance(where, PlaceUse)
        stands, place = self._write.standing(where)
        if isinstance(scope.place, StepResult):
            place = self._write.value(scope.place)
        name = self._local_name(f"at_{stands}".lower())
        reaching = [self._write.goal(where) for where in scope.reaching]
        more: dict[str, Expression | str] = {}
        if scope.attempts != ATTEMPTS:
            more["attempts"] = str(scope.attempts)
        if reaching:
            more["reaching"] = sequence(reaching)
        if scope.motion in self._symbols.stated:
            more["by"] = self._symbols.stated_class(scope.motion)
        use = self._symbols.use("at_location")
        expression = call(use, place, name, **more)
        return self._local_function(name, scope.body, depth), expression

    def _branches(self, branches: tuple[tuple[str, Node], ...], depth: int) -> tuple[list[str], dict[str, Expression]]:
        before: list[str] = []
        named: dict[str, Expression] = {}
        for key, branch in branches:
            inner, named[key] = self._branch(branch, depth, key)
            before += inner
        return before, named

    def _partial_order(self, node: PartialOrder, depth: int) -> tuple[list[str], CallExpression]:
        """Write a partial order; a branch that uses results of others has parameters named after these branches."""
        before: list[str] = []
        named: dict[str, Expression] = {}
        giving = {key: branch for key, branch in node.branches if self._is_giving(branch)}
        self._passed_steps = {
            **self._passed_steps,
            **{key: self._data_flow.leaving(branch) for key, branch in giving.items()},
        }
        for key, branch in node.branches:
            sources = tuple(k for k, other in giving.items() if k != key and self._data_flow.needed(branch, other))
            if sources:
                name = self._local_name(snake_case(key))
                variables = dict(self._variables)
                before += self._local_function(name, branch, depth, sources)
                for step in (step for k in sources for step in self._passed_steps[k]):
                    del self._variables[step]  # the parameter's name is valid only inside the branch
                self._variables.update(variables)
                named[key] = Text(name)
            else:
                inner, named[key] = self._branch(branch, depth, key)
                before += inner
        keys = {key: Text(quoted(key)) for key in named}
        steps = Display("{}", tuple(named.values()), tuple(keys.values()))
        orderings = [sequence([keys[a], keys[b]]) for a, b in node.orderings]
        return before, call(self._symbols.use("partial_order"), steps, sequence(orderings, "[]"))

    def _machine(self, machine: Machine, depth: int) -> tuple[list[str], CallExpression]:
        before = self._latest(machine, depth)
        states: dict[str, Expression] = {}
        done = {case.state for case in machine.cases if case.outcome == DONE and not case.is_failure}
        for state in machine.states:
            if state.name in machine.ends and not uses_latest_products(state.body):
                inner, states[state.name] = self._branch(state.body, depth, state.name)
                before += inner
                continue
            name = self._local_name(snake_case(state.name))
            states[state.name] = Text(name)
            if state.name in machine.ends:
                before += self._local_function(name, state.body, depth)
                continue
            above = _comment(state.body, depth + 1)
            first, expression = self._awaited(state.body, depth + 1)
            lines = [*above, *first, *self._outcome(state, expression, depth + 1, has_done=state.name in done)]
            before += [*signature(f"async def {name}", [], "str", depth=depth), *lines, ""]
        cases = [
            (sequence([Text(quoted(case.state)), self._case(case)]), Text(quoted(case.target)))
            for case in machine.cases
        ]
        ends = [Text(quoted(end)) for end in machine.ends]
        more: dict[str, Expression | str] = {"start": quoted(machine.start)}
        more["end"] = one_or_several(ends)
        table = Display("{}", tuple(states.values()), tuple(Text(quoted(name)) for name in states))
        transitions = Display("{}", tuple(target for _, target in cases), tuple(key for key, _ in cases))
        return before, call(self._symbols.use("state_machine"), table, transitions, **more)

    def _latest(self, machine: Machine, depth: int) -> list[str]:
        """Write a fluent for each product of states that others use, named so that a run can be resumed."""
        lines: list[str] = []
        for product in dict.fromkeys(product for state in machine.states for product in state.keeps):
            preferred = f"latest_{snake_case(product)}"
            self._products[product] = self._local_name(preferred if len(preferred) <= LONGEST_VARIABLE else "latest")
            fluent = call(self._symbols.use("Fluent"), "None", quoted(product))
            annotation = f"{self._products[product]}: Fluent[{self._symbols.use('Any', 'typing')}] = "
            lines += statement(fluent, depth=depth, before=annotation)
        return [*lines, ""] if lines else []

    def _case(self, case: Case) -> Expression:
        if case.is_failure:
            return Text(self._symbols.use(case.outcome, "planlang.failures"))
        return Text(quoted(case.outcome))

    def _outcome(self, state: State, expression: CallExpression, depth: int, *, has_done: bool) -> list[str]:
        """Write the statements of a state: perform its step and return its outcome."""
        indent = INDENT * depth

        def kept(result: str) -> list[str]:
            return [f"{indent}{self._products[name]}.set({result})" for name in state.keeps]

        if state.checks:
            answer = self._local_name("holds")
            return [
                *statement(expression, depth=depth, before=f"{answer} = await "),
                *kept(answer),
                f"{indent}return {quoted(FALSE)} if {answer} is False else {quoted(TRUE)}",
            ]
        if state.outcomes:
            outcome = self._local_name("outcome")
            lines = [*statement(expression, depth=depth, before=f"{outcome} = await "), *kept(outcome)]
            if not has_done:
                return [*lines, f"{indent}return str({outcome})"]
            known = sequence([Text(quoted(one)) for one in state.outcomes])
            return [
                *lines,
                *statement(known, depth=depth, before=f"if {outcome} in ", after=":"),
                f"{indent}{INDENT}return str({outcome})",
                f"{indent}return {quoted(DONE)}",
            ]
        if state.keeps:
            result_name = self._local_name("made")
            lines = [*statement(expression, depth=depth, before=f"{result_name} = await "), *kept(result_name)]
        else:
            lines = statement(expression, depth=depth, before="await ")
        return [*lines, f"{indent}return {quoted(DONE)}"]


def _spaced(lines: list[str]) -> list[str]:
    """Insert an empty line before a local function, or before its comment."""
    spaced: list[str] = []
    for line in lines:
        code = line.lstrip()
        if code.startswith("async def "):
            indent = line[: len(line) - len(code)]
            position = len(spaced)
            while position and spaced[position - 1].startswith(f"{indent}#"):
                position -= 1
            if position and spaced[position - 1].startswith(indent):
                spaced.insert(position, "")
        spaced.append(line)
    return spaced


def _comment(node: Node, depth: int) -> list[str]:
    """Comment with the description of a step, to be placed above it."""
    match node:
        case (
            Perform(name=name, label=str(label))
            | Call(name=name, label=str(label))
            | Alternatives(name=name, label=str(label))
            | Scope(name=name, label=str(label))
        ):
            is_informative = snake_case(label) != snake_case(name)
            return comment(label, depth) if is_informative else []
        case Gate(body=body, overlaps=overlaps):
            return [*(comment(overlaps, depth) if overlaps else ()), *_comment(body, depth)]
        case Handle(body=body) | Achieve(body=body) | Again(body=body) | Hold(body=body):
            return _comment(body, depth)
        case _:
            return []
