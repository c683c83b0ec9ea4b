"""Compile a recipe's file to the source of a plan: header, imports, constants, places, plan functions."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from planlang.closure import grouped, reached
from planlang.compiler.bodies import BodyWriter
from planlang.compiler.expressions import Symbols, is_iri, quoted
from planlang.compiler.layout import INDENT, WIDTH, Expression, Text, assignment, call, signature, statement
from planlang.compiler.lowering import Lowering
from planlang.compiler.recoveries import check_recoveries
from planlang.compiler.tree import Function, PlanTree
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, has_errors
from planlang.kernel.runner import quiet_collector
from planlang.language.source import PlanSource
from planlang.notebooks import highlighted, listed
from planlang.ontology import Ontology, load
from planlang.outputs import NO_DATA_FLOW, NO_SCOPES, PlanHeader, check_outputs, digest
from planlang.plan_versions import write_versions
from planlang.recipe import read_recipe
from planlang.recipe.actions import Actions, Performed
from planlang.recipe.model import (
    Description,
    Filler,
    Kind,
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
)
from planlang.records import dataclass
from planlang.visible import visible

if TYPE_CHECKING:
    from planlang.compiler.drawing import GraphDrawing

TYPES = {Kind.OBJECT: "Object", Kind.PERSON: "Person", Kind.DEVICE: "Device", Kind.PLACE: "Location"}
MAKERS = {Kind.OBJECT: "an_object", Kind.PERSON: "a_person", Kind.DEVICE: "a_device"}


def emit(
    tree: PlanTree, recipes: RecipeSet, version: str, options: tuple[str, ...] = ()
) -> tuple[str, tuple[str, ...]]:
    """Write the source of a plan module, formatted and deterministic, and list the names of its plan functions.

    Functions come before their callers, constants in order of first use. ``options`` are the compiler options that
    affected the tree.
    """
    symbols = Symbols(tree, recipes)
    for function in tree.functions:
        for thing in function.parameters:
            symbols.thing(thing)
    functions = [_function(symbols, function) for function in tree.functions]
    constants = [line for thing in symbols.things() if thing.slot is None for line in _thing(symbols, thing)]
    constants += [line for place, name in symbols.postures() for line in _posture(symbols, place, name)]
    classes = _classes(symbols)
    readable = _readable(symbols)
    parts = ["", *_imports(symbols), "", *_namespaces(symbols)]
    for block in (readable, classes, constants):
        parts += ["", *block] if block else []
    for block in functions:
        parts += ["", "", *block]
    below = "\n".join(parts) + "\n"
    source = "\n".join([*_header(recipes, version, options, digest(f'""""""\n{below}')), below])
    return source, tuple(symbols.functions[function.iri] for function in tree.functions)


def humanised(name: str) -> str:
    """Turn a name into a phrase: ``ServeADrink`` becomes ``Serve a drink``."""
    words = re.sub(r"[_\-]+", " ", re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)).split()
    text = " ".join(word if word.isupper() and len(word) > 1 else word.lower() for word in words)
    return text[:1].upper() + text[1:]


def _header(recipes: RecipeSet, version: str, options: tuple[str, ...], below: str) -> list[str]:
    source, main = recipes.source, recipes.main
    origin = PlanHeader(version, source.file, source.sha256, main.name, options, below)
    return _docstring([_sentence(main.label or humanised(main.name)), "", *origin.paragraphs()], depth=0)


def _imports(symbols: Symbols) -> list[str]:
    lines: list[str] = []
    imports = symbols.imports()
    standard = [entry for entry in imports if not entry[0].startswith("planlang")]
    ours = [entry for entry in imports if entry[0].startswith("planlang")]
    for group in (standard, ours):
        if lines and group:
            lines.append("")
        for module, names in group:
            line = f"from {module} import {', '.join(names)}"
            if len(line) <= WIDTH:
                lines.append(line)
            else:
                lines += [f"from {module} import (", *(f"{INDENT}{name}," for name in names), ")"]
    return lines


def _namespaces(symbols: Symbols) -> list[str]:
    return [
        line for name, start in symbols.namespaces() for line in assignment([Text(name)], Text(quoted(start)), depth=0)
    ]


def _readable(symbols: Symbols) -> list[str]:
    """State the names of IRIs that end in a number or in random letters."""
    if not symbols.readable:
        return []
    named = [f"{INDENT}{INDENT}{iri.flat()}: {name}," for iri, name in symbols.readable.values()]
    return [f"{symbols.use('label_iris')}(", f"{INDENT}{{", *named, f"{INDENT}}}", ")"]


def _classes(symbols: Symbols) -> list[str]:
    """Declare the action classes that only the recipe defines and that the plan uses more than once."""
    lines: list[str] = []
    for cls in (one for one in symbols.stated if one not in symbols.stated_in_place):
        lines += assignment([Text(symbols.action_class(cls))], symbols.statement_of_class(cls), depth=0)
    return lines


def _thing(symbols: Symbols, thing: Thing) -> list[str]:
    arguments: list[Expression | str] = [quoted(thing.type) if not is_iri(thing.type) else symbols.iri(thing.type)]
    if thing.iri is not None:
        arguments.append(symbols.iri(thing.iri))
    return assignment([Text(symbols.constant(thing))], call(symbols.use(MAKERS[thing.kind]), *arguments), depth=0)


def _posture(symbols: Symbols, place: Place, name: str) -> list[str]:
    posture = call(symbols.use("a_posture"), quoted(place.name))
    if place.pose is not None:
        numbers = {key: repr(round(value, 9)) for key, value in zip(("x", "y", "z", "yaw"), place.pose, strict=True)}
        posture = call(symbols.use("a_pose"), quoted(place.name), **numbers)
    return assignment([Text(name)], posture, depth=0)


def _function(symbols: Symbols, function: Function) -> list[str]:
    name = symbols.functions[function.iri]
    parameters = [_parameter(symbols, thing) for thing in function.parameters]
    title = _sentence(function.label or humanised(local_name(function.iri)))
    body = BodyWriter(symbols, name, function.body).lines()
    first = next((line.lstrip() for line in body if not line.lstrip().startswith("#")), "")
    if first.startswith("async def "):
        body.insert(0, "")
    return [
        *statement(call("@" + symbols.use("plan"), symbols.iri(function.iri)), depth=0),
        *signature(f"async def {name}", ["*", *parameters] if parameters else [], "None", depth=0),
        *_docstring([title], depth=1),
        *body,
    ]


def _parameter(symbols: Symbols, thing: Thing) -> str:
    """Parameter with its default; for a slot without a default, and annotated with its name in the recipe."""
    kinds = (thing.kind,) if thing.slot is None else thing.slot.kinds
    name = symbols.thing(thing)
    type = " | ".join(symbols.use(TYPES[kind]) if kind in TYPES else "float" for kind in kinds)
    if thing.slot is None:
        return f"{name}: {type} = {symbols.constant(thing)}"
    return f"{name}: {symbols.use('Annotated', 'typing')}[{type}, {quoted(thing.name)}]"


def _docstring(paragraphs: list[str], *, depth: int) -> list[str]:
    """Write a docstring, without characters that would end it; what is not displayed is written as its escape."""
    indent = INDENT * depth
    lines: list[str] = []
    for paragraph in paragraphs:
        text = " ".join(paragraph.split()).replace("\\", "/").replace('"', "'")
        text = visible(text)
        lines += textwrap.wrap(text, WIDTH - len(indent) - 6, break_long_words=False, break_on_hyphens=False) or [""]
    if len(lines) == 1:
        return [f'{indent}"""{lines[0]}"""']
    return [f'{indent}"""{lines[0]}', *((indent + line).rstrip() for line in lines[1:]), f'{indent}"""']


def _sentence(text: str) -> str:
    text = " ".join(text.split())
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")


@dataclass(frozen=True, slots=True)
class CompiledPlan:
    """Source of a plan, with the warnings and notes about its recipe; there are no errors.

    ``plan_source`` is the source in memory, for what reads and loads plans. ``functions`` are the names of the plan
    functions in it, that of the task last. ``recipes`` are the compiled recipes. ``added`` maps a recipe (IRI) to the
    orders of steps (IRIs) that its location scopes add, ``recoveries`` a step of a recipe (both IRIs) to the recoveries
    from its failures, in words.
    """

    plan_source: PlanSource
    task: str
    functions: tuple[str, ...]
    recipes: RecipeSet
    added: Mapping[str, tuple[tuple[str, str], ...]]
    diagnostics: tuple[Diagnostic, ...] = ()
    recoveries: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)

    @property
    def source(self) -> str:
        """Source of the plan."""
        return self.plan_source.text

    @property
    def graph(self) -> GraphDrawing:
        """Drawing of the order of the recipe's steps; notebooks show it, ``save("steps.svg")`` writes it."""
        from planlang.compiler.drawing import GraphDrawing, task_graph  # most plans are not drawn

        return GraphDrawing(task_graph(self.recipes, self.added, self.recoveries))

    def save(self, path: str | PathLike[str], *, force: bool = False) -> Path:
        """Write the plan as ``planlang compile --output`` does. Gives the path.

        ``force`` overwrites a plan that was edited, and files that planlang did not write. Raises BadInput if the file
        cannot be written.
        """
        target = Path(path)
        if problems := check_outputs({"plan": target}, {}, force=True):  # write_versions protects an edited plan itself
            raise BadInput(problems)
        write_versions(target, self.source, force=force)
        return target

    def __str__(self) -> str:
        return self.source

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        """Show the diagnostics and the coloured plan in a notebook."""
        return {"text/plain": self.source, "text/html": listed(self.diagnostics) + highlighted(self.source)}


