"""Spheres inside an arm: where they meet something the arm does, so that most postures need no exact query."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.motion import Chain
from executive.motion.urdf import Joint, displacement, joints_between, read_joints
from planlang.protocols import Array, Configuration, Pose
from sim import PyBulletWorld

APART = 0.04
"""Distance of neighbouring spheres, where those inside a link are not larger [m]."""
CORE = 0.5
"""Share of the box around a mesh that is taken as surely filled."""


def surely_filled(kind: str, size: tuple[float, float, float]) -> tuple[str, tuple[float, float, float]]:
    """A primitive, kind and size [m], that is surely filled: of a mesh the core of the box around it."""
    x, y, z = size
    return ("box", (CORE * x, CORE * y, CORE * z)) if kind == "mesh" else (kind, size)


_Step = tuple[Array, Array, Array, Array, Array, int, float, float]
"""Origin, constant, sine, versine, slide, column, factor and offset of one moving joint."""


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """Moving joints (s), each with the fixed ones before it: rotation A + B sin q + C (1 - cos q), or a slide."""

    origin: Array
    """(s, 3) in the frame before."""
    constant: Array
    """(s, 3, 3), as the next two."""
    sine: Array
    versine: Array
    slide: Array
    """(s, 3) in the frame before, per unit; zero for one that turns."""
    columns: NDArray[np.intp]
    """Of the arm's joint values, (s,): factor * value + offset."""
    factors: Array
    offsets: Array

    @staticmethod
    def of(steps: Sequence[_Step]) -> _Steps:
        """From one tuple for each joint."""
        count = len(steps)
        vectors = (np.array([step[part] for step in steps]).reshape(count, 3) for part in (0, 4))
        turns = (np.array([step[part] for step in steps]).reshape(count, 3, 3) for part in (1, 2, 3))
        columns = np.array([step[5] for step in steps], np.intp)
        factors, offsets = (np.array([step[part] for step in steps]).reshape(count) for part in (6, 7))
        origin, slide = vectors
        constant, sine, versine = turns
        return _Steps(origin, constant, sine, versine, slide, columns, factors, offsets)


@dataclass(frozen=True, slots=True, eq=False)
class ArmSpheres:
    """k spheres that move with an arm, with the fingers open."""

    radii: Array
    """(k,) [m]."""
    hand: NDArray[np.bool_]
    """Which belong to the hand, (k,)."""
    links: NDArray[np.intp]
    """Number of the solid link of each, (k,)."""
    in_tip: Array
    """Centres of those of the hand in the tip frame, (h, 3)."""
    steps: _Steps
    carriers: NDArray[np.intp]
    """The moving joint that carries each first, (k,)."""
    local: Array
    """Homogeneous centres (k, 4) in the frame after that joint."""

    def centres(self, q: Array) -> Array:
        """Centres (n, k, 3) in the base frame for joint values (n, d)."""
        if not len(self.radii):
            return np.zeros((len(q), 0, 3))
        steps = self.steps
        value = q[:, steps.columns] * steps.factors + steps.offsets
        frames = np.zeros((*value.shape, 4, 4))
        sine, versine = np.sin(value)[..., None, None], (1.0 - np.cos(value))[..., None, None]
        frames[..., :3, :3] = steps.constant + sine * steps.sine + versine * steps.versine
        frames[..., :3, 3] = steps.origin + value[..., None] * steps.slide
        frames[..., 3, 3] = 1.0
        for index in range(1, value.shape[1]):
            frames[:, index] = frames[:, index - 1] @ frames[:, index]
        return np.asarray(np.einsum("nkij,kj->nki", frames[:, self.carriers, :3], self.local))


