"""What a robot can do, in words and as JSON data: for ``planlang robot inspect`` and ``planlang robot make``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from executive.locations.capabilities import Capabilities
from executive.robots import Arm
from executive.robots.arms import called


def capability_lines(can: Capabilities) -> Iterator[str]:
    """Summarise what a robot can do in a few lines."""
    for holding in can.holdings:
        if holding.planned and not holding.bare:
            yield f"  the hand of the {holding.arm} arm holds {holding}"
        else:
            yield f"  what the hand of {called(holding.arm)} holds is {holding}"
    yield from doorway_lines(can)
    yield from warning_lines(can)


def doorway_lines(can: Capabilities) -> Iterator[str]:
    """Say through which doorways a robot drives."""
    if can.doorways is not None:
        yield f"  narrowest doorway: {can.doorways}"


def holding_lines(can: Capabilities, arm: Arm) -> Iterator[str]:
    """Say what an arm's hand holds."""
    yield from (f"  holds: {holding}" for holding in can.holdings if holding.arm == arm.name)


def warning_lines(can: Capabilities) -> list[str]:
    """List the warnings about a robot, if there are any."""
    return ["warnings", *(f"  {advice}" for advice in can.warnings)] if can.warnings else []


def holds_data(can: Capabilities, arm: Arm) -> dict[str, Any]:
    """What an arm's hand holds, as JSON data."""
    holds = next((holding.planned for holding in can.holdings if holding.arm == arm.name), ())
    return {"holds": {hold.kind.value: {"widths": list(hold.widths), "how": hold.how} for hold in holds}}


def capability_data(can: Capabilities) -> dict[str, Any]:
    """Doorways and warnings, as JSON data."""
    doors = can.doorways
    data = None if doors is None else {"empty": doors.empty, "with_mug": doors.with_mug, "held_by": doors.held_by}
    return {"doorway": data, "warnings": [{"what": one.what, "write": one.write} for one in can.warnings]}
