"""Compile a recipe's file to the source of a plan: header, imports, constants, places, plan functions."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from planlang.compiler.bodies import BodyWriter
from planlang.compiler.expressions import Symbols, is_iri, quoted
from planlang.compiler.layout import (
    INDENT,
    WIDTH,
    Expression,
    Text,
    assignment,
    call,
    one_or_several,
    signature,
    statement,
)
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
from planlang.recipe.canonical import canonical
from planlang.recipe.model import (
    Kind,
    Place,
    Reason,
    RecipeSet,
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
    where = {"where": _standing(symbols, thing.where)} if thing.where else {}
    made = call(symbols.use(MAKERS[thing.kind]), *arguments, **where)
    return assignment([Text(symbols.constant(thing))], made, depth=0)


def _standing(symbols: Symbols, relations: Sequence[tuple[str, Thing]]) -> Expression:
    """Location at which a thing of a class has to be, by constants."""
    related: dict[str, list[Expression]] = {}
    for relation, thing in relations:
        related.setdefault(relation, []).append(Text(symbols.constant(thing)))
    return call(symbols.use("a_location"), **{name: one_or_several(things) for name, things in related.items()})


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


def without_data_flow(recipes: RecipeSet) -> RecipeSet:
    """Drop the data flow between steps, and the orders that follow from it."""
    changed = {
        iri: replace(
            one, orderings=tuple(each for each in one.orderings if each.reason is not Reason.DATA_FLOW), flows=()
        )
        for iri, one in recipes.recipes.items()
    }
    return replace(recipes, recipes=changed)
