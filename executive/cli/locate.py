"""``planlang locate``: a phrase is read, its things found in the map, its poses searched and listed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import islice
from typing import Any

from executive.belief.scene_collisions import BasePose
from executive.cli.arguments import LocateArguments
from executive.cli.console import Answer, ExitCode
from executive.cli.inputs import check_files, chosen, environments, planar, refuse
from executive.locations import Rejections
from executive.locations.consistency import LocationMeaningless
from executive.locations.demands import base_demand, sides, thing_demand, viewpoint, without_unused
from executive.maps import read_map, scene_of
from executive.modules.platform import Platform
from executive.robots import bind_robot
from executive.robots.arms import with_carrying
from executive.runs.assembly import platform_of, world_at_start
from executive.runs.phrases import lexicon_of
from planlang.designators import Location, Object, Relation
from planlang.diagnostics import BadInput, Diagnostic, error, note, warning
from planlang.failures import LocationUnresolvable, MissingCapability, ObjectUnresolvable
from planlang.files import Bundled
from planlang.geometry import Pose
from planlang.ontology import load
from planlang.outputs import PNG_OR_SVG, check_outputs
from planlang.outputs import replace as write_complete
from planlang.phrases import Lexicon, read_location, read_thing, write_location, write_relation, write_thing
from planlang.phrases.lexicon import GRASP_FORMS
from planlang.relations import RELATIONS
from planlang.units import chosen_units, known_unit
from sim import PyBulletWorld


def command(arguments: LocateArguments) -> Answer:
    """Find poses; raises BadInput for what cannot be understood or used."""
    start = planar(arguments.start)
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf)
    robot_file = chosen(Bundled.ROBOT, arguments.robot, None, problems, needs="locate")
    first, *further = (*(arguments.environment or ()),) or (None,)
    environment = chosen(Bundled.ENVIRONMENT, first, None, problems, needs="locate")
    more = environments(further, problems)
    inputs = {"--urdf": arguments.urdf, "--robot": robot_file, "--environment": environment}
    outputs = {"--explain": arguments.explain}
    problems += check_outputs(outputs, inputs, formats={"--explain": PNG_OR_SVG}, force=arguments.force)
    refuse(problems)
    assert robot_file is not None
    assert environment is not None
    with ExitStack() as stack:
        found: list[Diagnostic] = []
        ontology = load(environment, folders=arguments.folders, also=more)
        semantic_map = read_map(ontology)
        lexicon = lexicon_of(semantic_map)
        location = read_location(arguments.phrase, lexicon)
        what = None if arguments.of is None else read_thing(arguments.of, lexicon, file="--of")
        robot = with_carrying(
            bind_robot(robot_file, urdf=arguments.urdf, folders=arguments.folders), report=arguments.progress
        )
        found.extend((*ontology.diagnostics, *semantic_map.diagnostics, *robot.diagnostics))
        if location.device is not None and not robot.arms_of(location.device):
            arms = ", ".join(arm.name for arm in robot.arms) or "none"
            asked = write_thing(location.device).removeprefix("the ")
            return _missing(f"{robot.name} has no {asked}; its arms: {arms}", found)
        world = world_at_start(scene_of(semantic_map, found), robot, start, stack)
        truth = PyBulletWorld(world.scene, robot.body())  # which is as believed: nothing moves
        stack.callback(truth.close)
        platform = platform_of(robot, semantic_map, truth, world, 0, arguments.progress)
        meant = _meant([*location.things(), *([] if what is None else [what])], lexicon, platform, found)
        found.extend(_choices(meant, lexicon, platform))
        try:
            return _resolved(location, what, lexicon, platform, meant, found, arguments)
        except LocationMeaningless as problem:
            raise BadInput([*found, *_of_no_place(problem, location, what, lexicon)]) from None
        except MissingCapability as problem:
            return _missing(str(problem), found)


def _missing(message: str, found: Iterable[Diagnostic]) -> Answer:
    """Return the answer when the robot has no part for what is asked."""
    text = f"MissingCapability: {message}"
    data = {"failure": ["MissingCapability"], "message": message}
    return Answer(ExitCode.MISSING_CAPABILITY, tuple(found), text, data)


def _meant(
    designators: Iterable[Object], lexicon: Lexicon, platform: Platform, found: Sequence[Diagnostic]
) -> dict[Object, str]:
    """Return the body that each designator means; raises BadInput, with what was found, when the map has none."""
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
        raise BadInput([*found, *problems])
    return meant


def _choices(meant: Mapping[Object, str], lexicon: Lexicon, platform: Platform) -> Iterator[Diagnostic]:
    """Yield a note for each thing that was chosen among several."""
    for what, name in meant.items():
        others = [other for other in platform.belief.of_class(what) if other != name]
        if what.iri is None and others:
            help = f"name it to mean another: {', '.join(others)}"
            stated = write_thing(what, lexicon)
            yield note("P009", f"{stated} is {name}, the nearest of {len(others) + 1}", help=help)


def _of_no_place(
    problem: LocationMeaningless, location: Location, what: Object | None, lexicon: Lexicon
) -> Iterator[Diagnostic]:
    """Yield why a phrase describes no location, in the words of phrases."""

    def words(part: object) -> str:
        if isinstance(part, Relation):
            return repr(write_relation(part, lexicon))
        return repr(write_location(part, lexicon)) if isinstance(part, Location) else RELATIONS[str(part)].forms[0]

    yield error("P010", problem.worded(words), help=_other_subject(location, what, lexicon))


def _used(location: Location, what: Object | None, platform: Platform) -> Location:
    """Return the location without arms and grasps that nothing uses."""
    if what is not None:
        return replace(location, device=None, grasp=None)
    return without_unused(location, platform.scene, platform.base()[:2])


def _idle(stated: Location, used: Location) -> Iterator[Diagnostic]:
    """Yield a warning for unused arms and grasps, those of nested locations included."""
    idle = []
    if stated.device is not None and used.device is None:
        idle.append(f"with {write_thing(stated.device)}")
    if stated.grasp is not None and used.grasp is None:
        idle.append(GRASP_FORMS[stated.grasp][0])
    if idle:
        help = "arms and grasps belong to a thing to reach: in reach of the bottle with the left arm from the top"
        yield warning("P011", f"{' '.join(idle)!r} has no effect here; it is left out", help=help)
    for one, other in zip(stated.relations, used.relations, strict=True):
        if isinstance(one.reference, Location) and isinstance(other.reference, Location):
            yield from _idle(one.reference, other.reference)


def _other_subject(location: Location, what: Object | None, lexicon: Lexicon) -> str | None:
    """Return how to ask for poses that a relation has a meaning for, if it has none for what was asked for."""
    for relation in location.relations:
        meaning = RELATIONS[relation.name]
        if what is None and meaning.base is None:
            hints = ["--of THING asks for poses of a thing"] if meaning.thing else []
            if meaning.hand:
                hints.append(f'the base for a hand is "in reach of a place {write_relation(relation, lexicon)}"')
            return "; ".join(hints)
        if what is not None and meaning.thing is None and meaning.base is not None:
            return "without --of, poses of the base are searched"
    return None


def _bases(
    location: Location, platform: Platform, count: int, log: Rejections, shown: Shown
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield base poses: a line for people, and data."""
    for number, solution in enumerate(islice(platform.resolver.bases(location, log), count), 1):
        x, y, yaw = solution.base
        detail = solution.detail
        arm = detail.get("arm", "")
        how = f"{arm if arm.endswith('arm') else f'{arm} arm'}: {', '.join(detail['reaches'])}" if arm else ""
        how += "".join(f", after a look from {shown(x=a, y=b, yaw=c)}" for a, b, c in detail.get("looks", ()))
        line = f"{number}  {shown(x=x, y=y, yaw=yaw)}  {how}".rstrip()
        score = next((place.score for place in reversed(log.places) if place.base == solution.base), None)
        hands = list(_hands(solution.base, platform))
        yield (
            line,
            {"x": x, "y": y, "yaw": yaw, "score": score, **detail, "hands": hands},
        )


