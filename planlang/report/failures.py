"""Failures of a run: a table without duplicates, and a card for each node in which a failure arose."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from planlang.closure import grouped
from planlang.failures import LocationUnresolvable, MissingCapability, ObjectNowhereToBeFound, PlanFailure
from planlang.report.tree import event_text, in_words, is_origin, shown
from planlang.report.wording import Wording, duration
from planlang.runs.codec import links, load_failure
from planlang.runs.run_tree import Happened, RunTree, TaskNode

_IN_VAIN = "no simple change "
"""How a clause begins that says what would not help."""
_LINE = re.compile(r"\(([^():]+):(\d+)\)$")


class Failures:
    """Table of the failures of nodes; nodes through which a failure propagated share an entry."""

    def __init__(
        self, tree: RunTree, reasons: Mapping[str, Mapping[str, Any]], remedies: Mapping[str, str] | None = None
    ) -> None:
        """``reasons`` maps messages to further data from the trace, as :func:`reasons_in` reads it.

        ``remedies`` maps a part (local name) that the robot lacks to a sentence with advice.
        """
        self.table: list[dict[str, Any]] = []
        self.index: dict[int, int] = {}
        self._reasons, self._remedies = reasons, remedies or {}
        failed: dict[str, list[TaskNode]] = {}
        for node in tree.numbered.values():
            if node.failure is not None:
                failed.setdefault(json.dumps(node.failure, sort_keys=True), []).append(node)
        for entry, nodes in enumerate(failed.values()):
            self.table.append(self._entry(nodes[-1]))  # the innermost, which knows what descriptions by class mean
            self.index |= {node.number: entry for node in nodes}

    def lowered(self, node: TaskNode) -> str:
        """Headline of a node's failure, to be used within a sentence."""
        message = str(self.table[self.index[node.number]]["headline"])
        return message[:1].lower() + message[1:] if message[1:2].islower() else message

    def _entry(self, node: TaskNode) -> dict[str, Any]:
        chain = [self._link(link) for link in _chain(node.failure or {})]
        for link in chain:
            link["message"] = node.named(link["message"])
        advice = [link["advice"] for link in chain if "advice" in link]
        # a search for a base pose only counts candidates, and other errors have the words of programs: the failure
        # that started the search, or that was made of the error, says more
        told = [link for link in chain if "where" in link] or chain
        plain = [link for link in told if link["type"] != LocationUnresolvable.__name__] or told
        sums = [link for link in plain if link["type"] == ObjectNowhereToBeFound.__name__]  # what began it says less
        headline = advice[0] if advice and not sums else (sums or plain[-1:])[0]["message"] or plain[-1]["type"]
        return {"headline": in_words(_reason_first(node.named(str(headline)))), "chain": chain}

    def _link(self, failure: Mapping[str, Any]) -> dict[str, Any]:
        message, where = str(failure["message"]), str(failure.get("where", ""))
        entry: dict[str, Any] = {"type": str(failure["type"]), "message": shown(message, 1000)}
        entry |= {"where": shown(_LINE.sub("", where).strip())} if where else {}
        line = _LINE.search(where)
        entry |= {"file": shown(line[1]), "line": int(line[2])} if line else {}
        if (reason := self._reasons.get(message)) is not None:
            # the page shows advice and counts on separate lines
            entry |= {
                "message": shown(message.partition(f": {reason['advice']}" if "advice" in reason else " (")[0]),
                **{key: value for key, value in reason.items() if key != "missing"},
            }
            remedies = [self._remedies[part] for part in reason.get("missing", ()) if part in self._remedies]
            entry |= {"advice": remedies[0]} if remedies else {}
        beside = {"at the same time": "siblings", "branch": "members", "during cleanup": "cleanup"}
        others = [
            [relation, shown(name), shown(text)]
            for relation, key in beside.items()
            for name, text in _named(failure.get(key))
        ]
        return entry | ({"others": others} if others else {})


def _reason_first(headline: str) -> str:
    """Put what was tried in vain behind the reason for which it was tried."""
    clauses = headline.split("; ")
    return "; ".join(sorted(clauses, key=lambda one: one.startswith(_IN_VAIN)))


