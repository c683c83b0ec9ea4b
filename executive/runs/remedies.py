"""Calls as advice for a run that cannot begin: another thing, another environment, another robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.maps import MapObject, SemanticMap
from executive.maps.classes import is_kind
from executive.maps.environments import environments_for
from executive.options.declaring import declared, stated
from executive.options.running import RunSettings, SituationSettings
from executive.robots import FindingKind, Missing, Robot, bind_robot
from executive.runs.failure import Failure
from executive.runs.options import Outcome, RunResult
from executive.runs.parameters import Bound, PlanParameter, things_of
from executive.runs.prepared import RunFiles
from planlang.designators import Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, error, note
from planlang.failures import ActionUnresolvable, AmbiguousPerception, MissingCapability, PlanFailure
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


def refused(missing: Sequence[Missing], found: Sequence[Diagnostic], seed: int, *, by_hand: bool) -> RunResult:
    """Result of a run that does not begin, as robot or process modules lack something."""
    kinds = [ActionUnresolvable if one.kind is FindingKind.ACTION else MissingCapability for one in missing]
    message = "\n".join(f"{kind.__name__}: {what}" for kind, what in zip(kinds, missing, strict=True))
    actions = performing(missing, by_hand=by_hand)
    message = Text(message, "\n    help: ", actions) if actions is not None else message
    advice = next((Text(one.message, "; ", one.help or "") for one in found if one.code == "X013"), actions)
    failure = Failure(kinds[0].__name__, "\n".join(map(str, missing)), advice=advice)
    return RunResult(Outcome.LACKS_CAPABILITY, message, (), tuple(found), failure=failure, seed=seed)


def trust_advised(files: RunFiles, robot: Robot, missing: Sequence[Missing]) -> list[Diagnostic]:
    """Advise a robot without a camera that lacks something for the plan to trust the map."""
    if not missing or robot.camera is not None or files.options.trust_map:
        return []
    trusting = call_of(files, trust_map=True)
    advice = Text(Option("trust_map", True), " takes the poses in the map as seen: ", trusting)
    return [note("X013", f"{robot.name} has no camera to look for things", help=advice)]


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


def call_of(files: RunFiles, **instead: Any) -> Call:
    """The call of a run, with other values for some of its options."""
    maps = [path for path in (files.environment, *files.additions) if path is not None]
    options = replace(
        files.options,
        **{
            "robot": None if files.robot is None else _named(files.robot, Bundled.ROBOT),
            "environment": [_named(path, Bundled.ENVIRONMENT) for path in maps],
            "world": [_named(path, Bundled.ENVIRONMENT) for path in files.world.files] if files.world else None,
            "resume": None,
            "world_as_left": False,
            **instead,
        },
    )
    options = replace(options, seed=files.seed if files.seed or options.start is not None else None, trust=False)
    return calling("run", _named(files.file.path, Bundled.RECIPE), **dict(stated(options, RunSettings)))


def call_to_pass_on(files: RunFiles, **instead: Any) -> Call:
    """The call of a run for others: files that are not bundled are given by name only."""
    call = call_of(files, **instead)
    told = (one for one in call.options if one.name not in ("urdf", "ontologies", "accept"))
    options = tuple(Option(one.name, _last(one.value)) for one in told)
    return Call(call.command, tuple(map(_last, call.arguments)), options)


def call_to_ask_why(files: RunFiles) -> Call:
    """The call that asks why a run failed, for others: the trace has the rest."""
    call = call_to_pass_on(files, apply=None, start=None, schedule=None, set=None, task=None)
    written, repeated = files.options.trace, files.options.repeated
    name = written.name if written is not None else Path(repeated.name).name if repeated is not None else None
    trace = Blank("TRACE") if name is None else Path(name)
    names = (*declared(SituationSettings),)
    return Call("why", (trace, *call.arguments), tuple(one for one in call.options if one.name in names))


def _last(value: object) -> object:
    """A path, or each of several, without its folder."""
    if isinstance(value, list):
        return [_last(one) for one in value]
    return Path(value.name) if isinstance(value, Path) else value


def _named(path: Path, kind: Bundled) -> str | Path:
    return path.name.partition(".")[0] if path.parent == kind.folder else path


def absent_things(
    failures: Mapping[str, PlanFailure],
    bound: Mapping[str, Bound],
    parameters: Mapping[str, PlanParameter],
    semantic_map: SemanticMap,
    files: RunFiles,
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
    here = call_of(files, set={**(files.options.set or {}), **sets})
    is_bundled = files.environment is not None and files.environment.parent == Bundled.ENVIRONMENT.folder
    rooms = environments_for(lambda one: all(_is_there(one, what) for what in things)) if is_bundled else ()
    elsewhere = _elsewhere(files, rooms)
    for name, failure in failures.items():
        things_that_fit = fitting.get(name, [])
        advice = Text(here, _others(things_that_fit)) if things_that_fit else elsewhere
        if elsewhere and not isinstance(failure, AmbiguousPerception):
            advice = elsewhere
        if not advice:
            cls = next((what.type for what in things_of(bound[name]) if not _is_there(semantic_map, what)), "thing")
            if is_bundled or files.environment is None:
                added = call_of(replace(files, additions=(*files.additions, Path("MAP"))))
                where = f"where MAP has a {local_name(cls)} with its pose (docs/reference/formats.md): "
                advice = Text(where, added)
            else:
                where = files.environment.name
                thing = f"a {local_name(cls)} with its pose to {where}"
                advice = Text(f"add {thing}, or name a thing of {where} in the recipe")
        yield error("X031", str(failure), help=advice)


def able_robots(files: RunFiles, can: Callable[[Robot], bool]) -> Iterator[Diagnostic]:
    """Yield a note with the call for a bundled robot that can run the plan, if there is one."""
    able = []
    for name in Bundled.ROBOT.names():
        file = Bundled.ROBOT.find(name)
        try:
            if file != files.robot and can(bind_robot(file, folders=files.options.folders)):
                able.append(name)
        except BadInput:  # the extra with its shape is not installed, for example
            continue
    if able:
        advice = Text(call_of(files, robot=able[0], urdf=None, start=None), _others(able))
        yield note("X032", f"{', '.join(able)} lack{'s' if len(able) == 1 else ''} nothing for the plan", help=advice)


def _others(names: Sequence[str]) -> str:
    return f" (or {', '.join(names[1:])})" if names[1:] else ""


def _elsewhere(files: RunFiles, environments: Sequence[str]) -> Text:
    """The call for the first of some bundled environments; "" if there is none."""
    if not environments:
        return Text()
    return Text(call_of(files, environment=[environments[0]], start=None), _others(environments))


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