def compile_recipe(
    path: Path,
    *,
    task: str | None = None,
    folders: Sequence[Path] = (),
    scopes: bool = True,
    data_flow: bool = True,
    performed: Performed | None = None,
    content: bytes | None = None,
) -> CompiledPlan:
    """Compile the recipe in a file: RDF/XML, Manchester syntax or Turtle, recognised by its content.

    ``task`` chooses one of several by local name or IRI. Imports are searched beside the file, then in ``folders``,
    then among the bundled ontologies. Without ``scopes`` base motions are steps like any other; without ``data_flow``
    steps pass no results on, and data flow orders nothing. ``performed`` gives the action classes that process modules
    perform, so that R021 does not report steps of these classes. ``content`` is a recipe in memory; then ``path`` only
    names it. Raises BadInput with all diagnostics if there is an error.
    """
    with quiet_collector():  # nearly all objects live until the end: collecting garbage would only cost time
        ontology = load(path, folders=folders, content=content)
        return compile_ontology(ontology, task=task, scopes=scopes, data_flow=data_flow, performed=performed)


def compile_ontology(
    ontology: Ontology,
    *,
    task: str | None = None,
    scopes: bool = True,
    data_flow: bool = True,
    performed: Performed | None = None,
) -> CompiledPlan:
    """Compile a recipe of an ontology whose main document is the recipe; see :func:`compile_recipe`."""
    with quiet_collector():
        return _compiled(Actions(ontology, performed), task, scopes=scopes, data_flow=data_flow)


