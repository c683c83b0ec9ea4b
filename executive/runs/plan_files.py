"""Plans as files: compiling them, finding the plan to run, and what it needs of robot and modules."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from executive.robots import Availability, FindingKind, Missing, Robot, possessions_of
from executive.robots.tasks import match
from planlang.action_classes import ancestors_of, nearest_unstated
from planlang.designators import action_class, is_called
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.language.branches import Branch
from planlang.language.plans import Plan
from planlang.ontology import Ontology, expand, load, shorten
from planlang.outputs import LONGEST, header
from planlang.recipe import Actions, RecipeSet, read_recipe
from planlang.records import dataclass
from planlang.shell import quoted
from planlang.temporary import temporary_folder

if TYPE_CHECKING:
    from planlang.compiler import CompiledPlan


def fixed_recipe(
    recipe: Path,
    stack: ExitStack,
    diagnostics: list[Diagnostic],
    task: str | None,
    folders: Sequence[Path],
    accepted: Sequence[str],
) -> Path:
    """Fix a copy of a recipe, with uncertain fixes of accepted codes. ``stack`` removes the copy."""
    from executive.runs.fixing import fixed  # slow, and most recipes are not fixed

    result = fixed(recipe, task=task, folders=folders, accepted=accepted)
    diagnostics.extend(note("C017", f"fixed {one.code} {one.message}", Span(str(recipe))) for one in result.done)
    for one, why in result.refused:
        diagnostics.append(warning("C022", f"refused: {one.code} {one.message}; {why}", one.span, why.advice))
    copy = stack.enter_context(temporary_folder()) / recipe.name
    copy.write_bytes(result.after.encode(result.encoding))
    return copy


def located(diagnostic: Diagnostic, copy: Path, file: Path) -> Diagnostic:
    """Replace the copy of a file by the file in a diagnostic; lines remain those of the copy."""
    span = diagnostic.span
    return (
        diagnostic
        if span is None or span.file != str(copy)
        else replace(diagnostic, span=span._replace(file=str(file)))
    )


def compiled(recipe: Ontology, task: str | None, performed: frozenset[str]) -> CompiledPlan:
    """Compile a recipe; ``performed`` are the action classes that process modules perform. Raises BadInput."""
    from planlang.compiler import compile_ontology  # plans run without the compiler

    return compile_ontology(recipe, task=task, performed=lambda: performed)


def plan_file(plan: CompiledPlan, stack: ExitStack) -> Path:
    """Write a compiled plan to a temporary folder, which ``stack`` removes."""
    folder = stack.enter_context(temporary_folder())
    path = folder / f"{plan.functions[-1]}.py"
    path.write_text(plan.source, encoding="utf-8")
    return path


def main_plan(module: ModuleType, task: str | None) -> Plan[Any, Any]:
    """Find a plan by name or IRI; by default the last one in the file, which calls the others.

    Raises BadInput, listing the plans, if there is none, or not that one.
    """
    plans = [value for value in vars(module).values() if isinstance(value, Plan)]
    if not plans:
        advice = "mark the plan with @plan from planlang"
        raise BadInput([error("X002", "this file defines no plan", Span(str(module.__file__)), advice)])
    if task is None:
        return plans[-1]
    for plan in plans:
        if task == plan.name or is_called(plan.iri or "", task):
            return plan
    advice = f"this file defines {', '.join(plan.name for plan in plans)}"
    raise BadInput([error("R001", f"there is no task {task}", Span(str(module.__file__)), advice)])


MOVING = "Translation-LocationChange"
"""Action class that ``at_location`` needs."""


@dataclass(frozen=True, slots=True)
class Needs:
    """Action classes that a piece of plan performs, and its choices, of each of which one alternative suffices.

    ``modular`` are action classes that only process modules can perform: the plan has no other way.
    """

    actions: tuple[str, ...] = ()
    choices: tuple[tuple[Alternative, ...], ...] = ()
    modular: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Alternative:
    """Branch of a choice: the function that it calls, its line, and what it needs."""

    name: str
    line: int
    needs: Needs


@dataclass(frozen=True, slots=True)
class Assessment:
    """Requirements of a plan that a robot lacks, and infeasible alternatives of choices that have a feasible one.

    ``unknown`` are requirements that it may lack: the plan runs, with a warning.
    """

    missing: tuple[Missing, ...]
    infeasible: tuple[tuple[Alternative, Missing], ...] = ()
    unknown: tuple[Missing, ...] = ()

    def also(self, lacking: Iterable[Missing]) -> Assessment:
        """Add what the robot lacks of the recipe's requirements; each is listed once."""
        known = {(one.kind, one.name) for one in (*self.missing, *self.unknown)}
        others = [one for one in lacking if (one.kind, one.name) not in known]
        missing = tuple(one for one in others if one.state is Availability.MISSING)
        unknown = tuple(one for one in others if one.state is not Availability.MISSING)
        return Assessment((*self.missing, *missing), self.infeasible, (*self.unknown, *unknown))

    def notes(self, file: Path | None) -> Iterator[Diagnostic]:
        """Yield a note for each infeasible alternative, and a warning for each thing that the robot may lack.

        ``file`` is that of the plan, unless it is temporary.
        """
        for what in self.unknown:
            advice = "planlang match RECIPE --robot ROBOT shows why it is required; a self-model can claim it"
            yield warning("X009", f"the robot may lack {what}", None, advice)
        for alternative, why in self.infeasible:
            span = Span(str(file), alternative.line) if file is not None else None
            yield note("X008", f"the robot cannot do the alternative `{alternative.name}`: {why}", span)


