"""The library as its users have it: the notebook of the guide runs, and their files are typed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
NOTEBOOK = CHECKOUT / "docs" / "guides" / "notebook.ipynb"
USERS = """
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, assert_type

import planlang

plan = planlang.compile("serve_a_drink", task="ServeADrink", scopes=False)
assert_type(plan.source, str)
assert_type(plan.graph.svg, str)
assert_type(plan.save(Path("plan.py"), force=True), Path)

run = planlang.simulate(plan, robot="amigo", environment=["hospital_room", Path("more.omn")], seed=3, trace="run.jsonl")
assert_type(run.succeeded, bool)
assert_type(run.duration, float)
assert_type(run.final_state, tuple[str, ...])
assert_type(run.trace, Sequence[Mapping[str, Any]])
if run.failure is not None:
    assert_type(run.failure.type, str)
    assert_type(run.failure.advice, str | None)
    assert_type([cause.message for cause in run.failure.causes], list[str])
planlang.simulate("serve_a_drink", set={"bottle": "bottle1", "Nap.duration": 3.5}, start=(0.5, 1, 0)).report("run.html")

found = planlang.locate("near the bed", robot="amigo", environment="hospital_room", count=2)
assert_type(found[0].x, float)
assert_type([pose.arm for pose in found], list[str | None])
assert_type(planlang.check("serve_a_drink").ok, bool)
assert_type(planlang.sweep("serve_a_drink", 2, first=5), list[dict[str, Any]])

try:
    planlang.compile("nowhere")
except planlang.BadInput as problem:
    assert_type([one.code for one in problem.diagnostics], list[str])

planlang.simulate("serve_a_drink", seed="three")  # wrong
planlang.locate("near the bed")  # wrong
run.suceeded  # wrong
"""


@pytest.mark.long
def test_a_users_file_is_typed_and_its_mistakes_are_found(tmp_path: Path) -> None:
    file = tmp_path / "users.py"
    file.write_text(USERS, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", str(file)]
    told = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    lines = sorted({int(line) for line in re.findall(r"users\.py:(\d+): error", told.stdout)})
    wrong = [number for number, line in enumerate(USERS.splitlines(), 1) if line.endswith("# wrong")]
    assert lines == wrong, told.stdout + told.stderr


@pytest.mark.long
def test_the_notebook_runs_in_a_kernel_and_shows_its_results(tmp_path: Path) -> None:
    pytest.importorskip("ipykernel")
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook: Any = nbformat.read(NOTEBOOK, as_version=4)
    assert [cell.id for cell in notebook.cells if cell.get("outputs")] == [], "it is kept without outputs"
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    shown = {cell.id: cell.outputs[-1].data for cell in notebook.cells if cell.cell_type == "code"}
    assert "ServeADrink" in shown["compile"]["text/html"]
    assert shown["graph"]["image/svg+xml"].startswith("<svg")
    assert "data:image/png;base64," in shown["locate"]["text/html"]
    assert shown["run"]["text/html"].startswith("<iframe")
    assert shown["seeds"]["text/html"].count("<tr") == 12, "two lines of head, and ten runs"
    assert shown["plot"]["image/png"]
    assert "different, new reaches the goal more often" in shown["compare"]["text/html"]
    assert shown["figure"]["image/svg+xml"].startswith("<svg")