def _compiled(read: Actions, task: str | None, *, scopes: bool, data_flow: bool) -> CompiledPlan:
    ontology, reading = read.ontology, read_recipe(read, task, scopes=scopes)
    diagnostics = (*reading.diagnostics, *check_recoveries(reading.actions.recoveries))
    if reading.recipes is None or has_errors(diagnostics):
        raise BadInput(diagnostics)
    read_recipes = reading.recipes if data_flow else without_data_flow(reading.recipes)
    recipes, actions = canonical(read_recipes), reading.actions
    del reading, read_recipes  # frees the order of the recipe as read, which is as large as that of the canonical one
    lowering = Lowering(ontology, recipes, actions, scopes=scopes)
    tree = lowering.tree()
    switches = ((NO_SCOPES, not scopes), (NO_DATA_FLOW, not data_flow))
    options = tuple(option for option, is_set in switches if is_set)
    source, functions = emit(tree, recipes, installed_version(), options)
    reported = (*diagnostics, *lowering.diagnostics)
    name, text = recipes.main.name, PlanSource(source, f"<compiled>/{functions[-1]}.py")
    return CompiledPlan(text, name, functions, recipes, lowering.added, reported, lowering.recoveries)


def installed_version() -> str:
    """Version of planlang that compiles."""
    try:
        return version("planlang")
    except PackageNotFoundError:
        return "0.1.0"


Key = tuple[tuple[int, int, str], ...]
_F = TypeVar("_F", bound=Filler)


def without_data_flow(recipes: RecipeSet) -> RecipeSet:
    """Drop the data flow between steps, and the orders that follow from it."""
    changed = {
        iri: replace(
            one, orderings=tuple(each for each in one.orderings if each.reason is not Reason.DATA_FLOW), flows=()
        )
        for iri, one in recipes.recipes.items()
    }
    return replace(recipes, recipes=changed)