NO_SPHERES = ArmSpheres(
    np.zeros(0),
    np.zeros(0, bool),
    np.zeros(0, np.intp),
    np.zeros((0, 3)),
    _Steps.of([]),
    np.zeros(0, np.intp),
    np.zeros((0, 4)),
)
"""Of an arm of which no shape is known: nothing is ruled out before the exact query."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedSpheres:
    """k spheres inside arms in one posture."""

    centres: Array
    """(k, 3) in the base frame."""
    radii: Array
    hand: NDArray[np.bool_]
    """Which belong to hands, (k,)."""

    @staticmethod
    def of(arms: Sequence[tuple[ArmSpheres, Array]]) -> PlacedSpheres:
        """Those of arms at joint values (d,) each."""
        centres = [spheres.centres(q[None])[0] for spheres, q in arms]
        radii, hand = [spheres.radii for spheres, _ in arms], [spheres.hand for spheres, _ in arms]
        if not arms:
            return PlacedSpheres(np.zeros((0, 3)), np.zeros(0), np.zeros(0, bool))
        return PlacedSpheres(np.concatenate(centres), np.concatenate(radii), np.concatenate(hand))


def arm_spheres(
    chain: Chain, tip: str, base_link: str, torso: str | None, world: PyBulletWorld, opened: Mapping[str, float]
) -> ArmSpheres:
    """Spheres of the solid links that the joints of an arm move, the ``torso`` that carries it left out.

    ``opened``: joints of the fingers, as they are when the hand comes to grasp. The world is left as it was.
    """
    before = world.configuration()
    joints = {name: float(value) for name, value in zip(chain.names, (chain.lower + chain.upper) / 2, strict=True)}
    world.set_configuration(Configuration((0.0, 0.0, 0.0), {**joints, **opened}))
    try:
        return _spheres(chain, tip, base_link, torso, world)
    finally:
        world.set_configuration(before)


def _spheres(chain: Chain, tip: str, base_link: str, torso: str | None, world: PyBulletWorld) -> ArmSpheres:
    robot = world.robot
    way = joints_between(read_joints(robot.body.urdf), base_link, tip)
    steps, carried = _steps(way, chain)
    hand = robot.hand_of(tip)
    moved = frozenset[int]().union(*(robot.moved_by(name) for name in chain.names if name != torso))
    from_tip = world.link_pose(tip).inverse()
    groups: list[list[tuple[Array, float, int]]] = [[] for _ in steps.columns]
    in_tip = []
    for number in sorted(moved):
        link = robot.solid_names[number]
        above = next(name for i in robot.ancestors(robot.links[link]) if (name := robot.link_names[i]) in carried)
        # the frame after the moving joint, from a link that is fixed to it
        step, fixed = carried[above]
        there = world.link_pose(link)
        offset = Pose.from_matrix(fixed) @ world.link_pose(above).inverse() @ there
        for kind, size, pose in robot.shapes(number):
            for centre, radius in _inside(kind, size):
                point = pose @ Pose(centre)
                groups[step].append((np.array((offset @ point).position), radius, number))
                if number in hand:
                    in_tip.append((step, (from_tip @ there @ point).position))
    every = [sphere for group in groups for sphere in group]
    in_tip.sort(key=lambda item: item[0])
    return ArmSpheres(
        np.array([radius for _, radius, _ in every]),
        np.array([number in hand for _, _, number in every], bool),
        np.array([number for _, _, number in every], np.intp),
        np.array([place for _, place in in_tip]).reshape(-1, 3),
        steps,
        np.repeat(np.arange(len(groups)), [len(group) for group in groups]),
        np.array([(*place, 1.0) for place, _, _ in every]).reshape(-1, 4),
    )


def _steps(way: Sequence[Joint], chain: Chain) -> tuple[_Steps, dict[str, tuple[int, Array]]]:
    """The moving joints; and for each link of the chain after the first of them which it hangs from, and how (4, 4)."""
    steps: list[_Step] = []
    carried: dict[str, tuple[int, Array]] = {}
    fixed = np.eye(4)
    for joint in way:
        fixed = fixed @ joint.origin
        name, factor, offset = joint.name, 1.0, 0.0
        if joint.mimic is not None and name not in chain.names:
            name, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
        if joint.kind != "fixed" and name in chain.names:
            turn = fixed[:3, :3]
            zero = np.zeros((3, 3))
            if joint.kind == "prismatic":
                parts = turn, zero, zero, turn @ joint.axis
            else:
                x, y, z = joint.axis
                cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
                parts = turn, turn @ cross, turn @ cross @ cross, np.zeros(3)
            steps.append((fixed[:3, 3], *parts, chain.names.index(name), factor, offset))
            fixed = np.eye(4)
        elif joint.kind != "fixed":
            fixed = fixed @ displacement(joint, 0.0)
        if steps:
            carried[joint.child] = len(steps) - 1, fixed.copy()
    return _Steps.of(steps), carried


def _inside(kind: str, size: tuple[float, float, float]) -> Iterator[tuple[tuple[float, float, float], float]]:
    """Centres and radii [m] of spheres inside a primitive."""
    x, y, z = size
    match kind:
        case "sphere":
            yield (0.0, 0.0, 0.0), x / 2
            return
        case "cylinder":
            width = x if z >= x else x / np.sqrt(2)  # the square inside a disc
            x = y = width
        case "mesh":
            x, y, z = CORE * x, CORE * y, CORE * z
    radius = min(x, y, z) / 2
    axes = []
    for extent in (x, y, z):
        reach = extent / 2 - radius
        count = 1 if reach < 1e-6 else int(np.ceil(2 * reach / max(APART, 1.5 * radius))) + 1
        axes.append(np.linspace(-reach, reach, count) if count > 1 else np.zeros(1))
    for a, b, c in product(*axes):
        yield (float(a), float(b), float(c)), float(radius)
