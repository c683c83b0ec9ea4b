"""Openings of a hand: just wide enough for the object to grasp, so that the fingers clear its neighbours.

Gaps are measured on the shapes of the fingers at some openings from closed to opened, at sections along the approach.
Hands that cannot be measured have fingers or palms without a collision shape, or with a box for a missing mesh.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from executive.robots.mechanism import Mechanism
from executive.robots.robot import Arm, Gripper
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import ConvexSolid
from planlang.geometry.urdf import read_urdf
from planlang.geometry.xml_tree import tree_of
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim import PlanningWorld
from sim.description import read_description

ROOM = 0.02
"""Usual clearance between fingers and object, both sides together [m]."""
TIGHT = 0.008
"""Least such clearance, used where wider fingers do not fit between the object's neighbours [m]."""
SPARE = 0.002
"""Clearance, both sides together, below which open fingers may penetrate an object [m]."""
BESIDE = 0.003
"""Distance of an object from a jaw that does not move, when the opposite finger closes on it [m]."""
STEPS = 21
"""Number of measured openings, from closed to opened."""
SECTIONS = np.linspace(-0.1, 0.1, 21)
"""Positions along the approach, relative to the grip point, at which gaps are measured [m]."""
_TURNS = np.arange(16) * (np.pi / 8)
AROUND = np.stack([np.cos(_TURNS), np.sin(_TURNS)])
"""Directions (2, 16) of the corners of an outline."""

Fingers = tuple[tuple[str, float], ...]
"""Finger joints with their values; empty to leave the fingers as they are."""


