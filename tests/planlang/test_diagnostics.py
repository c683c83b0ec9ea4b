"""Diagnostics: one line that a person reads, one object that a machine reads, codes that all mean something."""

import json
import re
from pathlib import Path

import pytest

from planlang.diagnostics import BadInput, Diagnostic, Severity, Span, error, has_errors, note, warning
from tests.support.codes import CODES

CHECKOUT = Path(__file__).resolve().parents[2]
SPAN = Span("recipe.omn", 12, 5)


def sources() -> dict[str, str]:
    """Text of the product's own modules, by path."""
    found = {}
    for package in ("planlang", "executive", "sim"):
        for path in sorted((CHECKOUT / package).rglob("*.py")):
            found[str(path.relative_to(CHECKOUT))] = path.read_text(encoding="utf-8")
    return found


def test_a_diagnostic_is_one_line_with_place_severity_code_and_message() -> None:
    assert str(error("R012", "a cycle", SPAN)) == "recipe.omn:12:5: error R012 a cycle"
    assert str(warning("O030", "no such file")) == "warning O030 no such file"


def test_help_is_on_a_line_of_its_own_below() -> None:
    text = str(note("M005", "filled in", SPAN, "write the size"))
    assert text.splitlines() == ["recipe.omn:12:5: note M005 filled in", "    help: write the size"]


def test_places_are_sorted_by_file_then_line_then_column() -> None:
    spans = [Span("b", 1, 1), Span("a", 10, 1), Span("a", 2, 9), Span("a", 2, 1)]
    assert [str(span) for span in sorted(spans)] == ["a:2:1", "a:2:9", "a:10:1", "b:1:1"]


def test_lines_and_columns_count_from_one() -> None:
    assert str(Span("a")) == "a:1:1"


def test_json_has_all_parts_and_null_for_those_that_are_absent() -> None:
    whole = json.loads(json.dumps(error("R012", "a cycle", SPAN, "remove one").as_json()))
    assert whole == {
        "severity": "error",
        "code": "R012",
        "message": "a cycle",
        "span": {"file": "recipe.omn", "line": 12, "column": 5},
        "help": "remove one",
    }
    assert error("R012", "a cycle").as_json()["span"] is None
    assert error("R012", "a cycle").as_json()["help"] is None


def test_only_errors_stop() -> None:
    assert not has_errors([])
    assert not has_errors([warning("O030", ""), note("M005", "")])
    assert has_errors([note("M005", ""), error("R012", "")])


def test_bad_input_carries_and_prints_everything_that_was_found() -> None:
    found = [error("R012", "a cycle", SPAN), Diagnostic(Severity.WARNING, "O030", "no such file")]
    problem = BadInput(found)
    assert problem.diagnostics == tuple(found)
    assert str(problem).splitlines() == list(map(str, found))


@pytest.mark.parametrize("code", CODES)
def test_each_code_has_a_letter_three_digits_and_a_meaning_of_one_line(code: str) -> None:
    assert re.fullmatch(r"[ORMBXCPK]\d{3}", code)
    assert CODES[code]
    assert "\n" not in CODES[code]
    assert not CODES[code].endswith(".")


def test_every_code_that_the_product_uses_has_a_meaning_and_every_meaning_is_used() -> None:
    used = {code for path, text in sources().items() for code in re.findall(r"\"([ORMBXCPK]\d{3})\"", text)}
    assert used - set(CODES) == set(), "used, but without a meaning in CODES"
    assert set(CODES) - used == set(), "in CODES, but nothing says them"
