"""What a trace tells of a failure: the failures that ended the run, what they advise, and the things that they name."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from planlang.advice import Change
from planlang.failures import LocationUnresolvable
from planlang.plan_failure import links_of
from planlang.records import dataclass
from planlang.runs import RecordedRun, RunTree
from planlang.runs.codec import load_failure

_NAME = re.compile(r"[\w.\-]+")
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
    is_concurrent: bool
    """True if the order of some steps was open."""

    @staticmethod
    def of(recorded: RecordedRun) -> Evidence:
        """Read the evidence of a trace."""
        tree = RunTree()
        for line in recorded.lines:
            tree.add(line.record)
        ended = tree.roots[0].failure if tree.roots else None
        chain = list(_links(ended))
        told = [(str(one["type"]), str(one["message"])) for one in chain]
        failures = list(_failures(recorded))
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
            str(chain[0].get("where", "")) if chain else "",
            any(node.kind in CONCURRENT and len(node.children) > 1 for node in tree.numbered.values()),
        )

    def named(self, names: Collection[str]) -> list[str]:
        """List those of some names that the failures name: what was acted on, what was in the way, then others."""
        found: dict[str, None] = {}
        first = _named(self.texts[:1], names)
        found.update(dict.fromkeys([*first, *(name for name in self.blocking if name in names)]))
        found.update(dict.fromkeys(_named(self.texts, names)))
        return list(found)


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


def _links(failure: Mapping[str, Any] | None) -> Iterator[Mapping[str, Any]]:
    link: object = failure
    while isinstance(link, Mapping):
        yield link
        link = link.get("cause")


def _failures(recorded: RecordedRun) -> Iterator[BaseException]:
    """Yield the failures that a trace stores losslessly, with their causes, the latest first."""
    for line in reversed(recorded.lines):
        if line.event not in ("answer", "performed", "completed") or "failure" not in line.record:
            continue
        try:
            failure = load_failure(line.record["failure"])
        except (ValueError, KeyError):
            continue
        yield from links_of(failure)
