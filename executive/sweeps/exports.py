"""Rows of a sweep for other programs: Parquet for tables, JUnit for continuous integration."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from executive.sweeps.records import CRASHED, Row, first_sentence, is_reached
from executive.sweeps.table import outcome_of
from planlang.outputs import MARK
from planlang.visible import visible

_LARGEST = 2**63 - 1
"""Largest integer of a column of integers."""


def save_parquet(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as Parquet: numbers, flags, texts, lists of texts; nested objects as JSON. Raises OSError.

    Needs pyarrow. Equal rows give equal bytes, with one version of pyarrow.
    """
    import pyarrow  # an extra
    import pyarrow.parquet

    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: _column([row.get(name) for row in rows]) for name in names}
    table = pyarrow.table({visible(name): values for name, values in columns.items()})
    pyarrow.parquet.write_table(table.replace_schema_metadata({"writer": MARK}), path)


def _column(values: Sequence[Any]) -> Any:
    """Values as an array of the narrowest type that has all of them."""
    import pyarrow

    stated = [value for value in values if value is not None]
    if stated and all(isinstance(value, bool) for value in stated):
        return pyarrow.array(values, pyarrow.bool_())
    numbers = [value for value in stated if isinstance(value, int | float) and not isinstance(value, bool)]
    if stated and len(numbers) == len(stated):
        if all(isinstance(value, int) and abs(value) <= _LARGEST for value in numbers):
            return pyarrow.array(values, pyarrow.int64())
        return pyarrow.array([None if value is None else float(value) for value in values], pyarrow.float64())
    if stated and all(isinstance(value, list) for value in stated):
        lists = [None if value is None else [_text(one) for one in value] for value in values]
        return pyarrow.array(lists, pyarrow.list_(pyarrow.string()))
    return pyarrow.array([None if value is None else _text(value) for value in values], pyarrow.string())


def _text(value: Any) -> str:
    return visible(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False))


def junit_text(title: str, rows: Mapping[str, Sequence[Row]]) -> str:
    """Format variants (name -> rows) as JUnit: a suite for each, a test for each world.

    A world whose goal was not reached is a failure, one that crashed an error, with the command that repeats it. The
    time of a test is its plan time [s].
    """
    root = Element("testsuites", {"name": visible(title), **_counts([row for own in rows.values() for row in own])})
    for name, own in rows.items():
        suite = SubElement(root, "testsuite", {"name": visible(name), **_counts(own)})
        for row in own:
            seed = row.get("seed", row["world"])
            time = {"time": f"{row['duration']:.3f}"} if "duration" in row else {}
            called = {"classname": visible(name), "name": visible(f"world {seed}")}
            test = SubElement(suite, "testcase", {**called, **time})
            if not is_reached(row):
                _add_failure(test, row)
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {MARK} -->\n{tostring(root, encoding="unicode")}\n'


def _counts(rows: Sequence[Row]) -> dict[str, str]:
    errors = sum(row.get("outcome") == CRASHED for row in rows)
    failures = sum(not is_reached(row) for row in rows) - errors
    return {"tests": str(len(rows)), "failures": str(failures), "errors": str(errors)}


def _add_failure(test: Element, row: Row) -> None:
    outcome = str(row.get("outcome"))
    kind = str((row.get("failure") or [outcome_of(row)])[0])
    message = str(row.get("message") or row.get("cause") or outcome_of(row))
    tag = "error" if outcome == CRASHED else "failure"
    added = SubElement(test, tag, type=visible(kind), message=visible(first_sentence(message)))
    added.text = visible("\n".join(_lines(row, message)))


def _lines(row: Row, message: str) -> Iterator[str]:
    if row.get("failure"):
        yield " < ".join(map(str, row["failure"]))
    yield message
    if row.get("repeat"):
        yield str(row["repeat"])
