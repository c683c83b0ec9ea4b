"""Believed state and memory as JSON, for resuming a run in the world as it was left; numbers survive exactly."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from executive.belief.estimates import Estimate
from executive.belief.memory import Knowledge, Meaning, Memory, Source
from executive.belief.obstacles import NAMES
from executive.maps.classes import MapObject
from planlang.geometry import Pose
from planlang.runs.codec import dump, load
from planlang.state import Grip, Hold, Made, Matter, WorldState
from sim.joints import Articulation

FARTHEST = 1e4
"""Largest plausible coordinate [m]: ten kilometres, farther than any map."""
UNIT = 1e-3
"""Largest error of a quaternion's norm: poses written by planlang come back to the last digit."""


def dump_belief(state: WorldState, memory: Memory, revision: int) -> dict[str, Any]:
    """Convert what is believed to JSON; poses that equal the first ones are left out. Robots are no part of it."""
    made = [
        [name, one.type, "cylinder" if one.is_round else "box", list(one.size), [*one.at.position, *one.at.orientation]]
        for name, one in state.made.items()
    ]
    things = {"created": made, "matter": state.matter.snapshot()}
    return {"belief": {"revision": revision, **_beliefs(state, memory)}, "things": things}


def _beliefs(state: WorldState, memory: Memory) -> dict[str, Any]:
    reserve = state.away.intersection(NAMES)
    return {
        "made": [
            [one.name, one.iri, list(one.types), list(one.size or ()), dump(memory.first[one.name])]
            for one in memory.made.values()
        ],
        "gone": list(memory.gone),
        "time": memory.time,
        "poses": {name: dump(pose) for name, pose in state.poses.items() if pose != memory.first[name]},
        "held": {name: _held(grip) for name, grip in state.held.items()},
        "dropped": dict(memory.dropped),
        "refused": {name: [dump(offset) for offset in offsets] for name, offsets in memory.refused.items()},
        "taken": sorted(state.away - reserve),
        "unknown": list(memory.unknown),
        "recognition": {
            "stopped": list(memory.recognition.stopped),
            "classes": None if memory.recognition.classes is None else list(memory.recognition.classes),
        },
        "met": memory.met,
        "felt": [name for name in state.poses if name in NAMES and name not in reserve],
        "leaves": {leaf: value for leaf, value in state.joints.items() if value},
        "led": dict(state.led),
        "failing": dict(memory.failing),
        "neck": memory.neck,
        **({} if memory.grasp is None else {"grasp": memory.grasp}),
        "uncertain": sorted(memory.uncertain),
        **({"unseen": dict(memory.unseen)} if memory.unseen else {}),
        **({"estimates": dict(_estimated(memory))} if memory.estimates else {}),
        "witnessed": sorted(memory.witnessed),
        "known": {name: [one.source.value, one.time, one.moves] for name, one in memory.known.items()},
        "moves": memory.moves,
        "bound": [[dump(what), name] for what, name in memory.bound.items()],
        "meanings": [[dump(what), [list(one) for one in had]] for what, had in memory.meanings.items() if had],
        "in_vain": {name: [list(base) for base in bases] for name, bases in memory.in_vain.items()},
    }


def load_belief(
    snapshot: Mapping[str, Any], state: WorldState, memory: Memory, joints: Mapping[str, Articulation]
) -> tuple[WorldState, Memory, int]:
    """Restore what was believed by :func:`dump_belief`, in a run that begins with a state and a memory.

    Raises ValueError if it is damaged or belongs to another map.
    """
    try:
        left, things = snapshot["belief"], snapshot["things"]
        known = memory.first.keys() - memory.made.keys()
        made = dict(_made_of(things["created"], known))
        matter = Matter.of(things["matter"], (*known, *made))
        state, memory = _load(left, replace(state, made=made, matter=matter), memory, joints)
        return state, memory, int(left["revision"])
    except (KeyError, TypeError, AttributeError) as problem:
        raise ValueError(f"the state of the belief is damaged: {problem!r}") from None