Lacking = Callable[[Iterable[str]], tuple[Missing, ...]]
"""Finds all that is or may be missing for action classes."""


def assess(needs: Needs, lacking: Lacking, unperformed: Lacking = lambda actions: ()) -> Assessment:
    """Assess whether a robot can do what is needed.

    ``lacking`` finds what it lacks for action classes, ``unperformed`` the classes without a process module. If no
    alternative of a choice is feasible, all that they lack is missing.
    """
    lacks = (*unperformed(needs.modular), *lacking(needs.actions))
    missing = dict.fromkeys(one for one in lacks if one.state is Availability.MISSING)
    unknown = dict.fromkeys(one for one in lacks if one.state is not Availability.MISSING)
    infeasible: dict[tuple[Alternative, Missing], None] = {}
    for choice in needs.choices:
        assessed = [(alternative, assess(alternative.needs, lacking, unperformed)) for alternative in choice]
        feasible = [assessment for _, assessment in assessed if not assessment.missing]
        for alternative, assessment in assessed:
            unknown.update(dict.fromkeys(assessment.unknown))
            if not feasible:
                missing.update(dict.fromkeys(assessment.missing))
            elif assessment.missing:
                infeasible[alternative, assessment.missing[0]] = None
            else:
                infeasible.update(dict.fromkeys(assessment.infeasible))
    return Assessment(tuple(missing), tuple(infeasible), tuple(unknown))


def needs_of(module: ModuleType, plan: Plan[Any, Any]) -> Needs:
    """What a plan of a module needs, including the functions that it calls in the module."""
    return _Source(module).needs(plan.name)


Performs = Callable[[str, Branch | None], bool]
"""Decides whether a process module performs an action of a class, rather than the plan given for it."""


def read_names(module: ModuleType, plan: Plan[Any, Any], performs: Performs) -> frozenset[str]:
    """Names that a plan of a module reads, except in plans that process modules replace."""
    return _Source(module).read(plan.name, performs)


def outputs_of(module: ModuleType) -> frozenset[str]:
    """Names of what the actions of a plan's module create (``outputs_created``): it need not exist before."""
    stated = (
        keyword.value
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        for keyword in (node.keywords if isinstance(node, ast.Call) else ())
        if keyword.arg == "outputs_created"
    )
    return frozenset(node.id for value in stated for node in ast.walk(value) if isinstance(node, ast.Name))


