"""The state of a world as JSON, and back: what moves, what is held, who has what, and time. Numbers come back exactly.

Only what differs from the scene is written, so that a snapshot of a furnished room is about 2 kB.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim.bodies import Bodies
from sim.contact import Held
from sim.falling import Falling
from sim.leaves import Leaves, Led
from sim.people import People
from sim.robot import Robot
from sim.scene import Body

JSON = dict[str, Any]
FARTHEST = 1e4
"""Greatest coordinate [m], angle [rad] or speed [m/s] that is believed: ten kilometres, farther than any map goes."""
UNIT = 1e-3
"""Largest error of a quaternion's length: a pose that was written comes back to the last digit."""


def configuration(now: Configuration) -> JSON:
    """Return where the robot is."""
    return {"base": list(now.base), "joints": dict(now.joints)}


def configuration_of(state: Mapping[str, Any]) -> Configuration:
    """Return the inverse of :func:`configuration`; raises ValueError."""
    x, y, yaw = _numbers(state["base"], 3)
    return Configuration((x, y, yaw), {str(name): _numbers([value], 1)[0] for name, value in state["joints"].items()})


def bodies(all_: Bodies, held: Mapping[str, Held]) -> JSON:
    """Return where bodies are that are neither held nor where the scene has them, and which were removed."""
    moved = {
        name: pose_json(pose)
        for name, pose in all_.poses.items()
        if name not in held and pose != all_.bodies[name].pose
    }
    return {"bodies": moved, "removed": sorted(all_.removed)}


def restore_bodies(all_: Bodies, state: Mapping[str, Any]) -> None:
    """Put all bodies where they were."""
    moved = state["bodies"]
    _known(all_, moved, state["removed"])
    for name, body in all_.bodies.items():
        all_.removed.discard(name)
        all_.place(name, pose_of(moved[name]) if name in moved else body.pose)
        if name in state["removed"]:
            all_.remove(name)


def created(all_: Bodies) -> list[Any]:
    """Return the bodies that were not in the scene at the beginning, where they came into being."""
    bodies = [all_.bodies[name] for name in all_.created]
    return [[one.name, one.type, str(one.shape), list(one.size), pose_json(one.pose)] for one in bodies]


def created_of(state: Any, all_: Bodies) -> Iterator[Body]:
    """Yield the inverse of :func:`created`; raises ValueError for a damaged one."""
    for name, type, shape, size, pose in state:
        if not isinstance(name, str) or name in all_.bodies:
            raise ValueError(f"{name!r} cannot come into being")
        x, y, z = _numbers(size, 3)
        yield Body(name, pose_of(pose), (x, y, z), shape, type=str(type), movable=True)


def held(all_: Mapping[str, Held]) -> JSON:
    """Return what is in the robot's hands, in the order of grasping."""
    return {
        name: [
            one.link,
            pose_json(one.offset),
            sorted(one.touched),
            {link: pose_json(offset) for link, offset in one.others.items()},
            one.on,
        ]
        for name, one in all_.items()
    }


def restore_held(all_: dict[str, Held], robot: Robot, known: Bodies, state: Mapping[str, Any]) -> None:
    """Put things into the hands that held them."""
    _known(known, state)
    all_.clear()
    for name, (link, offset, touched, others, on) in state.items():
        if absent := [one for one in (link, *others) if one not in robot.links]:
            raise ValueError(f"the robot has no link {absent[0]!r}")
        if on is not None and on not in state:
            raise ValueError(f"{name} stands on {on}, which is not held")
        hands = [] if on is not None else map(robot.hand_of, (link, *others))
        more = {str(one): pose_of(there) for one, there in others.items()}
        needs, hand = known.bodies[name].hands if on is None else 1, frozenset[int]().union(*hands)
        all_[name] = Held(link, pose_of(offset), hand, set(touched), others=more, needs=needs, on=on)


def leaves(all_: Leaves) -> JSON:
    """Return the joints that are not shut, and which hands lead leaves."""
    led = {
        leaf: [
            one.link,
            one.grip.tolist(),
            sorted(one.touched),
            {k: pose_json(v) for k, v in one.carried.items()},
            *([] if one.turn is None else [pose_json(one.turn)]),
        ]
        for leaf, one in all_.led.items()
    }
    return {"leaves": {leaf: value for leaf, value in all_.values.items() if value}, "led": led}


