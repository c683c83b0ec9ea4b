"""What a run did again although nothing had changed: neither done, nor seen, nor believed otherwise since it failed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import planlang.failures as failures
from planlang.ontology import Ontology, shorten
from planlang.recipe.actions import read_recoveries

Records = Sequence[Mapping[str, Any]]


def passing(vocabulary: Ontology) -> tuple[type[failures.PlanFailure], ...]:
    """Failures that may pass by themselves: those of recoveries that are marked ``transient``."""
    rules = [rule for rule in read_recoveries(vocabulary) if rule.transient]
    found = [getattr(failures, shorten(name)) for rule in rules for name in rule.failures]
    # a contact has shown that there is no room: the belief is another one
    return (*found, failures.ManipulationGoalInCollision)


def repeated(records: Records, passes: tuple[type[failures.PlanFailure], ...]) -> Iterator[str]:
    """Yield the failures, other than those that may pass, after which the same was done again in the same belief."""
    failed: dict[tuple[int, str], int] = {}
    """Node and class of a failure -> the first record of such a failure in the present attempt: what comes after it,
    as the looks of a recovery, may fail in the same way."""
    for number, record in enumerate(records):
        if record["event"] == "attempt":
            failed = {key: value for key, value in failed.items() if key[0] != record["node"]}
        elif record["event"] == "ended" and record.get("status") == "failed" and "parent" in record:
            failed.setdefault((record["parent"], record["failure"]["type"]), number)
        elif record["event"] == "recovery" and record["decision"] == "retry":
            name = record["failure"]["type"]
            between = records[failed[record["node"], name] : number]
            if not issubclass(getattr(failures, name), passes) and not any(map(_changes, between)):
                yield name


def _changes(record: Mapping[str, Any]) -> bool:
    """Check whether a record is of something that was done or seen, or is believed since."""
    return record["event"] == "belief" or (record["event"] == "started" and record["kind"] == "perform")


def base_poses(records: Iterable[Mapping[str, Any]]) -> Iterator[tuple[object, object]]:
    """Yield each base pose that failed with the next one of its scope, each with the revision of the belief."""
    last: dict[int, Mapping[str, Any]] = {}
    tried: dict[int, tuple[object, object]] = {}
    for record in records:
        if record["event"] == "pose failed":
            tried[record["node"]] = last[record["node"]]["base"], last[record["node"]]["revision"]
        elif record["event"] == "solution":
            last[record["node"]] = record
            if (before := tried.pop(record["node"], None)) is not None:
                yield before, (record["base"], record["revision"])


def retries(records: Iterable[Mapping[str, Any]]) -> int:
    """Count how often a recovery let something be done again."""
    return sum(record["event"] == "recovery" and record["decision"] == "retry" for record in records)