def count_of_steps(module: ModuleType) -> int:
    """Number of actions in the source of a plan's module."""
    calls = (node for node in ast.walk(ast.parse(inspect.getsource(module))) if isinstance(node, ast.Call))
    return sum(isinstance(call.func, ast.Name) and call.func.id == "action" for call in calls)


def stated_waiting(module: ModuleType) -> float:
    """Sum of the durations of actions that the source of a plan's module gives as numbers [s]."""
    stated = (
        keyword.value.value
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        for keyword in (node.keywords if isinstance(node, ast.Call) else ())
        if keyword.arg == "duration" and isinstance(keyword.value, ast.Constant)
    )
    return sum(float(value) for value in stated if isinstance(value, int | float) and 0 <= value < math.inf)


Scope = Mapping[str, ast.AST]
"""Definitions in the source, by name."""


class _Source:
    """Source of a plan's module. Recursive definitions are analysed once."""

    def __init__(self, module: ModuleType) -> None:
        tree = ast.parse(inspect.getsource(module))
        self._values = vars(module)
        self._original = {
            alias.asname or alias.name: alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "planlang"
            for alias in node.names
        }
        self._top = _definitions(tree.body)
        self._known: dict[int, Needs] = {}
        self._read: dict[str, frozenset[str]] = {}

    def needs(self, name: str) -> Needs:
        """What a plan function needs; all functions of the module together if it is defined elsewhere."""
        nodes = [self._top[name]] if name in self._top else self._top.values()
        return _together(self._definition(node, self._top) for node in nodes)

    def _definition(self, node: ast.AST, scope: Scope) -> Needs:
        if id(node) not in self._known:
            self._known[id(node)] = Needs()  # the result inside of a recursion
            pieces: Iterable[ast.AST] = [node]
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                pieces = ast.iter_child_nodes(node)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                scope = {**scope, **_definitions(node.body)}
            self._known[id(node)] = _together(self._within(piece, scope) for piece in pieces)
        return self._known[id(node)]

    def _within(self, node: ast.AST, scope: Scope) -> Needs:
        """What a piece of source needs; local functions and values count where they are used."""
        needs: list[Needs]
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() if scope.get(node.name) is node:
                return Needs()
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if scope.get(name) is value:
                if not any(isinstance(inner, ast.Await) for inner in ast.walk(value)):
                    return Needs()
                needs = []
            case ast.Call(func=function, args=[first, *_]) if self._name(function) in ("action", "Action"):
                own = self._class(first, node.keywords)
                needs = [Needs(nearest_unstated(own), modular=(own,))] if own is not None else []
            case ast.Call(func=function, args=[described, *_]) if self._name(function) == "perform":
                return self._performed(described, node, scope)
            case ast.Call(args=[first, described, *_]) if self._name(first) == "perform":  # partial(perform, ...)
                return self._performed(described, node, scope)
            case ast.Call(func=function, args=branches) if self._name(function) == "try_in_order":
                return self._choice([*branches, *(k.value for k in node.keywords if k.arg != "name")], scope)
            case ast.Call(args=[first, *branches]) if self._name(first) == "try_in_order":  # partial(try_in_order, ...)
                return self._choice([*branches, *(k.value for k in node.keywords if k.arg != "name")], scope)
            case ast.Name() | ast.Attribute() if self._name(node) == "at_location":
                needs = [Needs((MOVING,))]
            case ast.Name(id=name, ctx=ast.Load()) if name in scope:
                definition = scope[name]
                needs = [self._definition(definition, self._top if self._top.get(name) is definition else scope)]
            case _:
                needs = []
        return _together([*needs, *(self._within(child, scope) for child in ast.iter_child_nodes(node))])

    def _performed(self, described: ast.expr, call: ast.Call, scope: Scope) -> Needs:
        """What a call of ``perform`` needs: a process module, unless ``otherwise`` gives a plan for the action."""
        others = [*call.args, *(keyword.value for keyword in call.keywords)]
        others.remove(described)
        own = self._within(described, scope)
        if any(keyword.arg == "otherwise" for keyword in call.keywords):
            own = replace(own, modular=())
        return _together([own, *(self._within(other, scope) for other in others)])

    def _choice(self, branches: list[ast.expr], scope: Scope) -> Needs:
        if any(isinstance(branch, ast.Starred) for branch in branches):
            return _together(self._within(branch, scope) for branch in branches)
        return Needs(
            choices=(tuple(Alternative(_title(b), b.lineno, self._within(b, scope)) for b in branches),),
        )

    def read(self, name: str, performs: Performs) -> frozenset[str]:
        """Names that a plan function reads, itself or as arguments of functions that read them."""
        if name not in self._read:
            whole = [self._top[name]] if name in self._top else self._top.values()
            self._read[name] = frozenset(
                one.id for node in whole for one in ast.walk(node) if isinstance(one, ast.Name)
            )  # the result inside of a recursion
            self._read[name] = frozenset(one for node in whole for one in self._names(node, performs))
        return self._read[name]

    def _names(self, node: ast.AST, performs: Performs) -> Iterator[str]:
        """Yield the names that a piece of source reads; see :meth:`read`."""
        if isinstance(node, ast.Name):
            yield node.id
        unread: set[str | None] = set()
        if isinstance(node, ast.Call):
            called = [one.id for one in (*node.args[:1], node.func) if isinstance(one, ast.Name)]
            known = next((self._top[one] for one in called if one in self._top), None)
            if isinstance(known, ast.AsyncFunctionDef):
                unread |= {one.arg for one in known.args.kwonlyargs} - self.read(known.name, performs)
            if self._is_performed(node, performs):
                unread |= {"otherwise", "recoveries"}
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, ast.keyword) or child.arg not in unread:
                yield from self._names(child, performs)

    def _is_performed(self, call: ast.Call, performs: Performs) -> bool:
        """Check whether a call performs an action by a process module rather than by its plan."""
        for described in call.args[:2]:
            match described:
                case ast.Call(func=function, args=[first, *_]) if self._name(function) in ("action", "Action"):
                    own = self._text(first)
                    others = [keyword.value for keyword in call.keywords if keyword.arg == "otherwise"]
                    return own is not None and bool(others) and performs(own, self._plan(others[0]))
        return False

    def _plan(self, branch: ast.expr) -> Branch | None:
        """The plan of this module that a branch calls; None if it calls something else."""
        match branch:
            case ast.Call(args=[ast.Name(id=name), *_]) | ast.Name(id=name):
                plan = self._values.get(name)
                return plan if isinstance(plan, Plan) else None
        return None

    def _name(self, node: ast.AST) -> str | None:
        """Name in planlang of what an expression names: ``action`` after ``import action as act``."""
        match node:
            case ast.Name(id=name):
                return self._original.get(name, name)
            case ast.Attribute(attr=name):
                return name
        return None

    def _class(self, node: ast.expr, keywords: Iterable[ast.keyword]) -> str | None:
        """Class of a described action, with its superclasses if the source gives them."""
        own = self._text(node)
        below = next((keyword.value for keyword in keywords if keyword.arg == "below"), None)
        above = [self._text(one) for one in (below.elts if isinstance(below, ast.Tuple | ast.List) else (below,))]
        known = [one for one in above if one]  # an empty one is refused when the plan runs
        return action_class(own, below=known) if own and known else own

    def _text(self, node: ast.expr | None) -> str | None:
        """Value of a string expression: a literal, a constant of the module, or a sum of these."""
        match node:
            case ast.Constant(value=str(text)):
                return text
            case ast.Name(id=name) if isinstance(self._values.get(name), str):
                constant: str = self._values[name]  # may be an ActionClass
                return constant
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                parts = self._text(left), self._text(right)
                return parts[0] + parts[1] if parts[0] is not None and parts[1] is not None else None
        return None


