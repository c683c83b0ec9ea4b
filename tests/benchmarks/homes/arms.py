"""Arms that come to what they take, while the others are as the robot drives, or aside if they are in the way so."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property

import numpy as np
import pybullet

from executive.robots import Arm
from planlang.geometry import Array
from tests.support.locations.dense_sampler import PRESSED, Joints, way_from
from tests.support.locations.oracle import BasePose, Oracle
from tests.support.locations.ways import Ways

ASIDE = 8
"""Postures drawn for arms that would be in the way of another one, beside those that have a name."""
NARROW = 800
"""Postures drawn of each arm, of which the narrowest is the other one in which the robot drives."""

Posture = Mapping[str, float]
Drives = defaultdict[int, Ways | None]
"""What is known of where the base gets to, by the number of the posture in which it drives; None if it begins in
something in that posture.
"""


class Arms:
    """The arms of a robot in a scene."""

    def __init__(self, oracle: Oracle, chains: Mapping[str, Joints]) -> None:
        self._oracle, self._chains = oracle, chains
        self._usual = dict(oracle.posture)

    @contextmanager
    def driving(self) -> Iterator[Iterator[int]]:
        """Have the robot drive in one posture after the other, by numbers; afterwards in its usual one again."""
        try:
            yield self._each()
        finally:
            self._oracle.posture = dict(self._usual)

    def _each(self) -> Iterator[int]:
        yield 0
        self._oracle.posture = dict(self._narrow)
        yield 1

    def come(self, drives: Drives, arm: Arm, base: BasePose, hands: Array, q: Array, target: str | None) -> bool:
        """Return True if the base gets to its place, and an arm to its hands (k, 4, 4), to the second with joints (d,).

        The other arms are where one posture has them all the while, the first in which they are not in its way.
        """
        oracle, chain = self._oracle, self._chains[arm.name]
        with self.driving() as numbers:
            for number in numbers:
                aside, would_help = self._aside(arm, base, q, target)
                if not would_help:
                    return False
                oracle.place(base, oracle.posture)
                if aside is None or oracle.touched(depth=PRESSED) is not None:
                    continue
                ways = drives[number]
                if ways is not None and ways.lead_to(base):
                    return way_from(oracle, ways, arm, chain, base, hands, q, target, aside) is not None
        return False

    def _aside(self, arm: Arm, base: BasePose, q: Array, target: str | None) -> tuple[Posture | None, bool]:
        """Return where the other arms are while one is at its joints (d,) and nothing is touched but a target.

        None if they are in the way in all postures that are known; then also if others would help.
        """
        oracle = self._oracle
        opened = dict(arm.gripper.opened) if arm.gripper is not None else {}
        values = dict(zip(self._chains[arm.name].names, q.tolist(), strict=True))
        for aside in self._asides[arm.name]:
            oracle.place(base, {**oracle.posture, **opened, **aside, **values})
            pair = oracle.touched(oracle.fingers(arm.name), target, depth=PRESSED)
            if pair is None:
                return aside, True
            if self._others[arm.name].isdisjoint(pair):
                return None, False
        return None, True

    @cached_property
    def _narrow(self) -> Posture:
        """The posture that keeps each arm, one after the other, nearest to the middle of the base, torso raised."""
        oracle, rng = self._oracle, np.random.default_rng(0)
        shared = set.intersection(*({*chain.names} for chain in self._chains.values()))
        posture = dict(self._usual)
        for chain in self._chains.values():
            spans = dict(zip(chain.names, zip(chain.lower.tolist(), chain.upper.tolist(), strict=True), strict=True))
            if len(self._chains) > 1:
                posture |= {joint: spans.pop(joint)[1] for joint in shared}
            moving = {oracle.joints[joint] for joint in spans}
            links = [link for link in oracle.names if moving & {*oracle.upwards(link)}]
            best, kept = math.inf, posture
            for _ in range(NARROW):
                drawn = {**posture, **{joint: float(rng.uniform(*span)) for joint, span in spans.items()}}
                oracle.place((0.0, 0.0, 0.0), drawn)
                corners = [pybullet.getAABB(oracle.uid, link, physicsClientId=oracle.client) for link in links]
                away = max(math.hypot(*np.maximum(np.abs(low), np.abs(high))[:2]) for low, high in corners)
                if away < best and not oracle.pressed_into_itself():
                    best, kept = away, drawn
            posture = dict(kept)
        return posture

    @cached_property
    def _others(self) -> dict[str, frozenset[str]]:
        """The links of all other arms, by the name of each arm."""
        oracle, found = self._oracle, {}
        for name in self._chains:
            theirs = {oracle.joints[joint] for joint in self._spans(name)}
            found[name] = frozenset(oracle.names[link] for link in oracle.names if theirs & {*oracle.upwards(link)})
        return found

    @cached_property
    def _asides(self) -> dict[str, list[dict[str, float]]]:
        """Joints of all other arms, by the name of each arm, where they may be meanwhile: first as they drive."""
        rng, found = np.random.default_rng(0), {}
        for name in self._chains:
            spans = self._spans(name)
            named = [{one: row[one] for one in spans if one in row} for row in self._oracle.robot.postures.values()]
            drawn = [{one: float(rng.uniform(*span)) for one, span in spans.items()} for _ in range(ASIDE)]
            found[name] = [{}, *(one for one in (*named, *drawn) if one)]
        return found

    def _spans(self, name: str) -> dict[str, tuple[float, float]]:
        """Return the joints of all arms but one that do not move this one too, with their limits."""
        return {
            joint: (low, high)
            for other in self._chains.values()
            for joint, low, high in zip(other.names, other.lower.tolist(), other.upper.tolist(), strict=True)
            if joint not in self._chains[name].names
        }
