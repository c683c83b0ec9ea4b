"""The command: what it says and how it ends, for good input and for a hostile user's."""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import Result

from executive.cli import console
from executive.cli.console import Answer
from planlang.diagnostics import BadInput, Span, error, warning
from tests.support.cli_runs import invoke

PLAN = '''"""Compiled by planlang 0.1.0 from gone.omn (sha256 0123456789abcdef), task Gone."""

from planlang import plan
'''


def codes(result: Result) -> list[str]:
    """Codes of the diagnostics on stderr, in order."""
    return re.findall(r"(?:^|: )error ([A-Z]\d{3}) ", result.stderr, flags=re.MULTILINE)


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """A compiled plan whose recipe is not there."""
    path = tmp_path / "plan.py"
    path.write_text(PLAN)
    return path


@pytest.mark.parametrize("command", ["compile", "check", "run"])
def test_help_of_each_command_ends_with_an_example(command: str) -> None:
    result = invoke(command, "--help")
    assert result.exit_code == 0
    assert f"Example: planlang {command}" in result.stdout


def test_help_names_the_exit_codes() -> None:
    assert "130 interrupted" in " ".join(invoke("--help").stdout.split())


@pytest.mark.parametrize("command", ["compile", "check", "run"])
@pytest.mark.parametrize("name", ["missing.owl", "no/such/folder/x.omn", "a" * 5000, "nul\0character", "."])
def test_a_missing_file_is_bad_input(command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = invoke(command, name)
    assert result.exit_code == 2
    assert codes(result)[0] == "C001"
    assert not isinstance(result.exception, Exception) or isinstance(result.exception, SystemExit)


def test_a_misspelled_bundled_recipe_is_suggested() -> None:
    assert "did you mean serve_a_drink?" in invoke("compile", "serve_a_drnk").stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["--start", "1,2"],
        ["--start", "1,2,x"],
        ["--start", "nan,0,0"],
        ["--seed", "-1"],
        ["--seed", "1.5"],
        ["--schedule", "-2"],
        ["--set", "bottle"],
        ["--set", "=bottle1"],
        ["--set", "bottle="],
        ["--set", "bottle=a", "--set", "bottle=b"],
        ["--no-such-option"],
    ],
    ids=" ".join,
)
def test_a_wrong_option_is_a_usage_error(arguments: list[str]) -> None:
    result = invoke("run", "serve_a_drink", *arguments)
    assert result.exit_code == 2
    assert "Usage: planlang run" in result.stderr


def test_an_unknown_robot_and_environment_are_both_reported() -> None:
    result = invoke("run", "serve_a_drink", "--robot", "marvin", "--environment", "milliways")
    assert result.exit_code == 2
    assert "no such robot: marvin" in result.stderr
    assert "no such environment: milliways" in result.stderr
    assert "amigo" in result.stderr, "the bundled robots are named"


def test_only_bundled_recipes_have_a_default_robot_and_environment(plan: Path) -> None:
    result = invoke("run", plan)
    assert result.exit_code == 2
    assert codes(result) == ["C008", "C008"]


def test_outputs_that_cannot_be_written_are_told_before_anything_runs(tmp_path: Path) -> None:
    result = invoke(
        "run", "serve_a_drink", "--trace", tmp_path, "--picture", tmp_path / "no" / "x.png", "--record", "/proc/x.rrd"
    )
    assert result.exit_code == 2
    assert codes(result)[:2] == ["C004", "C004"]


def test_a_view_is_told_to_be_none_before_anything_runs(tmp_path: Path) -> None:
    for options, why in (
        (["--view", "top"], "--view needs --picture or --video"),
        (["--view", "left", "--picture", tmp_path / "x.png"], "write X,Y,Z or X,Y,Z:X,Y,Z"),
    ):
        result = invoke("run", "serve_a_drink", *options)
        assert result.exit_code == 2
        assert why in result.stderr


def test_a_video_is_a_webp() -> None:
    assert codes(invoke("run", "serve_a_drink", "--video", "x.mp4")) == ["C004"]


