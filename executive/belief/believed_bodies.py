"""Bodies of the believed world: shapes and poses, supports, people, doors and drawers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from executive.belief.belief import Belief
from executive.belief.obstacles import NAMES as OBSTACLES
from executive.belief.scene_part import Kept, ScenePart
from executive.maps import SemanticMap
from executive.maps.hollow import room_behind
from executive.maps.scene_bodies import SceneBodies
from planlang.designators import Object
from planlang.failures import ObjectUnresolvable
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.protocols import Touch
from planlang.state.matter import KG_PER_ML
from sim import Body, ComfortZone, WorldMirror
from sim.joints import Articulation, JointKind
from sim.leaves import inside
from sim.scene import GRASPABLE_WIDTH, LONGEST, BodyShape

MEANT = 0.03
"""Distance from a touch of the fingers up to which a believed object explains it [m]."""
SHIFTED = 0.15
"""Distance from a touch up to which a body explains it by having been moved [m]."""
PUSHED = 3.0
"""Distance by which movable furniture that has not been seen may have been pushed [m]: across a room."""


def something_at(x: float, y: float) -> str:
    """Say in words that the robot has touched something that it does not know, and where in the map [m]."""
    return f"something unknown at {x:.2f}, {y:.2f}"


def handles_of(body: Body, pose: Pose) -> tuple[Block, ...]:
    """Compute the blocks of a body's handles with the body at a pose."""
    return tuple(Block.of(pose @ one.pose, one.size) for one in body.handles)


def _nearest(distances: Mapping[str, float], within: float) -> str | None:
    """Find the nearest body; None if none is ``within`` [m]."""
    nearest = min(distances, key=lambda name: distances[name], default=None)
    return nearest if nearest is not None and distances[nearest] <= within else None


