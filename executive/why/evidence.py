"""What a trace tells of a failure: the failures that ended the run, what they advise, and the things that they name."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from executive.locations.demands import LocationMeaningless
from executive.locations.rejections import NO_HOLD
from executive.runs.options import RunResult
from executive.runs.plan_body import ACTIONS_BEFORE, STEPS
from planlang.advice import Change
from planlang.failures import (
    ActionUnresolvable,
    HandleNotReachable,
    HandsFull,
    HandsLacking,
    LocationUnresolvable,
    MissingCapability,
    ObjectNowhereToBeFound,
    StateUnknown,
    TooHeavy,
)
from planlang.plan_failure import links_of
from planlang.records import dataclass
from planlang.recoveries import ASIDE
from planlang.relations.reaching import InReachOf
from planlang.runs import RunTree, TaskNode
from planlang.runs.codec import links, load_failure

_NAME = re.compile(r"[\w.\-]+")
_ATTEMPT = re.compile(r"(?<=/with_failure_handling)(?P<name>/[^/#]+)#\d+")
OF_ROBOTS = (
    *(TooHeavy, HandsLacking, LocationMeaningless, MissingCapability, ActionUnresolvable, StateUnknown),
    ObjectNowhereToBeFound,
)
"""Failures of what a robot cannot do, wherever things are."""
OF_HANDS = (HandsFull, HandsLacking)
"""Failures for want of a free hand."""
AT_LAST = "EmptyingTheHands"
"""Class of the action by which all that is held is put down once the plan has failed."""
SAME = 100
"""Number of characters at either end by which texts are compared."""
CONCURRENT = frozenset({"par", "partial_order", "par_each", "try_all", "with_requests"})
"""Kinds of constructs whose branches run in an order that the schedule determines."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What is known of the failure that ended a run."""

    advised: tuple[tuple[Change, ...], ...]
    """Changes that failures and searches advised, those of the last failure first."""
    texts: tuple[str, ...]
    """Texts that may name things: those of the innermost cause first, then of other failures, latest first."""
    blocking: Mapping[str, int]
    """Bodies in the way of candidates that the last failed search rejected, and how many of these."""
    sentence: str
    """Class and message of the failure, with what was measured by the search that failed last."""
    where: str
    """Path of the step that failed, without what a change adds to it: actions before the plan, and attempts."""
    is_concurrent: bool
    """True if the order of some steps was open."""
    is_of_places: bool
    """False if the cause is nothing that other places of things, or doors, would change: what the robot cannot see,
    carry, hold between its fingers or do at all."""
    is_of_search: bool
    """True if a search found no place although every arm and grasp was open, and nothing had been grasped before."""
    steps: int
    """Number of steps of the plan that succeeded; -1 if it did not begin."""
    held: tuple[tuple[str, str], ...] = ()
    """Things that hands hold at the end, each with the path of the step that failed and could begin without it."""
    is_grasp_open: bool = False
    """True if the run looked for a place from which to grasp something, by any class of grasps."""

    @staticmethod
    def of(records: Sequence[Mapping[str, Any]]) -> Evidence:
        """Read the evidence of the records of a trace."""
        tree = RunTree()
        for record in records:
            tree.add(record)
        ended = tree.roots[0].failure if tree.roots else None
        chain = list(links(ended))
        told = [(str(one["type"]), str(one["message"])) for one in chain]
        failures = list(_failures(records))
        last = [one for kind, text in reversed(told) for one in failures if _is(one, kind, text)]
        others = [one for one in failures if one not in last]
        ordered = [*last, *others]
        search = next((one for one in ordered if isinstance(one, LocationUnresolvable) and one.blocking), None)
        advised = dict.fromkeys(tuple(getattr(one, "changes", ())) for one in ordered)
        acts = [str(node.parameters.get("action")) for node in tree.numbered.values() if node.failure is not None]
        texts = [*(message for _, message in reversed(told)), *reversed(acts), *map(str, others)]
        return Evidence(
            tuple(changes for changes in advised if changes),
            tuple(dict.fromkeys(texts)),
            {} if search is None else dict(search.blocking),
            _sentence(told, last),
            _place(str(chain[0].get("where", ""))) if chain else "",
            any(node.kind in CONCURRENT and len(node.children) > 1 for node in tree.numbered.values()),
            not any(isinstance(one, OF_ROBOTS) or _is_of_hands(one) for one in last),
            any(type(one) in (LocationUnresolvable, HandleNotReachable) for one in last)
            and not any(record.get("event") == "belief" and record.get("change") == "grasped" for record in records),
            _succeeded(tree),
            tuple(_held(tree, texts[:1], are_hands_lacking=any(isinstance(one, OF_HANDS) for one in last))),
            any(_leaves_grasp_open(node) for node in tree.numbered.values()),
        )

    @staticmethod
    def from_json(json: Mapping[str, Any]) -> Evidence:
        """Read what :meth:`as_json` wrote."""
        advised = tuple(tuple(map(Change.of, changes)) for changes in json["advised"])
        held = tuple((name, step) for name, step in json["held"])
        return Evidence(**{**json, "advised": advised, "texts": tuple(json["texts"]), "held": held})

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON, for the row of a rerun."""
        own = {name: getattr(self, name) for name in Evidence.__slots__}
        return {**own, "advised": [[one.as_json() for one in changes] for changes in self.advised]}

    @staticmethod
    def in_row(result: RunResult) -> dict[str, Any]:
        """The entry of the row of a rerun from which :meth:`from_json` reads what is known of its failure."""
        return {"evidence": None if result.failure is None else Evidence.of(result.trace).as_json()}

    def is_past(self, other: Evidence) -> bool:
        """Check whether this run did more steps than another, or as many and failed elsewhere."""
        is_elsewhere = self.where != other.where and f"/{ASIDE}/" not in self.where
        return self.steps > other.steps or (self.steps == other.steps and is_elsewhere)

    def named(self, names: Collection[str]) -> list[str]:
        """List those of some names that the failures name: what was acted on, what was in the way, then others."""
        found: dict[str, None] = {}
        first = _named(self.texts[:1], names)
        found.update(dict.fromkeys([*first, *(name for name in self.blocking if name in names)]))
        found.update(dict.fromkeys(_named(self.texts, names)))
        return list(found)


def _place(where: str) -> str:
    return _ATTEMPT.sub(r"\g<name>", where.replace(f"/{ACTIONS_BEFORE}/", "/"))


def _succeeded(tree: RunTree) -> int:
    """Count the steps of the plan that succeeded, without things that were put down before one."""
    plan = next((node for node in tree.numbered.values() if node.kind == "plan"), None)
    if plan is None:
        return -1
    return sum(one.status == "succeeded" and one.action != ASIDE for one in plan.children)


def _held(tree: RunTree, texts: Sequence[str], *, are_hands_lacking: bool) -> Iterator[tuple[str, str]]:
    """Yield things in hands at the failure, each with the path of the outermost failed step that began after its grasp.

    A thing that the failure is about is needed in the hand, unless hands are what is lacking.
    """
    grasped: dict[str, int] = {}
    end = next((node.first for node in tree.numbered.values() if node.action == AT_LAST), None)
    for one in (one for one in tree.belief if end is None or one.place < end):
        name = str(one.details.get("name"))
        if one.details.get("change") == "grasped":
            grasped.setdefault(name, one.place)
        elif one.details.get("change") == "released":
            grasped.pop(name, None)
    for name, place in grasped.items():
        step = _failed_step(tree, place)
        if step is not None and (are_hands_lacking or name not in _named(texts, (name,))):
            yield name, step.path


def _failed_step(tree: RunTree, place: int) -> TaskNode | None:
    """The outermost step that failed and began after a record of the trace; of its attempts the first."""
    node = tree.roots[0] if tree.roots else None
    while node is not None and not node.inner:
        if node.kind in STEPS and node.first > place:
            name = node.name.partition("#")[0]
            attempts = [] if node.parent is None else node.parent.children
            return next(one for one in (*attempts, node) if one.first > place and one.name.partition("#")[0] == name)
        node = next((one for one in reversed(node.children) if one.status == "failed"), None)
    return None


def _leaves_grasp_open(node: TaskNode) -> bool:
    """Check whether a construct seeks a place in reach of something, and names no class of grasps."""
    where = str(node.parameters.get("location", ""))
    return node.kind == "at_location" and InReachOf.name in where and not where.endswith(" grasp")


def _sentence(told: Sequence[tuple[str, str]], last: Iterable[BaseException]) -> str:
    """Say the failure that ended the run in one line."""
    if not told:
        return "the run failed"
    message = f"{told[0][0]}: {told[0][1]}".partition("\n")[0]
    reason = next((one.because() for one in last if isinstance(one, LocationUnresolvable) and one.because()), "")
    return message if not reason or reason in message else f"{message}; {reason}"


def _is(failure: BaseException, kind: str, text: str) -> bool:
    """Check whether a failure is the one that a record tells, whose text may be cut."""
    own = str(failure)
    return type(failure).__name__ == kind and own[:SAME] == text[:SAME] and own[-SAME:] == text[-SAME:]


def _named(texts: Iterable[str], names: Collection[str]) -> Iterator[str]:
    known = frozenset(names)
    for text in texts:
        for word in _NAME.findall(text):
            for name in (word, word.rstrip(".")):
                if name in known:
                    yield name


def _is_of_hands(failure: BaseException) -> bool:
    """Check whether the fingers find no hold, wherever the thing is."""
    return isinstance(failure, LocationUnresolvable) and next(iter(failure.counts), "") == NO_HOLD.text


def _failures(records: Sequence[Mapping[str, Any]]) -> Iterator[BaseException]:
    """Yield the failures that a trace stores losslessly, with their causes, the latest first."""
    for record in reversed(records):
        if record["event"] not in ("answer", "performed", "completed") or "failure" not in record:
            continue
        try:
            failure = load_failure(record["failure"])
        except (ValueError, KeyError):
            continue
        yield from links_of(failure)
