"""Why something failed: the failures of a run once each, and a card for each place where one arose."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from planlang.failures import LocationUnresolvable, MissingCapability
from planlang.report.tree import event_text, is_origin, shown
from planlang.report.wording import Wording, duration
from planlang.runs.codec import load_failure
from planlang.runs.run_tree import Happened, RunTree, TaskNode

_LINE = re.compile(r"\(([^():]+):(\d+)\)$")


class Failures:
    """The table of the failures that nodes ended with; several nodes through which one passes share an entry."""

    def __init__(
        self, tree: RunTree, reasons: Mapping[str, Mapping[str, Any]], remedies: Mapping[str, str] | None = None
    ) -> None:
        """``reasons`` has what records say beside messages, as :func:`reason_in` reads it.

        ``remedies`` has a sentence that says what to change for each part (local name) that the robot lacks.
        """
        self.table: list[dict[str, Any]] = []
        self.index: dict[int, int] = {}
        self._reasons, self._remedies = reasons, remedies or {}
        known: dict[str, int] = {}
        for number, node in tree.numbered.items():
            if node.failure is not None:
                key = json.dumps(node.failure, sort_keys=True)
                if key not in known:
                    known[key] = len(self.table)
                    self.table.append(self._entry(node.failure))
                self.index[number] = known[key]

    def lowered(self, node: TaskNode) -> str:
        """Return the headline of a node's failure, to stand within a sentence."""
        message = str(self.table[self.index[node.number]]["headline"])
        return message[:1].lower() + message[1:] if message[1:2].islower() else message

    def _entry(self, failure: Mapping[str, Any]) -> dict[str, Any]:
        chain = [self._link(link) for link in _chain(failure)]
        advice = [link["advice"] for link in chain if "advice" in link]
        # counts of candidates say less than what they were counted for
        plain = [link for link in chain if link["type"] != LocationUnresolvable.__name__] or chain
        return {"headline": advice[0] if advice else plain[-1]["message"] or plain[-1]["type"], "chain": chain}

    def _link(self, failure: Mapping[str, Any]) -> dict[str, Any]:
        message, where = str(failure["message"]), str(failure.get("where", ""))
        found: dict[str, Any] = {"type": str(failure["type"]), "message": shown(message, 1000)}
        found |= {"where": shown(_LINE.sub("", where).strip())} if where else {}
        line = _LINE.search(where)
        found |= {"file": shown(line[1]), "line": int(line[2])} if line else {}
        if (reason := self._reasons.get(message)) is not None:
            # advice and counts have lines of their own
            found |= {
                "message": shown(message.partition(f": {reason['advice']}" if "advice" in reason else " (")[0]),
                **{key: value for key, value in reason.items() if key != "missing"},
            }
            remedies = [self._remedies[part] for part in reason.get("missing", ()) if part in self._remedies]
            found |= {"advice": remedies[0]} if remedies else {}
        beside = {"at the same time": "siblings", "branch": "members", "during cleanup": "cleanup"}
        others = [
            [relation, shown(name), shown(text)]
            for relation, key in beside.items()
            for name, text in _named(failure.get(key))
        ]
        return found | ({"others": others} if others else {})


