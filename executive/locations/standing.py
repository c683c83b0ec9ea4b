"""Places for the base that need not reach anything, best first, judged one by one."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.belief.visibility import Unseen
from executive.locations.anywhere import all_places
from executive.locations.grid import around_places
from executive.locations.judging import MOST_CROWDED, PLACES, BaseJudge, scored, unmet
from executive.locations.reaching import TRAVEL
from executive.locations.rejections import Rejections
from executive.locations.relations import BaseDemand
from executive.locations.sight import sight_score
from planlang.geometry import Array
from planlang.protocols import Solution

AT_ONCE = 60
"""Places that are looked at before, and between, judging what is surely not seen."""
MOST_AREAS = 600
"""Places that are judged."""


def standing_places(judge: BaseJudge, demand: BaseDemand, log: Rejections) -> Iterator[Solution]:
    """Places without reach: around what they are about, and when there are no more of these, anywhere."""
    found, looked_at = yield from _judged(judge, demand, around_places(demand, judge.scene), MOST_AREAS, log)
    if looked_at >= MOST_AREAS:
        return
    counts, blocking = log.counts.copy(), log.blocking.copy()
    told = found or bool(blocking)  # where one would look first
    yield from _judged(judge, demand, all_places(demand, judge.scene), MOST_AREAS - looked_at, log, named=told)
    if told:
        log.counts, log.blocking = counts, blocking


def _judged(
    judge: BaseJudge,
    demand: BaseDemand,
    places: tuple[Array, Array, NDArray[np.intp]],
    most: int,
    log: Rejections,
    *,
    named: bool = False,
) -> Generator[Solution, None, tuple[bool, int]]:
    """Of bases, with the room around each and its square, those that will do; so many are looked at exactly.

    ``named``: what takes the room is known. Returns whether there were any, and how many were looked at.
    """
    scene = judge.scene
    terms = list(demand.areas)
    bases, room, squares = places
    score = np.ones(len(bases))
    for term in terms:
        score = score * scored(term, bases)
        log.refuse(unmet(term), bases[scored(term, bases) <= 0])
    for name in demand.seen:
        score = score * sight_score(bases, scene.bodies.block(name), scene.visibility.camera_range())
    roomy = room > 0
    log.refuse("no room for the base", bases[~roomy & (score > 0)])
    x, y, _ = scene.base()
    travel = np.hypot(bases[:, 0] - x, bases[:, 1] - y)
    total = score * (0.4 + np.clip(room, 0.0, 0.3)) * np.exp(-travel / TRAVEL)
    crowded = np.flatnonzero(~roomy & (score > 0))
    if not named and not (roomy & (score > 0)).any():
        promising = crowded[np.argsort(-score[crowded].round(9), kind="stable")][:MOST_CROWDED]
        judge.name_crowding([(float(score[index]), bases[index]) for index in promising], log)
    good = np.flatnonzero(roomy & (score > 0))
    log.scored.append((bases[good], total[good]))
    order = good[np.argsort(-total[good].round(9), kind="stable")]
    found, hidden = False, 0
    rows = np.fromiter(islice(_spread(squares[order], order), most), np.intp)
    for row, unseen in zip(rows.tolist(), _surely_unseen(judge, demand, bases[rows]), strict=True):
        if unseen and (hidden := hidden + 1) > MOST_CROWDED:
            log.add("not visible")
            continue
        place = bases[row].round(PLACES)
        base = (float(place[0]), float(place[1]), math.remainder(float(place[2]), 2 * math.pi))
        worth = float(total[row])
        # there is room by the field: what is seen decides more often
        if not judge.sees(base, worth, demand, log) or not judge.stands(base, worth, demand, log):
            continue
        answer = judge.answer(base, float(total[row]), {}, demand, log)
        if answer is not None:
            found = True
            yield answer
    return found, len(rows)


def _surely_unseen(judge: BaseJudge, demand: BaseDemand, bases: Array) -> Iterator[bool]:
    """From which bases (n, 3) the robot itself, or the room, surely hides what has to be seen; looked at lazily."""
    scene = judge.scene
    view = scene.visibility.own_view()
    for first in range(0, len(bases), AT_ONCE):
        part = bases[first : first + AT_ONCE]
        # what is found at once needs no more than an exact look
        if view is None or first == 0:
            yield from (False for _ in part)
            continue
        unseen = np.zeros(len(part), bool)
        for name in judge.to_see(demand):
            block, solids = scene.bodies.block(name), scene.collisions.solids()
            others = solids.only(np.array([body != name for body in solids.bodies], bool))
            unseen |= Unseen(view, block)(part) | view.hidden_by(others, part, block)
        yield from unseen.tolist()


def _spread(squares: NDArray[np.intp], order: NDArray[np.intp]) -> Iterator[int]:
    """The order, so that of each square the best comes first, then the second best of each, and so on."""
    rank = np.zeros(len(order), np.intp)
    seen: dict[int, int] = {}
    for index, value in enumerate(squares.tolist()):
        rank[index] = seen.get(value, 0)
        seen[value] = rank[index] + 1
    return iter(order[np.argsort(rank, kind="stable")].tolist())
