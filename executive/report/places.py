"""Searches for base poses on the page of a run: candidates, reasons of rejections, the chosen pose."""

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
"""Largest number of searches on a page."""


@dataclass(frozen=True, slots=True)
class Search:
    """A search for base poses: when it began [world steps], the location, and the log of its candidates."""

    step: int
    location: Location
    log: Rejections


class Questions:
    """Collects the searches of a run."""

    def __init__(self) -> None:
        self.searches: list[Search] = []
        self.step = 0

    def watch(self, location: Location, log: Rejections) -> None:
        """Register a search that begins; it fills ``log`` later."""
        if len(self.searches) < MOST_QUESTIONS:
            self.searches.append(Search(self.step, location, log))

    def model(self, tree: RunTree) -> list[dict[str, Any]]:
        """Build the page's data of all searches with candidates, each with the task that needed the location."""
        texts = {id(one): str(one.location) for one in self.searches}
        by_location: dict[str, list[TaskNode]] = {}
        for node in tree.numbered.values():
            if isinstance(text := node.parameters.get("location"), str):
                by_location.setdefault(text, []).append(node)
        questions = []
        for one in self.searches:
            earlier = [node for node in by_location.get(texts[id(one)], ()) if (node.begun or 0) <= one.step]
            if (question := _question(one, earlier[-1] if earlier else None, tree.rate)) is not None:
                questions.append(question)
        clouds = [question[name] for question in questions for name in ("bases", "hands")]
        colour_of = colours([reason["text"] for cloud in clouds for reason in cloud["reasons"]])
        for reason in (reason for cloud in clouds for reason in cloud["reasons"]):  # same colours in all searches
            reason["colour"] = "#{:02x}{:02x}{:02x}".format(*colour_of[reason["text"]])
        return questions


def _question(one: Search, node: TaskNode | None, rate: float) -> dict[str, Any] | None:
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
    events = node.happened if node is not None else ()
    chosen = next((event for event in events if event.event == "solution" and event.step >= one.step), None)
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
    """Reasons with their numbers of candidates, most frequent first, and points [index of reason, x, y].

    At most ``MOST_PLACES`` evenly spaced points are kept for each reason. The empty reason (accepted) comes last.
    """
    distinct = {reason: np.unique(np.concatenate(parts).round(3), axis=0) for reason, parts in groups.items()}
    number_of = {**{reason: len(points) for reason, points in distinct.items()}, **counts}
    reasons = sorted(number_of, key=lambda reason: (reason == "", -number_of[reason], reason))
    points = []
    for index, reason in enumerate(reasons):
        positions = distinct.get(reason, np.zeros((0, 2)))
        rows = np.linspace(0, len(positions) - 1, min(MOST_PLACES, len(positions))).round().astype(int)
        points += [[index, x, y] for x, y in positions[rows].tolist()]
    return {"reasons": [{"text": shown(reason), "count": number_of[reason]} for reason in reasons], "points": points}
