"""Robot files: the parameters of a robot that OWL cannot express well, in a TOML file beside its URDF.

```toml
name = "amigo"                  # required
urdf = "amigo.urdf"             # required: beside this file, or in an installed package (below)
self_model = "amigo.omn"        # OWL self-model; without one, [arms.*] describe the robot
torso = "spindle_joint"
allowed_contacts = [["a", "b"]] # links that may touch

[base]                          # required: radius [m], speeds [m/s, rad/s], accelerations, jerk; or fixed = true
[mount]                         # stand of a URDF without a base: size (x, y, z, or diameter and height), at [m]
[arms.right]                    # tip, tool_offset (grip point in its frame [m]), hand, side, approach, closing,
                                # payload: the largest mass that the hand carries [kg]
[arms.right.gripper]            # joints opened/closed by name, max_opening [m], fingers (links)
[camera]                        # link, fov [rad], near, far [m], width, height [pixels], forward, up, neck (joints),
                                # recognises (classes; all)
[camera.noise]                  # how it errs: position [m], position_per_metre [m/m], angle [rad], misses,
                                # misses_hidden, misses_far (probabilities); exact without
[camera.noise.confusions.CLASS] # class for which its things are taken = probability
[joints.NAME]                   # speed, acceleration, jerk; [joints.default] for all others; limits (lower, upper)
                                # if those of the URDF are wrong
[postures.NAME]                 # joint = position
```

A URDF in a package: ``urdf = { package = "pybullet", file = "franka_panda/panda.urdf" }``, with the end of the file's
path; ``extra`` is the extra of planlang that installs the package.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.robots.mechanism import Mount, NotInstalled, Range, ToolPoint, mounted, packaged
from executive.robots.robot import Axis, BaseDrive, JointLimits
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.extras import install_command
from planlang.files import beginning, decode, read_file
from planlang.geometry.urdf_schema import FARTHEST
from planlang.records import dataclass
from sim import CameraModel
from sim.scene import CameraNoise

_KEYS: dict[str, tuple[str, ...]] = {
    "": (
        *("name", "urdf", "self_model", "torso", "allowed_contacts"),
        *("base", "mount", "arms", "camera", "joints", "postures"),
    ),
    "urdf": ("package", "file", "extra"),
    "mount": ("size", "at"),
    "base": ("radius", "speed", "acceleration", "turn_speed", "turn_acceleration", "jerk", "fixed"),
    "arms.*": ("tip", "tool_offset", "hand", "side", "approach", "closing", "payload", "gripper"),
    "arms.*.gripper": ("opened", "closed", "fingers", "max_opening"),
    "camera": ("link", "fov", "near", "far", "width", "height", "forward", "up", "neck", "recognises", "noise"),
    "camera.noise": (
        *("position", "position_per_metre", "angle", "misses", "misses_hidden", "misses_far", "confusions"),
    ),
    "joints.*": ("speed", "acceleration", "jerk", "limits"),
}
"""Valid keys of each table."""
_RANGES: Mapping[tuple[str, str], tuple[float, float, str]] = {
    ("base", "radius"): (0.01, 100.0, "m"),
    ("base", "speed"): (0.01, 100.0, "m/s"),
    ("base", "acceleration"): (0.01, 1000.0, "m/s2"),
    ("base", "turn_speed"): (0.01, 100.0, "rad/s"),
    ("base", "turn_acceleration"): (0.01, 1000.0, "rad/s2"),
    ("base", "jerk"): (0.01, 1e5, "m/s3"),
    ("joints.*", "speed"): (0.001, 100.0, "rad/s or m/s"),
    ("joints.*", "acceleration"): (0.001, 1e4, "rad/s2 or m/s2"),
    ("joints.*", "jerk"): (0.001, 1e6, "rad/s3 or m/s3"),
    ("arms.*", "payload"): (1e-3, 1e4, "kg"),
    ("arms.*.gripper", "max_opening"): (1e-4, 100.0, "m"),
    ("camera", "fov"): (0.01, 3.1, "rad"),
    ("camera", "near"): (1e-3, 100.0, "m"),
    ("camera", "far"): (0.01, 1000.0, "m"),
    ("camera", "width"): (1, 4096, "pixels"),
    ("camera", "height"): (1, 4096, "pixels"),
    ("camera.noise", "position"): (0.0, 1.0, "m"),
    ("camera.noise", "position_per_metre"): (0.0, 1.0, "m/m"),
    ("camera.noise", "angle"): (0.0, 1.0, "rad"),
    **{("camera.noise", key): (0.0, 1.0, "") for key in ("misses", "misses_hidden", "misses_far")},
}
"""Plausible ranges: beyond them, motions take years or no time, and pictures no or all memory."""
_SHOWN = 60
"""Characters of a bad value in a message."""
_FARTHEST = 100.0
"""Greatest coordinate of a point at a hand or a base, and greatest extent of a mount [m]."""


@dataclass(frozen=True, slots=True)
class GripperNumbers:
    """A gripper: joint values when opened and closed, finger links, width of the widest object that fits [m]."""

    opened: Mapping[str, float]
    closed: Mapping[str, float]
    fingers: tuple[str, ...]
    max_opening: float


@dataclass(frozen=True, slots=True)
class ArmNumbers:
    """An arm, defined by its tip frame; the axes are unit vectors in that frame."""

    name: str
    tip: str
    """A link; with a tool offset, the one that :func:`mounted` adds at the grip point."""
    hand: str
    side: str | None
    approach: Axis
    closing: Axis
    gripper: GripperNumbers | None
    payload: float = math.inf
    """Largest mass that the hand carries [kg]."""


@dataclass(frozen=True, slots=True)
class RobotFile:
    """The content of a robot's TOML file."""

    path: Path
    name: str
    urdf: Path
    self_model: Path | None
    torso: str | None
    base: BaseDrive
    arms: tuple[ArmNumbers, ...]
    camera: CameraModel | None
    neck: tuple[str, ...]
    default_limits: JointLimits
    limits: Mapping[str, JointLimits]
    postures: Mapping[str, Mapping[str, float]]
    allowed_contacts: tuple[tuple[str, str], ...]
    tools: Mapping[str, ToolPoint]
    """Links to add at grip points, by name."""
    ranges: Mapping[str, Range]
    """Lower and upper limits [rad, m] to use instead of those of the URDF, by joint."""
    span: Callable[[str], Span]
    """Source span of a dotted key, or of the nearest table around it."""