@dataclass(frozen=True, slots=True, eq=False)
class Openings:
    """The openings of a hand, the narrowest first; none for a hand without moving fingers."""

    fingers: tuple[Fingers, ...] = ()
    gaps: Array = field(default_factory=lambda: np.zeros((0, len(SECTIONS))))
    """Gap between the fingers at each opening and section (n, s) [m]; infinite where there are no fingers."""
    ends: Array = field(default_factory=lambda: np.zeros(0))
    """Distance of the fingertips in front of the grip point at each opening (n,) [m]: it varies if fingers rotate."""

    jaw: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """For fingers that close on a jaw that does not move: a point on it, and its normal, in the tip frame (2, 3)."""

    def middles(self, widths: Array) -> Array:
        """Compute where the middles of objects of widths (m,) [m] are between the fingers, in the tip frame (m, 3) [m].

        At the grip point; beside a jaw that does not move where fingers close on one.
        """
        if not len(self.jaw):
            return np.zeros((len(widths), 3))
        halves = np.where(np.isfinite(widths), widths, 0.0) / 2
        return np.asarray(self.jaw[0] + (halves[:, None] + BESIDE) * self.jaw[1])

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the finger joints."""
        return tuple(name for name, _ in self.widest)

    @property
    def widest(self) -> Fingers:
        """The fully opened fingers."""
        return self.fingers[-1] if self.fingers else ()

    @property
    def gap(self) -> float:
        """Gap at the grip point between the fully opened fingers [m]; infinite without any."""
        return float(self.gaps[-1, len(SECTIONS) // 2]) if self.fingers else math.inf

    @property
    def widest_gaps(self) -> tuple[float, ...]:
        """Gaps of the fully opened fingers at each section [m], rounded so that equal hands have equal ones."""
        return tuple(self.gaps[-1].round(4).tolist()) if self.fingers else ()

    def around(self, spans: Array, room: float = ROOM, *, is_round: bool = False) -> NDArray[np.intp]:
        """Find the indices (m,) of the narrowest openings for objects; the widest one if none is wide enough.

        ``spans`` (m, 2) are the objects' widths in the closing direction, and how far they extend behind the grip point
        [m]; ``room`` is the clearance, both sides together [m]. What ``is_round`` also extends behind it as a circle.
        """
        is_beside = -spans[:, 1:] - 1e-9 <= SECTIONS
        fits = ~is_beside[:, None] | (self.gaps >= spans[:, None, :1] + room)
        if is_round:  # fingers that narrow towards the palm may touch it there
            circle = 2 * np.sqrt(np.maximum((spans[:, :1] / 2) ** 2 - np.minimum(SECTIONS, 0.0) ** 2, 0.0))
            fits &= (circle == 0.0)[:, None] | (self.gaps >= circle[:, None] + SPARE)
        is_wide_enough: NDArray[np.bool_] = np.asarray(fits.all(axis=2))
        is_wide_enough[:, -1] = True
        return np.asarray(is_wide_enough.argmax(axis=1), np.intp)

    def closing(self, fingers: Fingers, width: float) -> tuple[Fingers, ...]:
        """List the openings that fingers pass as they close on an object of some width [m], narrowest first."""
        if not self.fingers:
            return (fingers,)
        last = self.fingers.index(fingers)
        first = int(self.around(np.array([[width, 0.0]]), 0.0)[0])
        return self.fingers[min(first, last) : last + 1]

    def advance(self, width: float) -> float:
        """Compute how far fingertips move forward, from fully opened, as they close on an object of some width [m]."""
        if not self.fingers:
            return 0.0
        narrow, wide = (int(self.around(np.array([[width, 0.0]]), room)[0]) for room in (0.0, ROOM))
        last = max(0, narrow - 1)  # contact happens between two measured openings
        return max(0.0, float(self.ends[last : wide + 1].max() - self.ends[-1]))

    def lets_in(self, width: float) -> bool:
        """Check whether an object of some width [m] fits between the fingertips of the closed hand."""
        tips = self.gaps[0][np.isfinite(self.gaps[0])][-1:] if self.fingers else ()
        return any(width < gap for gap in tips)

    def beyond(self, joints: Mapping[str, float]) -> Fingers:
        """Find the narrowest opening that releases what fingers at these joint values hold."""
        if not self.fingers:
            return ()
        return self.fingers[int(self.around(np.array([[self.gap_at(self.share(joints)), 0.0]]))[0])]

    def gap_at(self, share: float) -> float:
        """Compute the gap at the grip point between fingers that are open by a share, from 0 closed to 1 [m]."""
        shares = np.linspace(0.0, 1.0, len(self.fingers))
        return float(np.interp(share, shares, self.gaps[:, len(SECTIONS) // 2]))

    def share(self, joints: Mapping[str, float]) -> float:
        """Compute how far fingers at these joint values are open: 0 closed, 1 fully opened."""
        closed, opened = (np.array([value for _, value in self.fingers[end]]) for end in (0, -1))
        now, moves = np.array([joints[name] for name in self.joints]), opened != closed  # others turn a thumb
        return float(np.clip(((now - closed)[moves] / (opened - closed)[moves]).max(initial=0.0), 0.0, 1.0))


def depths(widths: Array, gaps: tuple[float, ...]) -> Array:
    """Compute how far behind the grip point objects of widths (m,) may extend between open fingers (m,) [m].

    ``gaps`` are those of :attr:`Openings.widest_gaps`. Infinite for what is too wide even at the grip point: exact
    queries decide about that.
    """
    middle = len(SECTIONS) // 2
    fits = np.array(gaps)[middle::-1] >= widths[:, None] + SPARE
    deep = np.where(fits.all(axis=1), np.inf, -SECTIONS[middle::-1][np.maximum(fits.argmin(axis=1) - 1, 0)])
    return np.asarray(np.where(fits[:, 0], deep, np.inf))


def openings_of(arm: Arm, world: PlanningWorld) -> Openings:
    """Measure the openings of an arm's hand; for fingers without shapes all gaps are 0, so that the widest is used."""
    if arm.gripper is None:
        return Openings()
    gripper = arm.gripper
    fingers = tuple(_between(gripper, share) for share in np.linspace(0.0, 1.0, STEPS).tolist())
    moving = frozenset[int]().union(*map(world.robot.moved_by, gripper.joints))
    still = frozenset(world.robot.solid_names) - {world.robot.solid_names[number] for number in moving}
    measured = [_measured(arm, gripper, dict(one), world, still) for one in fingers]
    world.link_pose(arm.tip)  # puts the robot back into its own configuration
    gaps, ends = np.stack([one.gaps for one in measured]), np.array([one.end for one in measured])
    jaw = measured[-1].jaw
    return Openings(fingers, gaps if np.isfinite(gaps).any() else np.zeros_like(gaps), ends, jaw)


