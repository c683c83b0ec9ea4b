"""Wording of failures: their fields, and what was counted or measured, as parts of sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from planlang.closure import grouped

NO_WAY = "no way for the base"
"""Reason of a search for candidates that the base could not drive to."""
HAIR = 1e-6
"""Tolerance for rounding [g]."""


def in_words(details: Mapping[str, Any]) -> str:
    """Format the fields of a failure for its message: ``what`` first, without its name; an arm as ``left arm``."""
    about = [_plain(details["what"])] if "what" in details else []
    others = (_field(name, value) for name, value in details.items() if name != "what")
    return ", ".join(filter(None, [*about, *others]))


def counts_in_words(counts: Mapping[str, int], blocking: Mapping[str, int]) -> str:
    """Format the numbers of rejected candidates by reason, and by body in the way; "" without any."""
    total = sum(counts.values())
    numbered = (reason if total == 1 else f"{number} {reason}" for reason, number in counts.items() if number)
    parts = [f"{total} candidate{'' if total == 1 else 's'}: {', '.join(numbered)}"] if counts else []
    if blocking:
        parts.append(f"in the way: {', '.join(f'{body} {number}' for body, number in blocking.items())}")
    return "; ".join(parts)


def search_in_words(text: str, designator: str | None, after: int) -> str:
    """``no place found for DESIGNATOR``, or how many places were found ``after`` which there were no more."""
    wanted = f" for {designator}" if designator else ""
    found, each = ("one place was", "it") if after == 1 else (f"{after} places were", "each")
    return f"only {found} found{wanted}, and {each} failed" if after else f"{text}{wanted}"


def closed_in_words(what: object, doors: Sequence[object]) -> str:
    """``bottle1 is behind door1, which is closed``; ``door1 is closed`` if that is what is meant."""
    named = " and ".join(map(str, doors))
    if what == named:
        return f"{what} is closed"
    return f"{what} is behind {named}, which {'are' if len(doors) > 1 else 'is'} closed"


def weight_in_words(what: object, mass: float, load: float, payload: float, hands: int) -> str:
    """``pot1 weighs 3.9 kg with the 1.5 kg in it or on it, both hands carry 3 kg: 0.9 kg too much``; all in kg.

    Of what is loaded it also says with how much in it or on it it could be carried, or that not even empty.
    """
    carry = f"{'the hand carries' if hands == 1 else 'both hands carry'} {payload:g} kg"
    loaded = f" with the {load:g} kg in it or on it" if load else ""
    said = f"{what} weighs {mass:g} kg{loaded}, {carry}: {mass - payload:.3g} kg too much"
    if not load:
        return said
    allowed = round(payload - (mass - load), 6)
    if allowed < 0:
        return f"{said}; empty it would still be {-allowed:.3g} kg too heavy"
    return f"{said}; with {math.floor(1000 * allowed + HAIR) / 1000:g} kg in it or on it, it could be carried"


def hands_in_words(what: object, needed: int, free: int, of: int) -> str:
    """``tray1 takes 2 hands, the robot has 1``; of more hands that it has, how many are free."""
    there = f"the robot has {of}" if of < needed else f"{free} of {of} are free"
    alone = "" if free < needed else ", but one was asked alone (PickingUpAnObject asks all)"
    return f"{what} takes {needed} hands, {there}{alone}"


def full_in_words(what: object, held: Mapping[str, object]) -> str:
    """``no hand is free for glass1: arm holds bottle1; put it down first``; ``held`` is what each hand holds."""
    hands = grouped((str(thing), hand) for hand, thing in held.items())
    full = ", ".join(f"{' and '.join(one)} hold{'' if one[1:] else 's'} {thing}" for thing, one in hands.items())
    return f"no hand is free for {what}: {full}; put {'it' if len(hands) == 1 else 'one'} down first"


def budget_in_words(
    seconds: float | None, attempts: int | None, spent: Mapping[str, float], used: Mapping[str, int]
) -> str:
    """``the budget of S s and N attempts is used up, last by ACTION: ACTION S s, ..., CONSTRUCT N times, ...``.

    The last of those that have ``spent`` time is the one that did so last.
    """
    allowed = [] if seconds is None else [f"{seconds:g} s"]
    allowed += [] if attempts is None else [f"{attempts} attempts"]
    parts = [f"{part} {time:g} s" for part, time in spent.items()]
    parts += [f"{construct} again {number} times" for construct, number in used.items()]
    last = f", last by {list(spent)[-1]}" if len(spent) > 1 else ""
    return f"the budget of {' and '.join(allowed)} is used up{last}{': ' if parts else ''}{', '.join(parts)}"


_BASE = ("x", "y", "yaw")
"""Parts of a pose of the base [m, rad]."""


def _field(name: str, value: object) -> str:
    if name == "arm" and isinstance(value, str):  # the only arm of a robot is called so, which tells nothing
        return f"{value.removesuffix('arm').rstrip('_ ')} arm" if value != "arm" else ""
    if name == "target" and isinstance(value, tuple) and len(value) == len(_BASE):
        return " ".join(
            ("target", *(f"{axis} {round(number, 2):g}" for axis, number in zip(_BASE, value, strict=True)))
        )
    return f"{name.replace('_', ' ')} {_plain(value)}"


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_plain, value))})"
    return str(value)
