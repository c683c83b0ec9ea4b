"""The example of docs/guides/modules.md works as the page says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.cli.app import app

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "modules.md"
WHERE = ("--robot", "amigo", "--environment", "hospital_room")


@pytest.fixture
def kitchen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of the page."""
    blocks = re.findall(r"^```(?:owl|python)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    for name, block in zip(("soup.omn", "stirring.py", "test_soup.py"), blocks, strict=True):
        (tmp_path / name).write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def planlang(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, arguments)
    return result.exit_code, result.output


def test_the_recipe_compiles_and_runs_with_the_module_only(kitchen: Path) -> None:
    code, said = planlang("check", "soup.omn")
    assert (code, said.count("R021")) == (0, 1)
    assert "register a process module for `StirSoup` or" in said
    code, said = planlang("run", "soup.omn", *WHERE)
    assert code == 3
    assert "ActionUnresolvable: action StirSoup: no process module is registered" in said
    code, said = planlang("run", "soup.omn", *WHERE, "--modules", "stirring.py", "--trace", "run.jsonl")
    assert code == 0, said
    assert re.search(r'"kind": ?"perform", ?"name": ?"StirSoup"', (kitchen / "run.jsonl").read_text())


def test_its_plan_is_the_one_that_the_page_shows(kitchen: Path) -> None:
    _, source = planlang("compile", "soup.omn")
    (line,) = re.findall(r"`(action\(RECIPE \+ \"StirSoup\", .+?)`", PAGE.read_text(encoding="utf-8"))
    assert line in source


@pytest.mark.long
def test_its_scripted_tests_pass(kitchen: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_soup.py"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout
