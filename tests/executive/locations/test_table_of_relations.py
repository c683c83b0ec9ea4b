"""The table of relations, cell by cell: what is found keeps the relation by arithmetic of its own, and then it holds.

Found is what the relation scores; that it holds is asked of the belief after robot, hand or thing was put there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest

from executive.locations import HandSolution
from planlang.designators import Location, Relation, a_device, a_location, a_person, an_object, located
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array, Pose
from planlang.phrases.lexicon import GRASP_FORMS
from planlang.protocols import Configuration
from planlang.relations import RELATIONS
from planlang.relations.demands import SUBJECTS
from planlang.relations.looking import SeenFrom
from sim import Body
from tests.executive.conftest import (
    BED,
    BOTTLE,
    CABINET,
    PATIENT,
    PLACE,
    THE_BOTTLE,
    MakeStage,
    Stage,
    hold_bottle,
    stand,
)
from tests.executive.locations.conftest import MakeJudge
from tests.support.examples import some
from tests.support.locations.predicates import OF_A_BASE, OF_A_THING, is_between, keeps

T = TypeVar("T")
CUP = Body("cup", Pose((-0.2, 1.7, 0.66)), (0.08, 0.08, 0.12), "cylinder", type="Cup", movable=True)
TABLE_TOP = Body("table", Pose((0.0, 1.7, 0.3)), (0.9, 0.9, 0.6), "cylinder", type="Table-PieceOfFurniture")
BAY = Body("bay", Pose((1.6, 0.0, 1.05)), (0.4, 0.8, 0.5), "marker", type="Compartment")
DOOR = Body("door", Pose((0.0, -2.5, 1.0)), (0.9, 0.04, 2.0), type="Door")
ALL = (CABINET, BOTTLE, BED, PATIENT, CUP, TABLE_TOP, BAY, DOOR)
THE_BED, THE_CABINET = an_object(BED.type, PLACE + "bed"), an_object(CABINET.type, PLACE + "cabinet")
THE_CUP, THE_TABLE = an_object(CUP.type, PLACE + "cup"), an_object(TABLE_TOP.type, PLACE + "table")
THE_BAY, THE_DOOR = an_object(BAY.type, PLACE + "bay"), an_object(DOOR.type, PLACE + "door")
THE_PATIENT = a_person("Patient")
SIDES = ("in_front_of", "behind", "left_of", "right_of", "next_to")
RADIUS = 0.333
HAIR = 2e-3
LEFT, RIGHT = a_device("LeftArm"), a_device("RightArm")


@pytest.fixture(scope="module")
def room(furnish: MakeStage) -> Stage:
    """A cabinet with a bottle, a bed with a patient, a round table with a cup, a place in a cabinet, a door."""
    return furnish(*ALL)


def first(answers: Iterator[T], most: int) -> list[T]:
    """The first answers, fewer if there are not so many."""
    found: list[T] = []
    with suppress(LocationUnresolvable):
        found.extend(islice(answers, most))
    return found


def distance(point: Array, body: Body) -> float:
    """Return how far a point (2,) is from the outline of a body whose axes are those of the map [m]."""
    out = np.maximum(np.abs(point - np.array(body.pose.position[:2])) - np.array(body.size[:2]) / 2, 0.0)
    return float(np.hypot(*out))


def in_comfort(stage: Stage, point: Array) -> bool:
    """Return whether a point (3,) is where the patient takes things: before a shoulder, within the arm's length."""
    person = stage.truth.person("patient")
    arrows = [point - np.array(shoulder) for shoulder in person.shoulders]
    return any(
        0.25 * person.arm_length <= np.linalg.norm(arrow) <= person.arm_length
        and arrow @ person.facing >= 0.5 * np.linalg.norm(arrow) - HAIR
        for arrow in arrows
    )


# For a base

BASES: dict[str, Location] = {
    "in_reach_of": a_location(in_reach_of=THE_BOTTLE),
    "visible_from": a_location(visible_from=THE_BOTTLE),
    "near": a_location(near=THE_BED, within="40 cm"),
    "far_from": a_location(far_from=THE_BED, beyond="8 ft"),
    "facing": a_location(facing=THE_BED, near=THE_BED),
    "clear_of": a_location(clear_of=THE_DOOR, near=THE_DOOR),
    "between": a_location(between=(THE_CABINET, THE_TABLE), near=THE_TABLE),
    **{name: a_location(**{name: THE_CUP if name in ("left_of", "behind") else THE_CABINET}) for name in SIDES},  # type: ignore[arg-type]
}