def _load(
    left: Mapping[str, Any], state: WorldState, memory: Memory, joints: Mapping[str, Articulation]
) -> tuple[WorldState, Memory]:
    classes = left["recognition"]["classes"]
    memory = Memory(
        replace(
            memory.recognition,
            classes=None if classes is None else tuple(map(str, classes)),
            stopped=tuple(map(str, left["recognition"]["stopped"])),
        ),
        {name: pose for name, pose in memory.first.items() if name not in memory.made},
        known={
            name: Knowledge(Source(source), float(at), int(age)) for name, (source, at, age) in left["known"].items()
        },
        moves=int(left["moves"]),
        time=float(left["time"]),
        witnessed=frozenset(map(str, left["witnessed"])),
        in_vain={
            name: tuple((float(x), float(y), float(a)) for x, y, a in bases) for name, bases in left["in_vain"].items()
        },
        bound={load(what): name for what, name in left["bound"]},
        meanings={load(what): tuple(_meaning(*one) for one in had) for what, had in left["meanings"]},
        met=None if left["met"] is None else str(left["met"]),
        dropped={str(arm): str(name) for arm, name in left["dropped"].items()},
        failing={str(arm): int(times) for arm, times in left["failing"].items()},
        neck=int(left.get("neck", 0)),
        grasp=left.get("grasp"),
        uncertain=frozenset(map(str, left["uncertain"])),
        unseen={str(name): int(count) for name, count in left.get("unseen", {}).items()},
        estimates={str(name): _estimate(*one) for name, one in left.get("estimates", {}).items()},
        refused={str(name): tuple(map(_pose, offsets)) for name, offsets in left["refused"].items()},
    )
    for name, iri, types, size, pose in left["made"]:
        x, y, z = map(float, size)
        memory = memory.created(MapObject(str(iri), str(name), tuple(map(str, types)), None, (x, y, z)), _pose(pose))
    held = {name: _grip(*grip) for name, grip in left["held"].items()}
    named = {*left["poses"], *held, *left["taken"], *memory.bound.values(), *memory.dropped.values(), *left["felt"]}
    named |= {one.name for had in memory.meanings.values() for one in had}
    named |= {leaf for leaf in (*left["leaves"], *left["led"]) if leaf not in joints}
    _check_names({*named, *left["gone"]}, memory.first)
    poses = {**memory.first, **{name: _pose(pose) for name, pose in left["poses"].items()}}
    felt = {str(name): poses.pop(name) for name in left["felt"]}
    reserve = [name for name in NAMES if name in poses]
    poses |= felt  # at the end: the oldest obstacle comes first
    memory = replace(memory, unknown={str(name): poses.pop(name) for name in left["unknown"]})
    _check_names({rider for grip in held.values() for rider in grip.riders}, poses)
    for name in left["gone"]:
        memory = memory.destroyed(name)
        poses.pop(name, None)
        held.pop(name, None)
    return replace(
        state,
        poses=poses,
        joints={leaf: joint.within(float(left["leaves"].get(leaf, 0.0))) for leaf, joint in joints.items()},
        led={leaf: str(link) for leaf, link in left["led"].items()},
        held=held,
        touched={},
        away=frozenset((*reserve, *left["taken"])),
    ), memory


def changed_since(start: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any]:
    """Select the entries of a snapshot that differ from those of an earlier one; of tables in it likewise."""
    changed: dict[str, Any] = {}
    for key, value in now.items():
        if value != start[key]:
            is_table = isinstance(value, dict)
            changed[key] = (
                {one: what for one, what in value.items() if what != start[key].get(one)} if is_table else value
            )
    return changed


def with_changes(start: Mapping[str, Any], changed: Mapping[str, Any]) -> dict[str, Any]:
    """Restore a whole snapshot from :func:`changed_since`."""
    return {
        key: {**value, **changed.get(key, {})} if isinstance(value, dict) else changed.get(key, value)
        for key, value in start.items()
    }


def _check_names(named: set[str], known: Mapping[str, object]) -> None:
    if unknown := named - known.keys():
        raise ValueError(f"the map has no {', '.join(sorted(unknown))}")


def _held(grip: Grip) -> list[Any]:
    return [[[hand.arm, hand.link, dump(hand.offset)] for hand in grip.hands], dump(grip.before), list(grip.riders)]


def _grip(hands: Sequence[Any], before: object, riders: Sequence[object]) -> Grip:
    first, *others = (Hold(str(arm), str(link), _pose(offset)) for arm, link, offset in hands)
    return Grip(*first, _pose(before), tuple(others), tuple(map(str, riders)))


def _estimated(memory: Memory) -> Iterator[tuple[str, list[Any]]]:
    for name, one in memory.estimates.items():
        yield name, [dump(one.pose), one.deviation, one.angle_deviation]


def _estimate(pose: object, deviation: object, angle_deviation: object) -> Estimate:
    return Estimate(_pose(pose), *_numbers([deviation, angle_deviation], 2))


def _meaning(occasion: str, step: str, aim: str, name: str, served: bool) -> Meaning:
    return Meaning(str(occasion), str(step), str(aim), str(name), bool(served))


def _pose(state: object) -> Pose:
    pose = load(state)
    if not isinstance(pose, Pose):
        raise ValueError(f"a pose is expected, not {pose!r}")
    return pose


def _made_of(left: Any, known: Collection[str]) -> Iterator[tuple[str, Made]]:
    for name, type, _, size, pose in left:
        if not isinstance(name, str) or name in known:
            raise ValueError(f"{name!r} is no name for a created body, or is already in use")
        x, y, z = _numbers(size, 3)
        if min(x, y, z) <= 0:
            raise ValueError(f"expected a size, got {size!r}")
        yield name, Made(str(type), (x, y, z), _unit_pose(pose))


def _unit_pose(left: object) -> Pose:
    x, y, z, a, b, c, d = _numbers(left, 7)
    if abs(math.hypot(a, b, c, d) - 1.0) > UNIT:
        raise ValueError(f"expected a unit quaternion, got {[a, b, c, d]!r}")
    return Pose((x, y, z), (a, b, c, d))


def _numbers(left: object, count: int) -> list[float]:
    if not isinstance(left, list) or len(left) != count:
        raise ValueError(f"expected {count} numbers, got {left!r}")
    if not all(type(value) in (int, float) and math.isfinite(value) for value in left):
        raise ValueError(f"expected finite numbers, got {left!r}")
    if any(abs(value) > FARTHEST for value in left):
        raise ValueError(f"expected numbers up to {FARTHEST:g}, got {left!r}")
    return left
