"""What commands print beside their results: diagnostics, as many as a user asks for."""

from __future__ import annotations

import pytest
from cli_runs import COMMANDS, invoke

from executive.cli.console import Detail, show
from planlang.diagnostics import Span, error, note, warning

FOUND = [
    note("M005", "size 1", Span("room.owl", 3)),
    note("M005", "size 2", help="measure it"),
    note("B010", "assumed"),
    warning("M014", "inside", help="measure it"),
    warning("M014", "inside, too", help="measure it"),
    warning("M014", "within", help="move it"),
    error("M001", "reflected"),
    error("M001", "reflected, too"),
]


def shown(capsys: pytest.CaptureFixture[str], detail: Detail) -> list[str]:
    show(FOUND, detail)
    return capsys.readouterr().err.splitlines()


def test_of_notes_and_warnings_the_first_of_each_code_is_printed_with_the_number_of_others(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert shown(capsys, Detail.CODES) == [
        "room.owl:3:1: note M005 size 1 (and 1 more M005)",
        "note B010 assumed",
        "warning M014 inside (and 2 more M014)",
        "    help: measure it",
        "error M001 reflected",
        "error M001 reflected, too",
        "2 errors, 3 warnings, 3 notes; --verbose lists all",
    ]


def test_where_advice_is_what_is_asked_for_each_advice_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown(capsys, Detail.ADVICE)
    assert [line for line in lines if "M014" in line] == [
        "warning M014 inside (and 1 more M014)",
        "warning M014 within",
    ]


def test_quiet_prints_errors_only_and_verbose_everything(capsys: pytest.CaptureFixture[str]) -> None:
    assert shown(capsys, Detail.NONE) == ["error M001 reflected", "error M001 reflected, too", "2 errors"]
    assert len(shown(capsys, Detail.ALL)) == 9 + 2, "all, their help, once, and the numbers"


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_command_can_be_told_to_be_quiet_or_verbose(command: str) -> None:
    text = invoke(*command.split(), "--help").stdout
    assert "--quiet" in text
    assert "--verbose" in text


def test_quiet_and_verbose_exclude_each_other() -> None:
    result = invoke("check", "serve_a_drink", "--quiet", "--verbose")
    assert (result.exit_code, "exclude each other" in result.stderr) == (2, True)
