"""The robot's belief about where objects are: poses of the map at first, then what it saw, felt and did itself."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from executive.belief.knowledge import Knowledge, Source
from executive.belief.known_things import KnownThings, ignore
from executive.belief.obstacles import NAMES
from executive.maps.semantic_map import MapObject
from planlang.geometry import Pose
from planlang.protocols import Configuration, Detection
from planlang.runs.codec import dump, load
from planlang.state import Grip, Hold, WorldState
from planlang.state.matter import OFF, without
from sim import WorldMirror
from sim.leaves import inside

MOVED = 0.002
"""Distance of a seen object from its believed position up to which it counts as not moved [m]."""
TURNED = 0.01
"""The same limit for its rotation [rad]."""
RESTING = 0.02
"""Distance between the bottom of an object and the top of another up to which it stands on that [m]."""


class Belief(KnownThings):
    """Believed poses of the objects of a map. Only sensing and acting change it."""

    # Updates

    def see(self, detections: Iterable[Detection]) -> None:
        """Move the recognised objects to the poses at which the camera detected them."""
        for detection in detections:
            if detection.name in self.unknown:
                self._find_out(detection.name)
            if detection.name in self._poses and detection.name not in self.carried():
                self._know(detection.name, Source.SEEN)
                self._in_vain.pop(detection.name, None)
                self._put(detection.name, detection.pose, "seen")
                self._read(detection)

    def _read(self, detection: Detection) -> None:
        """Take over the state that a seen leaf or device shows."""
        if detection.name in self._moving:
            self._witnessed.add(self._moving[detection.name])
        if detection.state is not None:
            self._witnessed.add(detection.name)
            if self.state.matter.states.get(detection.name, OFF) != detection.state:
                self._become(matter=self.state.matter.switched(detection.name, detection.state))
                self._changed("seen", name=detection.name, state=detection.state)

    def touched(self, leaf: str, value: float) -> None:
        """Record the position of a leaf's joint that a hand feels at its handle [rad, m]."""
        self.moved(leaf, value, "felt")
        self._witnessed.add(leaf)

    def doubted(self, name: str) -> None:
        """Record that the state of a leaf or device may have changed, so that it has to be looked at again."""
        self._witnessed.discard(name)

    def _find_out(self, name: str) -> None:
        self._become(poses={**self._poses, name: self.unknown.pop(name)})
        self._changed("found", name=name)

    def not_seen(self, name: str, base: tuple[float, float, float]) -> None:
        """Record that an object was looked for from a base pose and not seen."""
        self._in_vain.setdefault(name, []).append(base)
        self._changed("not_seen", name=name, base=base)

    def not_there(self, name: str) -> None:
        """Record that an object is not at its believed pose, so that its place is unknown."""
        self.unknown[name] = self._poses[name]
        self._become(poses=without(self._poses, name))
        for table in (self._known, self._in_vain):
            table.pop(name, None)
        self._bound = {what: meant for what, meant in self._bound.items() if meant != name}
        self._changed("not there", name=name)

    def missed(self, name: str, arm: str, base: tuple[float, float, float]) -> None:
        """Record that a hand closed on nothing where an object was believed to be."""
        self.dropped[arm] = name
        self.not_seen(name, base)

    def bump(self, name: str, pose: Pose) -> None:
        """Record that the robot touched an object, which must be about at ``pose``; it has to be looked at again."""
        self._know(name, Source.FELT)
        if name in self._moving:
            self.doubted(self._moving[name])
        self._put(name, pose, "felt")

    def obstacle(self, pose: Pose, called: str | None = None) -> None:
        """Record that the robot touched something unknown; failures name it ``called``, if that is given.

        Once all obstacles of the pool are used, the oldest one is moved.
        """
        pool = [name for name in self._poses if name in NAMES]
        if not pool:
            return
        name = next(iter(self._absent), pool[0])
        self._absent.pop(name, None)
        self.met = called or name
        self._become(poses={**without(self._poses, name), name: pose})  # at the end: the oldest obstacle comes first
        self._changed("felt", name=name, pose=pose)

    def forget(self, obstacles: Collection[str]) -> None:
        """Return obstacles to the pool, because a known body explains the touch."""
        for name in obstacles:
            self._absent[name] = None
            self._become()
            self._changed("explained", name=name)
        if obstacles and not any(name in NAMES for name in self.names()):
            self.met = None

    def moved(self, leaf: str, value: float, how: str = "moved") -> None:
        """Record the position of a leaf's joint [rad, m]; its parts and the objects inside it move with it."""
        value = self.joints[leaf].within(value)
        if value != self.joint(leaf):
            self.state = self.with_leaf(leaf, value)
            self._changed(how, name=leaf, value=value)

    def leads(self, leaf: str, link: str) -> None:
        """Record that a hand has closed on a leaf's handle, so that they move together."""
        self._become(led={**self.led, leaf: link})
        self._witnessed.add(leaf)
        self._changed("leads", name=leaf, link=link)

    def let_go(self, leaf: str) -> None:
        """Record that a hand has released a leaf, which stays where it is."""
        if leaf in self.led:
            self._become(led=without(self.led, leaf))
            self._changed("let go", name=leaf)

    def observed(self, configuration: Configuration, mirror: WorldMirror) -> None:
        """Take over the configuration that the robot's encoders tell; leaves in a hand are where the hand is.

        ``mirror`` computes where, and takes over all grips before the robot moves in it: what a held thing touches is
        found out where the hand has closed on it.
        """
        world = mirror.at(self.state)
        leaves, touched = world.led_joints(configuration), world.still_touched(configuration)
        for leaf, value in leaves.items():
            self.moved(leaf, value, "led")
        if configuration != self.state.robots[self.robot]:
            self._become(robots={**self.state.robots, self.robot: configuration}, touched=touched)

    def base_moved(self) -> None:
        """Record that the base has moved, so that objects must be looked at again before they are manipulated."""
        self._moves += 1

    def grasped(self, name: str, arm: str, link: str, offset: Pose) -> None:
        """Record that a hand has grasped an object, in addition to hands that hold it already."""
        self._taken.discard(name)
        self.dropped.pop(arm, None)
        self.dropped = {arm: dropped for arm, dropped in self.dropped.items() if dropped != name}
        grip = self.held.get(name)
        if grip is None or arm in grip.arms:
            grip = Grip(arm, link, offset, self._poses[name])
        else:
            grip = replace(grip, others=(*grip.others, Hold(arm, link, offset)))
        self._become(held={**self.held, name: grip})
        self._changed("grasped", name=name, arm=arm)

    def loaded(self, name: str, riders: Iterable[str]) -> None:
        """Record that objects stand on a held one and move with it."""
        self._become(held={**self.held, name: replace(self.held[name], riders=tuple(riders))})

    def released(self, name: str, pose: Pose, *, to: str | None = None) -> None:
        """Record that an object was released: to a person, or to rest at ``pose`` with the objects on it."""
        self._came_down(name, pose)
        self.refused.pop(name, None)
        if to is not None:
            self._taken.add(name)
            self._become()
        self._changed("released", name=name, pose=pose, to=to)

    def pushed(self, name: str, pose: Pose) -> None:
        """Record that a hand has pushed an object to a pose."""
        self._know(name, Source.DONE)
        self._put(name, pose, "pushed")

    def refuse(self, name: str, grip: Grip) -> None:
        """Rule out a grip of an object for later grasps, until the object is released from another grip."""
        self.refused.setdefault(name, []).extend(hand.offset for hand in grip.hands)
        self._changed("grip refused", name=name)

    def lost(self, name: str, pose: Pose) -> None:
        """Record that an object has slipped out of the hand; it is assumed to have fallen to ``pose``."""
        self.dropped |= dict.fromkeys(self.held[name].arms, name)
        self._came_down(name, pose)
        self._changed("lost", name=name, pose=pose)

    def _came_down(self, name: str, pose: Pose) -> None:
        grip = self.held.get(name)
        motion = pose @ self._poses[name].inverse()
        down = {name: pose, **{one: motion @ self._poses[one] for one in (grip.riders if grip is not None else ())}}
        touched = {one: bodies for one, bodies in self.state.touched.items() if one not in down}
        self._become(poses={**self._poses, **down}, held=without(self.held, name), touched=touched)
        for one in down:
            self._know(one, Source.DONE)

    def happened(self, state: WorldState) -> None:
        """Go on to a state that effects of an action, heat or flow have led to; what it means is recorded apart."""
        for name in (name for name in state.made if state.there(name) and name not in self._first):
            self._first[name], self._boxes[name] = state.poses[name], state.made[name].size
        self.state = state

    def came_to_be(self, thing: MapObject, pose: Pose) -> None:
        """Record that an object was created."""
        self._make(thing, pose)
        self._changed("created", name=thing.name, pose=pose)

    def _make(self, thing: MapObject, pose: Pose) -> None:
        self.made[thing.name] = thing
        self._first[thing.name] = pose
        self._become(poses={**self._poses, thing.name: pose})
        self._boxes[thing.name] = thing.size or (0.0, 0.0, 0.0)

    def destroyed(self, name: str) -> None:
        """Record that an object no longer exists; its designators may be bound to others."""
        self._lose(name)
        self._changed("destroyed", name=name)

    def _lose(self, name: str) -> None:
        self._gone[name] = None
        self._known.pop(name, None)
        self._become(poses=without(self._poses, name), held=without(self.held, name))
        self._bound = {what: meant for what, meant in self._bound.items() if meant != name}

    def turned_over(self, name: str, pose: Pose) -> None:
        """Record that an object has been turned over."""
        self._become(poses={**self._poses, name: pose})
        self._changed("turned over", name=name, pose=pose)

    def switched(self, name: str, state: str) -> None:
        """Record the state of a device, or of an object that was mixed or cleaned."""
        self._witnessed.add(name)
        self._changed("switched", name=name, state=state)

    def poured(self, source: str, target: str, amount: float) -> None:
        """Record that an amount [ml] was poured out of one object into or onto another."""
        self._changed("poured", name=source, into=target, amount=amount)

    def _know(self, name: str, source: Source) -> None:
        self._known[name] = Knowledge(source, self.time, self._moves)

    def _put(self, name: str, pose: Pose, how: str) -> None:
        before = self._poses[name]
        if name in self._moving:
            leaf = self._moving[name]
            value = self.joints[leaf].value_of(self._first[name], pose)
            joint, known = self.joints[leaf], self.joint(leaf)
            same = joint.is_shut(value) is joint.is_shut(known) and joint.is_open(value) is joint.is_open(known)
            if abs(value - known) > TURNED or not same:
                self.moved(leaf, value, how)
            return
        if pose.distance(before) <= MOVED and pose.turn(before) <= TURNED:
            return
        riders = self._riders(name)
        self._become(poses={**self._poses, name: pose})
        self._changed(how, name=name, pose=pose)
        for rider in riders:
            self._become(poses={**self._poses, rider: pose @ before.inverse() @ self._poses[rider]})
            self._changed("went along", name=rider, pose=self._poses[rider])

    def _riders(self, name: str) -> list[str]:
        """Find the objects that stand on one, directly or stacked, and whose poses are only known from the map.

        They are assumed to move with it.
        """
        stack, loose = [name], [other for other in self._boxes if self._is_loose(other)]
        for support in (one for one in stack if one in self._boxes):  # grows in the loop: objects may be stacked
            x, y, z = self._boxes[support]
            to_support = self._poses[support].inverse()
            for other in (one for one in loose if one not in stack):
                bottom = to_support @ self._poses[other] @ Pose((0.0, 0.0, -self._boxes[other][2] / 2))
                ahead, aside, above = bottom.position
                if abs(ahead) <= x / 2 and abs(aside) <= y / 2 and abs(above - z / 2) <= RESTING:
                    stack.append(other)
        return stack[1:]

    def _is_loose(self, name: str) -> bool:
        """Check whether the pose of an object is only known from the map."""
        elsewhere = name in self.joints or name in self.held or name in self._taken or name not in self._poses
        return not elsewhere and self.knowledge(name).source in (Source.MAP, Source.TOLD)

    def _become(self, **changes: Any) -> None:
        """Go on to another state: the last one with other tables."""
        self.state = replace(self.state, away=frozenset((*self._absent, *self._taken)), **changes)

    def _changed(self, how: str, **details: Any) -> None:
        self.revision += 1
        self.tell("belief", {"revision": self.revision, "change": how, **details})

    # Snapshots

    def snapshot(self) -> dict[str, Any]:
        """Convert the belief to JSON; poses that equal the map's are left out."""
        moved = {name: dump(pose) for name, pose in self._poses.items() if pose != self._first[name]}
        made = [
            [one.name, one.iri, list(one.types), list(one.size or ()), dump(self._first[one.name])]
            for one in self.made.values()
        ]
        held = {
            name: [
                [[hand.arm, hand.link, dump(hand.offset)] for hand in grip.hands],
                dump(grip.before),
                list(grip.riders),
            ]
            for name, grip in self.held.items()
        }
        return {
            "revision": self.revision,
            "made": made,
            "gone": list(self._gone),
            "time": self.time,
            "poses": moved,
            "held": held,
            "dropped": dict(self.dropped),
            "refused": {name: [dump(offset) for offset in offsets] for name, offsets in self.refused.items()},
            "taken": sorted(self._taken),
            "unknown": list(self.unknown),
            "recognition": self.recognition.snapshot(),
            "met": self.met,
            "felt": [name for name in self._poses if name in NAMES and name not in self._absent],
            "leaves": {leaf: value for leaf, value in self.state.joints.items() if value},
            "led": dict(self.led),
            **({"witnessed": sorted(self._witnessed)} if self._witnessed else {}),
            "known": {name: [one.source.value, one.time, one.moves] for name, one in self._known.items()},
            "moves": self._moves,
            "bound": [[dump(what), name] for what, name in self._bound.items()],
            "in_vain": {name: [list(base) for base in bases] for name, bases in self._in_vain.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the belief of :meth:`snapshot`. Raises ValueError if it is malformed or belongs to another map."""
        try:
            dropped = {str(arm): str(name) for arm, name in state["dropped"].items()}
            unknown = {*state["poses"], *state["held"], *state["taken"], *(name for _, name in state["bound"])}
            unknown |= {leaf for leaf in (*state["leaves"], *state["led"]) if leaf not in self.joints}
            unknown |= {*dropped.values(), *state["felt"]}
            for name in self.made:
                del self._first[name], self._boxes[name]
            self.made, self._gone = {}, {}
            self._become(poses=dict(self._first))
            for name, iri, types, size, pose in state["made"]:
                x, y, z = map(float, size)
                one = MapObject(str(iri), str(name), tuple(map(str, types)), None, (x, y, z))
                self._make(one, _pose(pose))
            unknown |= set(state["gone"])
            if not unknown <= self._poses.keys():
                raise ValueError(f"the map has no {', '.join(sorted(unknown - self._poses.keys()))}")
            self.time = float(state["time"])
            values = {leaf: float(state["leaves"].get(leaf, 0.0)) for leaf in self.joints}
            joints = {leaf: self.joints[leaf].within(value) for leaf, value in values.items()}
            led = {leaf: str(link) for leaf, link in state["led"].items()}
            self._witnessed = set(map(str, state.get("witnessed", ())))
            poses = {**self._first, **{name: _pose(pose) for name, pose in state["poses"].items()}}
            felt = {str(name): poses.pop(name) for name in state["felt"]}
            placed = {**poses, **felt}
            self.unknown = {str(name): placed.pop(name) for name in state["unknown"]}
            self.recognition.restore(state["recognition"])
            self._absent = {name: None for name in NAMES if name in poses}
            self.met = None if state["met"] is None else str(state["met"])
            held = {name: _grip(*grip) for name, grip in state["held"].items()}
            if unknown := {rider for grip in held.values() for rider in grip.riders} - placed.keys():
                raise ValueError(f"the map has no {', '.join(sorted(unknown))}")
            self.dropped = dropped
            refused = state["refused"].items()
            self.refused = {str(name): [_pose(offset) for offset in offsets] for name, offsets in refused}
            self._taken, self._moves = set(state["taken"]), int(state["moves"])
            self._become(poses=placed, joints=joints, led=led, held=held, touched={})
            self._known = {
                name: Knowledge(Source(source), float(time), int(moves))
                for name, (source, time, moves) in state["known"].items()
            }
            self._bound = {load(what): name for what, name in state["bound"]}
            self._in_vain = {
                name: [(float(x), float(y), float(yaw)) for x, y, yaw in bases]
                for name, bases in state["in_vain"].items()
            }
            self.revision = int(state["revision"])
            for name in state["gone"]:
                self._lose(name)
        except (KeyError, TypeError, AttributeError) as problem:
            raise ValueError(f"the state of the belief is damaged: {problem!r}") from None

    # Hypotheses

    def supposing(self, state: WorldState) -> Belief:
        """Make a belief of another state, with the same knowledge of where facts come from; nobody is told of it.

        Bodies without a pose there are unknown. Designators that it binds are bound for it alone.
        """
        other = copy(self)
        other.state, other.tell, other._bound = state, ignore, dict(self._bound)
        other.unknown = self.unknown | {name: pose for name, pose in self._poses.items() if name not in state.poses}
        return other

    def with_leaf(self, leaf: str, value: float) -> WorldState:
        """Make the state with a leaf's joint at a position [rad, m]; its parts and the objects inside move with it."""
        joint, value = self.joints[leaf], self.joints[leaf].within(value)
        elsewhere = {*self.joints, *self.held, *self._taken}
        loose = [name for name in self._boxes if name in self._poses and name not in elsewhere]
        before, places = self._poses[leaf], np.array([self._poses[name].position for name in loose]).reshape(-1, 3)
        within = np.flatnonzero(inside(before, self._boxes[leaf], places)).tolist()
        offsets = {loose[index]: before.inverse() @ self._poses[loose[index]] for index in within}
        motion = joint.motion(value)
        parts = {name: motion @ self._first[name] if value else self._first[name] for name in joint.bodies}
        contents = {name: parts[leaf] @ offset for name, offset in offsets.items()}
        poses, joints = {**self._poses, **parts, **contents}, {**self.state.joints, leaf: value}
        return replace(self.state, poses=poses, joints=joints)


def _grip(hands: Sequence[Any], before: object, riders: Sequence[object]) -> Grip:
    first, *others = (Hold(str(arm), str(link), _pose(offset)) for arm, link, offset in hands)
    return Grip(*first, _pose(before), tuple(others), tuple(map(str, riders)))


def _pose(state: object) -> Pose:
    pose = load(state)
    if not isinstance(pose, Pose):
        raise ValueError(f"a pose is expected, not {pose!r}")
    return pose