def restore_leaves(all_: Leaves, robot: Robot | None, known: Bodies, state: Mapping[str, Any]) -> None:
    """Put joints to their values, and let leaves follow the hands that led them; poses are restored before."""
    joints, led = state["leaves"], state["led"]
    if not {*joints, *led} <= all_.joints.keys():
        raise ValueError(f"there is no joint of {', '.join(sorted({*joints, *led} - all_.joints.keys()))}")
    for leaf, joint in all_.joints.items():
        all_.values[leaf] = joint.within(_numbers([joints.get(leaf, 0.0)], 1)[0])
    all_.led.clear()
    for leaf, (link, grip, touched, carried, *turns) in led.items():
        if robot is None or link not in robot.links:
            raise ValueError(f"the robot has no link {link!r}")
        _known(known, carried)
        inside = {str(name): pose_of(pose) for name, pose in carried.items()}
        place, closed = np.array(_numbers(grip, 3), float), all_.handle(leaf)
        turn = pose_of(turns[0]) if turns else None
        hands, near = robot.hand_of(link), frozenset(map(str, touched))
        all_.led[leaf] = Led(link, place, closed, hands, near, inside, turn=turn)


def falling(all_: Falling) -> JSON:
    """Return what is on its way down: speed [m/s] and where it will rest."""
    return {name: [speed, pose_json(rest)] for name, (speed, rest) in all_.on_the_way.items()}


def restore_falling(all_: Falling, state: Mapping[str, Any]) -> None:
    """Let things go on falling."""
    _known(all_.bodies, state)
    all_.on_the_way = {name: (_numbers([speed], 1)[0], pose_of(rest)) for name, (speed, rest) in state.items()}


def people(all_: People) -> JSON:
    """Return the hands of persons, what they have and what they reach for, and how long things have been offered."""
    persons = {
        name: {
            "hands": [np.asarray(hand).tolist() for hand in person.hands],
            "holds": {thing: [k, pose_json(pose)] for thing, (k, pose) in person.holds.items()},
            "reaching": None if person.reaching is None else list(person.reaching),
            "close": person.close,
        }
        for name, person in all_.persons.items()
    }
    return {"persons": persons, "still": {name: [pose_json(p), count] for name, (p, count) in all_.still.items()}}


def restore_people(all_: People, state: Mapping[str, Any]) -> None:
    """Let persons go on with what they did."""
    if state["persons"].keys() != all_.persons.keys():
        raise ValueError(f"there are other persons: {', '.join(state['persons'])}")
    for name, one in state["persons"].items():
        person = all_.persons[name]
        person.hands = [np.array(_numbers(hand, 3)) for hand in one["hands"]]
        person.holds = {str(thing): (_arm(k), pose_of(pose)) for thing, (k, pose) in one["holds"].items()}
        person.reaching = None if one["reaching"] is None else (_arm(one["reaching"][0]), str(one["reaching"][1]))
        person.close = int(one["close"])
        _known(all_.bodies, person.holds, [person.reaching[1]] if person.reaching is not None else [])
        all_.place_arms(name, (0, 1))
    all_.still = {str(name): (pose_of(pose), int(count)) for name, (pose, count) in state["still"].items()}


def pose_json(pose: Pose) -> list[float]:
    """Return the position and quaternion, seven numbers."""
    return [*pose.position, *pose.orientation]


def pose_of(state: object) -> Pose:
    """Return the inverse of :func:`pose_json`; raises ValueError."""
    x, y, z, a, b, c, d = _numbers(state, 7)
    if abs(math.hypot(a, b, c, d) - 1.0) > UNIT:
        raise ValueError(f"a unit quaternion is expected, not {[a, b, c, d]!r}")
    return Pose((x, y, z), (a, b, c, d))


def _numbers(state: object, count: int) -> list[float]:
    if not isinstance(state, list) or len(state) != count:
        raise ValueError(f"{count} numbers are expected, not {state!r}")
    if not all(type(value) in (int, float) and math.isfinite(value) for value in state):
        raise ValueError(f"finite numbers are expected, not {state!r}")
    if any(abs(value) > FARTHEST for value in state):
        raise ValueError(f"numbers up to {FARTHEST:g} are expected, not {state!r}")
    return state


def _arm(k: object) -> int:
    if k not in (0, 1):
        raise ValueError(f"an arm of a person is 0 or 1, not {k!r}")
    return int(k)


def _known(all_: Bodies, *names: Any) -> None:
    unknown = [name for some in names for name in some if name not in all_.bodies]
    if unknown:
        raise ValueError(f"there is no body {', '.join(map(str, unknown))}")
