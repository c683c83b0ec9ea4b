"""Calls as advice for a run that cannot begin: another thing, another environment, another robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from executive.maps import MapObject, SemanticMap
from executive.maps.classes import is_kind
from executive.maps.environments import environments_for
from executive.robots import FindingKind, Missing, Robot, bind_robot
from executive.runs.options import RunOptions
from executive.runs.parameters import Bound, PlanParameter, things_of
from executive.runs.settings import in_header
from planlang.designators import Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, error, note
from planlang.failures import AmbiguousPerception, PlanFailure
from planlang.files import Bundled, bundled
from planlang.ontology import expand, load
from planlang.recipe.actions import read_library
from planlang.words import Blank, Call, Option, Text, calling


def performing(missing: Sequence[Missing], *, by_hand: bool) -> Text | None:
    """Advice for the action classes among ``missing``, which no module performs; None if there are none.

    In a plan written ``by_hand`` the compiler cannot expand an action of the library.
    """
    classes = [one.name for one in missing if one.kind is FindingKind.ACTION]
    if not classes:
        return None
    advice = Text("name process modules of your own with ", Option("modules", Blank("FILE.py")))
    stated = _library_files() if by_hand else {}
    if expanded := [f"{cls} ({stated[cls]})" for cls in classes if cls in stated]:
        expands = f" expands {', '.join(expanded)} in a recipe, a plan written by hand performs the steps of it ("
        advice = Text(advice, "; ", calling("compile"), expands, calling("list", "actions"), ")")
    return advice


def _library_files() -> dict[str, str]:
    """Map local names of action classes to the names of the library's files with a recipe for them."""
    files: dict[str, str] = {}
    for file in sorted((bundled("recipes") / "library").glob("*.omn")):
        ontology = load(file)
        for cls, recipes in read_library(ontology).items():
            span = ontology.span(recipes[0])
            if span is not None:
                files[local_name(cls)] = Path(span.file).stem
    return files


def call_of(
    options: RunOptions,
    start: Sequence[float] | None,
    bindings: Mapping[str, str],
    *,
    forced: bool = False,
    folders: bool = False,
) -> Call:
    """The call of a run.

    ``bindings`` are the parameters that differ from the plan's defaults; a ``forced`` run lacks something. Without
    ``folders``, files that are not bundled are given by name only, so that the call can be passed on.
    """
    plan = options.plan or options.recipe
    maps = [path for path in (options.environment, *options.additions) if path is not None]
    settings = {name: getattr(options, name) or None for name in in_header()}
    given = {
        "task": options.task,
        "robot": None if options.robot is None else _named(options.robot, Bundled.ROBOT, folders),
        "environment": [_named(path, Bundled.ENVIRONMENT, folders) for path in maps] or None,
        **({"urdf": options.urdf, "ontologies": [*options.ontologies] or None} if folders else {}),
        "accept": [*options.accepted] or None if folders else None,
        "start": None if start is None else tuple(map(float, start)),
        "seed": options.seed if options.seed or start is not None else None,
        "schedule": options.schedule,
        "set": dict(bindings) or None,
        **{
            name: [one if folders else _last(one) for one in value] if isinstance(value, list | tuple) else value
            for name, value in settings.items()
        },
        "force": forced,
    }
    return calling("run", *([] if plan is None else [_named(plan, Bundled.RECIPE, folders)]), **given)


def _last(value: object) -> str:
    return value.name if isinstance(value, Path) else str(value)


def _named(path: Path, kind: Bundled, folders: bool) -> str | Path:
    if path.parent == kind.folder:
        return path.name.partition(".")[0]
    return path if folders else path.name


