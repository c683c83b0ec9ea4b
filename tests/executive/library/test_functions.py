"""planlang as a library: what the commands do, from values of Python, with results that show themselves."""

from __future__ import annotations

import asyncio
import inspect
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import planlang
from executive.cli.app import app
from executive.runs.options import RunResult
from planlang import BadInput
from tests.support.refusals import refusal

RECIPE = """
Prefix: : <http://example.org/wait.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/wait.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Class: Rest
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Nap
Class: Nap
    SubClassOf: knowrob:WaitForPredefinedTimeInterval
"""
FAILING = '''
from planlang import perform, action, plan

@plan
async def juggle() -> None:
    """Do what nothing can."""
    raise ValueError("three balls are too many")
'''
WARD: dict[str, Any] = {"robot": "amigo", "environment": "hospital_room"}


@pytest.fixture(scope="module")
def rest() -> RunResult:
    """Return a run of the text of a recipe, from within a running event loop, as a notebook has one."""

    async def cell() -> RunResult:
        return planlang.simulate(RECIPE, **WARD, seed=4, set={"Nap.duration": 2.5}, start=(0, 0, 0.5))

    return asyncio.run(cell())


def test_a_run_has_what_users_ask_for(rest: RunResult) -> None:
    assert (rest.succeeded, rest.outcome.value, rest.failure, rest.duration) == (True, "done", None, 2.5)
    assert rest.row == {
        "seed": 4, "outcome": "done", "succeeded": True, "claimed": True, "reached": True, "duration": 2.5,
        "failure": None, "reason": None,
    }  # fmt: skip
    assert rest.trace[0]["start"] == [0.0, 0.0, 0.5]
    assert "Nap" in str(planlang.TaskTree.of(rest.trace))


def test_a_run_that_has_ended_is_repeated_for_its_page_and_its_picture(rest: RunResult, tmp_path: Path) -> None:
    before = list(rest.trace)
    page = rest.report(tmp_path / "run.html").read_text(encoding="utf-8")
    assert '"scene":' in page, "the world is in it"
    assert rest.picture(str(tmp_path / "scene.png")).read_bytes().startswith(b"\x89PNG")
    assert rest.trace == before
    (tmp_path / "mine.html").write_text("something of the user's", encoding="utf-8")
    with refusal("C005", naming="mine.html"):
        rest.report(tmp_path / "mine.html")


def test_a_notebook_shows_a_run_as_its_page_in_a_frame(rest: RunResult) -> None:
    shown = rest._repr_mimebundle_()
    assert shown["text/plain"] == "done"
    assert shown["text/html"].startswith("<iframe ")
    assert 'srcdoc="' in shown["text/html"]
    assert "<script" not in shown["text/html"], "the page is text in an attribute"


def test_a_plan_in_text_that_fails_is_a_result_with_the_line() -> None:
    run = planlang.simulate(FAILING, **WARD)
    assert (run.succeeded, run.failures) == (False, ("ValueError",))
    assert run.failure is not None
    assert str(run.failure) == "ValueError: three balls are too many"
    assert run.failure.where == "in the plan, plan.py:7"
    assert run.row["failure"] == "ValueError"
    assert run._repr_mimebundle_()["text/plain"].startswith("ValueError: three balls")


def test_a_run_that_did_not_begin_has_no_page() -> None:
    run = planlang.simulate("pass_a_drink", robot="panda", environment="hospital_room")
    assert (run.outcome.value, run.failures) == ("lacks a capability", ("MissingCapability",))
    assert run.failure is not None
    assert run.failure.advice is not None
    assert "trust_map=True" in run.failure.advice
    assert [*run._repr_mimebundle_()] == ["text/plain"]
    with refusal("C041"):
        run.report("run.html")


