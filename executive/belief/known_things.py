"""Knowledge of the objects of a map: which one a designator means, its pose, and the source of that."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain, islice
from typing import Any

import numpy as np

from executive.belief.association import Associator, Features
from executive.belief.lookalikes import Alike
from executive.belief.meanings import Choice
from executive.belief.memory import VISION, BasePose, Knowledge, Memory, Recognition, Source
from executive.belief.obstacles import NAMES
from executive.belief.purposes import Purposes
from executive.maps.classes import MapObject, is_kind
from executive.maps.contents import is_content
from executive.maps.semantic_map import SemanticMap, namesakes, namespace_of
from planlang.designators import Object, local_name, unused_name
from planlang.failures import AmbiguousPerception, ObjectUnresolvable
from planlang.geometry import Pose
from planlang.language.performances import Performance, performance_of
from planlang.ontology import expand, shorten
from planlang.protocols import Detection
from planlang.runs.run_tree import with_names
from planlang.state import Grip
from sim import PlanningWorld
from sim.joints import Articulation
from sim.leaves import inside
from sim.scene import BodyShape

ALIKE = 0.02
"""Difference of distances from the robot below which two objects are equally near [m]."""


def ignore(event: str, details: Mapping[str, Any]) -> None:
    """Ignore a change, as no listener is registered."""


class KnownThings:
    """Read access to the robot's knowledge of objects; :class:`executive.belief.Belief` changes it."""

    def __init__(
        self,
        semantic_map: SemanticMap,
        world: PlanningWorld,
        *,
        robot: str = "robot",
        trusts_map: bool = False,
        unknown: Iterable[str] = (),
        recognised: Iterable[str] | None = None,
    ) -> None:
        """Begin with the poses of ``world``, a planning world of the map's scene; ``robot`` names the robot in it.

        With ``trusts_map`` they count as seen from every base pose. The places of objects in ``unknown`` are unknown
        until the robot has seen them. ``recognised``: classes of which there are recognition models; None: of all.
        """
        self.map, self.robot = semantic_map, robot
        self.trusts_map = trusts_map
        self.revision = 0
        """Number of changes so far, by which the records of a trace count them."""
        self.purposes: Purposes | None = None
        """What steps are for, by which things are chosen for designators by class; None: that is unknown."""
        self.tell: Callable[[str, Mapping[str, Any]], None] = ignore
        """Listener of changes: event, details."""
        self._told: Mapping[tuple[Object, str], str] = {}
        """Designators and performances of which the listener knows which thing they mean."""
        state = world.world_state(robot)
        poses = dict(state.poses)
        closed = {name: world.scene.body(name).pose for joint in world.scene.joints for name in joint.bodies}
        first = poses | {name: pose for name, pose in closed.items() if name in poses}
        hidden = {name: poses.pop(name) for name in dict.fromkeys(unknown) if name in poses}
        classes = None if recognised is None else tuple(map(expand, recognised))
        self.memory = Memory(Recognition(semantic_map.ontology, classes), first, hidden)
        """Where the facts of the state come from."""
        self.joints: dict[str, Articulation] = {joint.leaf: joint for joint in world.scene.joints}
        """Joints of doors, drawers, lids and knobs, by leaf."""
        away = frozenset(NAMES).intersection(poses)
        self.state = replace(state, robots={robot: world.configuration()}, poses=poses, away=away)
        """What is believed to be where; the robot as it was last observed."""
        self.devices = frozenset(control.device for control in world.scene.controls)
        """Devices with a button or a knob."""
        self._alike: Mapping[str, Alike] = {}
        """Things that plans mean -> the others that they could be as well, in the last picture."""
        self._moving = {name: leaf for leaf, joint in self.joints.items() for name in joint.bodies}
        self.camera_noise = world.camera_noise
        """How the camera errs, as it states of itself."""
        self._associator = Associator(self, world.scene.bodies, world.scene.movers)
        moving = {*self._moving, *(one.body for one in world.scene.movers)}
        self._fixed = {
            one.name
            for one in world.scene.bodies
            if not (one.movable or one.shape is BodyShape.PERSON or one.name in moving)
        }
        """Bodies that are where the map has them as long as nothing else is seen."""
        self._boxes = {body.name: body.size for body in world.scene.bodies if body.movable or body.name in self.joints}

    # Queries

    @property
    def held(self) -> Mapping[str, Grip]:
        """Held objects -> grips."""
        return self.state.held

    @property
    def led(self) -> Mapping[str, str]:
        """Leaf -> link of the hand that moves it."""
        return self.state.led

    @property
    def _poses(self) -> Mapping[str, Pose]:
        return self.state.poses

    @property
    def things(self) -> Iterator[MapObject]:
        """Objects of the map, then created ones, including those without a pose."""
        return chain(self.map.objects, self.memory.made.values())

    def new_iri(self, name: str) -> str:
        """Make an IRI in the namespace of the map for a thing that is created."""
        return unused_name(f"{namespace_of(self.map.iri)}{name}", {thing.iri for thing in self.things})

    def known_types(self, cls: str) -> tuple[str, ...]:
        """List a class and, if only a recipe declares it, the nearest of its superclasses that the map knows."""
        above = (one for ontology in self.map.recipes for one in ontology.ancestors(cls))
        return tuple(dict.fromkeys((cls, *islice(filter(self.map.ontology.defined, above), 1))))

    def joint(self, leaf: str) -> float:
        """Look up how far a door or drawer is believed to be open [rad, m]; 0 is closed."""
        return self.state.joints[leaf]

    def is_left_open(self, leaf: str) -> bool:
        """Check whether a door or drawer is believed to be open, even a little; False for knobs."""
        return not (self.joints[leaf].is_knob or self.joints[leaf].is_shut(self.state.joints[leaf]))

    def witnessed(self, name: str) -> bool:
        """Check whether the robot itself has seen or felt the state of a leaf or a device as it is now.

        A state that only the map tells may be wrong: nothing that is left undone may depend on it.
        """
        return name in self.memory.witnessed

    def names(self) -> tuple[str, ...]:
        """List all objects with a pose in the order of the map, then the touched obstacles."""
        reserve = self.state.away.intersection(NAMES)
        return tuple(name for name in self._poses if name not in reserve)

    def pose(self, name: str) -> Pose:
        """Look up the believed pose of an object in the map; for a held one, where it last stood."""
        return self._poses[name]

    def boxes(self) -> Mapping[str, tuple[float, float, float]]:
        """Collect the extents of all objects that may move, leaves and created ones included [m]."""
        made = {name: thing.size or (0.0, 0.0, 0.0) for name, thing in self.memory.made.items()}
        return {**self._boxes, **made} if made else self._boxes

    def closed_pose(self, name: str) -> Pose:
        """Compute the believed pose of an object as if the door or drawer that it moves with were closed."""
        pose, leaf = self._poses[name], self._moving.get(name)
        if leaf is None and name not in self.held:
            opened = (one for one, value in self.state.joints.items() if value and not self.joints[one].is_knob)
            within = (
                one for one in opened if inside(self._poses[one], self.boxes()[one], np.array([pose.position]))[0]
            )
            leaf = next(within, None)
        return pose if leaf is None else self.joints[leaf].motion(self.state.joints[leaf]).inverse() @ pose

    def reference_pose(self, name: str) -> Pose:
        """Look up the pose to which relative locations refer: for a held object, the one before it was grasped."""
        return self.held[name].before if name in self.held else self._poses[name]

    def seen_from_here(self, name: str) -> bool:
        """Check whether an object has been seen since the base last moved, or the map is trusted about it."""
        return (self.trusts_map and name not in self.memory.in_vain) or self.seen(name)

    def seen(self, name: str) -> bool:
        """Check whether the camera has shown an object since the base last moved."""
        known = self.knowledge(name)
        return known.source is Source.SEEN and known.moves == self.memory.moves

    def knowledge(self, name: str) -> Knowledge:
        """Look up the source and age of an object's pose."""
        return self.memory.known.get(name, Knowledge(Source.TOLD if self.trusts_map else Source.MAP))

    def remembers(self, name: str) -> bool:
        """Check whether an object has been seen, from anywhere, without being touched or moved since."""
        is_doubtful = name in self.memory.in_vain or name in self.memory.uncertain
        return self.knowledge(name).source in (Source.SEEN, Source.TOLD) and not is_doubtful

    def by_map_alone(self, name: str) -> bool:
        """Check whether an object is believed at its pose of the map, without ever having been seen."""
        return self._poses[name] == self.memory.first[name] and self.knowledge(name).source is not Source.SEEN

    def looked_in_vain(self, name: str) -> tuple[BasePose, ...]:
        """List the base poses from which an object was looked for and not seen."""
        return self.memory.in_vain.get(name, ())

    def bind(self, what: Object, near: BasePose) -> str:
        """Resolve a designator to the object of its IRI, else of its name; otherwise to the nearest one of its class.

        A designator stays bound to an object as long as that exists; one by class within the performance of a step, see
        :mod:`executive.belief.meanings`. Without a match it resolves to the nearest object that contains a substance of
        the class, which is not bound. Of things that nothing distinguishes one is as good as the other. Raises
        ObjectUnresolvable, with a list of the known objects, and AmbiguousPerception if two objects that differ, and
        are seen from here, are equally near.
        """
        performance = performance_of(what)
        if performance is None:
            name = self.memory.bound.get(what) or self._find(what, near)
            if name is not None and what not in self.memory.bound:
                self.bound_to(what, name)
        else:
            name = self._meant_in(performance, what, near)
        return self._container(what, near) if name is None else name

    def bound_to(self, what: Object, name: str) -> None:
        """Bind a designator to an object, in the performance of a step around the running task if it is by class."""
        performance = performance_of(what)
        if performance is None:
            self.memory = replace(self.memory, bound={**self.memory.bound, what: name})
        else:
            self.memory = self.memory.meaning(what, self._choice(what, performance).of(name))
        self._tell_meaning(what, name, performance)

    def _tell_meaning(self, what: Object, name: str, performance: Performance | None) -> None:
        """Tell the listener which thing a designator by class means, once in each attempt at a performance.

        Steps that bring nothing about, such as looking for any such thing, mean none in particular.
        """
        key, purposes = (what, "" if performance is None else performance.path), self.purposes
        actions = () if performance is None else performance.actions
        is_meant = performance is None or purposes is None or any(purposes.of(one, what) for one in actions)
        if what.iri is None and is_meant and self._told.get(key) != name:
            self._told = {**self._told, key: name}  # hypotheses have a table of their own from here on
            self.tell("means", {"what": str(what), "name": name, "within": key[1]})

    def with_names(self, text: str, within: str) -> str:
        """Replace designators by class in a text by the names of the things that they mean at a path in the plan."""
        around = ((one, path) for one, path in self._told if f"{within}/".startswith(f"{path}/" if path else ""))
        return with_names(text, {str(one): self._told[one, path] for one, path in around})

    def _meant_in(self, performance: Performance, what: Object, near: BasePose) -> str | None:
        """Find what a designator by class means in a performance, and bind it if that is new; None without a match."""
        known = self.memory.meant_in(what, performance.occasion, performance.step)
        choice = self._choice(what, performance)
        if known is not None:
            if known.name != choice.last or choice.serves > known.served:
                self.memory = self.memory.meaning(what, known._replace(served=known.served or choice.serves))
            self._tell_meaning(what, known.name, performance)
            return known.name
        name = choice.last if choice.is_same() else self._find(what, near, choice)
        if name is not None:
            self.memory = self.memory.meaning(what, choice.of(name))
            self._tell_meaning(what, name, performance)
        return name

    def _choice(self, what: Object, performance: Performance) -> Choice:
        """Begin to choose what a designator by class means in a performance."""
        purposes, had = self.purposes, self.memory.meanings.get(what, ())
        each = [None if purposes is None else purposes.of(one, what) for one in performance.actions]

        def is_done(name: str) -> bool:
            return purposes is not None and purposes.reached(each[0], what, self.designator(name))

        serves = any(one is not None and not one.passes for one in each)
        return Choice(what, performance, each[0], serves, had, self.memory.bound.get(what), is_done)

    def designator(self, name: str) -> Object:
        """Build a designator of a thing, which may be of the map or created."""
        thing = next(thing for thing in self.things if thing.name == name)
        return Object(shorten(thing.types[0]) if thing.types else "EnduringThing-Localized", thing.iri)

    def of_class(self, what: Object) -> tuple[str, ...]:
        """List the objects of a designator's class that are where it says, in the order of the map."""
        fitting = (one.name for one in self.things if one.name in self._poses and self.is_a(one, what.type))
        if what.where is None or self.purposes is None:
            return tuple(fitting)
        return tuple(name for name in fitting if self.purposes.is_at(what.where, self.designator(name)))

    def _find(self, what: Object, near: BasePose, choice: Choice | None = None) -> str | None:
        placed = [thing for thing in self.things if thing.name in self._poses]
        named = namesakes(self.map.ontology, placed, what)
        if len(named) == 1:
            return named[0].name
        distances = {
            thing.name: math.dist(self._poses[thing.name].position[:2], near[:2])
            for thing in named or placed
            if self.is_a(thing, what.type)
        }
        if what.where is not None:
            right = self.of_class(what)
            distances = {name: distance for name, distance in distances.items() if name in right}
        if not distances or self._missing(what) is not None:
            return None
        if choice is not None:
            there = [name for name in distances if name not in self.state.away] or list(distances)
            distances = {name: distances[name] for name in choice.among(there, self.held)}
        nearest = min(distances, key=lambda name: distances[name])
        equal = tuple(n for n in distances if distances[n] - distances[nearest] < ALIKE and self.seen_from_here(n))
        is_open = len(equal) > 1 and nearest in equal and (choice is None or choice.last is None)
        if is_open and not all(self.is_like(nearest, other) for other in equal):
            raise AmbiguousPerception(what=str(what), candidates=equal)
        return nearest

    def _container(self, what: Object, near: BasePose) -> str:
        """Find the nearest object that contains the substance of a designator."""
        if what.where is not None:
            others = ", ".join(self.of_class(replace(what, where=None))) or "none"
            told = f"no {what.name} is known to be {what.where}; known of this class: {others}"
            raise ObjectUnresolvable(told, designator=str(what))
        individual = self._missing(what)
        containers = [
            name
            for name, content in self.state.matter.contents.items()
            if name in self._poses and any(self._is_kind(one.type, what.type) for one in content.values())
            if individual is None or any(individual in one.origins for one in content.values())
        ]
        if not containers:
            known = ", ".join(name for name in self._poses if name not in NAMES)
            problem = "is not there any more" if individual in self.memory.gone else "is not in the map"
            problem = "has not been found yet" if individual in self.memory.unknown else problem
            told = f"{what} ({local_name(what.type)}) {problem}; there are {known}"
            raise ObjectUnresolvable(told, designator=str(what))
        return min(containers, key=lambda name: math.dist(self._poses[name].position[:2], near[:2]))

    def _missing(self, what: Object) -> str | None:
        """Find the individual of a designator's IRI, if it is the content of something, not found yet, or destroyed."""
        named = namesakes(self.map.ontology, self.things, what)
        elsewhere = {*self.memory.gone, *self.memory.unknown}
        return next((thing.name for thing in named if is_content(thing) or thing.name in elsewhere), None)

    def means(self, what: Object, name: str) -> bool:
        """Check whether a designator means an object itself rather than its content."""
        thing = next((one for one in self.things if one.name == name), None)
        return thing is not None and (thing.iri == what.iri or self.is_a(thing, what.type))

    def is_a(self, thing: MapObject, cls: str) -> bool:
        """Check whether an object is of a class, or was before it was heated."""
        return any(self._is_kind(one, cls) for one in (*thing.types, *self.state.matter.types.get(thing.name, ())))

    def _is_kind(self, one: str, cls: str) -> bool:
        """Check whether a class is a subclass of ``cls``; classes unknown to the map's ontology compare by name."""
        return is_kind(self.map.ontology, one, cls)

    def features(self, name: str) -> Features:
        """Look up what a camera may tell a thing by."""
        return self._associator.features(name)

    def alike(self, name: str) -> Alike | None:
        """Look up which others a thing that a plan means could be as well, in the last picture; None without any."""
        return self._alike.get(name)

    def lost_of(self, what: Object) -> str | None:
        """Find the thing at no known place that a designator names; None without one."""
        named = (thing.name for thing in self.map.objects if what.iri is not None and thing.iri == what.iri)
        return next((name for name in named if name in self.memory.unknown), None)

    def without_mark(self, name: str) -> tuple[str, ...]:
        """List what no map has, and is of the class and size of a thing, but does not show the mark of that."""
        one = self.features(name)
        if one.mark is None and one.colour is None:
            return ()
        made = (thing.name for thing in self.memory.made.values() if "#" in thing.name and thing.name in self._poses)
        return tuple(other for other in made if self._is_of_kind(other, name))

    def is_like(self, one: str, other: str) -> bool:
        """Check whether nothing that a camera reads distinguishes two things."""
        its, others = self.features(one), self.features(other)
        return self._is_of_kind(one, other) and (its.mark, its.colour) == (others.mark, others.colour)

    def _is_of_kind(self, one: str, other: str) -> bool:
        """Check whether two things are of one class and size, as far as a camera tells."""
        known = self.features(one)
        return self._associator.is_of_kind(Detection(known.types[0], self._poses[one], 1.0, known.size), other)

    def recognises(self, name: str) -> bool:
        """Check whether an object would be recognised in an image.

        Created objects need no model. Neither do leaves and devices, which are recognised as parts of the map.
        """
        thing = self.map.find(name)
        if name in self._moving or name in self.devices:
            return self.memory.recognition.runs(VISION)
        if thing is None:
            return name not in self.memory.made or self.memory.recognition.runs(VISION)
        return self.memory.recognition.recognises(thing)
