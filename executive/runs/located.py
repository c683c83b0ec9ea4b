"""Result of a search for poses: the poses, the reasons for rejection, and how they are shown."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.pictures.scenery import Resolution, Scenery
from executive.runs.failure import Failure
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.notebooks import table
from planlang.outputs import PNG_OR_SVG, check_outputs
from planlang.outputs import replace as write_complete
from planlang.records import dataclass
from planlang.units import chosen_units, known_unit
from planlang.words import Option, Text

if TYPE_CHECKING:
    from planlang.sheets import Sheet

Drawn = tuple[Scenery, Resolution]
"""A room, and the candidates in it."""


@dataclass(frozen=True, slots=True)
class FoundPose:
    """Pose of the base, or of the centre of a thing's box, that matches a phrase; in the frame of the map."""

    x: float
    """[m], as ``y`` and ``z``."""
    y: float
    yaw: float
    """[rad]"""
    z: float | None = None
    """None for a base, which stands on the floor."""
    score: float | None = None
    """How well the phrase holds, in 0..1; None if no relation is graded."""
    arm: str | None = None
    """Arm that reaches from there."""
    reaches: tuple[str, ...] = ()
    """What that arm reaches from there, each with the grasp."""
    looks: tuple[tuple[float, float, float], ...] = ()
    """Base poses (x, y, yaw) from which the robot looks before."""
    hands: tuple[Mapping[str, Any], ...] = field(default=(), repr=False)
    """Postures of each hand: arm, link, joint values [rad, m] and poses of the link."""
    frame: Mapping[str, str] = field(default_factory=dict)
    """Words of the phrase such as ``left of`` -> the thing whose sides they refer to."""
    detail: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Further data of the search."""
    blocked_by: tuple[str, ...] | None = None
    """What the base, or the thing, would run into there in the true world; None if that is as the environment."""

    @property
    def row(self) -> dict[str, Any]:
        """The pose as a row of a table: x, y [m], yaw [rad], for things z [m], score, arm and what it reaches."""
        height = {} if self.z is None else {"z": self.z}
        numbers = {"x": self.x, "y": self.y, **height, "yaw": self.yaw, "score": self.score}
        blocked = {} if self.blocked_by is None else {"blocked_by": ", ".join(self.blocked_by)}
        return numbers | {"arm": self.arm, "reaches": ", ".join(self.reaches)} | blocked

    def as_json(self) -> dict[str, Any]:
        """The pose as JSON."""
        blocked = {} if self.blocked_by is None else {"blocked_by": [*self.blocked_by]}
        if self.z is not None:
            frame = {"frame": self.frame} if self.frame else {}
            return {"x": self.x, "y": self.y, "z": self.z, "yaw": self.yaw, **frame, **blocked}
        pose = {"x": self.x, "y": self.y, "yaw": self.yaw, "score": self.score}
        return {**pose, **self.detail, "hands": [*self.hands], **blocked}

    def line(self, shown: Shown) -> str:
        """Format the pose for people, with the arm and what it reaches."""
        height = {} if self.z is None else {"z": self.z}
        how = f"{self.arm_in_words}: {', '.join(self.reaches)}" if self.arm else ""
        how += "".join(f", after a look from {shown(x=x, y=y, yaw=yaw)}" for x, y, yaw in self.looks)
        how += f"  in the world it runs into {', '.join(self.blocked_by)}" if self.blocked_by else ""
        return f"{shown(x=self.x, y=self.y, **height, yaw=self.yaw)}  {how}".rstrip()

    @property
    def arm_in_words(self) -> str:
        """The arm in the words of phrases, "" without one."""
        return self.arm or "" if not self.arm or self.arm.endswith("arm") else f"{self.arm} arm"


@dataclass(frozen=True, slots=True)
class Located:
    """Meaning of a phrase in a map, and the poses that match it, best first; notebooks display it.

    It is the sequence of its poses: ``len(found)``, ``found[0]``, ``for pose in found``.
    """

    phrase: str
    """The phrase as understood, without unused arms and grasps."""
    poses: tuple[FoundPose, ...] = ()
    failure: Failure | None = None
    """Why there is no pose; None if there is one."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """Reasons for rejection -> number of candidates."""
    blocking: Mapping[str, int] = field(default_factory=dict)
    """Bodies in the way -> number of candidates that they block."""
    meant: Mapping[str, str] = field(default_factory=dict)
    """Things of the phrase -> bodies of the map."""
    posture: Mapping[str, float] = field(default_factory=dict)
    """Joint values of the robot at the start [rad, m]."""
    diagnostics: tuple[Diagnostic, ...] = ()
    sides: Mapping[str, tuple[str, tuple[float, float] | None, bool]] = field(default_factory=dict, repr=False)
    """Words such as ``left of`` -> whose sides they refer to, the viewpoint (x, y), True if it is the robot's."""
    lacks_capability: bool = False
    """True if the robot lacks the required part; then nothing was searched."""
    units: tuple[str, ...] = ()
    """Units of numbers in ``str()``, if other than m and rad."""
    drawn: Drawn | None = field(default=None, repr=False, compare=False)
    """What a picture of the candidates shows; None if no poses were searched."""

    def __len__(self) -> int:
        return len(self.poses)

    def __iter__(self) -> Iterator[FoundPose]:
        return iter(self.poses)

    def __getitem__(self, number: int) -> FoundPose:
        return self.poses[number]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The poses as rows, for ``pandas.DataFrame``; see :attr:`FoundPose.row`."""
        return [pose.row for pose in self.poses]

    def as_json(self) -> dict[str, Any]:
        """The result as JSON."""
        failed = {} if self.failure is None else {"failure": self.failure.as_json(), "message": self.failure.message}
        if self.lacks_capability:
            return failed
        return {
            "location": self.phrase,
            "meant": self.meant,
            "posture": self.posture,
            "solutions": [pose.as_json() for pose in self.poses],
            "counts": self.counts,
            "blocking": self.blocking,
            **failed,
        }

    def __str__(self) -> str:
        """Format for people: the phrase, whose sides it refers to, a line for each pose, and rejections."""
        shown = Shown(self.units)
        if self.lacks_capability and self.failure is not None:
            return f"{self.failure.type}: {self.failure.message}"
        lines = [f"{self.phrase}{shown.heading()}"]
        for words, (whose, point, by_robot) in self.sides.items():
            seen = "" if point is None else f"as seen from {'the robot at ' * by_robot}{shown(x=point[0], y=point[1])}"
            lines.append(f"  {words}: {'in its own frame' if whose == 'its own' else seen}")
        lines += [f"  {number}  {pose.line(shown)}" for number, pose in enumerate(self.poses, 1)]
        if self.failure is not None:
            lines.append(self.failure.message)
        elif self.counts:
            lines.append(f"  rejected: {', '.join(f'{number} {reason}' for reason, number in self.counts.items())}")
        return "\n".join(lines)

    def picture(self, path: str | PathLike[str], *, force: bool = False) -> Path:
        """Draw the room from above with candidates and reasons for rejection, as PNG or SVG; return the path.

        ``force`` overwrites a file that planlang did not write. Raises BadInput if the file cannot be written.
        """
        if self.drawn is None:
            raise BadInput([error("C041", "nothing to draw: no poses were searched", help=str(self))])
        target = Path(path)
        problems = check_outputs({"picture": target}, {}, formats={"picture": PNG_OR_SVG}, force=force)
        if problems:
            raise BadInput(problems)
        write_complete(target, _sheet(*self.drawn).save)
        return target

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        """Picture and table of the poses, for notebooks."""
        bundle = {"text/plain": str(self)}
        if self.drawn is not None:
            content = io.BytesIO()
            _sheet(*self.drawn).finished().save(content, format="PNG")
            picture = base64.b64encode(content.getvalue()).decode("ascii")
            rows = [[_rounded(value) for value in row.values()] for row in self.rows]
            poses = table([*self.rows[0]], rows) if rows else ""
            attributes = f'alt="{escape(self.phrase)}" style="max-width: 100%"'
            bundle["text/html"] = f'{poses}<img {attributes} src="data:image/png;base64,{picture}">'
        return bundle


def _sheet(scenery: Scenery, resolution: Resolution) -> Sheet:
    from executive.pictures.floor_plan import picture  # Pillow is slow to import, and most searches are not drawn

    return picture(scenery, resolution)


def _rounded(value: object) -> object:
    return "" if value is None else f"{value + 0.0:.3f}" if isinstance(value, float) else value


class Shown:
    """Formats numbers of poses with their names, in m and rad or in the user's units; BadInput for invalid units."""

    def __init__(self, names: Sequence[str]) -> None:
        self._chosen = chosen_units(names)
        shown = {known_unit(name).dimension for name in ("Meter", "Radian")}
        wrong = [name for dimension, name in self._chosen.items() if dimension not in shown]
        help = Text("lengths and angles are shown: ", Option("units", ["Centimeter", "DegreeAngle"]))
        if wrong:
            said = [Text(Option("units", one), ": neither a length nor an angle") for one in wrong]
            raise BadInput([error("C019", message, help=help) for message in said])

    def __call__(self, **numbers: float) -> str:
        """Format numbers [m, rad] with their names."""
        return "  ".join(f"{name} {self._number(number, name)}" for name, number in numbers.items())

    def _number(self, number: float, name: str) -> str:
        """Format a number to a millimetre or milliradian; adding zero avoids -0.000."""
        si = known_unit("Radian" if name == "yaw" else "Meter")
        own = known_unit(self._chosen.get(si.dimension, "Radian" if name == "yaw" else "Meter"))
        places = max(0, math.ceil(3 + math.log10(own.factor)))
        return f"{round(si.to(own, number), places) + 0.0:.{places}f}"

    def heading(self) -> str:
        """The user's units, in brackets."""
        return f" [{', '.join(self._chosen.values())}]" if self._chosen else ""
