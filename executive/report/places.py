"""Searches for base poses in a page: what was looked at, what was rejected and why, what was chosen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from executive.locations.rejections import MOST_PLACES, Rejections
from executive.pictures.floor_plan import colours
from planlang.designators import Location
from planlang.geometry import Array
from planlang.records import dataclass
from planlang.report.tree import shown
from planlang.runs.run_tree import RunTree, TaskNode

MOST_QUESTIONS = 100
"""Searches that a page shows."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A search for base poses: when it began [world steps], for what, and what it has counted and remembered."""

    step: int
    location: Location
    log: Rejections


class Questions:
    """The searches of a run, while it goes on."""

    def __init__(self) -> None:
        self.asked: list[Asked] = []
        self.step = 0

    def watch(self, location: Location, log: Rejections) -> None:
        """Take the log of the next search, into which it writes what it looks at."""
        if len(self.asked) < MOST_QUESTIONS:
            self.asked.append(Asked(self.step, location, log))

    def model(self, tree: RunTree) -> list[dict[str, Any]]:
        """Return those in which anything was looked at, with the constructs of the plan that they were for."""
        texts = {id(one): str(one.location) for one in self.asked}
        asking: dict[str, list[TaskNode]] = {}
        for node in tree.numbered.values():
            if isinstance(text := node.parameters.get("location"), str):
                asking.setdefault(text, []).append(node)
        found = []
        for one in self.asked:
            before = [node for node in asking.get(texts[id(one)], ()) if (node.begun or 0) <= one.step]
            if (question := _question(one, before[-1] if before else None, tree.rate)) is not None:
                found.append(question)
        clouds = [question[of] for question in found for of in ("bases", "hands")]
        of = colours([reason["text"] for cloud in clouds for reason in cloud["reasons"]])
        for reason in (reason for cloud in clouds for reason in cloud["reasons"]):
            reason["colour"] = "#{:02x}{:02x}{:02x}".format(*of[reason["text"]])  # the same in all searches
        return found


def _question(one: Asked, node: TaskNode | None, rate: float) -> dict[str, Any] | None:
    log = one.log
    if not (log.counts or log.places or log.refused):
        return None
    bases: dict[str, list[Array]] = {}
    for reason, candidates in log.refused:
        bases.setdefault(reason, []).append(np.asarray(candidates, float)[:, :2])
    for place in log.places:
        bases.setdefault(place.reason, []).append(np.array([place.base[:2]], float))
    hands: dict[str, list[Array]] = {}
    for reason, candidates in log.hands:
        hands.setdefault(reason, []).append(np.asarray(candidates, float)[:, :2])
    happened = node.happened if node is not None else ()
    chosen = next((event for event in happened if event.event == "solution" and event.step >= one.step), None)
    accepted = sum(place.reason == "" for place in log.places)
    return {
        "time": round(one.step / rate, 4),
        "node": None if node is None else node.number,
        "location": shown(one.location),
        "chosen": None if chosen is None else [round(float(number), 4) for number in chosen.details["base"]],
        "bases": _cloud(bases, {**log.counts, **({"": accepted} if accepted else {})}),
        "hands": _cloud(hands, {reason: sum(map(len, parts)) for reason, parts in hands.items()}),
        "blocking": [[shown(body), number] for body, number in log.blocking.most_common(8)],
    }


def _cloud(groups: Mapping[str, list[Array]], counts: Mapping[str, int]) -> dict[str, Any]:
    """Return reasons with how many candidates there were, and points [reason, x, y], at most 200 for each reason.

    These are taken evenly out of all; those without a reason, which were accepted, come last.
    """
    every = {reason: np.unique(np.concatenate(parts).round(3), axis=0) for reason, parts in groups.items()}
    number_of = {**{reason: len(points) for reason, points in every.items()}, **counts}
    known = sorted(number_of, key=lambda reason: (reason == "", -number_of[reason], reason))
    points = []
    for place, reason in enumerate(known):
        found = every.get(reason, np.zeros((0, 2)))
        rows = np.linspace(0, len(found) - 1, min(MOST_PLACES, len(found))).round().astype(int)
        points += [[place, x, y] for x, y in found[rows].tolist()]
    return {"reasons": [{"text": shown(reason), "count": number_of[reason]} for reason in known], "points": points}
