"""URDFs of robots made of boxes: an arm with a parallel gripper on a base, with joints below it as a test needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

Row = tuple[str, str, str, str, str, str]
"""Name, kind, axis and origin (xyz) of a joint, and its limits; its child link has the same name."""

ARM: Sequence[Row] = (
    ("pan", "revolute", "0 0 1", "0.12 0 0.35", "-2.9", "2.9"),
    ("raise", "revolute", "0 1 0", "0 0 0.12", "-2", "2"),
    ("elbow", "revolute", "0 1 0", "0 0 0.4", "-2.7", "2.7"),
    ("roll", "revolute", "0 0 1", "0 0 0.36", "-2.9", "2.9"),
    ("bend", "revolute", "0 1 0", "0 0 0.09", "-2.1", "2.1"),
    ("turn", "revolute", "0 0 1", "0 0 0.09", "-2.9", "2.9"),
)
"""Six joints, 1.1 m from the shoulder to the wrist."""
SCARA: Sequence[Row] = (
    ("lift", "prismatic", "0 0 1", "0.06 0 0.43", "0", "0.9"),
    ("shoulder", "revolute", "0 0 1", "0.1 0 0", "-1.8", "1.8"),
    ("elbow", "revolute", "0 0 1", "0.3 0 0", "-2.4", "2.4"),
    ("wrist", "revolute", "0 0 1", "0.25 0 0", "-2.2", "2.2"),
)
"""Three joints that turn about the vertical, on a lift."""
ODOMETRY: Sequence[Row] = (
    ("odom_x_joint", "prismatic", "1 0 0", "0 0 0", "-1000", "1000"),
    ("odom_y_joint", "prismatic", "0 1 0", "0 0 0", "-1000", "1000"),
    ("odom_yaw_joint", "continuous", "0 0 1", "0 0 0", "0", "0"),
)
UP, AHEAD = "0 0 1", "1 0 0"


def box(size: str, at: str = "0 0 0") -> str:
    """A collision shape."""
    return f'<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'


def joint(row: Row, parent: str, extra: str = "") -> str:
    """A joint whose child has its name."""
    name, kind, axis, origin, low, high = row
    limit = (
        f'<limit lower="{low}" upper="{high}" effort="9" velocity="1"/>' if kind in ("revolute", "prismatic") else ""
    )
    ends = f'<parent link="{parent}"/><child link="{name}_link"/>'
    where = f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{where}{limit}{extra}</joint>'


def robot(arm: Sequence[Row] = ARM, *, below: Sequence[Row] = (), along: str = UP, inside: Iterable[str] = ()) -> str:
    """A robot: ``below`` are joints from the root link ``world`` down to the body, ``along`` is the arm's direction.

    ``inside`` are more elements.
    """
    parts, parent = ['<link name="world"/>'], "world"
    for row in below:
        parts += [joint(row, parent), f'<link name="{row[0]}_link"/>']
        parent = f"{row[0]}_link"
    parts.append(f'<joint name="on" type="fixed"><parent link="{parent}"/><child link="body"/></joint>')
    parts.append(f'<link name="body">{box("0.5 0.44 0.3", "0 0 0.2")}</link>')
    wheels = (("wheel_left", "0 0.2 0.08"), ("wheel_right", "0 -0.2 0.08"))
    for name, at in wheels:
        parts += [joint((name, "continuous", "0 1 0", at, "0", "0"), "body"), f'<link name="{name}_link"/>']
    parent = "body"
    for row in arm:
        parts += [joint(row, parent), f'<link name="{row[0]}_link">{box("0.05 0.05 0.05")}</link>']
        parent = f"{row[0]}_link"
    a, b, c = map(float, along.split())

    def ahead(distance: float) -> str:
        return f"{a * distance} {b * distance} {c * distance}"

    palm = "0.05 0.14 0.03" if c else "0.03 0.14 0.05"
    finger = "0.02 0.012 0.09" if c else "0.09 0.012 0.02"
    parts.append(f'<joint name="palm" type="fixed"><parent link="{parent}"/><child link="hand"/>')
    parts.append(f'<origin xyz="{ahead(0.05)}"/></joint><link name="hand">{box(palm)}</link>')
    for name, y, mimic in (("left", 1, ""), ("right", -1, '<mimic joint="left_finger"/>')):
        row = (f"{name}_finger", "prismatic", f"0 {y} 0", f"{ahead(0.06)}", "0", "0.045")
        x, _, z = ahead(0.0).split()
        parts += [
            joint(row, "hand", mimic),
            f'<link name="{name}_finger_link">{box(finger, f"{x} {0.006 * y} {z}")}</link>',
        ]
    return f'<robot name="boxes">{"".join((*parts, *inside))}</robot>'