def absent_things(
    failures: Mapping[str, PlanFailure],
    bound: Mapping[str, Bound],
    parameters: Mapping[str, PlanParameter],
    semantic_map: SemanticMap,
    options: RunOptions,
) -> Iterator[Diagnostic]:
    """Yield an error for each parameter that means no thing of the map, or several, with a call as advice.

    ``failures`` explains each such parameter; ``bound`` has all parameters. The advice is, in this order, a thing of
    the map, or an addition to the map. If the map is bundled, a bundled environment with all things of the plan comes
    first; a user who draws a map does not mean another room.
    """
    fitting = {
        name: _fitting(parameters[name], failure, bound[name], semantic_map)
        for name, failure in failures.items()
        if name in parameters
    }
    things = [what for value in bound.values() for what in things_of(value)]
    sets = {parameters[name].setting: names[0] for name, names in fitting.items() if names}
    here = _call(options, {**(options.bindings or {}), **sets})
    is_bundled = options.environment is not None and options.environment.parent == Bundled.ENVIRONMENT.folder
    rooms = environments_for(lambda one: all(_is_there(one, what) for what in things)) if is_bundled else ()
    elsewhere = _elsewhere(options, rooms)
    for name, failure in failures.items():
        things_that_fit = fitting.get(name, [])
        advice = Text(here, _others(things_that_fit)) if things_that_fit else elsewhere
        if elsewhere and not isinstance(failure, AmbiguousPerception):
            advice = elsewhere
        if not advice:
            cls = next((what.type for what in things_of(bound[name]) if not _is_there(semantic_map, what)), "thing")
            if is_bundled or options.environment is None:
                added = _call(replace(options, additions=(*options.additions, Path("MAP"))), options.bindings or {})
                where = f"where MAP has a {local_name(cls)} with its pose (docs/reference/formats.md): "
                advice = Text(where, added)
            else:
                where = options.environment.name
                thing = f"a {local_name(cls)} with its pose to {where}"
                advice = Text(f"add {thing}, or name a thing of {where} in the recipe")
        yield error("X031", str(failure), help=advice)


def able_robots(options: RunOptions, can: Callable[[Robot], bool]) -> Iterator[Diagnostic]:
    """Yield a note with the call for a bundled robot that can run the plan, if there is one."""
    able = []
    for name in Bundled.ROBOT.names():
        file = Bundled.ROBOT.find(name)
        try:
            if file != options.robot and can(bind_robot(file, folders=options.ontologies)):
                able.append(name)
        except BadInput:  # the extra with its shape is not installed, for example
            continue
    if able:
        other = replace(options, robot=Bundled.ROBOT.find(able[0]), urdf=None, start=None)
        advice = Text(_call(other, options.bindings or {}), _others(able))
        yield note("X032", f"{', '.join(able)} lack{'s' if len(able) == 1 else ''} nothing for the plan", help=advice)


def _call(options: RunOptions, bindings: Mapping[str, str]) -> Call:
    return call_of(options, options.start, bindings, forced=options.force, folders=True)


def _others(names: Sequence[str]) -> str:
    return f" (or {', '.join(names[1:])})" if names[1:] else ""


def _elsewhere(options: RunOptions, environments: Sequence[str]) -> Text:
    """The call for the first of some bundled environments; "" if there is none."""
    if not environments:
        return Text()
    there = Bundled.ENVIRONMENT.find(environments[0])
    moved = replace(options, environment=there, additions=(), start=None)
    return Text(_call(moved, options.bindings or {}), _others(environments))


def _fitting(parameter: PlanParameter, failure: PlanFailure, value: Bound, semantic_map: SemanticMap) -> list[str]:
    """Things with a pose that a parameter may be set to, most similar first."""
    if isinstance(failure, AmbiguousPerception):
        return [*failure.candidates]
    ontology = semantic_map.ontology
    above = {cls for what in things_of(value) for cls in ontology.ancestors(expand(what.type))}

    def in_common(name: str) -> int:
        thing = semantic_map.find(name)
        return 0 if thing is None else max(len(above.intersection(ontology.ancestors(cls))) for cls in thing.types)

    right = [one.name for one in semantic_map.objects if one.pose is not None and parameter.fits(semantic_map, one)]
    return sorted(parameter.likely(semantic_map, right) if right else [], key=in_common, reverse=True)


def _is_there(semantic_map: SemanticMap, what: Object) -> bool:
    """Check whether a map has the individual, or a thing of its class, with a pose."""

    def is_meant(thing: MapObject) -> bool:
        return thing.iri == what.iri or any(is_kind(semantic_map.ontology, cls, what.type) for cls in thing.types)

    return any(thing.pose is not None and is_meant(thing) for thing in semantic_map.objects)
