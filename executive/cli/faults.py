"""``planlang faults``: the kinds of faults that may be stated for a run."""

from __future__ import annotations

from collections.abc import Sequence

from executive.cli.authoring_arguments import FaultsArguments
from executive.cli.console import Answer
from planlang.diagnostics import WrongOption
from planlang.faults.kinds import KINDS, Kind, parts
from planlang.spelling import guess


def command(arguments: FaultsArguments) -> Answer:
    """List the kinds. Raises WrongOption for a part that there is not."""
    known = parts()
    if arguments.part is not None and arguments.part not in known:
        raise WrongOption(f"no fault is of {arguments.part!r}; {guess(arguments.part, known)}parts: {', '.join(known)}")
    kinds = [one for one in KINDS if arguments.part in (None, one.part)]
    return Answer(text="\n".join(_lines(kinds)), data={"faults": [_as_json(one) for one in kinds]})


def _lines(kinds: Sequence[Kind]) -> list[str]:
    """A table: what is stated; what happens, when, and what shows it."""
    rows = [(one.stated, one.opportunity.value, one.sense.value, one.happens + one.chance) for one in kinds]
    rows = [("fault", "at", "shown by", "what happens"), *rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    cells = ([f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)] for row in rows)
    return ["  ".join(row).rstrip() for row in cells]


def _as_json(kind: Kind) -> dict[str, object]:
    return {
        "fault": str(kind),
        "value": kind.value,
        "opportunity": kind.opportunity.value,
        "sense": kind.sense.value,
        "happens": kind.happens,
        "shows": list(kind.shows),
        "by_chance": kind.recovers,
    }