def test_a_trace_in_a_file_is_the_one_in_memory(rest: RunResult, tmp_path: Path) -> None:
    file = tmp_path / "run.jsonl"
    again = planlang.simulate(RECIPE, **WARD, seed=4, set=["Nap.duration=2.5"], start=(0, 0, 0.5), trace=str(file))
    assert again.trace == rest.trace
    assert again.report(tmp_path / "run.html").is_file()
    file.unlink()
    with refusal("C001", naming="run.jsonl"):
        _ = again.trace


def test_an_interrupted_run_ends_a_loop_over_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    from executive.runs.assembly import RobotExecutive

    def interrupted(self: RobotExecutive) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(RobotExecutive, "revision", interrupted)
    with pytest.raises(KeyboardInterrupt):
        planlang.simulate("serve_a_drink")


def test_a_compiled_plan_is_saved_drawn_shown_and_run(tmp_path: Path) -> None:
    plan = planlang.compile(RECIPE)
    assert plan.task == "Rest"
    (unset,) = plan.diagnostics
    assert str(unset.span) == "recipe.omn:9:8"
    assert (unset.help or "").endswith('set={"Nap.duration": X}')
    assert plan.save(tmp_path / "rest.py").read_text(encoding="utf-8") == plan.source == str(plan)
    assert plan.graph._repr_svg_().startswith("<svg")
    assert repr(plan.graph) == "<GraphDrawing of Rest>"
    assert plan.graph.save(tmp_path / "rest.mmd").read_text(encoding="utf-8").startswith("flowchart")
    with refusal("C014"):
        plan.graph.save(tmp_path / "rest.jpg")
    assert '<span style="color' in plan._repr_mimebundle_()["text/html"]
    run = planlang.simulate(plan, **WARD, set={"Nap.duration": 1}, start="0,0,0")
    assert run.duration == 1.0
    assert " at 0x" not in repr(run)


def test_options_of_the_compiler_are_those_of_the_command(tmp_path: Path) -> None:
    one, other = planlang.compile("serve_a_drink"), planlang.compile("serve_a_drink", scopes=False)
    assert ("at_location" in one.source, "at_location" in other.source) == (True, False)
    planlang.compile("serve_a_drink", output=tmp_path / "serve.py", graph=str(tmp_path / "serve.svg"))
    assert (tmp_path / "serve.py").read_text(encoding="utf-8") == one.source
    assert (tmp_path / "serve.svg").is_file()


def test_a_check_returns_what_is_wrong_with_a_text() -> None:
    found = planlang.check(RECIPE.replace("WaitForPredefined", "WaitForPredefned"))
    assert found.kind == "recipe"
    assert {row["file"] for row in found.rows} == {"recipe.omn"}
    broken = planlang.check(RECIPE.replace("SubClassOf", "SubClssOf"))
    assert not broken.ok
    assert broken.rows[0]["code"] == "O020"
    assert "did you mean SubClassOf:?" in broken._repr_mimebundle_()["text/html"]
    assert planlang.check(Path("serve_a_drink")).ok
    assert planlang.check(FAILING).kind == "plan"


def test_poses_are_a_sequence_with_a_picture(tmp_path: Path) -> None:
    found = planlang.locate("in reach of the patient", count=2, **WARD)
    assert [pose.arm for pose in found] == ["left", "right"]
    assert (len(found), found[0].x) == (2, found.rows[0]["x"])
    assert str(found).startswith("in reach of the patient\n  1  x ")
    assert found.picture(tmp_path / "where.svg").read_text(encoding="utf-8").startswith("<svg")
    shown = found._repr_mimebundle_()["text/html"]
    assert "<table>" in shown
    assert "data:image/png;base64," in shown


def test_a_location_without_a_pose_is_a_result_with_its_reasons() -> None:
    found = planlang.locate("in the cabinet1", of="the bottle", **WARD)
    assert (len(found), found.rows) == (0, [])
    assert found.failure is not None
    assert found.failure.type == "LocationUnresolvable"
    assert found.counts
    arm = planlang.locate("in reach of the bottle with the left arm", robot="panda", environment="hospital_room")
    assert (arm.lacks_capability, str(arm)) == (True, "MissingCapability: panda has no left arm; its arms: arm")


