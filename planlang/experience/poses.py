"""Poses over time as JSON Lines: each line is a transform with the fields of ROS' tf, as in NEEMs.

A trace has poses when the robot perceives or computes them, and the believed poses of things at the end of each step
of the plan; a pose log (``planlang run --poses``) also has the motion in between.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from planlang.diagnostics import BadInput, Span, error
from planlang.experience.traces import LONGEST, roles_of
from planlang.files import encoding_of, read_file
from planlang.outputs import MARK
from planlang.records import dataclass
from planlang.runs.schema import LATEST
from planlang.words import Blank, Text, calling

MAP = "map"
"""Frame of the environment, in which the poses of the base and of bodies are expressed."""
BASE = "base"
IDENTITY = ("seed", "schedule", "plan_sha256", "robot_sha256", "map_sha256")
"""Keys of a trace's header that identify the run of a pose log."""
LARGEST = 200_000_000
"""Maximum size of a pose log [bytes]."""
EPOCH = datetime.fromtimestamp(0, UTC)
"""Time stamp of the beginning of a run if it is unknown."""


@dataclass(frozen=True, slots=True)
class Transform:
    """The pose of a frame in another at a time [world steps]: position [m], unit quaternion (x, y, z, w).

    ``by`` is its source: ``world``, the robot's ``belief``, its ``perception``, or a ``log`` of the world.
    """

    step: int
    frame: str
    child: str
    position: tuple[float, ...]
    orientation: tuple[float, ...]
    by: str


def transforms_in(records: Iterable[Mapping[str, Any]]) -> Iterator[Transform]:
    """Yield the poses in the records of a trace; malformed ones are skipped."""
    thing_of: dict[Any, str] = {}
    for record in records:
        step, node = record["step"], record.get("node")
        match record:
            case {"event": "header", "start": list(base)}:
                yield from _base(step, base)
            case {"event": "request", "action": str(action)} if isinstance(node, int):
                things = [role.filler for role in roles_of(action) if role.property == "objectActedOn"]
                thing_of[node] = things[0] if len(things) == 1 else ""
            case {"event": "performed", "value": dict(value)} if isinstance(node, int) and thing_of.get(node):
                yield from _pose(step, thing_of[node], value, "perception")
            case {"event": "belief", "name": str(name), "pose": dict(pose)}:
                yield from _pose(step, name, pose, "belief")
            case {"event": "completed", "left": dict(left)}:
                yield from _base(step, left.get("base"))
                yield from _believed(step, left.get("belief"))


def _believed(step: int, left: object) -> Iterator[Transform]:
    """Yield the believed poses of moved things in the map, and of held things in the frame of the hand."""
    belief = left if isinstance(left, dict) else {}
    poses, held = belief.get("poses"), belief.get("held")
    in_hands = held if isinstance(held, dict) else {}
    for name, pose in poses.items() if isinstance(poses, dict) else ():
        if isinstance(pose, dict) and name not in in_hands:
            yield from _pose(step, name, pose, "belief")
    for name, how in in_hands.items():
        match how:
            case [[[str(_), str(link), dict(offset)], *_], *_]:
                yield from _pose(step, name, offset, "belief", link)


def _base(step: int, base: object) -> Iterator[Transform]:
    numbers = _numbers(base, 3)
    if numbers is not None:
        x, y, yaw = numbers
        yield Transform(step, MAP, BASE, (x, y, 0.0), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)), "world")


def _pose(step: int, name: str, pose: Mapping[str, Any], by: str, frame: str = MAP) -> Iterator[Transform]:
    stated = ((pose.get(key), size) for key, size in (("position", 3), ("orientation", 4)))
    position, orientation = (
        _numbers(value.get("$tuple") if isinstance(value, dict) else value, size) for value, size in stated
    )
    if position is not None and orientation is not None:
        yield Transform(step, frame, name, position, orientation, by)


def _numbers(values: object, size: int) -> tuple[float, ...] | None:
    if not isinstance(values, list) or len(values) != size:
        return None
    if not all(type(one) in (int, float) and abs(one) < LATEST for one in values):
        return None
    return tuple(map(float, values))


def pose_lines(transforms: Iterable[Transform], rate: float, began: datetime | None, **known: object) -> Iterator[str]:
    """Yield the lines of a file: first what is ``known`` of the run, then transforms in their order.

    Time stamps are in UTC. If it is unknown when the run ``began``, they count from 1970.
    """
    head = {"file": f"poses, {MARK}", "rate": rate, **known, "began": None if began is None else began.isoformat()}
    yield json.dumps(head) + "\n"
    yield from transform_lines(transforms, rate, began)


def transform_lines(
    transforms: Iterable[Transform], rate: float, began: datetime | None, first: int = 0
) -> Iterator[str]:
    """Yield the lines of transforms, numbered from ``first`` on."""
    start = (EPOCH if began is None else began).astimezone(UTC)
    for number, one in enumerate(transforms, first):
        moment = (start + timedelta(seconds=one.step / rate)).isoformat(timespec="microseconds")
        stamp = {"$date": moment.replace("+00:00", "Z")}
        line = {
            "header": {"seq": number, "stamp": stamp, "frame_id": one.frame},
            "child_frame_id": one.child,
            "transform": {
                "translation": dict(zip("xyz", one.position, strict=True)),
                "rotation": dict(zip("xyzw", one.orientation, strict=True)),
            },
            "step": one.step,
            "by": one.by,
        }
        yield json.dumps(line) + "\n"


def read_poses(lines: Sequence[str]) -> tuple[Mapping[str, Any], list[Transform]]:
    """Read the header line and the transforms of a pose log. Raises ValueError, with the line, if one is malformed.

    An incomplete last line is skipped.
    """
    head: Mapping[str, Any] = {}
    transforms: list[Transform] = []
    for number, line in enumerate(lines, 1):
        if number == len(lines) and not line.endswith("\n"):
            break
        try:
            value = json.loads(line)
            if number == 1:
                head = dict(value)
                continue
            transforms.append(_transform(value))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise ValueError(f"line {number} is not a pose") from None
    return head, transforms


def read_log(path: Path, header: Mapping[str, Any]) -> list[Transform]:
    """Read the pose log of the run with a certain trace header. Raises BadInput for malformed logs and other runs."""
    content = read_file(path, "C001", largest=LARGEST)
    lines = content.decode(encoding_of(content), errors="replace").splitlines(keepends=True)
    try:
        head, transforms = read_poses(lines)
    except ValueError as problem:
        raise BadInput([error("K081", f"not a pose log: {problem}", Span(str(path)))]) from None
    if any(one.step > header["rate"] * LONGEST for one in transforms):
        raise BadInput([error("K081", "a pose has an impossible time", Span(str(path)))])
    differing = [key for key in IDENTITY if head.get(key) != header.get(key)]
    if differing:
        advice = Text(calling("run", Blank("PLAN"), trace="run.jsonl", poses="poses.jsonl"), " writes both")
        message = f"the poses belong to another run: {', '.join(differing)} differ"
        raise BadInput([error("K081", message, Span(str(path)), advice)])
    return transforms


def _transform(value: Any) -> Transform:
    moved = value["transform"]
    position = _numbers([moved["translation"][axis] for axis in "xyz"], 3)
    orientation = _numbers([moved["rotation"][axis] for axis in "xyzw"], 4)
    step = value["step"]
    if position is None or orientation is None or type(step) is not int or not 0 <= step <= LATEST:
        raise ValueError
    return Transform(
        step, str(value["header"]["frame_id"]), str(value["child_frame_id"]), position, orientation, str(value["by"])
    )
