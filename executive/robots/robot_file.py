"""Numbers of a robot that OWL cannot say nicely: one TOML file beside its URDF.

```toml
name = "amigo"                  # required
urdf = "amigo.urdf"             # required: beside this file, or in an installed package (below)
self_model = "amigo.omn"        # OWL self-model; without one, [arms.*] say what the robot is
torso = "spindle_joint"
allowed_contacts = [["a", "b"]] # links that may touch

[base]                          # required: radius [m], speeds [m/s, rad/s], accelerations, jerk
[mount]                         # what a URDF without base stands on: size (x, y, z, or diameter and height), at [m]
[arms.right]                    # tip, hand, side, approach, closing
[arms.right.gripper]            # joints opened/closed by name, max_opening [m], fingers (links)
[camera]                        # link, fov [rad], near, far [m], width, height [pixels], forward, up, neck (joints)
[joints.NAME]                   # speed, acceleration, jerk; [joints.default] for all others
[postures.NAME]                 # joint = position
```

A URDF in a package: ``urdf = { package = "pybullet", file = "franka_panda/panda.urdf" }``, the file by the end of its
path; ``extra``: which extra of planlang brings the package.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from executive.robots.mechanism import Mount, NotInstalled, composed, packaged
from executive.robots.robot import Axis, BaseDrive, JointLimits
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import open_regular, read_file
from sim import CameraModel

_KEYS: dict[str, tuple[str, ...]] = {
    "": (
        *("name", "urdf", "self_model", "torso", "allowed_contacts"),
        *("base", "mount", "arms", "camera", "joints", "postures"),
    ),
    "urdf": ("package", "file", "extra"),
    "mount": ("size", "at"),
    "base": ("radius", "speed", "acceleration", "turn_speed", "turn_acceleration", "jerk"),
    "arms.*": ("tip", "hand", "side", "approach", "closing", "gripper"),
    "arms.*.gripper": ("opened", "closed", "fingers", "max_opening"),
    "camera": ("link", "fov", "near", "far", "width", "height", "forward", "up", "neck"),
    "joints.*": ("speed", "acceleration", "jerk"),
}
"""Valid keys of each table."""


@dataclass(frozen=True, slots=True)
class GripperNumbers:
    """A gripper: joint values when opened and closed, finger links, widest thing that fits [m]."""

    opened: Mapping[str, float]
    closed: Mapping[str, float]
    fingers: tuple[str, ...]
    max_opening: float


@dataclass(frozen=True, slots=True)
class ArmNumbers:
    """An arm by its tip frame; the axes are unit vectors in that frame."""

    name: str
    tip: str
    hand: str
    side: str | None
    approach: Axis
    closing: Axis
    gripper: GripperNumbers | None


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
    lines: Mapping[str, int] = field(default_factory=dict)
    """Dotted key -> line in the file."""

    def span(self, key: str) -> Span:
        """Return where a key, or the nearest table around it, is written."""
        while key and key not in self.lines:
            key = key.rpartition(".")[0]
        return Span(str(self.path), self.lines.get(key, 1))


DEFAULT_BASE = BaseDrive(0.4, 0.5, 0.5, 0.8, 0.8, 5.0)
"""For a robot of which nothing is known but its URDF: slow and wide."""

DEFAULT_LIMITS = JointLimits(0.5, 1.0, 10.0)
"""For a joint without numbers; the speed is that of the URDF if that is lower."""


def looks_like_toml(path: Path) -> bool:
    """Return whether a file is a robot's TOML file: by its content, never by its suffix."""
    head = beginning(path)
    lines = [line.strip() for line in head.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return bool(lines) and re.match(r"\[[\w.\"-]+\]|[\w\"-]+\s*=", lines[0]) is not None


def looks_like_urdf(path: Path) -> bool:
    """Return whether the root element of a file is that of a URDF."""
    text = re.sub(r"<!--.*?-->|<\?.*?\?>", "", beginning(path), flags=re.DOTALL)
    return text.lstrip("\ufeff \t\r\n").startswith("<robot")


def beginning(path: Path) -> str:
    """Return the first 4000 bytes of a file as text; nothing of one that cannot be read."""
    try:
        with open_regular(path) as file:
            return file.read(4000).decode("utf-8", errors="replace")
    except OSError:
        return ""


def read_robot_file(path: Path) -> RobotFile:
    """Read and check a robot's TOML file; raises BadInput with everything wrong in it."""
    content = read_file(path, "B001")
    try:
        text = content.decode("utf-8")
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        where = re.search(r"line (\d+), column (\d+)", str(problem))
        span = Span(str(path), *map(int, where.groups())) if where else Span(str(path))
        raise BadInput([error("B001", f"not TOML: {problem}", span)]) from None
    reader = _Reader(path, _lines_of(text))
    numbers = reader.robot(table)
    if reader.found:
        raise BadInput(reader.found)
    return numbers


def _lines_of(text: str) -> dict[str, int]:
    """Dotted key -> line (from 1) of every table header and key."""
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


class _Reader:
    """Turns TOML tables into dataclasses; problems are collected, with a harmless value in place."""

    def __init__(self, path: Path, lines: dict[str, int]) -> None:
        self.path, self.lines = path, lines
        self.found: list[Diagnostic] = []

    def robot(self, table: dict[str, Any]) -> RobotFile:
        self._check_keys(table, "", "")
        folder = self.path.parent
        urdf = self._urdf(table)
        model = self._text(table, "self_model", "", required=False)
        if model and not (folder / model).is_file():
            self._bad("self_model", f"there is no {model} beside this file")
        base = self._table(table, "base", required=True)
        self._check_keys(base, "base", "base")
        camera, neck = self._camera(table)
        joints = self._table(table, "joints")
        limits = {name: self._limits(self._table(joints, name, "joints"), f"joints.{name}") for name in joints}
        postures = self._table(table, "postures")
        return RobotFile(
            self.path,
            self._text(table, "name", ""),
            urdf,
            folder / model if model else None,
            self._text(table, "torso", "", required=False) or None,
            BaseDrive(*(self._positive(base, key, "base") for key in _KEYS["base"])),
            tuple(self._arm(name, self._table(table["arms"], name, "arms")) for name in self._table(table, "arms")),
            camera,
            neck,
            limits.pop("default", DEFAULT_LIMITS),
            limits,
            {name: self._positions(postures, name, "postures") for name in postures},
            self._pairs(table),
            self.lines,
        )

    def _urdf(self, table: dict[str, Any]) -> Path:
        mount = self._mount(table) if "mount" in table else None
        said = table.get("urdf")
        if isinstance(said, dict):
            self._check_keys(said, "urdf", "urdf")
            name, file = self._text(said, "package", "urdf"), self._text(said, "file", "urdf")
            try:
                urdf = packaged(name, file) if name and file else Path()
            except NotInstalled as problem:
                extra = self._text(said, "extra", "urdf", required=False)
                advice = f"pip install 'planlang[{extra}]'" if extra else f"pip install {name}"
                self.found.append(error("B014", f"urdf: {problem}", self._span("urdf"), advice))
                return Path()
        else:
            urdf = self.path.parent / self._text(table, "urdf", "")
            if "urdf" in table and not urdf.is_file():
                self._bad("urdf", f"there is no {said} beside this file")
        if self.found or (mount is None and not isinstance(said, dict)):
            return urdf
        return composed(urdf, mount)

    def _mount(self, table: dict[str, Any]) -> Mount | None:
        inner = self._table(table, "mount")
        self._check_keys(inner, "mount", "mount")
        size = inner.get("size")
        if not isinstance(size, list) or len(size) not in (2, 3) or not all(_is_positive(value) for value in size):
            self._bad("mount.size", "x, y and z, or diameter and height, are expected as positive numbers")
            return None
        top = [0.0, 0.0, float(size[-1])]
        at = inner.get("at", top)
        if not isinstance(at, list) or len(at) != 3 or not all(_is_number(value) for value in at):
            self._bad("mount.at", f"three numbers are expected, not {at!r}")
            return None
        return Mount(tuple(map(float, size)), (float(at[0]), float(at[1]), float(at[2])))

    def _span(self, key: str) -> Span:
        while key and key not in self.lines:
            key = key.rpartition(".")[0]
        return Span(str(self.path), self.lines.get(key, 1))

    def _bad(self, key: str, message: str, help: str | None = None) -> None:
        self.found.append(error("B001", f"{key}: {message}", self._span(key), help))

    def _check_keys(self, table: Mapping[str, Any], kind: str, prefix: str) -> None:
        for key in table:
            if key not in _KEYS[kind]:
                self._bad(f"{prefix}.{key}".lstrip("."), "unknown key", f"valid here: {', '.join(_KEYS[kind])}")

    def _table(self, table: Mapping[str, Any], key: str, prefix: str = "", *, required: bool = False) -> dict[str, Any]:
        value = table.get(key, {})
        if not isinstance(value, dict) or (required and key not in table):
            self._bad(f"{prefix}.{key}".lstrip("."), "a table is expected")
            return {}
        return value

    def _text(self, table: Mapping[str, Any], key: str, prefix: str, *, required: bool = True) -> str:
        value = table.get(key, "" if not required else None)
        if not isinstance(value, str):
            self._bad(f"{prefix}.{key}".lstrip("."), "missing" if value is None else f"text is expected, not {value!r}")
            return ""
        return value

    def _number(self, table: Mapping[str, Any], key: str, prefix: str, default: float | None = None) -> float:
        value = table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            self._bad(f"{prefix}.{key}", "missing" if value is None else f"a finite number is expected, not {value!r}")
            return 1.0
        return float(value)

    def _positive(self, table: Mapping[str, Any], key: str, prefix: str, default: float | None = None) -> float:
        value = self._number(table, key, prefix, default)
        if value <= 0:
            self._bad(f"{prefix}.{key}", f"a positive number is expected, not {value}")
            return 1.0
        return value

    def _texts(self, table: Mapping[str, Any], key: str, prefix: str) -> tuple[str, ...]:
        value = table.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            self._bad(f"{prefix}.{key}", f"a list of names is expected, not {value!r}")
            return ()
        return tuple(value)

    def _axis(self, table: Mapping[str, Any], key: str, prefix: str, default: Axis) -> Axis:
        value = table.get(key, list(default))
        numbers = isinstance(value, list) and len(value) == 3 and all(isinstance(v, (int, float)) for v in value)
        length = math.hypot(*value) if numbers else 0.0
        if not 1e-9 < length < math.inf:
            self._bad(f"{prefix}.{key}", f"three numbers that are a direction are expected, not {value!r}")
            return default
        return (value[0] / length, value[1] / length, value[2] / length)

    def _positions(self, table: Mapping[str, Any], key: str, prefix: str) -> dict[str, float]:
        inner = self._table(table, key, prefix)
        return {joint: self._number(inner, joint, f"{prefix}.{key}") for joint in inner}

    def _limits(self, table: Mapping[str, Any], prefix: str) -> JointLimits:
        self._check_keys(table, "joints.*", prefix)
        return JointLimits(*(self._positive(table, key, prefix) for key in _KEYS["joints.*"]))

    def _arm(self, name: str, table: Mapping[str, Any]) -> ArmNumbers:
        prefix = f"arms.{name}"
        self._check_keys(table, "arms.*", prefix)
        side = self._text(table, "side", prefix, required=False) or None
        if side not in (None, "left", "right"):
            self._bad(f"{prefix}.side", f'"left" or "right" is expected, not {side!r}')
        approach = self._axis(table, "approach", prefix, (1.0, 0.0, 0.0))
        closing = self._axis(table, "closing", prefix, (0.0, 1.0, 0.0))
        if abs(sum(a * c for a, c in zip(approach, closing, strict=True))) > 1e-3:
            self._bad(f"{prefix}.closing", "the closing axis must be at a right angle to the approach axis")
        tip = self._text(table, "tip", prefix)
        hand = self._text(table, "hand", prefix, required=False) or tip
        gripper = self._gripper(self._table(table, "gripper", prefix), prefix) if "gripper" in table else None
        return ArmNumbers(name, tip, hand, side, approach, closing, gripper)

    def _gripper(self, table: Mapping[str, Any], prefix: str) -> GripperNumbers:
        prefix += ".gripper"
        self._check_keys(table, "arms.*.gripper", prefix)
        opened, closed = self._positions(table, "opened", prefix), self._positions(table, "closed", prefix)
        if not opened or set(opened) != set(closed):
            self._bad(f"{prefix}.closed", "opened and closed must give positions of the same joints, at least one")
        fingers = self._texts(table, "fingers", prefix)
        return GripperNumbers(opened, closed, fingers, self._positive(table, "max_opening", prefix))

    def _camera(self, table: Mapping[str, Any]) -> tuple[CameraModel | None, tuple[str, ...]]:
        if "camera" not in table:
            return None, ()
        inner = self._table(table, "camera")
        self._check_keys(inner, "camera", "camera")
        fov = self._positive(inner, "fov", "camera", 1.0)
        near, far = self._positive(inner, "near", "camera", 0.3), self._positive(inner, "far", "camera", 4.0)
        if not fov < math.pi:
            self._bad("camera.fov", f"an angle below pi is expected, not {fov}")
        if near >= far:
            self._bad("camera.far", f"must be more than near ({near} m)")
        model = CameraModel(
            self._text(inner, "link", "camera"),
            fov,
            near,
            far,
            int(self._positive(inner, "width", "camera", 160)),
            int(self._positive(inner, "height", "camera", 120)),
            self._axis(inner, "forward", "camera", (0.0, 0.0, 1.0)),
            self._axis(inner, "up", "camera", (0.0, -1.0, 0.0)),
        )
        return model, self._texts(inner, "neck", "camera")

    def _pairs(self, table: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
        value = table.get("allowed_contacts", [])
        pairs = []
        for pair in value if isinstance(value, list) else [value]:
            if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
                self._bad("allowed_contacts", f"a pair of link names is expected, not {pair!r}")
                continue
            pairs.append((pair[0], pair[1]))
        return tuple(pairs)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _is_positive(value: Any) -> bool:
    return _is_number(value) and value > 0
