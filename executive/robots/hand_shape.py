"""The shape of a hand: approach and closing directions, opened and closed positions, opening width and grip point.

Measured on the collision shapes of the fingers within their joint limits; without shapes, on the link origins. A hand
with a thumb closes it against all other fingers, other hands close fingers from both sides of the wrist's axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from executive.robots.anatomy import Limb
from executive.robots.mechanism import Mechanism, Part, is_tool, names
from executive.robots.openings import replaced_meshes, without_shapes
from executive.robots.robot import Axis
from executive.robots.thumbs import ROW, ThumbGrip, apart, thumb_gap, thumb_grip
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved, product, rotated
from planlang.geometry.urdf import Joint
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim import PlanningWorld

STRAIGHT, LOPSIDED = math.cos(math.radians(25)), math.cos(math.radians(45))
"""Least cosines to snap a direction to an axis: of any axis of the hand, and of the wrist for hands with one finger.

A single finger is beside the wrist's axis, so its direction deviates more.
"""
PAD = 0.02
"""Distance of the grip point behind the fingertips [m]; for short fingers, half their length."""
FRONT = 0.03
"""Length of the fingertips between which the gap is measured [m]."""
LEAST_TRAVEL = 0.002
"""Joints that move the fingers less than this do not open the hand [m]."""
SHARE = 0.95
"""Width of the widest object that fits, as a fraction of the gap."""
LEAST_OPENING = 0.01
"""Least plausible opening [m]: a smaller gap means that the fingers do not face each other."""
GREATEST_RANGE = {"revolute": 4 * math.pi, "continuous": 0.0, "prismatic": 0.3}
"""Greatest plausible range of a finger joint, or of a motor that fingers follow [rad, m]."""
FIRST = 0.25
"""Fraction of the way of a joint, from a flat hand to a fist, on which its fingers come nearer to the thumb."""
LEAST_SHARE = 0.05
"""Joints of a hand with a thumb that move it less than this fraction of the joint that moves it most spread fingers."""
WIDEST_GAP = 0.13
"""Greatest gap to which fingers that turn are opened [m]: wider ones no longer face each other."""
PARALLEL = math.cos(math.radians(8))
"""Least cosine between the attitudes of an open and a closed fingertip that counts as not turned."""
LEAST_CLOSED_GAP = -0.02
"""Least gap of closed fingers [m]: collision shapes are coarse and may overlap a little."""
STEPS = [k / 20 for k in range(21)]
"""Fractions of the travel from closed to opened at which the gap is measured."""
NEAR_GRIP = 0.05
"""Maximum distance of a tool link from the measured grip point for the link to be used as the tip [m]."""
FAR_GRIP = 0.3
"""The same for links ahead of fingers that have no shapes [m]."""

FIXED = ""
"""Name of the jaw that does not move, in place of a finger joint."""
Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class HandShape:
    """The shape of a hand; axes and offset are in the frame of ``tip``."""

    tip: str
    offset: Axis | None
    """Grip point [m]; None if it is the origin of the tip frame."""
    approach: Axis
    closing: Axis
    opened: Values
    closed: Values
    max_opening: float
    """Width of the widest object that fits [m]; 0 if it cannot be measured, or no finger moves."""
    fingers: tuple[str, ...]
    is_measured: bool
    """False if the approach is the axis of the wrist, as there are no fingers."""
    stuck: tuple[Joint, ...] = ()
    """Joints of fingers with an implausible range: none, without end, or too great."""
    size: float = 0.0
    """Greatest length of a finger [m]."""
    bare: str = ""
    """Which links lack the collision shapes that opening and grip point follow from; "" if none does."""
    unclear: str = ""
    """Why it is not clear which of many fingers oppose each other, so that the opening is a guess; "" if it is."""


def shape_of(limb: Limb, mechanism: Mechanism, world: PlanningWorld) -> HandShape:
    """Measure the hand at the end of a limb; moves the robot in ``world``."""
    return _Hand(limb, mechanism, world).shape()


class _Hand:
    """Measures a hand in a world. Points and directions are in the frame of the link that carries the fingers."""

    def __init__(self, limb: Limb, mechanism: Mechanism, world: PlanningWorld) -> None:
        self.limb, self.mechanism, self.world = limb, mechanism, world
        self.posture: Configuration | None = None
        """Posture of the hand that frames and points are of; None for that of the robot in ``world``."""
        self.links = {
            joint.name: [joint.child, *(one.child for one in mechanism.below(joint.child, limb.fingers))]
            for joint in limb.fingers
        }
        """Finger joint -> links that move with it, without those of a finger that hangs from it."""
        inner = [j for j in mechanism.joints.values() if any(j.child in links for links in self.links.values())]
        driven = [j for j in inner if mechanism.actuated(j.name) and not names(Part.SPRING, j.name, j.child)]
        self.joints = [joint for joint in driven if 0 < joint.upper - joint.lower <= GREATEST_RANGE[joint.kind]]
        self.stuck = [joint for joint in driven if joint not in self.joints]
        """Finger joints whose range is implausible."""
        thumbs = {name for name, links in self.links.items() if names(Part.THUMB, name, *links)}
        each = all(any(joint.child in links for joint in self.joints) for links in self.links.values())
        thumbs = thumbs or (apart(self._roots()) if each else set())  # bars of a linkage have no motors of their own
        self.thumbs = thumbs if len(thumbs) < len(self.links) > 2 else set[str]()
        """Finger joints of thumbs, which oppose all others; empty for hands without one."""
        self.rest = {
            joint.name: min(max(0.0, joint.lower), joint.upper) if self.thumbs else (joint.lower + joint.upper) / 2
            for joint in self.joints
        }
        """Values of finger joints that are not varied: hands with a thumb are flat at zero."""
        boxes = replaced_meshes(mechanism.path, {link for links in self.links.values() for link in links})
        self.faces_known = bool(self.thumbs) or not boxes
        """Whether the shapes of the fingers show where they face each other: boxes of their inertia fill more."""
        self.wrist = self._place(limb.joints[-1].child)
        self.grip: ThumbGrip | None = None
        """How a hand with a thumb closes."""

    def shape(self) -> HandShape:
        ahead = self._ahead()
        approach = ahead if ahead is not None else self._roll_axis()
        closing = self._closing(approach)
        opened, closed = self._ends(approach, closing)
        grip = self._grip(approach, closing, opened, closed) if ahead is not None else None
        tip, offset = self._tip(grip, approach)
        turn = self._frame(tip)[:3, :3].T
        links = [link for links in self.links.values() for link in links]
        touching = [link for link in links if link in self.world.robot.solid_names] or links
        fingers = (points for name, points in self._points({}).items() if name != FIXED)
        return HandShape(
            tip,
            offset,
            _axis(rotated(turn, approach)),
            _axis(rotated(turn, closing)),
            opened,
            closed,
            self._opening(approach, closing, opened, closed) if opened else 0.0,
            tuple(dict.fromkeys((*touching, *(self._jaw(approach) if opened else ())))),
            ahead is not None,
            tuple(self.stuck),
            max((float(np.ptp(points, axis=0).max()) for points in fingers), default=0.0),
            without_shapes(self.mechanism, self.limb.hand, self.links, self.world.robot.solid_names),
            self._unclear(),
        )

    def _unclear(self) -> str:
        """Word why the fingers of a hand of many cannot be told apart."""
        count = len(self.links)
        if not self.thumbs:
            own = [name for name, links in self.links.items() if any(joint.child in links for joint in self.joints)]
            return f"none of its {count} fingers is a thumb by its name or place" if len(own) >= ROW else ""
        if len(self.thumbs) > 1:
            return f"{len(self.thumbs)} of its {count} fingers are thumbs by their names"
        for joint in self.joints:
            one, other = (self._points({joint.name: value}) for value in (joint.lower, joint.upper))
            moved_by = {name for name in one if np.linalg.norm(other[name] - one[name], axis=1).max() > LEAST_TRAVEL}
            if moved_by & self.thumbs and moved_by - self.thumbs:
                return f"{joint.name} moves the thumb and fingers at once"
        return ""

    # Frames and points

    def _frame(self, link: str) -> Array:
        """Pose (4, 4) of a link in the frame of the hand."""
        to_hand = inverse(self.world.link_pose(self.limb.hand, self.posture).matrix())
        return np.asarray(product(to_hand, self.world.link_pose(link, self.posture).matrix()))

    def _place(self, link: str) -> Array:
        return np.asarray(self._frame(link)[:3, 3])

    def _points(self, values: Values) -> dict[str, Array]:
        """Points (n, 3) of each finger at joint values; a hand with a single finger has the fixed jaw as well."""
        joints = self.world.robot.joints
        posture = {name: value for name, value in {**self.rest, **values}.items() if name in joints}
        self.posture = Configuration((0.0, 0.0, 0.0), posture)
        points = {}
        for finger, links in self.links.items():
            drawn = self._drawn(links)
            points[finger] = np.concatenate(drawn) if drawn else np.stack([self._place(link) for link in links])
        palm = self._drawn(self.mechanism.rigid_with(self.limb.hand))
        if len(self.links) == 1 and palm:
            points[FIXED] = np.concatenate(palm)
        return points

    def _drawn(self, links: Iterable[str]) -> list[Array]:
        """Points (n, 3) of the shape of each of some links that has one."""
        solid = {name: number for number, name in enumerate(self.world.robot.solid_names)}
        to_hand = inverse(self.world.link_pose(self.limb.hand, self.posture).matrix())
        return [moved(to_hand, one) for one in self.world.robot.points([solid[one] for one in links if one in solid])]

    def _roots(self) -> dict[str, Array]:
        """Where each finger begins (3,)."""
        return {joint.name: self._place(joint.child) for joint in self.limb.fingers}

    # Directions

    def _ahead(self) -> Array | None:
        """Direction from the wrist to the fingers (3,); None without fingers, or if they surround the wrist.

        If that is oblique, the direction from the roots of the fingers to their middles: some hang below the wrist.
        """
        points = {name: one for name, one in self._points({}).items() if name not in self.thumbs}
        if not points:
            return None
        middle = np.mean([one.mean(axis=0) for one in points.values()], axis=0)
        moving = [name for name in points if name != FIXED]
        roots = np.mean([self._place(self.mechanism.joints[name].child) for name in moving], axis=0)
        ways = [middle - self.wrist, middle - roots, *([roots - self.wrist] if self.thumbs else [])]
        if np.linalg.norm(ways[0]) < LEAST_TRAVEL:
            return None
        ways = [way / np.linalg.norm(way) for way in ways if np.linalg.norm(way) >= LEAST_TRAVEL]
        straight = [way for one in ways if (way := self._along_an_axis(one)) is not None]
        return straight[0] if straight else self._of_a_tool(ways[min(1, len(ways) - 1)])

    def _of_a_tool(self, direction: Array) -> Array:
        """Find the axis of a link named as a tool that is close to a direction; the direction if there is none."""
        tools = [link for link in self.mechanism.rigid_with(self.limb.hand) if is_tool(link)]
        axes = [axis * sign for link in tools for axis in self._frame(link)[:3, :3].T for sign in (1.0, -1.0)]
        best = max(axes, key=lambda axis: round(float(axis @ direction), 6), default=direction)
        return best if float(best @ direction) >= LOPSIDED else direction

    def _along_an_axis(self, direction: Array) -> Array | None:
        """Find the axis of the hand or of the wrist's last joint that is close to a direction; None if none is."""
        wrist = self._last_axis()
        best = max([*np.eye(3), wrist], key=lambda axis: round(abs(float(axis @ direction)), 6))
        cosine = float(best @ direction)
        if abs(cosine) >= STRAIGHT:
            return np.asarray(best * math.copysign(1.0, cosine))
        cosine = float(wrist @ direction)
        is_likely = len(self.links) == 1 and abs(cosine) >= LOPSIDED
        return wrist * math.copysign(1.0, cosine) if is_likely else None

    def _last_axis(self) -> Array:
        last = self.limb.joints[-1]
        return rotated(self._frame(last.child)[:3, :3], last.axis)

    def _roll_axis(self) -> Array:
        """Axis of the last joint, pointing out of the arm: the approach of a hand without fingers."""
        axis = self._last_axis()
        elbow = self._place(self.limb.joints[-2].child)
        outwards = float(axis @ (self._place(self.limb.hand) - elbow))
        return -axis if outwards < -1e-6 else axis

    def _closing(self, approach: Array) -> Array:
        """Direction (3,), perpendicular to the approach, in which the fingers move most, or from them to the thumb."""
        best = np.zeros(3)
        if self.thumbs:
            self.grip = thumb_grip(self._points, self._roots(), self.thumbs, self.joints, self.rest, approach)
            if self.grip is not None:
                across = self._across(self.grip.closing, approach)
                opened, _ = self._steps(approach, across, self.grip.opened, self.grip.closed)
                gap = self._gap(approach, across, opened)
                if gap is not None and gap[1] - gap[0] >= LEAST_OPENING:
                    return across
                self.grip = None  # the thumb's tip is nowhere before the fingers
            fingers, thumb = self._middles(self._points({}))
            across = thumb - fingers - approach * float((thumb - fingers) @ approach)
            if np.linalg.norm(across) > LEAST_TRAVEL:
                return self._across(across, approach)
        for joint in self.joints:
            ends = [self._points({joint.name: value}) for value in (joint.lower, joint.upper)]
            for finger in self.links:
                travel = (ends[1][finger] - ends[0][finger]).mean(axis=0)
                travel = travel - approach * float(travel @ approach)
                if np.linalg.norm(travel) > np.linalg.norm(best) + LEAST_TRAVEL:
                    best = travel
        if np.linalg.norm(best) < LEAST_TRAVEL:
            best = min(np.eye(3)[[1, 0, 2]], key=lambda axis: round(abs(float(axis @ approach)), 6))
        return self._across(best, approach)

    def _across(self, direction: Array, approach: Array) -> Array:
        """Unit vector (3,) along a direction, if it is close to an axis along that, perpendicular to the approach."""
        across = direction / np.linalg.norm(direction)
        axis = self._along_an_axis(across)
        across = across if axis is None else axis
        across = across - approach * float(across @ approach)
        return np.asarray(across / np.linalg.norm(across))

    def _middles(self, points: Mapping[str, Array]) -> tuple[Array, Array]:
        """Middles (3,) of the fingers and of the thumb."""
        fingers = [one.mean(axis=0) for name, one in points.items() if name not in self.thumbs]
        thumbs = [one.mean(axis=0) for name, one in points.items() if name in self.thumbs]
        return np.asarray(np.mean(fingers, axis=0)), np.asarray(np.mean(thumbs, axis=0))

    # Opening

    def _ends(self, approach: Array, closing: Array) -> tuple[Values, Values]:
        """Joint values of the opened and the closed hand, of the joints that open it."""
        if not self.joints:
            return {}, {}
        if self.grip is not None:
            return self._steps(approach, closing, self.grip.opened, self.grip.closed)
        opened, closed, travels = {}, {}, {}
        for joint in self.joints:
            ends = [self._towards(joint, limit) for limit in (joint.lower, joint.upper)]
            low, high = (self._spread(closing, {joint.name: value}) for value in ends)
            limits = (joint.lower, joint.upper) if low < high else (joint.upper, joint.lower)
            closed[joint.name], opened[joint.name], travels[joint.name] = *limits, abs(high - low)
        least = LEAST_SHARE * max(travels.values()) if self.thumbs else LEAST_TRAVEL
        opening = [name for name, travel in travels.items() if travel >= least] or list(travels)
        wide, narrow = ({name: values[name] for name in opening} for values in (opened, closed))
        return self._steps(approach, closing, wide, narrow)

    def _steps(self, approach: Array, closing: Array, wide: Values, narrow: Values) -> tuple[Values, Values]:
        """Select the opened and the closed position on the way between two."""
        steps = [{name: narrow[name] + t * (wide[name] - narrow[name]) for name in wide} for t in STEPS]
        gaps = [self._gap(approach, closing, values) for values in steps]
        widths = {k: gap[1] - gap[0] for k, gap in enumerate(gaps) if gap is not None}
        stays = self._stays_parallel(approach, wide, narrow)
        wide_enough = [k for k, width in widths.items() if stays or width <= WIDEST_GAP]
        by_width = stays or bool(self.thumbs)
        last = max(wide_enough, key=lambda k: (round(widths[k], 3) if by_width else 0.0, k), default=len(STEPS) - 1)
        return steps[last], steps[self._shut(widths, last)]

    def _stays_parallel(self, approach: Array, wide: Values, narrow: Values) -> bool:
        """Check whether the link at the tip of each finger keeps its attitude as the hand opens."""
        turns, ends = list[dict[str, Array]](), list[str]()
        for values in (wide, narrow):
            self._points(values)  # takes this posture
            ends = ends or self._ends_ahead(approach)
            turns.append({link: self._frame(link)[:3, :3] for link in ends})
        return all((np.trace(turns[0][link].T @ turns[1][link]) - 1) / 2 >= PARALLEL for link in ends)

    def _shut(self, widths: Mapping[int, float], last: int) -> int:
        """Find the step at which the fingers are closed: beyond it they overlap, or pass each other and part again.

        While they are far apart a step may widen the gap: another part of turning fingers is in front.
        """
        narrower = [k for k, width in widths.items() if width >= LEAST_CLOSED_GAP and k < last]
        if self.thumbs or len(self.links) == 1:
            return min(narrower, default=0)
        shut = last
        for k in sorted(narrower, reverse=True):
            parts_again = widths[k] > widths[shut] + LEAST_TRAVEL and widths[shut] < widths[last] / 2
            if k < shut - 1 or parts_again:
                break
            shut = k
        return shut if shut < last else 0

    def _towards(self, joint: Joint, limit: float) -> float:
        """Value that shows what a joint does on its way to a limit: a fist that is shut is far from its thumb."""
        rest = self.rest[joint.name]
        return rest + FIRST * (limit - rest) if self.thumbs else limit

    def _spread(self, closing: Array, values: Values) -> float:
        """Mean distance of the fingers from the wrist's axis along the closing direction, or from the thumb [m]."""
        if self.thumbs:
            fingers, thumb = self._middles(self._points(values))
            return float(np.linalg.norm(fingers - thumb)) / 2
        middles = [float(closing @ (one.mean(axis=0) - self.wrist)) for one in self._points(values).values()]
        return float(np.mean(np.abs(middles)))

    def _ends_ahead(self, approach: Array) -> list[str]:
        """List the link at the tip of each finger: of those with a shape, as motors beside a finger have none."""
        solid = frozenset(self.world.robot.solid_names)
        fingers = [links for links in self.links.values() if not solid.isdisjoint(links)] or list(self.links.values())
        ends = list[str]()
        for links in fingers:
            ahead = {link: float((self._of_link(link) @ approach).max()) for link in links}
            ends.append(max(ahead, key=lambda link: round(ahead[link], 6)))
        return ends

    def _of_link(self, link: str) -> Array:
        """Points (n, 3) of the shape of a link; without one, its origin."""
        return next(iter(self._drawn([link])), self._place(link)[None])

    def _tips_apart(self, approach: Array, closing: Array, values: Values) -> float:
        """Mean distance of the fingertips from the wrist's axis along the closing direction [m]."""
        self._points(values)  # takes this posture
        tips = [self._of_link(link).mean(axis=0) for link in self._ends_ahead(approach)]
        return float(np.mean([abs(closing @ (tip - self.wrist)) for tip in tips]))

    def _opening(self, approach: Array, closing: Array, opened: Values, closed: Values) -> float:
        """Width of the widest object that fits [m]: from the gap between the fingers, else from their travel.

        0 if neither is plausible: several fingers around the palm, or fingers with a single joint and no shapes.
        """
        gap = self._gap(approach, closing, opened)
        if gap is None or gap[1] - gap[0] < LEAST_OPENING:
            width = 2 * (self._tips_apart(approach, closing, opened) - self._tips_apart(approach, closing, closed))
        else:
            width = gap[1] - gap[0]
        return round(SHARE * width, 3) if width >= LEAST_OPENING else 0.0

    def _gap(self, approach: Array, closing: Array, values: Values) -> tuple[float, float, float] | None:
        """Interval of the gap between the fingertips along the closing direction, and where it ends along the approach.

        In metres; None if all fingers are on one side, or boxes stand for their meshes.
        """
        if not self.faces_known:
            return None
        points = self._points(values)
        if self.grip is not None:
            return thumb_gap(points, self._roots(), self.thumbs, approach, closing)
        middles = {name: float((one @ closing).mean()) for name, one in points.items()}
        middle = sum(middles.values()) / 2 if len(self.links) == 1 else float(closing @ self.wrist)
        sides: tuple[list[Array], list[Array]] = [], []
        for name, one in points.items():
            sides[name in self.thumbs if self.thumbs else middles[name] > middle].append(one)
        if not all(sides):
            return None
        ends = [max(float((one @ approach).max()) for one in side) for side in sides]
        end = min(ends) if self.thumbs else max(ends)
        inner: list[list[float]] = []
        for side, innermost in zip(sides, (np.max, np.min), strict=True):
            along = [one @ approach for one in side]
            fronts = [(one @ closing)[(at >= end - FRONT) & (at <= end)] for one, at in zip(side, along, strict=True)]
            inner.append([float(innermost(front)) for front in fronts if len(front)])
        return (max(inner[0]), min(inner[1]), end) if inner[0] and inner[1] else None

    def _jaw(self, approach: Array) -> list[str]:
        """List the links on which a single finger closes: those of the palm that reach as far forward as it does."""
        if len(self.links) != 1:
            return []
        end = max(float((one @ approach).max()) for name, one in self._points({}).items() if name != FIXED)
        palm = [link for link in self.mechanism.rigid_with(self.limb.hand) if link in self.world.robot.solid_names]
        along = (float((one @ approach).max()) for one in self._drawn(palm))
        return [link for link, front in zip(palm, along, strict=True) if front >= end - FRONT]

    # Where it grips

    def _grip(self, approach: Array, closing: Array, opened: Values, closed: Values) -> Array:
        """Find the grip point (3,) between the tips of the closed fingers; for a thumb, which advances, halfway."""
        if self.grip is not None:
            closed = {name: (value + opened[name]) / 2 for name, value in closed.items()}
        points = np.concatenate(list(self._points(closed).values()))
        along = points @ approach
        gap = self._gap(approach, closing, closed)
        end, start = float(along.max()) if gap is None else gap[2], float(along.min())
        depth = end - (min(PAD, (end - start) / 2) if self.grip is None else 0.0)  # a thumb slants away from its base
        middle = float(closing @ self.wrist) if gap is None else sum(gap[:2]) / 2
        third = np.cross(approach, closing)
        height = float((points[along >= end - FRONT] @ third).mean())
        wrist = float(third @ self.wrist)
        point = depth * approach + middle * closing + (wrist if abs(height - wrist) < PAD / 2 else height) * third
        return np.asarray(point.round(4) + 0.0)

    def _tip(self, grip: Array | None, approach: Array) -> tuple[str, Axis | None]:
        """Choose the tip link, and the grip point in its frame: a tool link near the grip point, else the hand.

        Fingers without shapes end somewhere ahead of their frames, so there a tool link may be farther.
        """
        group = self.mechanism.rigid_with(self.limb.hand)
        tools = [link for link in group if is_tool(link)]
        if grip is None:
            return (self.limb.hand if self.limb.hand in tools or not tools else tools[-1]), None
        is_drawn = any(link in self.world.robot.solid_names for links in self.links.values() for link in links)
        away = {link: self._place(link) - grip for link in tools}
        near = {
            link: float(np.linalg.norm(way))
            for link, way in away.items()
            if np.linalg.norm(way) <= NEAR_GRIP or (not is_drawn and 0.0 < float(way @ approach) <= FAR_GRIP)
        }
        nearest = min(near, key=lambda link: near[link], default=None)
        if nearest is not None:
            return nearest, None
        return self.limb.hand, _axis(grip)


def _axis(values: Iterable[float]) -> Axis:
    x, y, z = (round(float(value), 4) + 0.0 for value in values)
    return x, y, z
