"""The way from a recipe's file to a plan's source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from planlang.compiler.canonical import canonical
from planlang.compiler.emit import emit
from planlang.compiler.lowering import Lowering
from planlang.compiler.recoveries import check_recoveries
from planlang.diagnostics import BadInput, Diagnostic, has_errors
from planlang.kernel.environment import quiet_collector
from planlang.ontology import Ontology, load
from planlang.plan_header import NO_DATA_FLOW, NO_SCOPES
from planlang.recipe import RecipeSet, read_recipe
from planlang.recipe.actions import Actions


@dataclass(frozen=True, slots=True)
class CompiledPlan:
    """A plan's source and what there is to say about its recipe: warnings and notes, no errors.

    ``functions`` are the names of the plan functions in the source, that of the task last. ``recipes`` is what the
    plan was made from, ``added`` for a recipe (IRI) the orders of steps (IRIs) that its location scopes add,
    ``recoveries`` for a step of a recipe (both IRIs) what is done when it fails, in words.
    """

    source: str
    task: str
    functions: tuple[str, ...]
    recipes: RecipeSet
    added: Mapping[str, tuple[tuple[str, str], ...]]
    diagnostics: tuple[Diagnostic, ...] = ()
    recoveries: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)


def compile_recipe(
    path: Path,
    *,
    task: str | None = None,
    folders: Sequence[Path] = (),
    allow_abstract: bool = False,
    scopes: bool = True,
    data_flow: bool = True,
) -> CompiledPlan:
    """Compile the recipe in a file: RDF/XML or Manchester syntax, told by its content.

    ``task`` chooses one of several by local name or IRI; imports are looked for beside the file, then in ``folders``,
    then among the bundled ontologies. With ``allow_abstract`` steps that nothing can execute are warnings. Without
    ``scopes`` base motions are steps like any other; without ``data_flow`` steps hand nothing on, and what they could
    hand on orders nothing. Raises BadInput with all diagnostics if there is an error.
    """
    with quiet_collector():  # nearly all that is read is kept to the end, too
        ontology = load(path, folders=folders)
        return compile_ontology(ontology, task=task, allow_abstract=allow_abstract, scopes=scopes, data_flow=data_flow)


def compile_ontology(
    ontology: Ontology,
    *,
    task: str | None = None,
    allow_abstract: bool = False,
    scopes: bool = True,
    data_flow: bool = True,
) -> CompiledPlan:
    """Compile a recipe of an ontology whose main document is the recipe; see :func:`compile_recipe`."""
    with quiet_collector():  # nearly all that a compilation makes is kept to its end
        return _compiled(ontology, task, allow_abstract=allow_abstract, scopes=scopes, data_flow=data_flow)


def _compiled(
    ontology: Ontology, task: str | None, *, allow_abstract: bool, scopes: bool, data_flow: bool
) -> CompiledPlan:
    reading = read_recipe(Actions(ontology), task, allow_abstract=allow_abstract, scopes=scopes)
    diagnostics = (*reading.diagnostics, *check_recoveries(reading.actions.recoveries))
    if reading.recipes is None or has_errors(diagnostics):
        raise BadInput(diagnostics)
    recipes = canonical(reading.recipes, data_flow=data_flow)
    lowering = Lowering(ontology, recipes, reading.actions, scopes=scopes)
    tree = lowering.tree()
    left_out = ((NO_SCOPES, not scopes), (NO_DATA_FLOW, not data_flow))
    options = tuple(option for option, is_left_out in left_out if is_left_out)
    source, functions = emit(tree, recipes, installed_version(), options)
    found = (*diagnostics, *lowering.diagnostics)
    name = recipes.main.name
    return CompiledPlan(source, name, functions, recipes, lowering.added, found, lowering.recoveries)


def installed_version() -> str:
    """The version of planlang that compiles."""
    try:
        return version("planlang")
    except PackageNotFoundError:
        return "0.1.0"