def test_a_disk_that_is_full_is_told_and_no_internal_error(capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> Answer:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(click.exceptions.Exit):
        console.answer("run", work, as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert (told["exit_code"], [one["code"] for one in told["diagnostics"]]) == (2, ["C004"])


def test_an_output_may_not_overwrite_the_plan_or_another_output(plan: Path, tmp_path: Path) -> None:
    result = invoke("run", plan, "--trace", plan, "--picture", tmp_path / "x", "--record", tmp_path / "x")
    assert "would overwrite the plan" in result.stderr
    assert "would overwrite --picture" in result.stderr
    assert plan.read_text() == PLAN


def test_a_plan_cannot_be_compiled(plan: Path) -> None:
    result = invoke("compile", plan)
    assert (result.exit_code, codes(result)) == (2, ["C007"])


def test_python_that_is_no_plan_is_not_run(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text("raise SystemExit('executed')\nimport os\n")
    marker = tmp_path / "marker.py"
    marker.write_text(f"import pathlib\npathlib.Path({str(tmp_path / 'touched')!r}).touch()\n")
    assert codes(invoke("run", marker)) == ["C003"]
    assert invoke("check", script).exit_code == 2
    assert not (tmp_path / "touched").exists()


def test_a_plan_with_a_syntax_error_is_reported_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("from planlang import plan\n\nasync def serve(:\n    pass\n")
    result = invoke("check", path)
    assert result.exit_code == 2
    assert f"{path}:3:" in result.stderr
    assert "error C002" in result.stderr


def test_checking_a_plan_does_not_execute_it(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("from planlang import plan\nraise RuntimeError('executed')\n")
    result = invoke("check", path)
    assert result.exit_code == 0
    assert "written by hand" in result.stdout


def test_an_action_that_no_module_performs_is_a_warning_in_a_plan_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "take.py"
    text = 'from planlang import *\n\n@plan\nasync def take():\n    await perform(action("Reaching"))\n'
    path.write_text(text + '    await perform(action("PickingUpAnObject"))\n', encoding="utf-8")
    result = invoke("check", path)
    assert result.exit_code == 0
    assert f"{path}:6:19: warning R021 no process module performs PickingUpAnObject\n" in result.stderr
    path.write_text(text + '    await perform(action("Greeting"), otherwise=take)\n', encoding="utf-8")
    assert "R021" not in invoke("check", path).stderr


def test_a_plan_whose_recipe_is_gone_is_a_warning(plan: Path) -> None:
    result = invoke("check", plan, "--json")
    answer = json.loads(result.stdout)
    assert result.exit_code == 0
    assert [(d["severity"], d["code"]) for d in answer["diagnostics"]] == [("warning", "C011")]


def test_a_changed_recipe_makes_its_plan_out_of_date(plan: Path) -> None:
    (plan.parent / "gone.omn").write_text("Ontology: <http://example.org/other>\n")
    result = invoke("check", plan)
    assert (result.exit_code, "error C009" in result.stderr) == (2, True)


def test_an_answer_as_json_is_one_object_on_stdout_with_all_diagnostics() -> None:
    result = invoke("compile", "missing.omn", "--json")
    answer = json.loads(result.stdout)
    assert result.exit_code == answer["exit_code"] == 2
    assert answer["command"] == "compile"
    assert answer["diagnostics"][0]["code"] == "C001"
    assert result.stderr == ""


def test_diagnostics_are_counted_and_keep_their_order(capsys: pytest.CaptureFixture[str]) -> None:
    span = Span("a.omn", 3, 7)
    console.show([warning("R001", "odd", span), error("R002", "wrong", span, "mend it"), error("R002", "too")])
    assert capsys.readouterr().err.splitlines() == [
        "a.omn:3:7: warning R001 odd",
        "a.omn:3:7: error R002 wrong",
        "    help: mend it",
        "error R002 too",
        "2 errors, 1 warning",
    ]


def ended(work: object) -> int:
    """Exit code with which an answer ends the command."""
    with pytest.raises(click.exceptions.Exit) as ending:
        console.answer("run", work, as_json=False)  # type: ignore[arg-type]
    return ending.value.exit_code


def test_a_programming_error_is_told_in_one_line_without_a_traceback(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def work() -> Answer:
        raise ZeroDivisionError("by zero")

    monkeypatch.delenv("PLANLANG_TRACEBACK", raising=False)
    assert ended(work) == 70
    said = capsys.readouterr().err
    assert said.startswith("internal error in work (test_cli.py:")
    assert "PLANLANG_TRACEBACK=1" in said
    assert "Traceback" not in said

    monkeypatch.setenv("PLANLANG_TRACEBACK", "1")
    assert ended(work) == 70
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_an_interruption_ends_with_130(capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> Answer:
        raise KeyboardInterrupt

    assert ended(work) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_bad_input_ends_with_2_and_its_diagnostics(capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> Answer:
        raise BadInput([error("O001", "torn")])

    assert ended(work) == 2
    assert capsys.readouterr().err == "error O001 torn\n1 error\n"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_is_bad_input(plan: Path) -> None:
    plan.chmod(stat.S_IWUSR)
    assert codes(invoke("check", plan)) == ["C001"]


def test_a_compiled_plan_is_told_from_an_edited_one(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    assert invoke("compile", "serve_a_drink", "-o", path).exit_code == 0
    assert "what serve_a_drink.omn compiles to" in invoke("check", path).stdout
    path.write_text(path.read_text().replace("retries=3", "retries=7"))
    result = invoke("check", path, "--json")
    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["state"]) == (0, "an edited plan")
    assert [(d["severity"], d["code"]) for d in answer["diagnostics"]] == [("note", "C010")]
    assert codes(invoke("compile", "serve_a_drink", "-o", path)) == ["C005"], "edited plans are not overwritten"
    assert "retries=7" in path.read_text()


def test_a_missing_viewer_package_is_told_before_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.extras.find_spec", lambda name: None)
    result = invoke("run", "serve_a_drink", "--record", tmp_path / "run.rrd")
    assert (result.exit_code, codes(result)) == (2, ["C012"])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere a display is taken for granted")
@pytest.mark.parametrize("display", ["", ":4711"])
def test_a_window_without_a_display_is_bad_input(display: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", display)
    result = invoke("run", "serve_a_drink", "--gui")
    assert (result.exit_code, codes(result)) == (2, ["C013"])


def test_pydantic_is_not_imported_for_words_that_need_no_conversion() -> None:
    """Typer converts each word by it, and its import took a tenth of a short run."""
    program = """
import sys
from executive.cli.app import app
words = ["run", "nothing.omn", "--set", "a=b", "--seed", "3", "--trace", "run.jsonl", "--environment", "room"]
try:
    app(words, standalone_mode=False)
finally:
    sys.stdout.write(str("pydantic" in sys.modules))
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.stdout.endswith("False")
    assert "nothing.omn" in ended.stderr
