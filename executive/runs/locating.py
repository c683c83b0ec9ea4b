"""Search for poses that match a phrase: parse it, bind its things to the map, search poses of base or thing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import field, replace
from itertools import islice
from pathlib import Path
from typing import Any

from executive.belief.scene_collisions import BasePose
from executive.locations import Rejections
from executive.locations.demands import LocationMeaningless, base_demand, sides, thing_demand, viewpoint, without_unused
from executive.maps import read_map, scene_of
from executive.modules.platform import Platform
from executive.options.declaring import check_written, names
from executive.options.locating import LocateOptions
from executive.pictures.scenery import Resolution, scenery_of
from executive.robots import bind_robot
from executive.robots.arms import with_carrying
from executive.runs.assembly import Holding, platform_of, world_at_start
from executive.runs.failure import Failure
from executive.runs.files import WorldFiles, check_files, chosen, environments, refuse
from executive.runs.located import Drawn, FoundPose, Located, Shown
from executive.runs.phrases import lexicon_of
from executive.runs.prepared import Inputs, read_maps
from planlang.designators import Location, Object, Relation
from planlang.diagnostics import BadInput, Diagnostic, error, note, warning
from planlang.failures import LocationUnresolvable, MissingCapability, ObjectUnresolvable, PlanFailure
from planlang.files import Bundled
from planlang.geometry import Pose
from planlang.ontology import load
from planlang.outputs import Named
from planlang.phrases import Lexicon, read_location, read_thing, write_location, write_relation, write_thing
from planlang.phrases.lexicon import GRASP_FORMS
from planlang.progress import Report, Waiting, unreported, unwatched
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.relations.reaching import In
from planlang.words import Blank, Option, Text, joined
from sim import PlanningWorld, PyBulletWorld, Scene


@dataclass(slots=True)
class _Question:
    """A parsed phrase, its things, and the believed world."""

    location: Location
    what: Object | None
    lexicon: Lexicon
    platform: Platform
    meant: Mapping[Object, str]
    found: list[Diagnostic] = field(default_factory=list)
    there: PlanningWorld | None = None
    """The true world, if it is not as the environment."""

    @property
    def body(self) -> str | None:
        """The body whose poses are searched; None: the base."""
        return None if self.what is None else self.meant[self.what]


@dataclass(frozen=True, slots=True)
class _Files:
    """What the options of a search name."""

    robot: Path
    environment: Path
    additions: tuple[Path, ...]
    world: WorldFiles | None


def locate(options: LocateOptions, *, long_work: Report = unreported, waiting: Waiting = unwatched) -> Located:
    """Find poses that match a phrase; ``explain`` writes a drawing of the candidates.

    ``long_work`` gets the progress of building reachability maps; ``waiting`` is entered while poses are searched.
    Raises BadInput for invalid input.
    """
    found = _located(options, long_work, waiting)
    if options.explain is not None and found.drawn is not None:
        found.picture(options.explain, force=True)
    return found


def _located(options: LocateOptions, long_work: Report, waiting: Waiting) -> Located:
    files = _found(options)
    Shown(options.units or ())  # refuses invalid units before the search
    with ExitStack() as stack:
        diagnostics: list[Diagnostic] = []
        ontology = load(files.environment, folders=options.folders, also=files.additions)
        semantic_map = read_map(ontology, ignore_unread=options.ignore_unread)
        lexicon = lexicon_of(semantic_map)
        location = read_location(options.phrase, lexicon)
        what = None if options.of is None else read_thing(options.of, lexicon, file=Text(Option("of")))
        robot = with_carrying(bind_robot(files.robot, urdf=options.urdf, folders=options.folders), report=long_work)
        diagnostics.extend((*ontology.diagnostics, *semantic_map.diagnostics, *robot.diagnostics))
        if location.device is not None and not robot.arms_of(location.device):
            arms = ", ".join(arm.name for arm in robot.arms) or "none"
            device = write_thing(location.device).removeprefix("the ")
            return _missing(MissingCapability(f"{robot.name} has no {device}; its arms: {arms}"), options, diagnostics)
        there = _world(files, options, diagnostics)
        in_world: Holding | None = None if there is None else (there, {})
        world = world_at_start(scene_of(semantic_map, diagnostics), robot, options.start, stack, None, in_world)
        truth = PyBulletWorld(world.scene, robot.body())  # equals the belief: nothing moves
        stack.callback(truth.close)
        platform = platform_of(robot, semantic_map, truth, world, 0, long_work)
        meant = _meant([*location.things(), *([] if what is None else [what])], lexicon, platform, diagnostics)
        diagnostics.extend(_choices(meant, lexicon, platform))
        try:
            question = _Question(location, what, lexicon, platform, meant, diagnostics)
            if there is not None:
                question.there = PlanningWorld(replace(there, start=world.scene.start), robot.body())
                stack.callback(question.there.close)
            located, log = _resolved(question, options, waiting)
            return replace(located, drawn=_drawn(located, log, question, options))
        except LocationMeaningless as problem:
            raise BadInput([*diagnostics, *_of_no_place(problem, location, what, lexicon)]) from None
        except MissingCapability as problem:
            return _missing(problem, options, diagnostics)


def _found(options: LocateOptions) -> _Files:
    """Find the files of a search, and check what it writes. Raises BadInput."""
    problems: list[Diagnostic] = []
    check_files(problems, urdf=options.urdf)
    robot = chosen(Bundled.ROBOT, options.robot, None, problems, needs="locate")
    first, *further = (*names(options.environment or ()),) or (None,)
    environment = chosen(Bundled.ENVIRONMENT, first, None, problems, needs="locate")
    additions = environments(further, problems)
    world = WorldFiles.named(names(options.world or ()), problems)
    inputs: dict[Named, Path | None] = {
        Option("urdf"): options.urdf,
        Option("robot"): robot,
        Option("environment"): environment,
        **({} if world is None else {Option("world", one): one for one in world.files}),
    }
    refuse([*problems, *check_written(options, LocateOptions, inputs)])
    assert robot is not None
    assert environment is not None
    return _Files(robot, environment, additions, world)


def _world(files: _Files, options: LocateOptions, found: list[Diagnostic]) -> Scene | None:
    """Read the true world; None if it is as the environment. Raises BadInput."""
    if files.world is None:
        return None
    maps = files.world.maps or (files.environment, *files.additions)
    noted: list[Diagnostic] = []
    scene = scene_of(read_maps(maps, files.world.changes(), options, Inputs(), noted), noted)
    found += [one for one in noted if one not in found]
    return scene


def _runs_into(pose: FoundPose, question: _Question) -> tuple[str, ...] | None:
    """Find what is in the way at a pose in the true world; None if that is as the environment, or lacks the thing."""
    there, body = question.there, question.body
    if there is None or (body is not None and body not in there.names()):
        return None
    if body is not None and pose.z is not None:
        return there.overlapping(body, Pose.planar(pose.x, pose.y, pose.yaw, pose.z))
    at = replace(there.configuration(), base=(pose.x, pose.y, pose.yaw))
    return tuple(sorted({one.body for one in there.contacts(at, moving=("base",))}))


def _missing(problem: PlanFailure, options: LocateOptions, diagnostics: Iterable[Diagnostic]) -> Located:
    """Result for a robot that lacks a required part."""
    return Located(options.phrase, failure=Failure.of(problem), diagnostics=tuple(diagnostics), lacks_capability=True)


def _resolved(question: _Question, options: LocateOptions, waiting: Waiting) -> tuple[Located, Rejections]:
    """Search poses; returns them, and what was rejected."""
    log, failure, platform = Rejections(explained=True), None, question.platform
    poses: list[FoundPose] = []
    frame: Mapping[str, str] = {}
    try:
        used = _used(question.location, question.what, platform)
        question.found.extend(_unused(question.location, used))
        question.location, frame = used, _frame(used, question.body, platform)
        search = _bases(question, log) if question.what is None else _things(question, frame, log)
        with waiting(lambda: f"searching for poses, {log.counts.total()} candidates rejected"):
            poses.extend(replace(one, blocked_by=_runs_into(one, question)) for one in islice(search, options.count))
    except LocationMeaningless:
        raise
    except LocationUnresolvable as problem:
        failure = problem
    reason = None if poses or failure is None else Failure.of(failure)
    if reason is not None:  # without the phrase, which is printed beside it
        reason = replace(reason, message=reason.message.replace(f" for {question.location}", "", 1))
    phrase = write_location(question.location, question.lexicon)
    located = Located(
        phrase,
        tuple(poses),
        reason,
        dict(log.counts.most_common()),
        dict(log.blocking.most_common()),
        {str(reference): name for reference, name in question.meant.items()},
        dict(platform.world.configuration().joints),
        tuple(question.found),
        _sides(frame, question.location, platform),
        units=tuple(options.units or ()),
    )
    return located, log


def _drawn(located: Located, log: Rejections, question: _Question, options: LocateOptions) -> Drawn:
    """What a drawing of the candidates shows: the room as it is now, and what was found in it."""
    refused = [*log.refused, *((reason, hands) for reason, hands in log.hands if reason)]
    why = "" if located.failure is None else located.failure.message.partition(" (")[0]  # counts are listed
    resolution = Resolution(
        options.phrase,
        [(pose.x, pose.y, pose.yaw) for pose in located.poses],
        log.places,
        log.scored,
        refused,
        located.counts,
        located.blocking,
        [pose.arm_in_words for pose in located.poses],
        why,
    )
    scene = question.platform.scene
    return scenery_of(scene, question.location, question.meant.values(), question.body), resolution


def _meant(
    designators: Iterable[Object], lexicon: Lexicon, platform: Platform, diagnostics: Sequence[Diagnostic]
) -> dict[Object, str]:
    """Map each designator to its body. Raises BadInput if the map has none."""
    meant: dict[Object, str] = {}
    problems = []
    for what in dict.fromkeys(designators):
        try:
            meant[what] = platform.scene.bodies.bind(what)
        except ObjectUnresolvable:
            known = ", ".join(platform.belief.names())
            message = f"the map has no {write_thing(what, lexicon).removeprefix('the ')}"
            problems.append(error("P008", message, help=f"it has {known}"))
    if problems:
        raise BadInput([*diagnostics, *problems])
    return meant


NAMED = 20
"""Most things that a note names: in a large map, nobody reads on."""


def _choices(meant: Mapping[Object, str], lexicon: Lexicon, platform: Platform) -> Iterator[Diagnostic]:
    """Yield a note for each thing chosen among several."""
    for what, name in meant.items():
        others = [other for other in platform.belief.of_class(what) if other != name]
        if what.iri is None and others:
            more = f", or one of {len(others) - NAMED} more" if len(others) > NAMED else ""
            help = f"to choose another, name it: {', '.join(others[:NAMED])}{more}"
            thing = write_thing(what, lexicon)
            yield note("P009", f"{thing} is {name}, the nearest of {len(others) + 1}", help=help)


def _of_no_place(
    problem: LocationMeaningless, location: Location, what: Object | None, lexicon: Lexicon
) -> Iterator[Diagnostic]:
    """Explain in the words of phrases why a phrase describes no location."""

    def words(part: object) -> str:
        if isinstance(part, Relation):
            return repr(write_relation(part, lexicon))
        return repr(write_location(part, lexicon)) if isinstance(part, Location) else RELATIONS[str(part)].forms[0]

    yield error("P010", problem.worded(words), help=_other_subject(location, what, lexicon))


def _used(location: Location, what: Object | None, platform: Platform) -> Location:
    """The location without unused arms and grasps."""
    if what is not None:
        return replace(location, device=None, grasp=None)
    return without_unused(location, platform.scene, platform.base()[:2])


def _unused(stated: Location, used: Location) -> Iterator[Diagnostic]:
    """Yield a warning for unused arms and grasps, also of nested locations."""
    unused = []
    if stated.device is not None and used.device is None:
        unused.append(f"with {write_thing(stated.device)}")
    if stated.grasp is not None and used.grasp is None:
        unused.append(GRASP_FORMS[stated.grasp][0])
    if unused:
        help = "arms and grasps belong to a thing to reach: in reach of the bottle with the left arm from the top"
        yield warning("P011", f"{' '.join(unused)!r} has no effect here, and is ignored", help=help)
    for one, other in zip(stated.references(), used.references(), strict=True):
        if isinstance(one, Location) and isinstance(other, Location):
            yield from _unused(one, other)


def _other_subject(location: Location, what: Object | None, lexicon: Lexicon) -> str | None:
    """Advice for a relation that applies to poses of a thing but not of the base, or vice versa."""
    for relation in location.relations:
        meaning = RELATIONS[relation.name]
        # a base is in rooms only
        if what is None and (meaning.of_base is None or isinstance(meaning, In)):
            hints = [Text(Option("of", Blank("THING")), " searches poses of a thing")] if meaning.of_thing else []
            if meaning.of_hand:
                hints.append(Text(f'for a hand, write "in reach of a place {write_relation(relation, lexicon)}"'))
            return joined("; ", hints)
        if what is not None and meaning.of_thing is None and meaning.of_base is not None:
            return Text("leave out ", Option("of"), " to search poses of the base")
    return None


def _bases(question: _Question, log: Rejections) -> Iterator[FoundPose]:
    """Yield base poses, best first."""
    platform = question.platform
    for solution in platform.resolver.bases(question.location, log):
        x, y, yaw = solution.base
        detail = solution.detail
        yield FoundPose(
            x,
            y,
            yaw,
            score=next((place.score for place in reversed(log.places) if place.base == solution.base), None),
            arm=detail.get("arm"),
            reaches=tuple(detail.get("reaches", ())),
            looks=tuple((a, b, c) for a, b, c in detail.get("looks", ())),
            hands=tuple(_hands(solution.base, platform)),
            detail=detail,
        )


def _hands(base: BasePose, platform: Platform) -> Iterator[dict[str, Any]]:
    """Yield the validated postures of each hand from a base pose: poses of the tip in order, with joint values."""
    torso = platform.robot.torso
    for (_, _), reached in platform.resolver.reached_from(base).items():
        for hand in reached.values():
            arm, values = hand.arm, hand.joints.tolist()
            poses = [
                {"position": list(pose.position), "orientation": list(pose.orientation)}
                for pose in map(Pose.from_matrix, hand.plan.poses[: len(values)])
            ]
            yield {
                "arm": arm.name,
                "reach": hand.plan.label,
                "link": arm.tip,
                "fingers": dict(hand.plan.fingers) or None,
                "torso": values[0][arm.joints.index(torso)] if torso in arm.joints else None,
                "postures": [
                    {"joints": dict(zip(arm.joints, row, strict=True)), **pose}
                    for row, pose in zip(values, poses, strict=True)
                ],
            }


def _things(question: _Question, frame: Mapping[str, str], log: Rejections) -> Iterator[FoundPose]:
    """Yield poses of a thing, of the centre of its box, best first."""
    assert question.what is not None
    for pose in question.platform.resolver.things(question.location, question.what, log):
        x, y, z = pose.position
        yield FoundPose(x, y, pose.yaw, z, frame=frame)


def _frame(location: Location, what: str | None, platform: Platform) -> dict[str, str]:
    """Words such as ``left of`` -> whose sides they refer to."""
    scene, (x, y, _) = platform.scene, platform.base()
    if what is None:
        return sides(base_demand(location, scene, (x, y)), scene)
    return sides(thing_demand(location, what, scene, (x, y)), scene)


def _sides(
    frame: Mapping[str, str], location: Location, platform: Platform
) -> dict[str, tuple[str, tuple[float, float] | None, bool]]:
    """Words such as ``left of`` -> whose sides they refer to, the viewpoint, and whether it is the robot's."""
    there = viewpoint(location, platform.scene)
    x, y = there or platform.base()[:2]
    return {words: (whose, (x, y), there is None) for words, whose in frame.items()}
