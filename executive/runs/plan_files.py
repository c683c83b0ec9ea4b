"""Plans as files: importing them, finding the plan to run, binding its parameters."""

from __future__ import annotations

import importlib.util
import inspect
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from difflib import get_close_matches
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from executive.belief import MapObject, SemanticMap
from executive.belief.semantic_map import environments_with
from planlang.designators import Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.language.plans import Plan
from planlang.ontology import Ontology, expand, shorten
from planlang.recipe import RecipeSet

MOST_NAMES = 20
"""Things of a map that one message lists."""


def compiled_plan(
    recipe: Ontology,
    stack: ExitStack,
    found: list[Diagnostic],
    *,
    task: str | None = None,
    allow_abstract: bool = False,
) -> tuple[Path, RecipeSet]:
    """Compile a recipe into a temporary folder that ``stack`` removes; warnings and notes go to ``found``."""
    from planlang.compiler import compile_ontology

    compiled = compile_ontology(recipe, task=task, allow_abstract=allow_abstract)
    found.extend(compiled.diagnostics)
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="planlang-")))
    path = folder / f"{compiled.functions[-1]}.py"
    path.write_text(compiled.source, encoding="utf-8")
    return path, compiled.recipes


def import_plan(path: Path) -> ModuleType:
    """The plan's file as a module; raises BadInput, with the line, when it cannot be imported."""
    loader = _PlanLoader(f"planlang_run_{path.stem}", str(path))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as problem:
        message = f"the plan cannot be imported: {type(problem).__name__}: {problem}"
        raise BadInput([error("X001", message, Span(str(path), line_in(problem, path) or 1))]) from problem
    return module


class _PlanLoader(SourceFileLoader):
    """Loads a plan from a file of any suffix and leaves no compiled copy beside it."""

    def set_data(self, path: Any, data: Any, *, _mode: int = 0o666) -> None:
        """Called with the compiled copy; it is not kept."""


def line_in(problem: BaseException, path: Path) -> int | None:
    """Return the line of a file that an exception passed last, or that it names itself."""
    lines = [frame.lineno for frame in traceback.extract_tb(problem.__traceback__) if frame.filename == str(path)]
    return lines[-1] if lines else getattr(problem, "lineno", None)


def main_plan(module: ModuleType, task: str | None) -> Plan[Any, Any]:
    """The plan of that name or IRI; without one the last plan in the file, which calls the others.

    Raises BadInput, telling which plans there are, when there is none or not the one that was asked for.
    """
    plans = [value for value in vars(module).values() if isinstance(value, Plan)]
    if not plans:
        advice = "mark the plan with @plan from planlang"
        raise BadInput([error("X002", "this file defines no plan", Span(str(module.__file__)), advice)])
    if task is None:
        return plans[-1]
    for plan in plans:
        if task in (plan.name, plan.iri, local_name(plan.iri or "")):
            return plan
    advice = f"this file defines {', '.join(plan.name for plan in plans)}"
    raise BadInput([error("R001", f"there is no task {task}", Span(str(module.__file__)), advice)])


def bindable_parameters(plan: Plan[Any, Any]) -> dict[str, Object]:
    """Return the plan's parameters that things can be bound to, with their defaults."""
    return {
        name: parameter.default
        for name, parameter in inspect.signature(plan.function).parameters.items()
        if isinstance(parameter.default, Object)
    }


def bound_parameters(
    plan: Plan[Any, Any], bindings: Mapping[str, str], semantic_map: SemanticMap, found: list[Diagnostic]
) -> dict[str, Object]:
    """The plan's parameters: their defaults, or things of the map that the user named, by IRI or local name.

    A thing has to be of the class of the default. Where the recipe names an individual, a thing of a class beside that
    of the individual, below the same one, will do, too, with a warning among ``found``. Raises BadInput, telling what
    would be valid, for a parameter or a thing that does not exist or does not fit.
    """
    parameters = bindable_parameters(plan)
    problems = []
    for name, wanted in bindings.items():
        if name not in parameters:
            known = ", ".join(parameters) or "none"
            similar = get_close_matches(name, parameters, n=1)
            guess = f"did you mean {similar[0]}? " if similar else ""
            problems.append(
                error("X004", f"the plan has no parameter {name!r}", help=f"{guess}its parameters: {known}")
            )
            continue
        default = parameters[name]
        thing = semantic_map.find(wanted)
        if thing is None or thing.pose is None:
            what = "is not in the map" if thing is None else "has no place in the map"
            problems.append(error("X005", f"{wanted!r} {what}", help=_instead(wanted, name, default, semantic_map)))
            continue
        classes = ", ".join(shorten(cls) for cls in thing.types)
        if _is(semantic_map, thing, expand(default.type)):
            parameters[name] = replace(default, iri=thing.iri)
        elif _is_alike(semantic_map, thing, default):
            message = f"{wanted} is a {classes}, where the recipe speaks of a {default.type}"
            found.append(warning("X006", message, help="the plan treats it as what it is"))
            parameters[name] = replace(default, iri=thing.iri, type=shorten(thing.types[0]))
        else:
            message = f"{wanted} is a {classes}, but {name} must be a {default.type}"
            problems.append(error("X006", message, help=_fitting(name, default, semantic_map)))
    if problems:
        raise BadInput(problems)
    return parameters


def _is(semantic_map: SemanticMap, thing: MapObject, cls: str) -> bool:
    return any(semantic_map.ontology.is_a(own, cls) for own in thing.types)


def _is_alike(semantic_map: SemanticMap, thing: MapObject, default: Object) -> bool:
    """True if a class directly above that of the recipe's individual is also above that of the thing."""
    if default.iri is None:
        return False
    return any(_is(semantic_map, thing, cls) for cls in semantic_map.ontology.parents(expand(default.type)))


def _instead(wanted: str, name: str, default: Object, semantic_map: SemanticMap) -> str:
    """What may have been meant by a thing that is not there, what would be valid, and where there is such a thing."""
    fitting = _fitting_things(default, semantic_map)
    placed = [thing.name for thing in semantic_map.objects if thing.pose is not None]
    short = local_name(wanted)
    similar = get_close_matches(short, fitting, n=1) or get_close_matches(short, placed, n=1)
    parts = [f"did you mean {similar[0]}? "] if similar else []
    parts.append(_fitting(name, default, semantic_map))
    others = [one for one in placed if one not in fitting]
    if fitting and others:
        parts.append(f"; the map also has {_listed(others)}")
    if there := environments_with((wanted,)):
        parts.append(f"; {wanted} is in a bundled environment: --environment {' or '.join(there)}")
    return "".join(parts)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def _fitting_things(default: Object, semantic_map: SemanticMap) -> list[str]:
    placed = [thing for thing in semantic_map.objects if thing.pose is not None]
    cls = expand(default.type)
    return [t.name for t in placed if _is(semantic_map, t, cls) or _is_alike(semantic_map, t, default)]


def _fitting(name: str, default: Object, semantic_map: SemanticMap) -> str:
    """What would be valid: the things with a place that a parameter may be bound to."""
    fitting = _fitting_things(default, semantic_map)
    if not fitting:
        placed = [thing.name for thing in semantic_map.objects if thing.pose is not None]
        return f"nothing in the map is a {default.type}; things with a place: {_listed(placed)}"
    return f"{name} may be {_listed(fitting)}"
