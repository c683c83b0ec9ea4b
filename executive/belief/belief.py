"""The robot's belief about where objects are: poses of the map at first, then what it saw, felt and did itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from executive.belief.estimates import Estimate, leaf_value
from executive.belief.known_things import KnownThings, ignore
from executive.belief.lookalikes import ShouldShow, look_alikes
from executive.belief.memory import MOST_FAILURES, VISION, BasePose, Recognition, Source
from executive.belief.obstacles import NAMES
from executive.belief.snapshots import dump_belief, load_belief
from executive.maps.classes import MapObject
from planlang.changes import Change, Poured, Switched, TurnedOver
from planlang.geometry import Pose
from planlang.ontology import expand, shorten
from planlang.protocols import Configuration, Detection
from planlang.state import Grip, Hold, Made, WorldState
from planlang.state.matter import OFF, without
from sim import WorldMirror
from sim.leaves import contents

MOVED = 0.002
"""Distance of a seen object from its believed position up to which it counts as not moved [m]."""
TURNED = 0.01
"""The same limit for its rotation [rad]."""
RESTING = 0.02
"""Distance between the bottom of an object and the top of another up to which it stands on that [m]."""
LEAST_NOTICED = 0.1
"""Visible share from which on a thing that no map has is believed."""
AtRest = Callable[[str, Estimate], Pose]
"""Makes of the estimate of a thing's pose the one in which it stands on what is below."""


def as_seen(name: str, seen: Estimate) -> Pose:
    """Leave a thing where it is seen."""
    return seen.pose


def nothing(names: Collection[str]) -> Collection[str]:
    """Expect nothing of a picture."""
    return ()