def test_every_cell_of_the_table_is_tried_here() -> None:
    tried = {name: one for name, one in RELATIONS.items() if not isinstance(one, SeenFrom)}
    cells = (
        {name for name, meaning in tried.items() if meaning.of_base} - {"in_"},  # it takes a room: test_in_rooms.py
        {name for name, meaning in tried.items() if meaning.of_hand},
    )
    assert cells == (BASES.keys(), HANDS.keys())
    assert THINGS.keys() == {name for name, meaning in tried.items() if meaning.of_thing}


@pytest.mark.parametrize("base", [(0.0, -0.4, 0.0), (0.3, 0.8, 2.0)])
def test_left_is_that_of_whoever_is_said_to_look_wherever_the_robot_stands(
    room: Stage, base: tuple[float, float, float]
) -> None:
    stand(room, base)
    for viewer, body in ((THE_BED, BED), (THE_TABLE, TABLE_TOP)):
        location = a_location(on=THE_CABINET, left_of=THE_BOTTLE, seen_from=viewer)
        poses = first(room.resolver.things(location, THE_CUP), 3)
        assert poses
        there = np.array(BOTTLE.pose.position[:2]) - np.array(body.pose.position[:2])
        for pose in poses:
            aside = np.array(pose.position[:2]) - np.array(BOTTLE.pose.position[:2])
            assert there[0] * aside[1] - there[1] * aside[0] > 0, "the cross product points up on the left"


def test_nothing_is_at_where_something_is_seen_from(room: Stage) -> None:
    for location in (a_location(seen_from=THE_BED), a_location(near=THE_BED, not_=a_location(seen_from=THE_TABLE))):
        with pytest.raises(LocationUnresolvable, match="seen"):
            next(room.resolver.bases(location))


def bodies_of(relation: Relation) -> list[Body]:
    """The bodies that a relation refers to, by name or class."""
    return [next(body for body in ALL if one.name in (body.name, body.type)) for one in relation.references]


def base_keeps(relation: Relation, base: tuple[float, float, float], viewer: tuple[float, float]) -> bool:
    """Return whether a base keeps a relation about the floor."""
    body, *others = bodies_of(relation)
    if relation.name == "between":
        return is_between(base[:2], body, *others)
    if relation.name == "clear_of":
        x, y = base[0] + 0.45, base[1] + 2.5  # from the hinge, the left end of the door
        inside = x >= 0 and math.hypot(x, y) < 0.9 + RADIUS
        beside = x < 0 and math.hypot(x, max(abs(y) - 0.9, 0.0)) < RADIUS
        return not (inside or beside)
    return keeps(relation, body, RADIUS, base, viewer, OF_A_BASE)


@pytest.mark.parametrize("name", some(sorted(BASES), 2))
@pytest.mark.parametrize("negated", [False, True], ids=["", "not"])
def test_a_base_keeps_the_relation_and_then_it_holds(
    name: str, negated: bool, room: Stage, judge_of: MakeJudge
) -> None:
    stand(room, (0.0, -0.4, 0.0))
    stated = next(relation for relation in BASES[name].relations if relation.name == name)
    others = Location(tuple(relation for relation in BASES[name].relations if relation != stated))
    location = Location((~stated, *others.relations)) if negated else BASES[name]
    found = [solution.base for solution in first(room.resolver.bases(location), 4)]
    assert len(found) == 4
    judge = judge_of(room)
    joints = room.planning.configuration().joints
    for base in found:
        assert room.resolver.satisfies(location, base)
        assert not room.resolver.satisfies(Location((stated if negated else ~stated, *others.relations)), base)
        match name:
            case "visible_from" if negated:
                x, y, _ = BOTTLE.pose.position
                aside = math.remainder(math.atan2(y - base[1], x - base[0]) - base[2], 2 * math.pi)
                assert abs(aside) > 1.57 + 0.15, "the neck turns by 1.57"
            case "visible_from":
                assert judge.sees("bottle", base, joints)
            case "in_reach_of" if negated:
                away = math.dist(base[:2], BOTTLE.pose.position[:2])
                assert away > 0.74 + 0.22 or away < 0.6, "an arm is 0.74 m long and begins 0.22 m aside"
            case "in_reach_of":
                stand(room, base)
                ways = [
                    way for arm in ("right", "left") for way in reaching(room, a_location(in_center_of=THE_BOTTLE), arm)
                ]
                judge.assert_possible(ways[0], base, room)
            case _:
                assert base_keeps(stated, base, (0.0, -0.4)) != negated, base
    stand(room, found[1])
    assert room.executive.holds(located(location))