def _chain(failure: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield a failure and what it was raised from; what was raised again with the same words is left out."""
    link: object = failure
    stated: set[tuple[str, str]] = set()
    while isinstance(link, Mapping):
        key = str(link["type"]), str(link["message"])
        if key not in stated:
            yield link
        stated.add(key)
        link = link.get("cause")


def _named(others: object) -> list[tuple[str, str]]:
    if isinstance(others, Mapping):
        return [(str(name), str(text)) for name, text in others.items()]
    return [("", str(text)) for text in others] if isinstance(others, list) else []


def reason_in(record: Mapping[str, Any]) -> tuple[str, dict[str, Any]] | None:
    """Return a failure's message and what else is known, if a record answers a search for a place that has failed.

    That is a sentence that says what would do (``advice``), and the numbers of candidates by ``counts`` of reasons and
    of bodies in the way (``blocking``); or the parts that the robot lacks (``missing``).
    """
    try:
        failure = load_failure(record["failure"])
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    if isinstance(failure, MissingCapability):
        return str(failure), {"missing": failure.missing}
    if not isinstance(failure, LocationUnresolvable):
        return None
    said = {"advice": shown(failure.because()), "counts": dict(failure.counts), "blocking": dict(failure.blocking)}
    return str(failure), {key: value for key, value in said.items() if value}


_Tried = dict[tuple[int, int], list[Any]]
"""What was tried, [time s, node, words], by the place in the trace of its record and the node."""


def cards_of(tree: RunTree, failures: Failures, wording: Wording) -> list[dict[str, Any]]:
    """Return a card for each failure where it arose, those that ended the run first, then in order of time.

    A card has the node and its moment, the place of the failure in the table, whether something around it went on
    (``recovered``), and what was tried, in the order of the trace: [time s, node, words]. That are attempts and
    recoveries around it, and the actions in the outermost construct that made them. Failures that ended the run
    together share a card, that of the innermost cause.
    """
    origins = sorted((node for node in tree.numbered.values() if is_origin(node)), key=lambda node: node.last)
    cards = [_card(node, failures, wording, tree.rate) for node in origins]
    ends: dict[int, list[dict[str, Any]]] = {}
    for card in cards:
        if not card["recovered"]:
            ends.setdefault(card["failure"], []).append(card)
    fatal = [_together(tree, failures, together) for together in ends.values()]
    every = [*fatal, *(card for card in cards if card["recovered"])]
    return [card | {"tried": _latest(card["tried"])} for card in every]


def _together(tree: RunTree, failures: Failures, cards: list[dict[str, Any]]) -> dict[str, Any]:
    """Return one card for those of failures that ended the run together; the others are among what was tried."""

    def cause(entry: int) -> tuple[str, str]:
        link = failures.table[entry]["chain"][-1]
        return link["type"], link["message"]

    wanted = cause(cards[0]["failure"])
    first = next((one for one in reversed(cards) if cause(failures.index[one["node"]]) == wanted), cards[-1])
    tried: _Tried = {key: row for one in cards for key, row in one["tried"].items()}
    for one in cards:
        if one is not first:
            node = tree.numbered[one["node"]]
            tried[node.last, node.number] = [one["time"], node.number, shown(node.reason)]
    return first | {"tried": tried}


def _latest(tried: _Tried) -> list[list[Any]]:
    rows = [tried[key] for key in sorted(tried)]
    left = len(rows) - MOST_TRIED
    return rows if left <= 0 else [[*rows[left - 1][:2], f"{left} earlier ones are in the plan"], *rows[left:]]


def _card(node: TaskNode, failures: Failures, wording: Wording, rate: float) -> dict[str, Any]:
    ended_by = node
    trying: TaskNode | None = None
    tried: _Tried = {}
    step: TaskNode | None = node
    is_outward = True
    while step is not None:
        is_outward = is_outward and step.failure is not None and step.ended == node.ended
        ended_by = step if is_outward else ended_by
        events = [one for one in step.happened if one.event in _TRIES and one.step <= (node.ended or 0)]
        for one in events:
            text = event_text(_without_known(one, ended_by))
            if text is not None:
                tried[one.place, step.number] = [round(one.step / rate, 4), step.number, text]
        trying = step if events or (trying is None and (step.kind == "plan" or step.parent is None)) else trying
        step = step.parent
    failure = failures.index[ended_by.number]
    for made in _actions(trying or node, node.last):
        text = _ended(made, failures, wording, failure)
        tried[made.first, made.number] = [round(made.start or 0.0, 4), made.number, text]
    return {
        "node": node.number,
        "time": None if node.end is None else round(node.end, 4),
        "failure": failure,
        "recovered": ended_by.parent is not None,
        "tried": tried,
    }


def _without_known(one: Happened, node: TaskNode) -> Happened:
    """Return an event without its failure if the card of a node's failure has that already."""
    known = [str(link["message"]) for link in _chain(node.failure or {})] if node.failure else []
    failure = one.details.get("failure")
    if not isinstance(failure, Mapping) or failure.get("message") not in known:
        return one
    return replace(one, details={key: value for key, value in one.details.items() if key != "failure"})


def _actions(around: TaskNode, last: int) -> Iterator[TaskNode]:
    """Yield the actions in a step that began before a place in the trace, of nested ones the innermost of the plan."""
    inside = [child for child in around.children if child.first < last] if not around.is_request else []
    found = False
    for child in inside:
        for one in _actions(child, last):
            found = True
            yield one
    if not found and around.kind == "perform" and around.start is not None:
        yield around


def _ended(node: TaskNode, failures: Failures, wording: Wording, known: int) -> str:
    """Return an action in words with what ended it; the failure that is that of the card is not repeated."""
    match node.status:
        case "succeeded":
            how = f"done in {duration(node)}"
        case "failed":
            why = "" if failures.index[node.number] == known else f": {failures.lowered(node)}"
            how = f"failed after {duration(node)}{why}"
        case "evaporated":
            how = f"stopped after {duration(node)}"
        case _:
            how = "not ended then"
    return shown(f"{wording.of(node)}: {how}")


MOST_TRIED = 40
"""Attempts, recoveries and actions that a card lists, the latest ones."""
_TRIES = frozenset({"attempt", "recovery", "solution", "pose failed", "no more poses", "transition"})