def canonical(recipes: RecipeSet) -> RecipeSet:
    """Sort the statements of recipes.

    A file is a set of triples without an order, so equal statements have to give equal plans, however they are sorted
    in the file. Where the recipe leaves an order open, names decide, and numbers in them count as numbers. Recipes come
    in order of first use, the task first, by the order of steps.
    """
    sorted_recipes = {iri: _recipe(recipe) for iri, recipe in recipes.recipes.items()}
    in_order: dict[str, Recipe] = {}
    waiting = [recipes.task]
    while waiting:
        iri = waiting.pop()
        if iri not in in_order:
            in_order[iri] = sorted_recipes[iri]
            waiting += reversed([callee for step in sorted_recipes[iri].steps for callee in step.recipes])
    return replace(recipes, recipes=in_order)


def natural(name: str) -> Key:
    """Key for natural sorting: ``pour2`` before ``pour10``."""
    parts = re.split(r"([0-9]+)", name)
    return tuple((1, int(part), part) if index % 2 else (0, 0, part) for index, part in enumerate(parts))


def iri_key(iri: str | None) -> tuple[Key, str]:
    """Key that sorts IRIs by their local names."""
    return natural(local_name(iri or "")), iri or ""


def _recipe(recipe: Recipe) -> Recipe:
    keys = {step.iri: iri_key(step.iri) for step in recipe.steps}
    orderings = [one for one in recipe.orderings if one.before in keys and one.after in keys]
    rank = {iri: number for number, iri in enumerate(sorted(keys, key=keys.__getitem__))}

    constraint = Reason.CONSTRAINT.value  # looked up once: most orderings of a large recipe have this reason

    def order(ordering: Ordering) -> tuple[int, int, str, str]:
        before, after, iri, reason, _ = ordering
        return rank[before], rank[after], constraint if reason is Reason.CONSTRAINT else reason.value, iri or ""

    machine = recipe.machine
    if machine is not None:
        transitions = sorted(
            machine.transitions, key=lambda one: (iri_key(one.source), one.outcome or "", iri_key(one.target))
        )
        machine = replace(machine, transitions=tuple(transitions), ends=tuple(sorted(machine.ends, key=iri_key)))
    visit = _visits(machine) if machine is not None else {}
    return replace(
        recipe,
        steps=tuple(
            sorted(map(_step, recipe.steps), key=lambda step: (visit.get(step.iri, len(keys)), keys[step.iri]))
        ),
        orderings=tuple(sorted(orderings, key=order)),
        parameters=_parameters(recipe.parameters),
        overlaps=tuple(
            sorted(recipe.overlaps, key=lambda one: (iri_key(one.first), one.relation.value, iri_key(one.second)))
        ),
        flows=tuple(
            sorted(
                recipe.flows,
                key=lambda one: (iri_key(one.producer), iri_key(one.consumer), one.consumes or "", one.resource or ""),
            )
        ),
        machine=machine,
    )


def _visits(machine: StateMachine) -> dict[str, int]:
    """Reachable states, numbered breadth-first from the start."""
    after = grouped((transition.source, transition.target) for transition in machine.transitions)
    states = reached((machine.start,), lambda state: after.get(state, ()))
    return {state: number for number, state in enumerate(states)}


def _step(step: Step) -> Step:
    if not step.parameters and step.condition is None and len(step.recipes) < 2:
        return step
    condition = step.condition
    if condition is not None:
        condition = Description(condition.type, _parameters(condition.parameters))
    recipes = tuple(sorted(step.recipes, key=iri_key))
    return replace(step, parameters=_parameters(step.parameters), recipes=recipes, condition=condition)


def _parameters(parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    sorted_inside = (replace(parameter, filler=_filler(parameter.filler)) for parameter in parameters)
    return tuple(sorted(sorted_inside, key=lambda one: (one.property, _filler_key(one.filler))))


def _filler(filler: _F) -> _F:
    """Filler with the relations of a place, and of places nested in it, sorted by name."""
    if not isinstance(filler, Place):
        return filler
    relations = [(name, tuple(sorted(map(_filler, each), key=_filler_key))) for name, each in filler.relations]
    ordered = sorted(relations, key=lambda one: (one[0], [*map(_filler_key, one[1])]))
    return replace(filler, relations=tuple(ordered))


def _filler_key(filler: Filler) -> tuple[int, tuple[Key, str], str]:
    match filler:
        case Thing():
            return 0, iri_key(filler.iri or filler.stated), repr(filler)
        case Place() | Name():
            return 1, iri_key(filler.iri), ""
        case _:
            return 2, (natural(str(filler)), ""), repr(filler)
