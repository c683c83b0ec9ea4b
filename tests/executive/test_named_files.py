"""Files that a user names: a recipe or a plan, as its content says, or neither."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from executive.runs.files import RecipeFile, read
from planlang.language.source import PlanSource
from tests.support.refusals import refusal


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"# only a comment\n",
        b'<?xml version="1.0"?>\n<rdf:RDF/>',
        b"\xef\xbb\xbf<rdf:RDF/>",
        '<?xml version="1.0"?><rdf:RDF/>'.encode("utf-16"),
        b"# a recipe\nPrefix: : <http://example.org/#>\n",
        b"Ontology: <http://example.org/>\n",
        b"@prefix : <http://example.org/#> .\n",
        b"PREFIX : <http://example.org/#>\n",
        b"complete nonsense, and not Python\n",
        bytes(range(256)),
    ],
)
@pytest.mark.parametrize("name", ["thing.py", "thing.owl.in", "thing"])
def test_owl_and_whatever_is_not_python_goes_to_the_recipe_reader(tmp_path: Path, content: bytes, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    assert read(str(path)) == RecipeFile(path)


@pytest.mark.parametrize(
    "content",
    [
        '"""A plan."""\nfrom planlang import plan\n',
        "# a comment\nimport planlang\n",
        "\ufefffrom planlang.failures import GraspMissed\n",
    ],
)
@pytest.mark.parametrize("name", ["plan.py", "plan.owl"])
def test_python_that_imports_planlang_is_a_plan_whatever_its_suffix(tmp_path: Path, content: str, name: str) -> None:
    path = tmp_path / name
    path.write_text(content, encoding="utf-8")
    assert isinstance(read(str(path)), PlanSource)


def test_a_plan_nested_too_deeply_for_the_parser_is_bad_input(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("import planlang\nx = " + "(" * 100_000 + ")" * 100_000 + "\n")
    with refusal("C002"):
        read(str(path))


def test_a_folder_of_the_name_of_a_bundled_recipe_does_not_hide_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "serve_a_drink").mkdir()
    monkeypatch.chdir(tmp_path)
    found = read("serve_a_drink")
    assert isinstance(found, RecipeFile)
    assert found.is_bundled


def test_a_users_own_recipe_is_not_taken_for_a_bundled_one(tmp_path: Path) -> None:
    path = tmp_path / "serve_a_drink.omn"
    path.write_text("Ontology: <http://example.org/>\n")
    found = read(str(path))
    assert isinstance(found, RecipeFile)
    assert not found.is_bundled


@pytest.mark.parametrize("name", ["", " "])
def test_an_empty_name_is_said_to_be_empty(name: str) -> None:
    with refusal("C001"):
        read(name)


@pytest.mark.parametrize("is_named", [True, False])
def test_a_pipe_is_bad_input_that_says_what_to_do(tmp_path: Path, is_named: bool) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with refusal("C001") as caught:
        read(str(pipe) if is_named else "-")
    assert caught.value.diagnostics[0].help == "write it to a file first: ... > recipe.owl"
