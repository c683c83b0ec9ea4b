"""Numbers of robot files beyond what any robot has: refused where they are read, not where they are used."""

from pathlib import Path

import pytest

from executive.robots.robot_file import read_robot_file
from planlang.diagnostics import BadInput
from tests.support.refusals import refusal

URDF = '<robot name="cart"><link name="base"/></robot>'
CART = """name = "cart"
urdf = "cart.urdf"
[base]
radius = 0.3
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
[mount]
size = [0.4, 0.4, 0.6]
at = [0.0, 0.0, 0.6]
[camera]
link = "base"
fov = 1.0
near = 0.3
far = 4.0
width = 160
height = 120
[arms.arm]
tip = "base"
tool_offset = [0.0, 0.0, 0.1]
payload = 1.0
[arms.arm.gripper]
opened = { finger = 0.04 }
closed = { finger = 0.0 }
max_opening = 0.08
[joints.default]
speed = 0.5
acceleration = 1.0
jerk = 10.0
[joints.elbow]
limits = [-1.0, 1.0]
[postures.carrying]
elbow = 0.5
"""
KEYS = [line.partition(" = ") for line in CART.splitlines()]
ROWS = [number for number, (_, _, value) in enumerate(KEYS) if value and value.strip("[")[0] in "-0123456789{"]
COORDINATES = ("size", "at", "tool_offset", "opened", "closed", "limits", "elbow")
"""Keys of lengths and positions, which may be small, some of them negative."""
EXTREME = ("1e9", "nan", "inf", "-inf", "1" + 400 * "0", "true", '"0.5"', "[]")
SMALL = ("1e-9", "1e-6", "-1.0")


def write(folder: Path, row: int, value: str) -> Path:
    """The robot file, with the value in one line replaced."""
    lines = CART.splitlines()
    lines[row] = f"{KEYS[row][0]} = {value}"
    (folder / "cart.urdf").write_text(URDF)
    path = folder / "cart.toml"
    path.write_text("\n".join(lines))
    return path


def of_one(row: int, value: str) -> str:
    """The value in the form that the line has: of all three coordinates, or of the finger."""
    before = KEYS[row][2]
    if before.startswith("["):
        return f"[{', '.join([value] * len(before.split(',')))}]"
    return f"{{ finger = {value} }}" if before.startswith("{") else value


def test_the_numbers_of_the_example_are_read(tmp_path: Path) -> None:
    assert read_robot_file(write(tmp_path, 3, "0.3")).base.jerk == 5.0


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{KEYS[row][0]}")
def test_an_extreme_number_is_refused_with_its_line(tmp_path: Path, row: int) -> None:
    for value in EXTREME if KEYS[row][0] in COORDINATES else (*EXTREME, *SMALL):
        with pytest.raises(BadInput) as caught:
            read_robot_file(write(tmp_path, row, of_one(row, value)))
        assert {one.code for one in caught.value.diagnostics} == {"B001"}
        assert row + 1 in [one.span.line for one in caught.value.diagnostics if one.span is not None], value


def test_an_integer_that_python_does_not_read_is_refused(tmp_path: Path) -> None:
    with refusal("B001", naming="TOML"):
        read_robot_file(write(tmp_path, 3, "1" + 5000 * "0"))


@pytest.mark.parametrize("value", ["1e-9", "1e-6", "1e9"])
def test_the_plausible_range_of_a_speed_is_named(tmp_path: Path, value: str) -> None:
    with refusal("B001", naming=("base.speed", "0.01", "100 m/s")):
        read_robot_file(write(tmp_path, KEYS.index(("speed", " = ", "0.5")), value))
