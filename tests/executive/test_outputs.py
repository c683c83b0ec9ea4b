"""Outputs are complete or absent, and a person's work is never lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.inputs import PlanHeader, header
from executive.outputs import replace, write_plan, write_text
from planlang.diagnostics import BadInput


def source(digest: str, body: str) -> str:
    """A compiled plan of a recipe with that digest."""
    return f'"""Serve.\n\nCompiled by planlang 0.1.0 from serve.omn\n(sha256 {digest}), task Serve.\n"""\n{body}\n'


OLD, NEW = "0123456789ab", "ba9876543210"


def test_the_header_is_found_however_the_docstring_is_wrapped() -> None:
    assert header(source(OLD, "")) == PlanHeader("0.1.0", "serve.omn", OLD, "Serve")


@pytest.mark.parametrize("text", ["", "x = (", '"""A plan by hand."""\n'])
def test_other_source_has_no_header(text: str) -> None:
    assert header(text) is None


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.write_text("old")

    def fail(temporary: Path) -> None:
        temporary.write_text("half")
        raise RuntimeError("torn")

    with pytest.raises(RuntimeError, match="torn"):
        replace(path, fail)
    assert [p.name for p in tmp_path.iterdir()] == ["out.txt"]
    assert path.read_text() == "old"


def test_a_replaced_file_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.write_text("old")
    path.chmod(0o640)
    write_text(path, "new")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("new", 0o640)


def test_a_folder_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="C004"):
        write_text(tmp_path / "no" / "out.txt", "new")


def test_an_unchanged_plan_is_written_again_without_question(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    assert write_plan(path, source(OLD, "a"), force=False) == []
    assert write_plan(path, source(OLD, "a"), force=False) == []


def test_an_edited_plan_is_not_overwritten_without_force(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text(source(OLD, "edited"))
    with pytest.raises(BadInput, match=r"C005.*edited"):
        write_plan(path, source(OLD, "compiled"), force=False)
    assert path.read_text() == source(OLD, "edited")
    write_plan(path, source(OLD, "compiled"), force=True)
    assert path.read_text() == source(OLD, "compiled")


def test_a_file_that_is_no_compiled_plan_is_not_overwritten_without_force(tmp_path: Path) -> None:
    path = tmp_path / "thesis.tex"
    path.write_text("three years of work")
    with pytest.raises(BadInput, match=r"C005.*not a compiled plan"):
        write_plan(path, source(OLD, "a"), force=False)
    assert path.read_text() == "three years of work"


def test_the_plan_of_an_earlier_recipe_is_kept_because_it_may_have_been_edited(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text(source(OLD, "maybe edited"))
    notes = write_plan(path, source(NEW, "compiled"), force=False)
    assert [note.code for note in notes] == ["C006"]
    assert (tmp_path / "plan.py.old").read_text() == source(OLD, "maybe edited")
    assert path.read_text() == source(NEW, "compiled")