def _hands(base: BasePose, platform: Platform) -> Iterator[dict[str, Any]]:
    """Yield how each hand was judged to reach from a base pose: the tip's poses in order, each with joint values."""
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
                "link": platform.robot.arm(arm.name).tip,
                "fingers": dict(hand.plan.fingers) or None,
                "torso": values[0][arm.joints.index(torso)] if torso in arm.joints else None,
                "postures": [
                    {"joints": dict(zip(arm.joints, row, strict=True)), **pose}
                    for row, pose in zip(values, poses, strict=True)
                ],
            }


def _things(
    location: Location,
    what: Object,
    frame: Mapping[str, str],
    platform: Platform,
    count: int,
    log: Rejections,
    shown: Shown,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield poses of a thing, of the centre of its box: a line for people, and data."""
    for number, pose in enumerate(islice(platform.resolver.things(location, what, log), count), 1):
        x, y, z = pose.position
        line = f"{number}  {shown(x=x, y=y, z=z, yaw=pose.yaw)}"
        yield line, {"x": x, "y": y, "z": z, "yaw": pose.yaw, **({"frame": frame} if frame else {})}


def _frame(location: Location, what: str | None, platform: Platform) -> dict[str, str]:
    """Return whose sides are meant, by the words of the phrase."""
    scene, (x, y, _) = platform.scene, platform.base()
    if what is None:
        return sides(base_demand(location, scene, (x, y)), scene)
    return sides(thing_demand(location, what, scene, (x, y)), scene)


def _frame_lines(frame: Mapping[str, str], location: Location, platform: Platform, shown: Shown) -> Iterator[str]:
    """Yield a line for each side."""
    there = viewpoint(location, platform.scene)
    x, y = there or platform.base()[:2]
    for words, whose in frame.items():
        seen = f"as seen from {'the robot at ' if there is None else ''}{shown(x=x, y=y)}"
        yield f"  {words}: {'in its own frame' if whose == 'its own' else seen}"


def _resolved(
    location: Location,
    what: Object | None,
    lexicon: Lexicon,
    platform: Platform,
    meant: Mapping[Object, str],
    found: list[Diagnostic],
    arguments: LocateArguments,
) -> Answer:
    log, failure, shown = Rejections(explained=True), None, Shown(arguments.units or ())
    places: list[tuple[str, dict[str, Any]]] = []
    frame: Mapping[str, str] = {}
    try:
        used = _used(location, what, platform)
        found.extend(_idle(location, used))
        location, frame = used, _frame(used, None if what is None else meant[what], platform)
        if what is None:
            solutions = _bases(location, platform, arguments.count, log, shown)
        else:
            solutions = _things(location, what, frame, platform, arguments.count, log, shown)
        with arguments.waiting(lambda: f"searching for poses, {log.counts.total()} candidates rejected"):
            places.extend(solutions)
    except LocationMeaningless:
        raise
    except LocationUnresolvable as problem:
        failure = problem
    counts, blocking = dict(log.counts.most_common()), dict(log.blocking.most_common())
    phrase = write_location(location, lexicon)
    data: dict[str, Any] = {
        "location": phrase,
        "meant": {str(reference): name for reference, name in meant.items()},
        "posture": dict(platform.world.configuration().joints),
        "solutions": [place for _, place in places],
        "counts": counts,
        "blocking": blocking,
    }
    lines = [
        f"{phrase}{shown.heading()}",
        *_frame_lines(frame, location, platform, shown),
        *(f"  {line}" for line, _ in places),
    ]
    if not places:
        message = str(failure).replace(f" for {location}", "", 1)  # the phrase is printed above
        data |= {"failure": [type(failure).__name__], "message": message}
        lines.append(message)
    elif counts:
        lines.append(f"  rejected: {', '.join(f'{number} {reason}' for reason, number in counts.items())}")
    if arguments.explain is not None:
        from executive.pictures.floor_plan import Resolution, save_picture, scenery_of  # Pillow is slow to import

        bases = [(place["x"], place["y"], place["yaw"]) for _, place in places]
        arms = [place.get("arm", "") for _, place in places]
        details = [arm if not arm or arm.endswith("arm") else f"{arm} arm" for arm in arms]
        refused = [*log.refused, *((reason, hands) for reason, hands in log.hands if reason)]
        why = data.get("message", "").partition(" (")[0]  # counts are listed
        resolution = Resolution(
            arguments.phrase, bases, log.places, log.scored, refused, counts, blocking, details, why
        )
        scenery = scenery_of(platform.scene, location, meant.values(), None if what is None else meant[what])
        write_complete(arguments.explain, lambda temporary: save_picture(temporary, scenery, resolution))
        data["picture"] = str(arguments.explain)
    return Answer(ExitCode.DONE if places else ExitCode.FAILED, tuple(found), "\n".join(lines), data)


class Shown:
    """Numbers of poses with their names, in m and rad or in the units that a user asks for; BadInput for others."""

    def __init__(self, names: Sequence[str]) -> None:
        self._chosen = chosen_units(names)
        shown = {known_unit(name).dimension for name in ("Meter", "Radian")}
        wrong = [name for dimension, name in self._chosen.items() if dimension not in shown]
        help = "locate shows lengths and angles: --units Centimeter --units DegreeAngle"
        refuse([error("C019", f"--units {name}: neither a length nor an angle", help=help) for name in wrong])

    def __call__(self, **numbers: float) -> str:
        """Return the numbers [m, rad] with their names."""
        return "  ".join(f"{name} {self._number(number, name)}" for name, number in numbers.items())

    def _number(self, number: float, name: str) -> str:
        """Return a number as precisely as a millimetre and a milliradian are; adding zero avoids -0.000."""
        si = known_unit("Radian" if name == "yaw" else "Meter")
        own = known_unit(self._chosen.get(si.dimension, "Radian" if name == "yaw" else "Meter"))
        places = max(0, math.ceil(3 + math.log10(own.factor)))
        return f"{round(si.to(own, number), places) + 0.0:.{places}f}"

    def heading(self) -> str:
        """Return the units that a user has asked for, in brackets."""
        return f" [{', '.join(self._chosen.values())}]" if self._chosen else ""