def reaching(stage: Stage, location: Location, arm: str) -> list[HandSolution]:
    """The first way of an arm to a place of the hand from where the robot stands, if there is one."""
    model = next(model for model in stage.platform.scene.arms.all if model.name == arm)
    return first(stage.resolver.hands(location, model, stage.platform.arm_joints(model)), 1)


# For a hand

OVER = a_location(above=THE_CABINET, beyond="22 cm", within="45 cm")
HANDS: dict[str, Location] = {
    "in_reach_of": a_location(in_reach_of=THE_PATIENT),
    "above": a_location(above=THE_BED, beyond="5 cm", within="0.1 m"),
    "on": a_location(on=THE_TABLE),
    "in_": a_location(in_=THE_BAY),
    "in_center_of": a_location(in_center_of=THE_BOTTLE),
    "in_front_of": a_location(in_front_of=THE_BOTTLE),
    "behind": OVER & a_location(behind=THE_BOTTLE, within=0.2),
    "left_of": OVER & a_location(left_of=THE_BOTTLE),
    "right_of": OVER & a_location(right_of=THE_BOTTLE, beyond="10 cm"),
    "next_to": OVER & a_location(next_to=THE_BOTTLE),
    "near": a_location(above=THE_BED) & a_location(near=THE_PATIENT, within="4 in"),
    "far_from": a_location(above=THE_BED) & a_location(far_from=THE_PATIENT, beyond="15 cm"),
    "between": a_location(above=THE_BED, between=(THE_PATIENT, THE_CABINET)),
}


def hand_keeps(stage: Stage, relation: Relation, tip: Array, held: Array | None, low: float, axes: Array) -> bool:
    """Return whether a hand keeps a relation: tip (4, 4), the middle of what it holds, the lowest point, its axes."""
    middle = tip[:3, 3] if held is None else held
    match relation.name:
        case "in_reach_of":
            return in_comfort(stage, middle)
        case "above":
            body = BED if relation.references[0] == THE_BED else CABINET
            least, most = relation.beyond or 0.02, relation.within or 0.15
            over = low - body.pose.position[2] - body.size[2] / 2
            return least - HAIR <= over <= most + HAIR and distance(middle[:2], body) == 0
        case "on":
            away = math.dist(middle[:2], TABLE_TOP.pose.position[:2])
            return away + BOTTLE.size[0] / 2 <= 0.45 + HAIR and abs(low - 0.6) < 0.02
        case "in_":
            beyond = np.abs(middle - np.array(BAY.pose.position)) + (np.array(BOTTLE.size) - np.array(BAY.size)) / 2
            return bool((beyond[:2] <= HAIR).all()) and abs(low - 0.8) < 0.02
        case "in_center_of":
            return bool(np.linalg.norm(tip[:3, 3] - np.array(BOTTLE.pose.position)) <= 0.01)
        case "in_front_of":
            return bool(np.linalg.norm(tip[:3, 3] + 0.08 * axes - np.array(BOTTLE.pose.position)) <= 0.01)
        case "near" | "far_from":
            away = distance(middle[:2], PATIENT)
            return away >= (relation.beyond or 0.0) - HAIR and away <= (relation.within or math.inf) + HAIR
        case "between":
            return is_between(middle[:2], *bodies_of(relation))
    place, asked_from = (float(middle[0]), float(middle[1]), 0.0), (0.0, 0.0)
    return keeps(relation, BOTTLE, 0.0, place, asked_from, OF_A_THING)


