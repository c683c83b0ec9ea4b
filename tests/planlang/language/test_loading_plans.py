"""Plans that are loaded: from memory or a file, with what their lines and encodings say, or refused with a line."""

from __future__ import annotations

import codecs
import linecache
import traceback
from pathlib import Path

import pytest
from loaded_plans import PLAIN, loaded, read

from planlang.diagnostics import BadInput
from planlang.language.loading import load_plan
from planlang.language.source import PlanSource
from planlang.testing import run_plan
from tests.support.refusals import refusal


def problems(caught: pytest.ExceptionInfo[BadInput]) -> list[tuple[str, str]]:
    """Codes and places of diagnostics."""
    return [(one.code, str(one.span)) for one in caught.value.diagnostics]


def test_a_plan_in_memory_has_its_lines_in_tracebacks() -> None:
    source = read("def fall():", "    raise ValueError('so')  # as written", file="<compiled>/fall.py")
    module = load_plan(source)
    with pytest.raises(ValueError, match="so") as caught:
        module.fall()
    linecache.checkcache()
    told = traceback.format_tb(caught.value.__traceback__)[-1].splitlines()
    assert told[:2] == ['  File "<compiled>/fall.py", line 2, in fall', "    raise ValueError('so')  # as written"]
    assert (module.__name__, module.__file__) == ("planlang_run_fall", "<compiled>/fall.py")


def test_a_plan_is_loaded_anew_each_time_and_nothing_is_written(tmp_path: Path) -> None:
    path = tmp_path / "go.py"
    path.write_text(PLAIN)
    assert loaded(path) is not loaded(path)
    assert list(tmp_path.iterdir()) == [path]


def test_annotations_are_what_the_plan_makes_of_them() -> None:
    assert load_plan(read("def f(x: int) -> None: ...")).f.__annotations__ == {"x": int, "return": None}


@pytest.mark.parametrize(
    ("line", "place", "message"),
    [
        ("return 3", 5, "SyntaxError: 'return' outside function"),
        ("x = (", 5, "SyntaxError: '(' was never closed"),
        ("def f():\n    raise KeyError('x')\nf()", 6, "KeyError: 'x'"),
        ("raise SystemExit(4)", 5, "SystemExit: 4"),
        ("from . import other", 5, "ImportError: attempted relative import with no known parent package"),
        ("x = '\0'", 1, ""),  # the error has another class in other versions of Python
    ],
)
def test_a_plan_that_cannot_be_executed_is_refused_with_its_line(
    tmp_path: Path, line: str, place: int, message: str
) -> None:
    path = tmp_path / "go.py"
    path.write_text(f"{PLAIN}{line}\n")
    for source in (PlanSource.read(path), PlanSource(path.read_text(), str(path))):
        with pytest.raises(BadInput) as caught:
            load_plan(source)
        assert problems(caught) == [("X001", f"{path}:{place}:1")]
        assert caught.value.diagnostics[0].message.startswith(f"the plan cannot be imported: {message}")


@pytest.mark.parametrize(
    "content",
    [
        codecs.BOM_UTF8 + "X = 'é'\n".encode(),
        "# coding: latin-1\nX = 'é'\n".encode("latin-1"),
        "# coding: utf-8\r\nX = 'é'\r\n".encode(),
    ],
    ids=["mark", "latin-1", "utf-8"],
)
def test_python_reads_the_encoding_of_a_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "go.py"
    path.write_bytes(content)
    assert loaded(path).X == "é"


def test_an_encoding_that_python_does_not_know_is_refused_when_the_plan_is_loaded(tmp_path: Path) -> None:
    path = tmp_path / "go.py"
    path.write_text(f"# coding: nonsense\n{PLAIN}")
    source = PlanSource.read(path)
    assert [one.line for one in source.steps] == [5]
    with refusal("X001", naming="nonsense") as caught:
        load_plan(source)
    assert problems(caught) == [("X001", f"{path}:1:1")]


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        PlanSource.read(tmp_path / "gone.py")
    assert problems(caught) == [("C001", f"{tmp_path / 'gone.py'}:1:1")]


def test_equal_bytes_have_equal_digests_in_a_file_and_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "go.py"
    path.write_text(PLAIN)
    assert PlanSource.read(path).sha256 == PlanSource(PLAIN, "<compiled>/go.py").sha256


def test_a_loaded_plan_runs() -> None:
    module = load_plan(read("from planlang import plan, sleep", "@plan", "async def go():", "    await sleep(2)"))
    assert run_plan(module.go).seconds == 2


EARLIER = """
from functools import partial
from planlang import Recovery, an_object, action, at_location, a_location, perform, plan

@plan("http://example.org/kitchen.owl#Fetch")
async def fetch() -> None:
    await at_location(a_location(near=an_object("Cup")), body, recoveries=[Recovery()])
    await perform(action("Reaching"), **{"until": None})

async def body() -> None:
    await with_own(partial(perform, again=True))

async def with_own(perform) -> None:
    await perform(1, 2, 3)
"""


@pytest.mark.parametrize("is_compiled", [True, False])
def test_a_plan_that_calls_the_language_as_an_earlier_version_did_is_refused_before_it_runs(
    tmp_path: Path, *, is_compiled: bool
) -> None:
    path = tmp_path / "fetch.py"
    origin = '"""Fetch.\n\nCompiled by planlang 0.0.9 from fetch.omn (sha256 0123456789abcdef), task Fetch.\n"""'
    path.write_text(origin * is_compiled + EARLIER)
    with pytest.raises(BadInput) as caught:
        loaded(path)
    found = caught.value.diagnostics
    line = EARLIER[: EARLIER.index("at_location(a_loc")].count("\n") + 1 + 3 * is_compiled
    assert [(one.code, one.message.split()[0], one.span and one.span.line) for one in found] == [
        ("X001", "at_location", line),
        ("X001", "Recovery", line),
    ]
    again = f'planlang.compile("fetch.omn", output="{path}")'
    advice = f"an earlier version compiled this plan: compile it again, {again}"
    assert {one.help for one in found} == {advice if is_compiled else None}


def test_a_plan_may_raise_errors_of_the_language(tmp_path: Path) -> None:
    path = tmp_path / "refuse.py"
    errors = "PlanStructureError, RunError, DeadlockError, StepLimit"
    path.write_text(f"from planlang import {errors}\nasync def refuse() -> None:\n")
    with path.open("a") as file:
        file.writelines(f"    raise {name}('nothing to do')\n" for name in errors.split(", "))
    assert loaded(path).__name__ == "planlang_run_refuse"


def test_an_import_of_what_planlang_no_longer_has_advises_to_compile_again(tmp_path: Path) -> None:
    path = tmp_path / "fetch.py"
    origin = '"""Fetch.\n\nCompiled by planlang 0.0.9 from fetch.omn (sha256 0123456789abcdef), task Fetch.\n"""'
    path.write_text(f"{origin}\nfrom planlang import nothing_such\n")
    with refusal("X001", naming="planlang.compile") as caught:
        loaded(path)
    assert problems(caught) == [("X001", f"{path}:5:1")]


def test_a_call_whose_arguments_only_the_running_plan_knows_is_not_judged() -> None:
    load_plan(read("from planlang import perform", "async def go():", "    await perform(*[1], what=2)"))
