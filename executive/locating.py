"""What ``planlang locate`` does: a phrase, a robot and a map in, places for the base out."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.assembly import check_start, placed, platform_of
from executive.capabilities import bind_robot
from executive.carrying import with_carrying
from executive.console import DONE, FAILED, MISSING_CAPABILITY, Answer
from executive.knowledge import SemanticMap, read_map, scene_of
from executive.locations import Base
from executive.outputs import replace as write_complete
from executive.platform import Platform
from planlang.designators import Location, Object, Person
from planlang.diagnostics import BadInput, Diagnostic, error, note
from planlang.failures import LocationUnresolvable, ObjectUnresolvable, PlanFailure
from planlang.ontology import expand, load, shorten
from planlang.phrases import Lexicon, read_location, write_location
from planlang.protocols import Solution
from sim import PyBulletWorld
from sim.geometry import corners, hull

if TYPE_CHECKING:
    from executive.locations.picture import Scenery


@dataclass(frozen=True, slots=True)
class LocateOptions:
    """What is looked for, by whom and where."""

    phrase: str
    robot: Path
    environment: Path
    urdf: Path | None = None
    ontologies: tuple[Path, ...] = ()
    start: Base | None = None
    count: int = 3
    explain: Path | None = None


def locate(options: LocateOptions) -> Answer:
    """Find places; raises BadInput for what cannot be understood or used."""
    with ExitStack() as stack:
        found: list[Diagnostic] = []
        ontology = load(options.environment, folders=options.ontologies)
        semantic_map = read_map(ontology)
        lexicon = lexicon_of(semantic_map)
        location = read_location(options.phrase, lexicon)
        robot = with_carrying(bind_robot(options.robot, urdf=options.urdf, folders=options.ontologies))
        found.extend((*ontology.diagnostics, *semantic_map.diagnostics, *robot.diagnostics))
        scene = placed(scene_of(semantic_map, found), robot, options.start)
        world = PyBulletWorld(scene, robot.body())
        stack.callback(world.close)
        check_start(world)
        platform = platform_of(robot, semantic_map, world, world, 0)
        meant = _meant(location, platform)
        found.extend(_choices(meant, platform))
        if location.device is not None and not platform.around.arms_of(location.device):
            arms = ", ".join(arm.name for arm in robot.arms) or "none"
            text = f"MissingCapability: {robot.name} has no {location.device}; its arms: {arms}"
            return Answer(MISSING_CAPABILITY, tuple(found), text, {"failure": ["MissingCapability"]})
        return _resolved(location, lexicon, platform, meant, found, options)


def lexicon_of(semantic_map: SemanticMap) -> Lexicon:
    """The nouns of a map: its things by name, the classes of its ontology by their words."""
    ontology = semantic_map.ontology
    things: dict[str, Object] = {}
    for thing in semantic_map.objects:
        if thing.pose is not None:
            cls = next((cls for cls in thing.types if not cls.endswith("#NamedIndividual")), "Thing")
            kind = Person if any(ontology.is_a(cls, expand("Person")) for cls in thing.types) else Object
            things[thing.name] = kind(shorten(cls), thing.iri)
    return Lexicon.of(ontology, things)


def references(location: Location) -> Iterator[Object]:
    """The things that a location is about, those of places within places included."""
    for relation in location.relations:
        match relation.reference:
            case Location() as inner:
                yield from references(inner)
            case Object() as what:
                yield what


def _meant(location: Location, platform: Platform) -> dict[Object, str]:
    """The body that each designator means; raises BadInput when the map has none."""
    meant: dict[Object, str] = {}
    problems = []
    for what in dict.fromkeys(references(location)):
        try:
            meant[what] = platform.around.bind(what)
        except ObjectUnresolvable:
            known = ", ".join(platform.belief.names())
            message = f"the map has no {what}"
            problems.append(error("P008", message, help=f"it has {known}"))
    if problems:
        raise BadInput(problems)
    return meant


def _choices(meant: Mapping[Object, str], platform: Platform) -> Iterator[Diagnostic]:
    """Which of several things was taken."""
    for what, name in meant.items():
        others = [other for other in platform.belief.alike(what) if other != name]
        if what.iri is None and others:
            help = f"name it to mean another: {', '.join(others)}"
            yield note("P009", f"the {what} is {name}, the nearest of {len(others) + 1}", help=help)


def _resolved(
    location: Location,
    lexicon: Lexicon,
    platform: Platform,
    meant: Mapping[Object, str],
    found: list[Diagnostic],
    options: LocateOptions,
) -> Answer:
    solutions: list[Solution] = []
    failure: PlanFailure | None = None
    try:
        solutions.extend(islice(platform.resolver.bases(location), options.count))
    except LocationUnresolvable as problem:
        failure = problem
    counts = dict(getattr(failure, "counts", {}))
    blocking = dict(getattr(failure, "blocking", {}))
    phrase = write_location(location, lexicon)
    data: dict[str, Any] = {
        "location": phrase,
        "meant": {str(what): name for what, name in meant.items()},
        "solutions": [{"x": s.base[0], "y": s.base[1], "yaw": s.base[2], **s.detail} for s in solutions],
        "counts": counts,
        "blocking": blocking,
    }
    lines = [phrase, *(f"  {_line(number, s)}" for number, s in enumerate(solutions, 1))]
    if not solutions:
        data["failure"] = [type(failure).__name__]
        lines = [phrase, str(failure)]
    if options.explain is not None:
        _explain(options.explain, phrase, solutions, platform, meant)
        data["picture"] = str(options.explain)
    return Answer(DONE if solutions else FAILED, tuple(found), "\n".join(lines), data)


def _line(number: int, solution: Solution) -> str:
    x, y, yaw = solution.base
    detail = solution.detail
    how = f"{detail['arm']} arm: {', '.join(detail['reaches'])}" if "arm" in detail else ""
    return f"{number}  x {x:.3f}  y {y:.3f}  yaw {yaw:.3f}  {how}".rstrip()


def _explain(
    path: Path, phrase: str, solutions: list[Solution], platform: Platform, meant: Mapping[Object, str]
) -> None:
    """Draw a resolution."""
    from executive.locations.picture import Resolution, save_picture

    resolution = Resolution(phrase, [solution.base for solution in solutions], [])
    write_complete(path, lambda temporary: save_picture(temporary, scenery_of(platform, meant.values()), resolution))


def scenery_of(platform: Platform, meant: Collection[str]) -> Scenery:
    """What a picture shows besides the resolution."""
    from executive.locations.picture import Outline, Scenery

    world = platform.around.world
    bodies = []
    tops = {name: float(corners(world.pose(name), world.scene.body(name).size)[:, 2].max()) for name in world.names()}
    for name in sorted(tops, key=lambda name: tops[name]):  # what is on top is drawn last
        body = world.scene.body(name)
        if body.shape == "room" or name in world.attached():
            continue
        points = corners(world.pose(name), body.size)[:, :2]
        kind = "meant" if name in meant else body.shape if body.shape in ("person", "marker") else "solid"
        bodies.append(Outline(name, hull(points), kind))
    robot = platform.robot
    return Scenery(world.scene.bounds, bodies, robot.base.radius, platform.base())