class BelievedBodies(ScenePart, SceneBodies):
    """Bodies of the believed world, by name."""

    def __init__(self, mirror: WorldMirror, belief: Belief) -> None:
        super().__init__(mirror, belief)
        self._masses: Kept[dict[str, float]] = Kept()

    @property
    def map(self) -> SemanticMap:
        """The map that the belief began with, and learns from."""
        return self._belief.map

    @property
    def joints(self) -> Mapping[str, Articulation]:
        """Leaf -> its joint, as it is believed."""
        return self._belief.joints

    def body(self, name: str) -> Body:
        """Look up the description of a body."""
        return self._world.scene.body(name)

    def bind(self, what: Object) -> str:
        """Resolve an object designator to a body. Raises ObjectUnresolvable."""
        return self._belief.bind(what, self._world.configuration().base)

    def known(self, what: Object) -> str | None:
        """Resolve an object designator to a body at a known place; None if there is none."""
        try:
            return self.bind(what)
        except ObjectUnresolvable:
            return None

    def means_unknown(self, what: Object) -> bool:
        """Check whether a designator matches an object of the map whose place is unknown."""
        belief = self._belief
        things = [thing for thing in belief.map.objects if thing.name in belief.memory.unknown]
        return any(one.iri == what.iri or (what.iri is None and belief.is_a(one, what.type)) for one in things)

    def designator(self, name: str) -> Object:
        """Build a designator of a body, which may be of the map or created."""
        return self._belief.designator(name)

    def pose(self, name: str) -> Pose:
        """Look up the believed map pose of a body; of a held one, where it was grasped."""
        return self._belief.reference_pose(name)

    def grips(self, name: str) -> tuple[Block, ...]:
        """List the blocks on which a hand can close: the body itself, and its handles."""
        return (self.block(name), *handles_of(self.body(name), self.pose(name)))

    def as_obstacle(self, name: str) -> str:
        """Name in words what is in the way: a body, known or not, or a link of the robot."""
        if name in self._world.robot.solid_names:
            return "the robot itself"
        if name in OBSTACLES:
            x, y, _ = self._belief.pose(name).position
            return something_at(x, y)
        return f"a wall of {name}" if name in self.names() and self.is_room(name) else name

    def ungraspable(self, name: str) -> str:
        """Describe why no hand can grasp a body, as a predicate: "is 0.4 m wide, and ..."."""
        body = self.body(name)
        if body.shape not in (BodyShape.BOX, BodyShape.CYLINDER):
            return "is not an object that a hand can grasp"
        if not body.movable and (min(body.size[:2]) <= GRASPABLE_WIDTH or max(body.size) > LONGEST):
            return f"is a {body.type}: things of this class are not taken"
        widths = f"is {min(body.size[:2]):g} m wide, and nothing wider than {GRASPABLE_WIDTH:g} m is taken"
        return f"{widths}, except by a handle for one hand"

    def graspable_at(self, point: Array) -> str | None:
        """Find the graspable body nearest to a map point (3,); None if none is within :data:`MEANT`."""
        distances = {
            name: min(one.away(point) for one in self.grips(name)) for name in filter(self.is_graspable, self.names())
        }
        return _nearest(distances, MEANT)

    def stands_at_place_of(self, name: str) -> str | None:
        """Find another solid thing that is seen from here and overlaps an object where that is believed; else None."""
        block, carried = self.block(name), self._belief.state.carried()
        if block.wall:
            return None  # the other one may be in it
        others = (one for one in self.names() if one != name and one not in carried and self._belief.seen(one))
        solid = (one for one in others if self.is_graspable(one) and not self.body(one).wall)
        blocks = ((one, self.block(one)) for one in solid)
        return next((one for one, its in blocks if block.away(its.centre) < min(its.half_x, its.half_y)), None)

    def explained(self, touch: Touch) -> tuple[str, Pose] | None:
        """Find the body that best explains a touch, and the pose that it then has; None if no body does.

        Prefers a body whose believed surface is within :data:`SHIFTED`; otherwise the nearest movable furniture within
        :data:`PUSHED` that has not been seen yet.
        """
        point = np.array(touch.point)
        carried = self._belief.state.carried()
        solid = [name for name in self.names() if name not in carried and self.is_solid(name)]
        bodies = [name for name in solid if not self.is_room(name) and point[2] <= self._highest(name)]
        name = self._nearest(point, bodies, SHIFTED)
        if name is not None:
            return name, self._shifted(name, point - self.block(name).nearest(point))
        unseen = [name for name in bodies if self._belief.by_map_alone(name) and not self.is_graspable(name)]
        name = self._nearest(point, filter(self.is_movable, unseen), PUSHED)
        if name is None:
            return None
        block, normal = self.block(name), np.array([*touch.normal[:2], 0.0]) / max(math.hypot(*touch.normal[:2]), 1e-9)
        centre = point - block.support(math.atan2(normal[1], normal[0])) * normal
        return name, self._shifted(name, np.array([*(centre - block.centre)[:2], 0.0]))

    def met(self, touch: Touch) -> str:
        """Name in words what the robot has run into, as far as it can tell from where it was touched.

        That is what another hand holds, the body that explains the touch best, a wall, or something unknown. A body
        that is seen from here does not explain a touch beside it.
        """
        point, world, belief = np.array(touch.point), self._world, self._belief
        others = (name for name, grip in belief.held.items() if touch.link not in [hand.link for hand in grip.hands])
        carried = {name: Block.of(world.pose(name), world.size(name)).away(point) for name in others}
        if (name := _nearest(carried, MEANT)) is not None:
            return name
        name, _ = self.explained(touch) or (None, None)
        if name is not None and (not belief.seen(name) or self.block(name).away(point) <= MEANT):
            return self.as_obstacle(name)
        rooms = (name for name in self.names() if self.is_room(name))
        if (room := next((name for name in rooms if self.from_walls(name, point) <= SHIFTED), None)) is not None:
            return self.as_obstacle(room)
        return something_at(*touch.point[:2])

    def from_walls(self, room: str, point: Array) -> float:
        """Compute how far a map point (3,) is from the walls of a room [m]."""
        block = self.block(room)
        local = np.abs(block.to_local(point[None])[0])
        return float(np.abs(np.array([block.half_x, block.half_y]) - local).min())

    def _highest(self, name: str) -> float:
        """Height up to which a touch may be of a body [m]: furniture stands on the floor, wherever it was moved."""
        return self.block(name).high + (SHIFTED if self.is_graspable(name) else MEANT)

    def _shifted(self, name: str, by: Array) -> Pose:
        x, y, z = (self.pose(name).position + by).tolist()
        return Pose((x, y, z), self.pose(name).orientation)

    def mass(self, name: str) -> float:
        """Compute the mass of a body with all that is believed to be in it and on it [kg]; unknown masses count as 0.

        This is what hands carry that lift it.
        """
        state = self._belief.state
        masses = self._masses.of((state.poses, state.held, state.matter.contents), dict)
        if name not in masses:
            held = self._belief.held.get(name)
            loaded = (name, *(self._world.standing_on(name) if held is None else held.riders))
            body = self._world.scene.body
            masses[name] = sum(body(one).mass + state.matter.total(one) * KG_PER_ML for one in loaded)
        return masses[name]

    def load(self, name: str) -> float:
        """Compute the share of :meth:`mass` that is in a body or on it [kg]."""
        return round(self.mass(name) - self.body(name).mass, 3)

    def hands(self, name: str) -> int:
        """Look up how many hands it takes to hold a body."""
        return self.body(name).hands

    def is_held(self, name: str) -> bool:
        """Check whether a hand is believed to hold a body."""
        return name in self._belief.held

    def is_movable(self, name: str) -> bool:
        """Check whether a body may stand elsewhere than in the map."""
        return self.body(name).movable

    def _nearest(self, point: Array, names: Iterable[str], within: float) -> str | None:
        return _nearest({name: self.block(name).away(point) for name in names}, within)

    def names(self) -> Sequence[str]:
        """List all bodies."""
        return self._world.names()

    def zone(self, name: str) -> ComfortZone:
        """Look up the zone in which a person takes objects."""
        return self._world.person(name)

    def taker(self, name: str, expected: str | None = None) -> str | None:
        """Infer who pulls at a held object; None if no person is known.

        People in whose comfort zone the object is come first, then the expected person, then the nearest.
        """
        point = np.array(self._world.pose(name).position)

        def order(person: str) -> tuple[bool, bool, float]:
            zone = self.zone(person)
            distance = np.linalg.norm(point - zone.shoulders, axis=1).min()
            return not zone.contains(point), person != expected, float(distance)

        return min(filter(self.is_person, self.names()), key=order, default=None)

    def support(self, name: str) -> str | None:
        """Find the body on which another is believed to stand; None if there is none."""
        support = self._world.support(name)
        return support if support in self._world.names() else None

    def below_rim(self, name: str) -> float:
        """Compute how far a body's bottom is below the rim of the drawer, box or vessel that encloses it [m].

        0 for a body in the open, or in a compartment with an open side.
        """
        block = self.block(name)
        rims = (self._rim(other, block.centre) for other in self.names() if other != name)
        return max(0.0, max(rims, default=-math.inf) - block.low)

    def _rim(self, name: str, point: Array) -> float:
        """Compute the height of a body's rim around a point (3,) inside it [m]; -inf if it does not enclose it."""
        body = self.body(name)
        if body.shape in (BodyShape.ROOM, BodyShape.MARKER) or not (body.cavities or body.wall):
            return -math.inf
        half = np.array(self.size(name)) / 2
        pose = self.pose(name).matrix()
        local = (point - pose[:3, 3]) @ pose[:3, :3]
        walls = [(np.zeros(3), half - np.array([body.wall, body.wall, -body.wall]))] if body.wall else []
        for middle, extent in (*((np.array(one.centre), np.array(one.size) / 2) for one in body.cavities), *walls):
            is_inside = (np.abs(local - middle) <= extent).all()
            is_closed_around = (np.abs(middle) + extent < half)[:2].all()
            if is_inside and is_closed_around and (middle + extent)[2] >= half[2]:
                return float(pose[2, 3] + half[2])
        return -math.inf

    def leaves_of(self, what: Object, *, shut: bool) -> list[Articulation]:
        """Find the joint of a leaf, or of the leaf with a part, that a designator means, or the joints of furniture.

        Of furniture or of a doorway, those of leaves that are shut come first, or open ones if not ``shut``, then the
        nearest.
        """
        name, joints, here = self.bind(what), self._belief.joints, self._world.configuration().base
        for joint in joints.values():
            if name in joint.bodies:
                return [joint]
        own = (one for one in joints.values() if name in (one.holder, *one.frame[:1]) and not one.is_knob)
        return sorted(
            own,
            key=lambda one: (
                one.is_shut(self._belief.joint(one.leaf)) is not shut,
                round(math.dist(self.pose(one.handle or one.leaf).position[:2], here[:2]), 6),
            ),
        )

    def drawer_of(self, name: str) -> Articulation | None:
        """Find the joint of the drawer that contains a body, open or not; None without one."""
        point = np.array([self.pose(name).position])
        sliding = (joint for joint in self._belief.joints.values() if joint.kind is JointKind.PRISMATIC)
        around = (joint for joint in sliding if inside(self.pose(joint.leaf), self.size(joint.leaf), point)[0])
        return next((joint for joint in around if name not in joint.bodies), None)

    def closed_before(self, name: str) -> str | None:
        """Find the closed door in front of a body, or the closed drawer around it; None without one."""
        point = np.array(self.pose(name).position)
        for leaf, joint in self._belief.joints.items():
            if joint.is_knob or not joint.is_shut(self._belief.joint(leaf)):
                continue
            if joint.kind is JointKind.PRISMATIC:
                if name not in joint.bodies and inside(self.pose(leaf), self.size(leaf), point[None])[0]:
                    return leaf
            elif joint.holder is not None and name not in (*joint.bodies, joint.holder):
                scene = self._world.scene
                furniture = scene.body(joint.holder)
                room = room_behind(scene.body(leaf), furniture)
                centre = furniture.pose @ Pose(room.centre)
                if inside(furniture.pose, furniture.size, point[None])[0] and inside(centre, room.size, point[None])[0]:
                    return leaf
        return None

    def door_of(self, name: str) -> str | None:
        """Find a door of furniture whose doors are all closed, or a closed drawer itself; None without one."""
        shut, count = self._doors_of(name)
        return shut[0] if shut and len(shut) == count else None

    def shut_doors(self, name: str) -> list[str]:
        """List the closed doors of furniture, or a drawer itself if it is closed."""
        return self._doors_of(name)[0]

    def _doors_of(self, name: str) -> tuple[list[str], int]:
        """List the closed doors of furniture, or a drawer itself; and count all of them."""
        joints = [joint for leaf, joint in self._belief.joints.items() if name in (leaf, joint.holder)]
        doors = [one for one in joints if one.leaf == name or (one.kind is JointKind.HINGED and not one.is_knob)]
        return [one.leaf for one in doors if one.is_shut(self._belief.joint(one.leaf))], len(doors)
