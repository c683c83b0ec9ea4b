"""Tolerances with which goals are decided in the true world: the one table of them."""

from __future__ import annotations

import math

SECONDS_AT_REST = 1.0
"""Time for which nothing has moved before goals are decided [s]."""
LONGEST_UNREST = 10.0
"""Time after the plan's end up to which things come to rest [s]; then goals are decided although something moves."""
RESTS = 0.005
"""Largest gap to its support at which a body still rests on it [m]."""
TILT = math.radians(15.0)
"""Angle by which a thing on another may be tilted more than before the plan [rad]."""
SHUT_SHARE = 0.05
"""Share of its range up to which a door, drawer or lid is closed."""
AMOUNT, AMOUNT_SHARE = 5.0, 0.05
"""Deviation that an amount may have, whichever is more: [ml], and share of the amount."""
MOVED = 0.05
"""Distance by which a thing that stays where it is may be moved [m]."""

TABLE: tuple[tuple[str, str], ...] = (
    ("held by", "its holder has hold of it: the robot until it has let go, then the person who has taken it"),
    (
        "on",
        f"at rest on it: held by nobody, not falling, at most {1000 * RESTS:g} mm above it; and tilted at most "
        f"{math.degrees(TILT):g} degrees more than before the plan",
    ),
    ("in", "the centre of its box is in the other's box, for a room in the room; and it is at rest on anything"),
    ("near, left of, ...", "as in a search for poses of a thing, of its pose in the world; and it is at rest"),
    ("closed", f"each of its doors, drawers and lids is open by at most {100 * SHUT_SHARE:g} % of its range"),
    (
        "open",
        "one of its doors, drawers or lids is open as wide as plans open them, less "
        f"{100 * SHUT_SHARE:g} % of its range: for furniture 65 %, for doors between rooms 85 %",
    ),
    ("switched on, off", "the state of the device"),
    ("contains", f"the amount, within {AMOUNT:g} ml or {100 * AMOUNT_SHARE:g} % of it, whichever is more"),
    ("empty", f"at most {AMOUNT:g} ml are in it, and the centre of no thing"),
    ("robot in", "the base stands in the room, or in the outline of the thing"),
)
"""What a goal means -> when it holds."""


def deviation(amount: float) -> float:
    """Return the deviation that an amount may have [ml]."""
    return max(AMOUNT, AMOUNT_SHARE * amount)
