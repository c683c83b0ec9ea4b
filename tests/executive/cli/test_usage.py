"""Wrong usage, with and without ``--json``: one object says what is wrong and what helps."""

from __future__ import annotations

import json
import shlex
import sys
from typing import Any

import pytest
from cli_runs import invoke

from executive.cli.app import main


def ended(arguments: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    """Run the command as its program does; return stdout and stderr."""
    monkeypatch.setattr(sys, "argv", ["planlang", *arguments.split()])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    printed = capsys.readouterr()
    return printed.out, printed.err


@pytest.mark.parametrize(
    ("arguments", "command", "error", "help"),
    [
        ("locate --json", "locate", "Missing argument 'PHRASE'.", "planlang locate -h shows how it is used"),
        ("check x --accpt R042 --json", "check", "No such option '--accpt'.", "did you mean '--accept'?"),
        ("check --json --reasoner hermt x", "check", "'hermt' is not one of", "did you mean hermit?"),
        ("convert x --to zzz --json", "convert", "'zzz' is not one of", "planlang convert -h shows how it is used"),
        ("chek x --json", "", "No such command 'chek'.", "did you mean 'check'?"),
        ("zzz --json", "", "No such command 'zzz'.", "planlang -h shows how it is used"),
        ("robot inspct --json", "robot", "No such command 'inspct'.", "did you mean 'inspect'?"),
        ("robot --json", "robot", "Missing command.", "planlang robot -h lists the commands"),
        ("--json", "", "Missing command.", "planlang -h lists the commands"),
        ("run --json", "run", "name a recipe or plan, or --resume TRACE", "planlang run -h shows how it is used"),
        ("check x --quiet --verbose --json", "check", "--quiet and --verbose exclude", "planlang check -h shows"),
    ],
)
def test_with_json_wrong_usage_is_one_object_with_what_is_wrong_and_what_helps(
    arguments: str,
    command: str,
    error: str,
    help: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, err = ended(arguments, monkeypatch, capsys)
    found: dict[str, Any] = json.loads(out)
    assert (found["command"], found["exit_code"], found["diagnostics"], err) == (command, 2, [], "")
    assert error in found["error"]
    assert help in found["help"]


def test_without_json_a_misspelt_value_is_corrected_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err = ended("convert x --to manchestr", monkeypatch, capsys)
    assert (out, err.splitlines()[-1]) == ("", "    help: did you mean manchester?")


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        ("match serve_a_drink --robot amigo --task GraspingSomthing", "GraspingSomething"),
        ("compile serve_a_drink --task ServeADrnk", "ServeADrink"),
        ("run serve_a_drink --unknown DrinkingBotle", "DrinkingBottle"),
        ("run serve_a_drink --robot amgo", "amigo"),
        ("locate 'near the refrigratr' --robot amigo --environment hospital_room", "'refrigerator'"),
        ("locate 'near the botle' --robot amigo --environment hospital_room", "'bottle'"),
    ],
)
def test_a_misspelt_name_is_corrected_wherever_one_is_given(arguments: str, meant: str) -> None:
    result = invoke(*shlex.split(arguments))
    assert (result.exit_code, f"did you mean {meant}? " in result.stderr) == (2, True), result.stderr
