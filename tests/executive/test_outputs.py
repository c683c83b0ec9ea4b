"""Outputs are complete or absent, and a person's work is never lost."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from PIL import Image

from executive.cli import app as cli
from planlang.outputs import PlanHeader, check_outputs, digest, header, replace, write_plan, write_text
from tests.support.refusals import refusal


def source(recipe: str, body: str, *, compiled: str | None = None) -> str:
    """A plan compiled from a recipe of that digest, with a body that was ``compiled`` before somebody edited it."""
    below = digest(f'"""docstring"""\n{compiled or body}\n')
    origin = PlanHeader("0.1.0", "serve.omn", recipe, "Serve", (), below)
    said = "\n".join(origin.paragraphs())
    return f'"""Serve.\n\n{said}\n"""\n{body}\n'


OLD, NEW = "0123456789ab", "ba9876543210"


def test_the_header_is_found_however_the_docstring_is_wrapped() -> None:
    text = f'"""Serve.\n\nCompiled by planlang 0.1.0 from serve.omn\n(sha256 {OLD}),\ntask Serve.\n"""\n'
    assert header(text) == PlanHeader("0.1.0", "serve.omn", OLD, "Serve")


@pytest.mark.parametrize("options", [(), ("--no-scopes",), ("--no-scopes", "--no-dataflow")])
def test_the_header_tells_what_was_written_into_it(options: tuple[str, ...]) -> None:
    origin = PlanHeader("0.1.0", "my recipe.omn", OLD, "Serve", options, "0" * 64)
    assert header('"""Serve.\n\n' + "\n".join(origin.paragraphs()) + '\n"""\n') == origin


@pytest.mark.parametrize("text", ["", "x = (", '"""A plan by hand."""\n'])
def test_other_source_has_no_header(text: str) -> None:
    assert header(text) is None


@pytest.mark.parametrize(("name", "refused"), [("a.jpg", True), ("a.png", False), ("a.PNG", False), ("a", False)])
def test_a_picture_is_not_written_under_the_name_of_another_format(tmp_path: Path, name: str, refused: bool) -> None:
    found = [
        (d.code, d.help)
        for d in check_outputs(
            {"--trace": tmp_path / "a.txt", "--picture": tmp_path / name}, {}, formats={"--picture": [".png"]}
        )
    ]
    assert found == ([("C004", "name it a.png")] if refused else [])


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


def test_a_pipe_gets_the_content_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "out.txt"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    try:
        write_text(pipe, "new")
        assert os.read(reader, 10) == b"new"
    finally:
        os.close(reader)
    assert pipe.is_fifo()


@pytest.mark.parametrize("is_there", [True, False])
def test_no_output_goes_through_a_link_which_only_force_replaces(tmp_path: Path, *, is_there: bool) -> None:
    there, link = tmp_path / "there.txt", tmp_path / "out.txt"
    if is_there:
        there.write_text("written by planlang")
    link.symlink_to("there.txt")
    (refused,) = check_outputs({"--output": link}, {})
    assert (refused.code, str(there) in str(refused.help)) == ("C005", True)
    assert check_outputs({"--output": link}, {}, force=True) == []
    write_text(link, "new")
    assert (link.is_symlink(), link.read_text()) == (False, "new")
    assert (there.read_text() if there.exists() else "") == ("written by planlang" if is_there else "")


def test_a_folder_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    with refusal("C004"):
        write_text(tmp_path / "no" / "out.txt", "new")


def test_an_unchanged_plan_is_written_again_without_question(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    write_plan(path, source(OLD, "a"), force=False)
    write_plan(path, source(OLD, "a"), force=False)
    assert path.read_text() == source(OLD, "a")


@pytest.mark.parametrize("recipe", [OLD, NEW])
def test_an_edited_plan_is_not_overwritten_without_force(tmp_path: Path, recipe: str) -> None:
    path = tmp_path / "plan.py"
    edited = source(OLD, "edited", compiled="compiled")
    path.write_text(edited)
    with refusal("C005", naming="merge=True"):
        write_plan(path, source(recipe, "compiled"), force=False)
    assert path.read_text() == edited
    write_plan(path, source(recipe, "compiled"), force=True)
    assert path.read_text() == source(recipe, "compiled")


def test_a_plan_that_nobody_edited_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text(source(OLD, "old"))
    write_plan(path, source(NEW, "new"), force=False)
    assert path.read_text() == source(NEW, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["plan.py"]


def test_other_ends_of_lines_are_no_edit(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_bytes(source(OLD, "old").replace("\n", "\r\n").encode())
    write_plan(path, source(NEW, "new"), force=False)
    assert path.read_text() == source(NEW, "new")


def test_a_file_that_is_no_compiled_plan_is_not_overwritten_without_force(tmp_path: Path) -> None:
    path = tmp_path / "thesis.tex"
    path.write_text("three years of work")
    with refusal("C005", naming="force=True"):
        write_plan(path, source(OLD, "a"), force=False)
    assert path.read_text() == "three years of work"


def compile_with(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli.app, ["compile", *map(str, arguments)], prog_name="planlang")


@pytest.mark.parametrize(
    ("name", "start"),
    [("g.svg", "<?xml"), ("g.SVG", "<?xml"), ("g.dot", "digraph"), ("g.mmd", "flowchart")],
)
def test_the_suffix_tells_the_format(name: str, start: str, tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / name)
    assert result.exit_code == 0
    assert (tmp_path / name).read_text(encoding="utf-8").startswith(start)
    assert result.stdout.startswith('"""Serve a drink.'), "the plan goes to stdout as without --graph"