DEFAULT_BASE = BaseDrive(0.4, 0.5, 0.5, 0.8, 0.8, 5.0)
"""Base of a robot with a URDF only: slow and wide, to be safe."""

DEFAULT_LIMITS = JointLimits(0.5, 1.0, 10.0)
"""Limits of a joint without numbers; the URDF's speed is used if it is lower."""


def tool_link(arm: str) -> str:
    """Name of the link that is added at the grip point of an arm."""
    return f"tool_point_of_{arm}"


def looks_like_toml(path: Path) -> bool:
    """Check whether a file is a robot file: by its content, and by its suffix if it has no content of another kind."""
    head = beginning(path)
    lines = [line.strip() for line in head.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if path.suffix.lower() == ".toml" and not (lines and re.match(r"[<@]|\w+\s*:", lines[0])):
        return True
    return bool(lines) and re.match(r"\[[\w.\"-]+\]|[\w\"-]+\s*=", lines[0]) is not None


def looks_like_urdf(path: Path) -> bool:
    """Check whether a file is a URDF, by its root element or its suffix."""
    text = re.sub(r"<!--.*?-->|<\?.*?\?>", "", beginning(path), flags=re.DOTALL)
    return text.lstrip().startswith("<robot") or path.suffix.lower() in (".urdf", ".xacro")


def read_robot_file(path: Path) -> RobotFile:
    """Read and check a robot file. Raises BadInput with all errors."""
    return read_robot(read_file(path, "B001"), path)


def read_robot(content: bytes, path: Path) -> RobotFile:
    """Read and check the content of a robot file. Raises BadInput with all errors."""
    text = decode(content, str(path))
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as problem:  # ValueError also for an integer of more than 4300 digits
        where = re.search(r"line (\d+), column (\d+)", str(problem))
        span = Span(str(path), *map(int, where.groups())) if where else Span(str(path))
        raise BadInput([error("B001", f"invalid TOML: {problem}", span)]) from None
    report = _Report(path, _lines_of(text))
    numbers = _robot(path, _Table(report, table))
    if report.problems:
        raise BadInput(report.problems)
    return numbers


def _lines_of(text: str) -> dict[str, int]:
    """Map the dotted name of each table and key to its line, counted from 1."""
    lines: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[([^\]\[]+)\]", line)
        key = re.match(r"\s*([\w\".-]+)\s*=", line)
        if header:
            table = header.group(1).replace('"', "").replace(" ", "")
            lines.setdefault(table, number)
        elif key:
            name = key.group(1).replace('"', "")
            lines.setdefault(f"{table}.{name}" if table else name, number)
    return lines


class _Report:
    """Collects the errors of a file."""

    def __init__(self, path: Path, lines: dict[str, int]) -> None:
        self.path, self.lines = path, lines
        self.problems: list[Diagnostic] = []

    def span(self, key: str) -> Span:
        """Source span of a dotted key, or of the nearest table around it."""
        while key and key not in self.lines:
            key = key.rpartition(".")[0]
        return Span(str(self.path), self.lines.get(key, 1))


class _Table:
    """A TOML table; a bad value is reported and replaced by a valid one, so that all errors are found in one pass."""

    def __init__(self, report: _Report, values: Mapping[str, Any], name: str = "", kind: str | None = "") -> None:
        """Check the keys against those of ``kind`` in :data:`_KEYS`; None allows any key."""
        self.report, self.values, self.name, self.kind = report, values, name, kind
        for key in values if kind is not None else ():
            if key not in _KEYS[kind or ""]:
                self.bad(key, "unknown key", f"valid here: {', '.join(_KEYS[kind or ''])}")

    def bad(self, key: str, message: str, help: str | None = None) -> None:
        """Report an error in the value of a key."""
        dotted = f"{self.name}.{key}".lstrip(".")
        self.report.problems.append(error("B001", f"{dotted}: {message}", self.report.span(dotted), help))

    def table(self, key: str, kind: str | None) -> _Table:
        """Read a table; empty if it is absent."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            self.bad(key, "must be a table")
            value = {}
        return _Table(self.report, value, f"{self.name}.{key}".lstrip("."), kind)

    def tables(self, key: str, kind: str) -> dict[str, _Table]:
        """Read a table of tables, by name."""
        inner = self.table(key, None)
        return {name: inner.table(name, kind) for name in inner.values}

    def text(self, key: str, default: str | None = None) -> str:
        """Read a string; required unless it has a default."""
        value = self.values.get(key, default)
        if not isinstance(value, str):
            self.bad(key, "missing" if value is None else f"must be a string, not {_shown(value)}")
            return ""
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Read a finite number, within its range if it has one; required unless it has a default."""
        value = self.values.get(key, default)
        least, most, unit = _RANGES.get((self.kind or "", key), (-FARTHEST, FARTHEST, ""))
        if not _is_number(value):
            self.bad(key, "missing" if value is None else f"must be a finite number, not {_shown(value)}")
        elif not least <= value <= most:
            self.bad(key, f"must be between {least:g} and {f'{most:g} {unit}'.strip()}, not {float(value):g}")
        else:
            return float(value)
        return 1.0 if default is None else default

    def texts(self, key: str) -> tuple[str, ...]:
        """Read a list of strings; empty if it is absent."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            self.bad(key, f"must be a list of names, not {_shown(value)}")
            return ()
        return tuple(value)

    def vector(self, key: str, default: Axis = (0.0, 0.0, 0.0)) -> Axis:
        """Read the coordinates of a point near the robot [m]."""
        value = self.values.get(key, list(default))
        if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
            self.bad(key, f"must be three numbers, not {_shown(value)}")
            return default
        if max(map(abs, value)) > _FARTHEST:
            self.bad(key, f"must be three numbers of at most {_FARTHEST:g} m, not {_shown(value)}")
            return default
        return (float(value[0]), float(value[1]), float(value[2]))

    def range(self, key: str) -> tuple[float, float]:
        """Read the lower and upper limit of a joint [rad, m]."""
        value = self.values[key]
        if not isinstance(value, list) or len(value) != 2 or not all(map(_is_number, value)):
            self.bad(key, f"must be two numbers, the lower and the upper limit, not {_shown(value)}")
        elif not -FARTHEST <= value[0] < value[1] <= FARTHEST:
            self.bad(key, f"the lower limit must be less than the upper one, not {_shown(value)}")
        else:
            return (float(value[0]), float(value[1]))
        return (-1.0, 1.0)

    def axis(self, key: str, default: Axis) -> Axis:
        """Read a direction of any length as a unit vector."""
        value = self.values.get(key, default)
        numbers = isinstance(value, (list, tuple)) and len(value) == 3 and all(map(_is_number, value))
        length = math.hypot(*value) if numbers else 0.0
        if not 1e-9 < length < math.inf:
            self.bad(key, f"must be three numbers, not all 0, not {_shown(value)}")
            return default
        return (value[0] / length, value[1] / length, value[2] / length)

    def positions(self, key: str) -> dict[str, float]:
        """Read a table of numbers by joint."""
        inner = self.table(key, None)
        return {joint: inner.number(joint) for joint in inner.values}


def _robot(path: Path, table: _Table) -> RobotFile:
    arms = table.tables("arms", "arms.*")
    offsets = {name: arm.vector("tool_offset") for name, arm in arms.items() if "tool_offset" in arm.values}
    tools = {tool_link(name): (arms[name].text("tip"), offset) for name, offset in offsets.items()}
    mount = _mount(table)
    limits, ranges = _joints(table)
    if "base" not in table.values:
        table.bad("base", "must be a table")
    urdf, model = _urdf(path, table, mount, tools, ranges), table.text("self_model", "")
    if model and not (path.parent / model).is_file():
        table.bad("self_model", f"file not found beside this one: {model}")
    camera, neck = _camera(table)
    postures = table.table("postures", None)
    return RobotFile(
        path,
        table.text("name"),
        urdf,
        path.parent / model if model else None,
        table.text("torso", "") or None,
        _base(table.table("base", "base"), mount),
        tuple(_arm(name, arm) for name, arm in arms.items()),
        camera,
        neck,
        limits.pop("default", DEFAULT_LIMITS),
        limits,
        {name: postures.positions(name) for name in postures.values},
        _pairs(table),
        tools,
        ranges,
        table.report.span,
    )


def _joints(table: _Table) -> tuple[dict[str, JointLimits], dict[str, Range]]:
    """Read the limits of motion of joints, and the ranges of those whose range in the URDF is wrong, by name."""
    joints, (*keys, limits) = table.tables("joints", "joints.*"), _KEYS["joints.*"]
    ranges = {name: joint.range(limits) for name, joint in joints.items() if limits in joint.values}
    if "default" in ranges:
        joints["default"].bad(limits, "limits are those of one joint")
    motions = {name: joint for name, joint in joints.items() if name not in ranges or len(joint.values) > 1}
    return {name: JointLimits(*map(joint.number, keys)) for name, joint in motions.items()}, ranges


def _base(table: _Table, mount: Mount | None) -> BaseDrive:
    """Read the parameters of the base, no narrower than its mount; a fixed one needs no speeds."""
    *keys, fixed = _KEYS["base"]
    is_fixed = table.values.get(fixed, False)
    if not isinstance(is_fixed, bool):
        table.bad(fixed, f"must be true or false, not {is_fixed!r}")
    base = BaseDrive(*map(table.number, keys)) if is_fixed is False else replace(DEFAULT_BASE, fixed=True)
    return replace(base, radius=max(table.number("radius"), 0.0 if mount is None else mount.radius))


def _urdf(
    path: Path, table: _Table, mount: Mount | None, tools: Mapping[str, ToolPoint], ranges: Mapping[str, Range]
) -> Path:
    value = table.values.get("urdf")
    if isinstance(value, dict):
        source = table.table("urdf", "urdf")
        name, file = source.text("package"), source.text("file")
        try:
            urdf = packaged(name, file) if name and file else Path()
        except NotInstalled as problem:
            extra = source.text("extra", "")
            advice = install_command(extra) if extra else f"pip install {name}"
            table.report.problems.append(error("B014", f"urdf: {problem}", table.report.span("urdf"), advice))
            return Path()
    else:
        urdf = path.parent / table.text("urdf")
        if value is not None and not urdf.is_file():
            table.bad("urdf", f"file not found beside this one: {value}")
    is_as_it_is = mount is None and not tools and not ranges
    return urdf if is_as_it_is or table.report.problems else mounted(urdf, mount, tools, ranges)


def _mount(table: _Table) -> Mount | None:
    if "mount" not in table.values:
        return None
    inner = table.table("mount", "mount")
    size = inner.values.get("size")
    extents: list[Any] = size if isinstance(size, list) and len(size) in (2, 3) else [None]
    if not all(_is_number(one) and 0 < one <= _FARTHEST for one in extents):
        inner.bad("size", f"must be positive numbers of at most {_FARTHEST:g} m: x, y and z, or diameter and height")
        return None
    return Mount(tuple(map(float, extents)), inner.vector("at", (0.0, 0.0, float(extents[-1]))))


def _arm(name: str, table: _Table) -> ArmNumbers:
    side = table.text("side", "") or None
    if side not in (None, "left", "right"):
        table.bad("side", f'must be "left" or "right", not {side!r}')
    approach, closing = table.axis("approach", (1.0, 0.0, 0.0)), table.axis("closing", (0.0, 1.0, 0.0))
    if abs(sum(a * c for a, c in zip(approach, closing, strict=True))) > 1e-3:
        table.bad("closing", "must be perpendicular to approach")
    tip_link = table.text("tip")
    tip = tool_link(name) if "tool_offset" in table.values else tip_link
    gripper = _gripper(table.table("gripper", "arms.*.gripper")) if "gripper" in table.values else None
    payload = table.number("payload") if "payload" in table.values else math.inf
    return ArmNumbers(name, tip, table.text("hand", "") or tip_link, side, approach, closing, gripper, payload)


def _gripper(table: _Table) -> GripperNumbers:
    opened, closed = table.positions("opened"), table.positions("closed")
    if not opened or set(opened) != set(closed):
        table.bad("closed", "opened and closed must have the same joints, at least one")
    return GripperNumbers(opened, closed, table.texts("fingers"), table.number("max_opening"))


def _camera(table: _Table) -> tuple[CameraModel | None, tuple[str, ...]]:
    if "camera" not in table.values:
        return None, ()
    inner = table.table("camera", "camera")
    fov = inner.number("fov", 1.0)
    near, far = inner.number("near", 0.3), inner.number("far", 4.0)
    if near >= far:
        inner.bad("far", f"must be greater than near ({near} m)")
    width, height = (int(inner.number(key, size)) for key, size in (("width", 160), ("height", 120)))
    forward, up = inner.axis("forward", (0.0, 0.0, 1.0)), inner.axis("up", (0.0, -1.0, 0.0))
    recognises = inner.texts("recognises") if "recognises" in inner.values else None
    noise = _noise(inner.table("noise", "camera.noise"))
    model = CameraModel(inner.text("link"), fov, near, far, width, height, forward, up, recognises, noise)
    return model, inner.texts("neck")


def _noise(table: _Table) -> CameraNoise:
    """Read how a camera errs; exact without a table."""
    *keys, confusions = _KEYS["camera.noise"]
    numbers = {key: table.number(key, 0.0) for key in keys}
    confused, classes = list[tuple[str, str, float]](), table.table(confusions, None)
    for cls in classes.values:
        often = classes.table(cls, None).values
        if not all(_is_number(one) and one >= 0 for one in often.values()) or sum(often.values()) > 1:
            classes.bad(cls, f"must be probabilities by class that sum to 1 at most, not {_shown(dict(often))}")
        else:
            confused += [(cls, other, float(share)) for other, share in often.items()]
    return CameraNoise(**numbers, confusions=tuple(confused))


def _pairs(table: _Table) -> tuple[tuple[str, str], ...]:
    value = table.values.get("allowed_contacts", [])
    pairs = []
    for pair in value if isinstance(value, list) else [value]:
        if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
            table.bad("allowed_contacts", f"must be pairs of link names, not {pair!r}")
            continue
        pairs.append((pair[0], pair[1]))
    return tuple(pairs)


def _is_number(value: Any) -> bool:
    """Check for a finite number; an integer too large for a float is none."""
    try:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