@pytest.mark.parametrize("name", some(sorted(HANDS), every=4))
def test_a_hand_keeps_the_relation_and_then_it_holds(name: str, make_stage: MakeStage, judge_of: MakeJudge) -> None:
    stage, location = make_stage(*ALL), HANDS[name]
    carries = name in ("on", "in_", "in_reach_of")
    if carries:
        hold_bottle(stage)
    solution = next(stage.resolver.bases(a_location(in_reach_of=location)))
    stand(stage, solution.base)
    (way,) = reaching(stage, location, solution.detail["arm"])
    judge = judge_of(stage)
    judge.assert_possible(way, solution.base, stage)
    arm = stage.platform.robot.arm(way.arm.name)
    number = {"grasp": 0 if name == "in_front_of" else 1, "place": 1}.get(way.reach.kind.value, 0)
    joints = dict(stage.planning.configuration().joints) | dict(zip(way.arm.joints, way.joints[number], strict=True))
    judge.place(solution.base, joints)
    tip = judge.link(arm.tip)
    held = tip @ stage.belief.held["bottle"].offset.matrix() if carries else None
    low = judge.lowest(way.arm.hand_links) if held is None else held[2, 3] - BOTTLE.size[2] / 2
    for relation in location.relations:
        middle = None if held is None else held[:3, 3]
        assert hand_keeps(stage, relation, tip, middle, low, tip[:3, :3] @ np.array(arm.approach)), relation
    here = located(location, LEFT if way.arm.name == "left" else RIGHT)
    not_here = located(Location((~location.relations[0],), device=location.device), here.arguments[1])  # type: ignore[arg-type]
    assert not stage.executive.holds(here)
    stage.truth.set_configuration(Configuration(solution.base, joints))
    assert stage.executive.holds(here)
    assert not stage.executive.holds(not_here)


def test_a_hand_that_moves_over_the_bed_stays_over_it_until_it_is_beside(room: Stage) -> None:
    location = a_location(above=THE_BED)
    solution = next(room.resolver.bases(a_location(in_reach_of=location)))
    stand(room, solution.base)
    (way,) = reaching(room, location, solution.detail["arm"])
    here = located(location, LEFT if way.arm.name == "left" else RIGHT)
    joints = dict(room.planning.configuration().joints) | dict(zip(way.arm.joints, way.joints[0], strict=True))
    edge = way.plan.poses[0][:2, 3]
    x, y, yaw = solution.base
    for aside in np.arange(0.0, 0.5, 0.03):
        to_bed = np.array([-2.5 - x, -y]) / math.hypot(-2.5 - x, -y)
        moved = (x - aside * to_bed[0], y - aside * to_bed[1], yaw)
        room.truth.set_configuration(Configuration(moved, joints))
        assert room.executive.holds(here) == (distance(edge - aside * to_bed, BED) == 0), f"{aside:.2f} m aside"
    stand(room, (0.0, 0.0, 0.0))


# For an object

THINGS: dict[str, Location] = {
    "in_reach_of": a_location(in_reach_of=THE_PATIENT, on=THE_BED),
    "on": a_location(on=THE_TABLE),
    "in_": a_location(in_=THE_BAY),
    "near": a_location(near=THE_CUP, within="15 cm"),
    "far_from": a_location(far_from=THE_CUP, beyond="40 cm") & a_location(on=THE_TABLE),
    "between": a_location(between=(THE_DOOR, THE_CUP), on=THE_TABLE),
    **{name: a_location(**{name: THE_CUP}) for name in SIDES},  # type: ignore[arg-type]
}
MORE_THINGS = (
    a_location(on=THE_TABLE, not_=a_location(near=THE_CUP)),
    a_location(on=THE_CABINET, left_of=THE_BOTTLE, not_=a_location(on=THE_BED)),
    a_location(on=THE_BED, far_from=THE_PATIENT, within="9 ft", beyond="1 ft"),
    a_location(on=THE_BED, not_=a_location(in_reach_of=THE_PATIENT)),
)