def test_a_graph_is_written_as_png_in_the_size_of_its_svg_and_equal_runs_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("g.png", "h.PNG", "g.svg"):
        assert compile_with("serve_a_drink", "--graph", tmp_path / name).exit_code == 0
    assert (tmp_path / "g.png").read_bytes() == (tmp_path / "h.PNG").read_bytes()
    size = re.search(r'width="([\d.]+)" height="([\d.]+)"', (tmp_path / "g.svg").read_text(encoding="utf-8"))
    assert size is not None
    with Image.open(tmp_path / "g.png") as image:
        assert image.size == pytest.approx([float(one) for one in size.groups()], abs=1)
        colours = {colour for _, colour in image.getcolors(image.width * image.height) or ()}
    assert {(0xF5, 0xF8, 0xFB), (0xFB, 0xF9, 0xF3)} <= colours, "steps and recipes"


def test_a_graph_that_is_too_large_for_a_picture_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.compiler.drawing.png.LARGEST", 1000)
    result = compile_with("serve_a_drink", "--graph", tmp_path / "g.png", "-o", tmp_path / "plan.py")
    assert (result.exit_code, "error C014" in result.stderr, ".svg" in result.stderr) == (2, True, True)
    assert not (tmp_path / "g.png").exists()


@pytest.mark.parametrize("name", ["g.pdf", "graph", "g.svg.txt", "g.html"])
def test_an_unknown_suffix_is_refused_with_the_valid_ones_and_nothing_is_written(name: str, tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / name, "-o", tmp_path / "plan.py")
    assert result.exit_code == 2
    assert "error C014" in result.stderr
    assert f"unknown graph format {Path(name).suffix or name}" in result.stderr
    assert "known: .svg, .dot, .mmd, .png" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_graph_may_not_overwrite_the_plan_or_the_recipe(tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / "x.svg", "-o", tmp_path / "x.svg")
    assert "would overwrite --output" in result.stderr


def test_a_recipe_with_errors_leaves_the_old_graph_as_it_was(tmp_path: Path) -> None:
    recipe, old = tmp_path / "r.omn", tmp_path / "g.svg"
    recipe.write_text("Ontology: <http://planlang.org/empty>\n")
    old.write_text("old")
    assert compile_with(recipe, "--graph", old).exit_code == 2
    assert old.read_text() == "old"


def test_the_answer_as_json_names_the_graph(tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / "g.mmd", "--json")
    assert json.loads(result.stdout)["graph"] == str(tmp_path / "g.mmd")