def _between(gripper: Gripper, share: float) -> Fingers:
    return tuple((name, (1.0 - share) * gripper.closed[name] + share * gripper.opened[name]) for name in gripper.joints)


@dataclass(frozen=True, slots=True)
class _Gap:
    """Gap at each section (s,) [m], how far fingers reach in front of the grip point [m], and a still jaw (2, 3)."""

    gaps: Array
    end: float
    jaw: Array


def _measured(
    arm: Arm, gripper: Gripper, joints: Mapping[str, float], world: PlanningWorld, still: Collection[str]
) -> _Gap:
    """Measure the gap between fingers at joint values; ``still`` are the links that they do not move.

    The gap is twice the least distance of any finger from the plane in the middle of the hand; with a still jaw it is
    the distance of the moving fingers from it.
    """
    configuration = Configuration((0.0, 0.0, 0.0), joints)
    to_tip = inverse(world.link_pose(arm.tip, configuration).matrix())
    numbers = {name: number for number, name in enumerate(world.robot.solid_names)}
    axes = np.stack([arm.approach, arm.closing], axis=1)
    least, end = np.full(len(SECTIONS), np.inf), 0.0
    outlined = {}
    for link in gripper.finger_links:
        if link not in numbers:
            continue
        frame = to_tip @ world.link_pose(link, configuration).matrix()
        outlined[link] = [_outline(frame @ hull.pose.matrix(), hull, axes) for hull in world.robot.hulls(numbers[link])]
    jaws = [one for link, outlines in outlined.items() if link in still for one in outlines]
    if jaws and len(jaws) < sum(map(len, outlined.values())):
        moving = [one for link, outlines in outlined.items() if link not in still for one in outlines]
        return _from_jaw(arm, jaws, moving)
    for outlines in outlined.values():
        side = float(np.sign(np.concatenate(outlines)[:, 1].mean()))
        for outline in outlines:
            least = np.minimum(least, _sections(outline * [1.0, side]))
            end = max(end, float(outline[:, 0].max()))
    return _Gap(np.asarray(2 * np.maximum(least, 0.0)), end, np.zeros((0, 3)))


