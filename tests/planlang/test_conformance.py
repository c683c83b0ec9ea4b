"""The table of facts names tests that exist, has every fact, and every numbered test is in it."""

import re
from pathlib import Path

TESTS = Path(__file__).resolve().parent
TABLE = TESTS.parent / "CONFORMANCE.md"
NUMBERED = re.compile(r"test_[lkfp]\d+_")
FACTS = [
    f"{letter}{number}"
    for letter, last in (("L", 32), ("K", 11), ("F", 19), ("P", 16))
    for number in range(1, last + 1)
]


def rows() -> dict[str, str]:
    lines = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {row[0]: row[-1] for row in cells if row[0] != "fact"}


def defined() -> set[str]:
    return {
        f"{path.relative_to(TESTS).as_posix()}::{name}"
        for path in TESTS.rglob("test_*.py")
        for name in re.findall(r"^(?:def )?(test_\w+|Test\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
    }


def test_every_fact_has_a_line() -> None:
    assert [fact for fact in rows() if fact in FACTS] == FACTS


def test_every_test_in_the_table_exists() -> None:
    known = defined()
    assert [test for test in rows().values() if "::" in test and test not in known] == []


def test_a_fact_has_a_test_or_a_reason() -> None:
    assert [fact for fact, test in rows().items() if "::" not in test and len(test.split()) < 4] == []


def test_every_numbered_test_is_in_the_table() -> None:
    listed = set(rows().values())
    assert sorted(test for test in defined() if NUMBERED.search(test) and test not in listed) == []