def _title(branch: ast.expr) -> str:
    match branch:
        case ast.Call(func=ast.Name("partial") | ast.Attribute(attr="partial"), args=[function, *_]):
            return ast.unparse(function)
    return ast.unparse(branch)


def _definitions(body: list[ast.stmt]) -> dict[str, ast.AST]:
    """Functions, classes and values that a body defines, by name."""
    definitions: dict[str, ast.AST] = {}
    for node in body:
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                definitions[name] = node
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                definitions[name] = value
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                definitions[name] = value
    return definitions


def _together(needs: Iterable[Needs]) -> Needs:
    """Union of needs, with each action class and each choice once."""
    actions: dict[str, None] = {}
    modular: dict[str, None] = {}
    choices: dict[tuple[Alternative, ...], None] = {}
    for one in needs:
        actions.update(dict.fromkeys(one.actions))
        choices.update(dict.fromkeys(one.choices))
        modular.update(dict.fromkeys(one.modular))
    return Needs(tuple(actions), tuple(choices), tuple(modular))


def without_module(ontology: Ontology, performed: frozenset[str] | None, actions: Iterable[str]) -> tuple[Missing, ...]:
    """Find the action classes that no process module performs.

    ``performed`` are the classes that modules perform; None if unknown: then nothing is missing.
    """
    reason = "no process module is registered for it or a superclass"

    def vocabulary(cls: str) -> tuple[str, ...]:
        return tuple(map(shorten, ontology.ancestors(expand(cls))))

    return tuple(
        Missing(cls, FindingKind.ACTION, Availability.MISSING, (cls,), reason)
        for cls in actions
        if performed is not None and performed.isdisjoint(ancestors_of(cls, vocabulary))
    )