class Belief(KnownThings):
    """Believed poses of the objects of a map. Only sensing and acting change it."""

    in_doubt: tuple[str, ...] = ()
    """Things that the last picture should have shown and did not, of which a further picture decides."""

    # Updates

    def see(
        self,
        detections: Iterable[Detection],
        should_show: ShouldShow = nothing,
        in_hands: Mapping[str, Pose] = MappingProxyType({}),
        at_rest: AtRest = as_seen,
    ) -> dict[str, Detection]:
        """Take over what the camera recognises; return the things that it is taken for, in the order of the map.

        A thing moves to where it is seen. What can be no known thing becomes a new one. ``should_show`` selects of some
        things those that the picture would show if they were where they are believed to be; ``in_hands`` has the poses
        of what hands carry. What a camera that errs tells is averaged, and put down by ``at_rest``.
        """
        self.in_doubt = ()
        visible = [one for one in detections if self.memory.recognition.runs(VISION)]
        names = self._associator.names(visible, in_hands)
        doubted = [name for name in self._rivals(visible, names) if name not in self.memory.uncertain]
        if doubted and (missing := self._surely_missing(sorted(should_show(doubted)))):
            self.memory = replace(self.memory, uncertain=self.memory.uncertain.union(missing))
            for name in missing:
                self._changed("not where expected", name=name)
            names = self._associator.names(visible, in_hands)
        found = dict[str, Detection]()
        for detection, shown in zip(visible, names, strict=True):
            if shown is None and self._is_noticed(detection):
                found[self._notice(detection)] = detection
            elif shown is not None and self.recognises(shown):
                found[shown] = detection
        order = {name: number for number, name in enumerate(self.memory.first)}
        found = {name: found[name] for name in sorted(found, key=lambda name: order[name])}
        self._tell_alike(found, should_show)
        for name, detection in found.items():
            self._sees(name, detection, at_rest)
        self._recognise_noticed(found, at_rest)
        return found

    def _tell_alike(self, found: Mapping[str, Detection], should_show: ShouldShow) -> None:
        """Tell by what the things that plans mean were taken, if the picture shows others that look alike."""
        self._alike = look_alikes(found, self._associator, self.state, self.memory, should_show)
        for name, one in self._alike.items():
            if not all(self.seen(other) for other in (name, *one.others) if other in found):
                self.tell("belief", {"revision": self.revision, **one.as_change()})

    def _sees(self, name: str, detection: Detection, at_rest: AtRest) -> None:
        if name in self.memory.unknown:
            self._find_out(name)
        if name in self._poses and name not in self.state.carried():
            seen = self.memory.learned((name,), Source.SEEN)
            self.memory = replace(seen, in_vain=without(seen.in_vain, name), unseen=without(seen.unseen, name))
            self._put(name, self._where(name, detection, at_rest), "seen")
            self._read(name, detection)

    def _where(self, name: str, detection: Detection, at_rest: AtRest) -> Pose:
        """Find the pose of a thing by a detection and by what has been seen of it before."""
        seen, believed = Estimate.of(detection), self._poses[name]
        if seen.is_exact:
            return seen.pose
        if name in self._moving:
            joint, closed = self.joints[self._moving[name]], self.memory.first[name]
            return joint.motion(leaf_value(joint, closed, self.joint(joint.leaf), seen)) @ closed
        known = self.memory.estimates.get(name) or (Estimate(believed) if name in self._fixed else None)
        now = known.fused(seen) if known is not None and known.agrees(seen) else seen
        if now.is_exact:
            return believed
        self.memory = replace(self.memory, estimates={**self.memory.estimates, name: now})
        rests = replace(now, pose=at_rest(name, now))
        return believed if rests.is_like(believed, MOVED, TURNED) else rests.pose

    def _surely_missing(self, names: list[str]) -> list[str]:
        """List the things that enough pictures in a row have not shown, of those that the present one should show."""
        enough = self.camera_noise.pictures
        if enough == 1 or not names:
            return names
        counts = {name: self.memory.unseen.get(name, 0) + 1 for name in names}
        self.in_doubt = tuple(name for name in names if counts[name] < enough)
        self.memory = replace(self.memory, unseen={**self.memory.unseen, **counts})
        return [name for name in names if counts[name] >= enough]

    def corrected(self, name: str, pose: Pose) -> None:
        """Record where a thing must be that the camera has shown, as other sensors tell."""
        self._put(name, pose, "seen")

    def _rivals(self, detections: Sequence[Detection], names: Sequence[str | None]) -> list[str]:
        """List things that unexplained detections, or those of things that no map has, might show instead.

        Only of things that are where the robot knows no better.
        """
        strange = (one for one, name in zip(detections, names, strict=True) if name is None or self.is_noticed(name))
        fitting = (name for one in strange for name in self._associator.fitting(one))
        elsewhere = {*names, *self.state.away, *self.state.carried(), *self.memory.unknown, *self._moving}
        return [one for one in dict.fromkeys(fitting) if one in self._poses and one not in elsewhere]

    def is_noticed(self, name: str) -> bool:
        """Check whether a thing is one that no map has, and that the camera has shown."""
        return "#" in name and name in self.memory.made

    def _is_noticed(self, detection: Detection) -> bool:
        """Check whether a detection that can be no known thing makes one known: of its class, or of a superclass."""
        is_known = self.memory.recognition.may_recognise([expand(detection.type)])
        return (
            bool(detection.type)
            and is_known
            and detection.visible >= LEAST_NOTICED
            and not self._associator.is_part(detection)
        )

    def _notice(self, detection: Detection) -> str:
        """Believe a thing that no map has where a detection shows it, and name it."""
        name = self._associator.new_name(detection.type)
        types = self.known_types(expand(detection.type))
        thing = MapObject(self.new_iri(name.replace("#", "_")), name, types, None, detection.size)
        made = Made(shorten(detection.type), detection.size, detection.pose)
        self.memory = self.memory.created(thing, detection.pose)
        self._become(made={**self.state.made, name: made}, poses={**self._poses, name: detection.pose})
        self._changed("noticed", name=name, pose=detection.pose)
        return name

    def _recognise_noticed(self, found: Mapping[str, Detection], at_rest: AtRest) -> None:
        """Take things that no map has, and that this picture shows, for those of the map that are at no known place."""
        for name in [one for one in found if self.is_noticed(one)]:
            lost = (one for one in self._associator.fitting(found[name]) if one not in found)
            meant = next((one for one in lost if one in self.memory.unknown or one in self.memory.uncertain), None)
            if meant is None:
                continue
            self.memory = self.memory.destroyed(name)
            self._become(poses=without(self._poses, name))
            self._changed("recognised", name=meant, instead_of=name)
            self._sees(meant, found[name], at_rest)

    def _read(self, name: str, detection: Detection) -> None:
        """Take over the state that a seen leaf or device shows."""
        if name in self._moving:
            self.memory = self.memory.witnesses(self._moving[name])
        if detection.state is not None:
            self.memory = self.memory.witnesses(name)
            if self.state.matter.states.get(name, OFF) != detection.state:
                self._become(matter=self.state.matter.switched(name, detection.state))
                self._changed("seen", name=name, state=detection.state)

    def touched(self, leaf: str, value: float) -> None:
        """Record the position of a leaf's joint that a hand feels at its handle [rad, m]."""
        self.moved(leaf, value, "felt")
        self.memory = self.memory.witnesses(leaf)

    def doubted(self, name: str) -> None:
        """Record that the state of a leaf or device may have changed, so that it has to be looked at again."""
        self.memory = replace(self.memory, witnessed=self.memory.witnessed - {name})

    def _find_out(self, name: str) -> None:
        self._become(poses={**self._poses, name: self.memory.unknown[name]})
        self.memory = replace(self.memory, unknown=without(self.memory.unknown, name))
        self._changed("found", name=name)

    def not_seen(self, name: str, base: BasePose) -> None:
        """Record that an object was looked for from a base pose and not seen."""
        in_vain = self.memory.in_vain
        self.memory = replace(self.memory, in_vain={**in_vain, name: (*in_vain.get(name, ()), base)})
        self._changed("not_seen", name=name, base=base)

    def not_there(self, name: str) -> None:
        """Record that an object is not at its believed pose, so that its place is unknown."""
        lost, unknown = self.memory.without_place(name), {**self.memory.unknown, name: self._poses[name]}
        self.memory = replace(lost, unknown=unknown, in_vain=without(lost.in_vain, name))
        self._become(poses=without(self._poses, name))
        self._changed("not there", name=name)

    def missed(self, name: str, arm: str, base: BasePose) -> None:
        """Record that a hand closed on nothing where an object was believed to be."""
        self.memory = self.memory.dropping(name, (arm,))
        self.not_seen(name, base)

    def bump(self, name: str, pose: Pose) -> None:
        """Record that the robot touched an object, which must be about at ``pose``; it has to be looked at again."""
        self.memory = self.memory.learned((name,), Source.FELT)
        if name in self._moving:
            self.doubted(self._moving[name])
        self._put(name, pose, "felt")

    def felt(self, name: str, pose: Pose) -> None:
        """Record that a hand has felt for an object, and found it at ``pose``: it need not be looked at again."""
        self.memory = self.memory.found(name, Source.FELT)
        self._put(name, pose, "felt")

    def obstacle(self, pose: Pose) -> None:
        """Record that the robot touched something unknown; once all of the pool are used, the oldest one is moved."""
        pool = [name for name in self._poses if name in NAMES]
        if not pool:
            return
        name = next((name for name in pool if name in self.state.away), pool[0])
        self.memory = replace(self.memory, met=name)
        poses = {**without(self._poses, name), name: pose}  # at the end: the oldest obstacle comes first
        self._become(poses=poses, away=self.state.away - {name})
        self._changed("felt", name=name, pose=pose)

    def forget(self, obstacles: Collection[str]) -> None:
        """Return obstacles to the pool, because a known body explains the touch."""
        for name in obstacles:
            poses = {**without(self._poses, name), name: self._poses[name]}  # it is the last to be used again
            self._become(poses=poses, away=self.state.away | {name})
            self._changed("explained", name=name)
        if obstacles and not any(name in NAMES for name in self.names()):
            self.memory = replace(self.memory, met=None)

    def moved(self, leaf: str, value: float, how: str = "moved") -> None:
        """Record the position of a leaf's joint [rad, m]; its parts and the objects inside it move with it."""
        value = self.joints[leaf].within(value)
        if value != self.joint(leaf):
            self.state = self.with_leaf(leaf, value)
            self._changed(how, name=leaf, value=value)

    def leads(self, leaf: str, link: str) -> None:
        """Record that a hand has closed on a leaf's handle, so that they move together."""
        self._become(led={**self.led, leaf: link})
        self.memory = self.memory.witnesses(leaf)
        self._changed("leads", name=leaf, link=link)

    def let_go(self, leaf: str, how: str = "let go") -> None:
        """Record that a hand leads a leaf no more, which stays where it is; ``how``: as it wants, or not."""
        if leaf in self.led:
            self._become(led=without(self.led, leaf))
            self._changed(how, name=leaf)

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
        self.memory = replace(self.memory, moves=self.memory.moves + 1)

    def hand_failed(self, arm: str) -> None:
        """Record that the fingers of an arm did not reach their goal, or that they missed or lost a thing."""
        before = self.memory
        self.memory = replace(before, failing={**before.failing, arm: before.failing.get(arm, 0) + 1})
        if self.memory.given_up != before.given_up:
            self._changed("given up", name=f"hand of {arm}")

    def neck_failed(self) -> None:
        """Record that the neck stopped before the camera pointed where it should."""
        before = self.memory.neck_given_up
        self.memory = replace(self.memory, neck=self.memory.neck + 1)
        if self.memory.neck_given_up != before:
            self._changed("given up", name="neck")

    def neck_arrived(self) -> None:
        """Record that the neck has moved as commanded."""
        if self.memory.neck:
            self.memory = replace(self.memory, neck=0)

    def prefer(self, others: Iterable[str], grasp: str | None) -> None:
        """Give up the hands of ``others`` from the start, and take things by grasps of a class, if that does."""
        self.memory = replace(self.memory, failing=dict.fromkeys(others, MOST_FAILURES), grasp=grasp)

    def rely_on_all_hands(self) -> bool:
        """Forget which hands were given up, and the preferred grasp, as the others did not do; False without any."""
        for arm in (given_up := self.memory.given_up):
            self.memory = replace(self.memory, failing=without(self.memory.failing, arm))
            self._changed("tried again", name=f"hand of {arm}")
        grasp = self.memory.grasp
        if grasp is not None:
            self.memory = replace(self.memory, grasp=None)
            self._changed("tried again", name=f"other grasps than {grasp}")
        return bool(given_up) or grasp is not None

    def grasped(self, name: str, arm: str, link: str, offset: Pose) -> None:
        """Record that a hand has grasped an object, in addition to hands that hold it already."""
        dropped = {one: lost for one, lost in self.memory.dropped.items() if one != arm and lost != name}
        self.memory = replace(self.memory, dropped=dropped, failing=without(self.memory.failing, arm))
        self.state = self.state.gripped(name, Hold(arm, link, offset))
        self._changed("grasped", name=name, arm=arm)

    def loaded(self, name: str, riders: Iterable[str]) -> None:
        """Record that objects stand on a held one and move with it."""
        self._become(held={**self.held, name: replace(self.held[name], riders=tuple(riders))})

    def released(self, name: str, pose: Pose, *, to: str | None = None) -> None:
        """Record that an object was released at ``pose``: into a person's hand, or to rest with the objects on it."""
        self._came_down(name, pose)
        self.memory = replace(self.memory, refused=without(self.memory.refused, name))
        if to is not None:
            self._become(away=self.state.away | {name})
        self._changed("released", name=name, pose=pose, to=to)

    def pushed(self, name: str, pose: Pose) -> None:
        """Record that a hand has pushed an object to a pose."""
        self.memory = self.memory.learned((name,), Source.DONE)
        self._put(name, pose, "pushed")

    def refuse(self, name: str, grip: Grip) -> None:
        """Rule out a grip of an object for later grasps, until the object is released from another grip."""
        offsets = (*self.memory.refused.get(name, ()), *(hand.offset for hand in grip.hands))
        self.memory = replace(self.memory, refused={**self.memory.refused, name: offsets})
        self._changed("grip refused", name=name)

    def lost(self, name: str, pose: Pose) -> None:
        """Record that an object is no longer in a hand of the robot, or of who took it, but has fallen, to ``pose``."""
        self.memory = self.memory.dropping(name, self.held[name].arms if name in self.held else ())
        self._become(away=self.state.away - {name})
        self._came_down(name, pose)
        self._changed("lost", name=name, pose=pose)

    def _came_down(self, name: str, pose: Pose) -> None:
        grip = self.held.get(name)
        motion = pose @ self._poses[name].inverse()
        down = {name: pose, **{one: motion @ self._poses[one] for one in (grip.riders if grip is not None else ())}}
        touched = {one: bodies for one, bodies in self.state.touched.items() if one not in down}
        self._become(poses={**self._poses, **down}, held=without(self.held, name), touched=touched)
        self.memory = self.memory.learned(down, Source.DONE)

    def happened(self, state: WorldState, change: Change | None = None) -> None:
        """Go on to a state to which a change by an action, heat or flow has led.

        Of a pouring, ``change`` has the amount that flowed. What came to be is recorded by :meth:`learn`.
        """
        known = self.memory.first
        if new := {name: state.poses[name] for name in state.made if name not in known and state.there(name)}:
            self.memory = replace(self.memory, first={**known, **new})
        self.state = state
        match change:
            case TurnedOver(name):
                self._changed("turned over", name=name, pose=self._poses[name])
            case Switched(name, value):
                self.memory = self.memory.witnesses(name)
                self._changed("switched", name=name, state=value)
            case Poured(source, target, amount):
                self._changed("poured", name=source, into=target, amount=amount)

    def learn(self, iris: Mapping[str, str] = MappingProxyType({})) -> None:
        """Record what is gone from the state and what came to be in it; ``iris`` has those of named objects.

        Designators of what is gone may be bound to others.
        """
        for name in sorted(self.state.matter.gone.keys() - set(self.memory.gone)):
            self.memory = self.memory.destroyed(name)
            self._changed("destroyed", name=name)
        for name in filter(self.state.there, self.state.made):
            if name in self.memory.made:
                continue
            made, pose = self.state.made[name], self._poses[name]
            iri = iris.get(name) or self.new_iri(name)
            thing = MapObject(iri, name, self.known_types(expand(made.type)), None, made.size)
            self.memory = self.memory.created(thing, pose)
            self._changed("created", name=name, pose=pose)

    def heated_until(self, time: float) -> float:
        """Record that heating has been simulated up to a plan time [s]; return how long it took since the last one."""
        passed, self.memory = time - self.memory.time, replace(self.memory, time=time)
        return passed

    def recognises_by(self, recognition: Recognition) -> None:
        """Record that components have been started or stopped, or recognition models loaded."""
        self.memory = replace(self.memory, recognition=recognition)

    def _put(self, name: str, pose: Pose, how: str) -> None:
        before = self._poses[name]
        if name in self._moving:
            leaf = self._moving[name]
            value = self.joints[leaf].value_of(self.memory.first[name], pose)
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
        boxes = self.boxes()
        stack, loose = [name], [other for other in boxes if self._is_loose(other)]
        for support in (one for one in stack if one in boxes):  # grows in the loop: objects may be stacked
            x, y, z = boxes[support]
            to_support = self._poses[support].inverse()
            for other in (one for one in loose if one not in stack):
                bottom = to_support @ self._poses[other] @ Pose((0.0, 0.0, -boxes[other][2] / 2))
                ahead, aside, above = bottom.position
                if abs(ahead) <= x / 2 and abs(aside) <= y / 2 and abs(above - z / 2) <= RESTING:
                    stack.append(other)
        return stack[1:]

    def _is_loose(self, name: str) -> bool:
        """Check whether the pose of an object is only known from the map."""
        elsewhere = name in self.joints or name in self.held or name in self.state.away or name not in self._poses
        return not elsewhere and self.knowledge(name).source in (Source.MAP, Source.TOLD)

    def _become(self, **changes: Any) -> None:
        """Go on to another state: the last one with other tables."""
        self.state = replace(self.state, **changes)

    def _changed(self, how: str, **details: Any) -> None:
        self.revision += 1
        self.tell("belief", {"revision": self.revision, "change": how, **details})

    # Snapshots

    def snapshot(self) -> dict[str, Any]:
        """Convert the belief to JSON; poses that equal the map's are left out."""
        return dump_belief(self.state, self.memory, self.revision)

    def restore(self, left: Mapping[str, Any]) -> None:
        """Restore the belief of :meth:`snapshot`. Raises ValueError if it is malformed or belongs to another map."""
        self.state, self.memory, self.revision = load_belief(left, self.state, self.memory, self.joints)

    # Hypotheses

    def supposing(self, state: WorldState) -> Belief:
        """Make a belief of another state, with the same knowledge of where facts come from; nobody is told of it.

        Bodies without a pose there are unknown. Designators that it binds are bound for it alone.
        """
        other = copy(self)
        other.state, other.tell = state, ignore
        lost = {name: pose for name, pose in self._poses.items() if name not in state.poses}
        if lost:
            other.memory = replace(self.memory, unknown={**self.memory.unknown, **lost})
        return other

    def with_leaf(self, leaf: str, value: float) -> WorldState:
        """Make the state with a leaf's joint at a position [rad, m]; its parts and the objects inside move with it."""
        joint, value = self.joints[leaf], self.joints[leaf].within(value)
        elsewhere, boxes = {*self.joints, *self.held, *self.state.away}, self.boxes()
        loose = {name: self._poses[name] for name in boxes if name in self._poses and name not in elsewhere}
        moved = joint.poses(value, self.memory.first, contents(self._poses[leaf], boxes[leaf], loose))
        return replace(self.state, poses={**self._poses, **moved}, joints={**self.state.joints, leaf: value})