def thing_keeps(stage: Stage, relation: Relation, at: Array, size: tuple[float, float, float]) -> bool:
    """Return whether a round thing with its middle at a point (3,) keeps a relation."""
    radius, low = size[0] / 2, at[2] - size[2] / 2
    body, *others = bodies_of(relation)
    if relation.name == "between":
        return is_between(at[:2], body, *others)
    away = at[:2] - np.array(body.pose.position[:2])
    match relation.name:
        case "in_reach_of":
            return in_comfort(stage, at)
        case "on" if body.shape == "cylinder":
            return bool(np.hypot(*away) + radius <= body.size[0] / 2 + 1e-6) and abs(low - 0.6) < 0.005
        case "on":
            top = body.pose.position[2] + body.size[2] / 2
            return bool((np.abs(away) + radius <= np.array(body.size[:2]) / 2 + 1e-6).all()) and abs(low - top) < 0.005
        case "in_":
            inside = np.abs(at - np.array(body.pose.position)) + np.array(size) / 2 <= np.array(body.size) / 2 + 1e-6
            return bool(inside.all())
    x, y, _ = stage.planning.configuration().base
    return keeps(relation, body, radius, (float(at[0]), float(at[1]), 0.0), (x, y), OF_A_THING)


@pytest.mark.parametrize("location", [*THINGS.values(), *MORE_THINGS], ids=str)
def test_a_thing_keeps_the_relation_and_then_it_holds(location: Location, room: Stage) -> None:
    stand(room, (0.0, 0.0, 0.5))
    moved, what = (CUP, THE_CUP) if THE_BOTTLE in location.objects() else (BOTTLE, THE_BOTTLE)
    poses = first(room.resolver.things(location, what), 40)[::7]
    assert len(poses) > 1
    for pose in poses:
        for relation in location.relations:
            kept = thing_keeps(room, relation, np.array(pose.position), moved.size)
            assert kept != relation.negated, f"{relation} at {pose}"
    relation = location.relations[0]
    try:
        room.belief.bump(moved.name, poses[1])
        assert room.executive.holds(located(location, what))
        assert not room.executive.holds(located(Location((~relation, *location.relations[1:])), what))
        room.belief.bump(moved.name, Pose((3.0, 3.0, 0.5)))
        assert not room.executive.holds(located(location, what))
    finally:
        room.belief.bump(moved.name, moved.pose)
        room.platform.observe()


CHECKOUT = Path(__file__).resolve().parents[3]
FILE = CHECKOUT / "docs" / "guides" / "locations.md"
PAGE = FILE.read_text(encoding="utf-8")


def relations() -> str:
    """Return what each relation denotes."""
    lines = ["| relation | OWL property | for a base | for a hand | for an object |", "|---|---|---|---|---|"]
    for name, relation in RELATIONS.items():
        cells = [one.text if (one := relation.meaning(subject)) else "-" for subject in SUBJECTS]
        lines.append(f"| `{name}` | {relation.owl} | {' | '.join(cells)} |")
    return "\n".join(lines)


def forms() -> str:
    """Return how each relation and each grasp is said."""
    lines = ["| relation, grasp | phrase | also |", "|---|---|---|"]
    for name, (first, *others) in {
        **{name: relation.forms for name, relation in RELATIONS.items()},
        **GRASP_FORMS,
    }.items():
        lines.append(f"| `{name}` | {first} | {', '.join(others) or '-'} |")
    return "\n".join(lines)


TABLES = {"table of relations": relations, "table of forms": forms}


def shown(title: str) -> str:
    """Return what stands between the marks of a table."""
    found = re.search(rf"<!-- {title} -->\n(.*?)<!-- end -->", PAGE, re.DOTALL)
    assert found, f"docs/guides/locations.md has no {title}"
    return found[1].strip()


@pytest.mark.parametrize("title", TABLES)
def test_a_table_of_the_page_is_that_of_the_code(title: str) -> None:
    assert shown(title) == TABLES[title]()


def rewrite() -> None:
    """Write the tables into the page anew."""
    text = PAGE
    for title, table in TABLES.items():
        text = re.sub(
            rf"(<!-- {title} -->\n).*?(<!-- end -->)", lambda m, t=table: f"{m[1]}{t()}\n{m[2]}", text, flags=re.DOTALL
        )
    FILE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    rewrite()