Requirements = Callable[[Robot], tuple[Missing, ...]]
"""Finds the requirements of a recipe that a robot lacks or may lack."""


def required(ontology: Ontology, recipes: RecipeSet) -> Requirements:
    """Make the requirements of recipes, which were read from ``ontology``."""
    return lambda robot: match(ontology, recipes, possessions_of(robot)).lacking()


def required_of_plan(
    file: Path, plan: Plan[Any, Any], diagnostics: list[Diagnostic], *, folders: Sequence[Path] = ()
) -> Requirements | None:
    """Read the requirements of a compiled plan from its recipe; None for a plan written by hand.

    A plan shows only what its steps do; the classes of the task and of its steps may require more. The recipe is named
    in the header, also of an edited plan. If it is missing or has changed, the result is None, with a warning in
    ``diagnostics``.
    """
    with file.open(encoding="utf-8", errors="replace") as source:
        origin = header(source.read(LONGEST))
    if origin is None:
        return None
    span = Span(str(file))
    unknown = f"the robot is not checked against the recipe {origin.recipe}"
    recipe = origin.find_recipe(file, folders)
    if recipe is None:
        advice = "name its folder with --ontologies DIR"
        diagnostics.append(warning("C011", f"{unknown}, which was not found", span, advice))
        return None
    try:
        ontology = load(recipe, folders=folders)
    except BadInput as problem:
        advice = f"planlang check {quoted(recipe)} shows more"
        diagnostics.append(warning("C011", f"{unknown}: {problem.diagnostics[0].message}", span, advice))
        return None
    if not ontology.documents[0].sha256.startswith(origin.sha256):
        advice = f"planlang compile {quoted(recipe)} -o {quoted(file)} compiles the plan again"
        diagnostics.append(warning("C009", f"{unknown}, which has changed since this plan was compiled", span, advice))
        return None
    reading = read_recipe(Actions(ontology), plan.iri or origin.task)
    return None if reading.recipes is None else required(ontology, reading.recipes)