def _chain(failure: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield a failure and its causes, without those that repeat type and message."""
    first = dict[tuple[str, str], Mapping[str, Any]]()
    for link in links(failure):
        first.setdefault((str(link["type"]), str(link["message"])), link)
    yield from first.values()


def _named(others: object) -> list[tuple[str, str]]:
    if isinstance(others, Mapping):
        return [(str(name), str(text)) for name, text in others.items()]
    return [("", str(text)) for text in others] if isinstance(others, list) else []


def reasons_in(record: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield messages and further data of the failed searches in a record, also of those that caused another failure.

    The data are ``advice`` (a sentence), the numbers of candidates by ``counts`` of reasons and by ``blocking`` bodies,
    or the parts that the robot lacks (``missing``).
    """
    try:
        first = load_failure(record["failure"])
    except (ValueError, KeyError):
        return
    for failure in first.chain() if isinstance(first, PlanFailure) else ():
        if isinstance(failure, MissingCapability):
            yield str(failure), {"missing": failure.missing}
        elif isinstance(failure, LocationUnresolvable):
            found = {"advice": shown(failure.because()), "counts": {**failure.counts}, "blocking": {**failure.blocking}}
            yield str(failure), {key: value for key, value in found.items() if value}


_Tried = dict[tuple[int, int], list[Any]]
"""(Position in the trace, node) -> attempt, as [time s, node, text]."""


def cards_of(tree: RunTree, failures: Failures, wording: Wording) -> list[dict[str, Any]]:
    """Build a card for each failure where it arose: those that ended the run first, then in order of time.

    A card has the node and its time, the index of the failure in the table, whether a surrounding node succeeded
    (``recovered``), and what was tried, in the order of the trace: [time s, node, text]. These are attempts and
    recoveries around the node, and the actions in the outermost construct that made attempts. Failures that together
    ended the run share the card of the innermost cause.
    """
    origins = sorted((node for node in tree.numbered.values() if is_origin(node)), key=lambda node: node.last)
    cards = [_card(node, failures, wording, tree.rate) for node in origins]
    ends = grouped((card["failure"], card) for card in cards if not card["recovered"])
    fatal = [_merged(tree, failures, group) for group in ends.values()]
    every = [*fatal, *(card for card in cards if card["recovered"])]
    return [card | {"tried": _latest(card["tried"])} for card in every]


def _merged(tree: RunTree, failures: Failures, cards: list[dict[str, Any]]) -> dict[str, Any]:
    """Merge the cards of failures that together ended the run; the others become entries of what was tried."""

    def cause(entry: int) -> tuple[str, str]:
        link = failures.table[entry]["chain"][-1]
        return link["type"], link["message"]

    main_cause = cause(cards[0]["failure"])
    first = next((one for one in reversed(cards) if cause(failures.index[one["node"]]) == main_cause), cards[-1])
    tried: _Tried = {key: row for one in cards for key, row in one["tried"].items()}
    for one in cards:
        if one is not first:
            node = tree.numbered[one["node"]]
            tried[node.last, node.number] = [one["time"], node.number, shown(failures.lowered(node))]
    return first | {"tried": tried}


def _latest(tried: _Tried) -> list[list[Any]]:
    rows = [tried[key] for key in sorted(tried)]
    omitted = len(rows) - MOST_TRIED
    return (
        rows if omitted <= 0 else [[*rows[omitted - 1][:2], f"{omitted} earlier ones: see the plan"], *rows[omitted:]]
    )


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
    for action in _actions(trying or node, node):
        text = _ended(action, failures, wording, failure)
        tried[action.first, action.number] = [round(action.start or 0.0, 4), action.number, text]
    return {
        "node": node.number,
        "time": None if node.end is None else round(node.end, 4),
        "failure": failure,
        "recovered": ended_by.parent is not None,
        "tried": tried,
    }


def _without_known(one: Happened, node: TaskNode) -> Happened:
    """Drop the failure of an event if the card already shows it."""
    known = [str(link["message"]) for link in _chain(node.failure or {})] if node.failure else []
    failure = one.details.get("failure")
    if not isinstance(failure, Mapping) or failure.get("message") not in known:
        return one
    return replace(one, details={key: value for key, value in one.details.items() if key != "failure"})


def _actions(construct: TaskNode, node: TaskNode) -> Iterator[TaskNode]:
    """Yield the actions in a construct that began before a node ended, the innermost of nested ones.

    An action around the node that went on after its failure is none of what was tried before.
    """
    inside = [child for child in construct.children if child.first < node.last] if not construct.is_request else []
    has_inner = False
    for child in inside:
        for one in _actions(child, node):
            has_inner = True
            yield one
    goes_on = construct.ended != node.ended and node.within(construct)
    if not has_inner and construct.kind == "perform" and construct.start is not None and not goes_on:
        yield construct


def _ended(node: TaskNode, failures: Failures, wording: Wording, known: int) -> str:
    """Describe an action and how it ended, without repeating the failure of the card."""
    match node.status:
        case "succeeded":
            how = f"done in {duration(node)}"
        case "failed":
            why = "" if failures.index[node.number] == known else f": {failures.lowered(node)}"
            how = f"failed after {duration(node)}{why}"
        case "evaporated":
            how = f"stopped after {duration(node)}"
        case _:
            how = "still running then"
    return shown(f"{wording.of(node)}: {how}")


MOST_TRIED = 40
"""Maximum number of attempts, recoveries and actions on a card; the latest ones are kept."""
_TRIES = frozenset({"attempt", "recovery", "solution", "pose failed", "no more poses", "transition"})