def _from_jaw(arm: Arm, jaws: Sequence[Array], moving: Sequence[Array]) -> _Gap:
    """Measure the gap between the outlines of still jaws and those of moving fingers."""
    apart = np.concatenate(moving)[:, 1].mean() - np.concatenate(jaws)[:, 1].mean()
    side = 1.0 if apart > 0 else -1.0
    inner = np.min([_sections(one * [1.0, side]) for one in moving], axis=0)
    outer = -np.min([_sections(one * [1.0, -side]) for one in jaws], axis=0)
    surface = outer[len(SECTIONS) // 2]
    normal = side * np.asarray(arm.closing)
    jaw = np.array([surface * normal, normal]) if np.isfinite(surface) else np.zeros((0, 3))
    gaps = np.where(np.isfinite(outer), np.maximum(inner - outer, 0.0), np.inf)
    return _Gap(gaps, max(0.0, float(np.concatenate(moving)[:, 0].max())), jaw)


def _outline(at: Array, hull: ConvexSolid, axes: Array) -> Array:
    """Project a convex solid at a pose (4, 4) onto two axes (3, 2): points (n, 2) that span its outline."""
    points = moved(at, hull.points) @ axes
    extreme = points[sorted({*(points @ AROUND).argmax(axis=0).tolist()})]
    radius = hull.radius + hull.beyond
    return np.asarray((extreme[:, None] + radius * AROUND.T).reshape(-1, 2) if radius > 0 else extreme)


def _sections(outline: Array) -> Array:
    """Find the least second coordinate of a convex outline (n, 2) at each section of the first; infinite beside it.

    Every pair of points is treated as an edge, as inner ones do not change the minimum.
    """
    first, second = outline[:, None], outline[None]
    low, high = np.minimum(first[..., 0], second[..., 0]), np.maximum(first[..., 0], second[..., 0])
    run = np.where(high - low < 1e-9, 1.0, second[..., 0] - first[..., 0])
    shares = (SECTIONS[:, None, None] - first[..., 0]) / run
    values = first[..., 1] + shares * (second[..., 1] - first[..., 1])
    crossed = (low <= SECTIONS[:, None, None]) & (SECTIONS[:, None, None] <= high) & (high - low >= 1e-9)
    return np.asarray(np.where(crossed, values, np.inf).min(axis=(1, 2)))


REMEDY = "add such shapes to the URDF"
"""What to do about links without a collision shape."""
_SHOWN = 4
"""Number of links that are named."""


def bare_hand(mechanism: Mechanism, hand: str, solid: Collection[str]) -> str:
    """Word which links lack the shape that the opening of a hand follows from: "jaw has no <collision> shape".

    ``solid`` are the links with a collision shape. "" if two sides have one, which is enough to hold a thing: two
    fingers, or one and the palm.
    """
    fingers = {
        joint.name: [joint.child, *(one.child for one in mechanism.below(joint.child))]
        for joint in mechanism.fingers(hand)
    }
    return without_shapes(mechanism, hand, fingers, solid)


def without_shapes(
    mechanism: Mechanism, hand: str, fingers: Mapping[str, Sequence[str]], solid: Collection[str]
) -> str:
    """Word the same for known ``fingers``: the links that move with each."""
    bare = [links for links in fingers.values() if not any(link in solid for link in links)]
    touching = len(fingers) - len(bare)
    if not fingers or touching > 1:
        return ""
    links = {link.get("name", ""): link for link in read_urdf(mechanism.path).tree.iterfind("link")}
    lacking = _drawn((link for one in bare for link in one), links)  # others may be motors beside a finger
    if not lacking and not touching:
        lacking = [one[0] for one in bare]
    palm = mechanism.rigid_with(hand)
    if (len(fingers) == 1 or not lacking) and not any(link in solid for link in palm):
        lacking += _drawn(palm, links) or [hand]
    if not lacking:
        return ""
    usable = "usable " if any(links[link].find("collision") is not None for link in lacking) else ""
    return f"{in_series(lacking)} {'has' if len(lacking) == 1 else 'have'} no {usable}<collision> shape"


def replaced_meshes(urdf: Path, links: Collection[str]) -> list[str]:
    """List those of some links for whose collision meshes, which are missing or unreadable, there are boxes."""
    description = read_description(urdf)
    before, after = (
        {link.get("name", ""): len(link.findall("collision/geometry/mesh")) for link in tree.iterfind("link")}
        for tree in (read_urdf(urdf).tree, tree_of(description.text.encode()))
    )
    return [link for link in before if link in links and before[link] > after.get(link, before[link])]


def in_series(links: Iterable[str]) -> str:
    """Join the names of links: "a, b and c"."""
    *first, last = links
    if len(first) >= _SHOWN:
        return f"{', '.join(first[:_SHOWN])} and {len(first) + 1 - _SHOWN} others"
    return f"{', '.join(first)} and {last}" if first else last


def _drawn(names: Iterable[str], links: Mapping[str, Element]) -> list[str]:
    """Select the links that are drawn."""
    return [name for name in names if links[name].find("visual") is not None]
