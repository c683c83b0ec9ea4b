"""Traces that an older planlang wrote: what is read of them, and what is refused."""

from __future__ import annotations

import pytest

from planlang import a_location, an_object
from planlang.designators import Relation
from planlang.runs import RecordedRun
from planlang.runs.codec import SCHEMA, load
from planlang.runs.recorded_run import OlderTrace

BOTTLE = an_object("Bottle")


def recorded(schema: int) -> RecordedRun:
    """A run of which only the header is left."""
    return RecordedRun.of([{"step": 0, "event": "header", "schema": schema, "seed": 0, "rate": 30}])


def test_an_older_trace_is_read_but_cannot_be_repeated_and_says_its_schema() -> None:
    with pytest.raises(OlderTrace) as caught:
        recorded(SCHEMA - 1).check_repeatable()
    assert caught.value.schema == SCHEMA - 1


def test_a_trace_of_the_present_schema_can_be_repeated() -> None:
    recorded(SCHEMA).check_repeatable()


def test_a_relation_that_was_written_when_there_was_one_reference_is_read() -> None:
    reference = {"$": "Object", "type": "Bottle", "iri": None}
    written = {"$": "Relation", "name": "near", "reference": reference, "within": None, "beyond": None}
    assert a_location(near=BOTTLE).relations == (load({**written, "negated": False}),)
    assert isinstance(load({**written, "negated": True}), Relation)