@pytest.mark.parametrize(
    ("call", "code", "said"),
    [
        (lambda: planlang.simulate("serve_a_drnk"), "C001", "did you mean serve_a_drink?"),
        (lambda: planlang.simulate(Path("nowhere.py")), "C001", "no such recipe: nowhere.py"),
        (lambda: planlang.simulate("serve_a_drink", robot="amgo"), "C001", "did you mean amigo?"),
        (lambda: planlang.simulate(FAILING), "C008", "add robot=FILE, or a bundled one: amigo"),
        (lambda: planlang.simulate(), "C040", "name a recipe or plan, or resume=TRACE"),
        (lambda: planlang.simulate("serve_a_drink", seed=-1), "C040", "seed=-1: write a number from 0 on"),
        (lambda: planlang.simulate("serve_a_drink", trace=3), "C040", "trace=3: write a path"),
        (lambda: planlang.simulate("serve_a_drink", trust_map="no"), "C040", "write True or False"),
        (lambda: planlang.simulate("serve_a_drink", start=(1, 2)), "C040", "(1, 2) is not x,y,yaw"),
        (lambda: planlang.simulate("serve_a_drink", resume="no.jsonl"), "C001", "no.jsonl cannot be read"),
        (lambda: planlang.compile(3), "C040", "3 is neither a recipe nor a plan"),  # type: ignore[arg-type]
        (lambda: planlang.compile(FAILING), "C007", "is a plan, not a recipe"),
        (lambda: planlang.check("nowhere"), "C001", "no such recipe: nowhere"),
        (lambda: planlang.check("serve_a_drink", reasoner="elk"), "C040", "'elk' is not a valid LogicReasoner"),
        (lambda: planlang.locate("near the moon", **WARD), "P002", "unknown thing 'moon'"),
        (lambda: planlang.locate("near the bed", units="Kilogram", **WARD), "C019", "neither a length nor an angle"),
    ],
)
def test_what_cannot_be_used_is_bad_input(call: Callable[[], object], code: str, said: str) -> None:
    with pytest.raises(BadInput) as caught:
        call()
    assert code in {one.code for one in caught.value.diagnostics}
    assert said in str(caught.value)
    assert "/tmp" not in str(caught.value)
    assert caught.value._render_traceback_() == [str(caught.value)], "a notebook shows no code below the call"


def test_a_misspelt_option_is_the_callers_mistake() -> None:
    with pytest.raises(TypeError, match="there is no option 'robt'; did you mean robot"):
        planlang.simulate("serve_a_drink", robt="amigo")
    with pytest.raises(TypeError, match="there is no option 'file'"):
        planlang.simulate("serve_a_drink", file="pass_a_drink")


@pytest.mark.parametrize(
    ("name", "function"),
    [
        ("compile", planlang.compile),
        ("check", planlang.check),
        ("run", planlang.simulate),
        ("locate", planlang.locate),
        ("sweep", planlang.sweep),
    ],
)
def test_a_function_has_all_options_of_its_command(name: str, function: Callable[..., object]) -> None:
    command: Any = app.commands[name]
    options = {one.name.removesuffix("_") for one in command.params if one.param_type_name == "option"}
    known = set(inspect.signature(function).parameters)
    assert options - known <= {"json", "verbose", "quiet"}
    text = inspect.getdoc(function) or ""
    assert [option for option in options & known if f"``{option}``" not in text] == []


def test_importing_planlang_loads_no_library() -> None:
    look = "import sys, planlang; print({'executive', 'click'} & {*sys.modules}, 'simulate' in dir(planlang))"
    told = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["set()", "True"]


def test_the_names_of_a_plan_do_not_hide_those_of_python() -> None:
    assert not {"compile", "check", "locate", "simulate", "sweep"} & set(planlang.__all__)
