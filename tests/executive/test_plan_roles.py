"""A misspelt role of an action is told by ``planlang check`` and by the scripted robot, with the right one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang import a_posture, action, perform, plan
from planlang.testing import run_plan

PLAN = """\
from planlang import action, perform, plan
from planlang.designators import a_posture

@plan
async def tuck():
    await perform(action("Reaching", to_locatoin=a_posture("carrying"), {more}))
"""


def told(tmp_path: Path, more: str = "") -> tuple[int, list[dict[str, Any]]]:
    path = tmp_path / "tuck.py"
    path.write_text(PLAN.format(more=more), encoding="utf-8")
    result = CliRunner().invoke(app, ["check", str(path), "--json"])
    return result.exit_code, json.loads(result.stdout)["diagnostics"]


def test_check_names_the_role_that_was_meant_and_its_place(tmp_path: Path) -> None:
    code, (found,) = told(tmp_path, "spoon=None, amount=3.0, from_location=None")
    assert (code, found["code"], found["help"]) == (2, "C024", "did you mean to_location?")
    assert (found["span"]["line"], found["span"]["column"]) == (6, 38)


def test_a_scripted_robot_refuses_a_misspelt_role() -> None:
    @plan
    async def tuck() -> None:
        await perform(action("Reaching", to_locatoin=a_posture("carrying")))

    with pytest.raises(ValueError, match="has no role to_locatoin: did you mean to_location"):
        run_plan(tuck)
