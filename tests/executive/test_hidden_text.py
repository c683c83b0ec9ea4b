"""Text of strangers is escaped wherever it is printed or written, so that it shows what it says."""

from __future__ import annotations

import ast
import json
import re
import tomllib
from pathlib import Path

import pytest

from planlang.files import Bundled
from planlang.visible import meant, visible
from tests.support.cli_runs import invoke

EVIL = "go\x1b[31m and\u202e of\u200b the \x9b1m end\u2028import os\x85x\u2066\ufeff\x07\x0b\U000e0041"
HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\U000e0000-\U000e007f]")
HERE = ("--robot", "amigo", "--environment", "hospital_room")


def hidden(text: str) -> list[str]:
    return [f"U+{ord(one):04X}" for one in HIDDEN.findall(text)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recipe, a map and a trace of a stranger, whose names are as bad as what is in them."""
    folder = tmp_path_factory.mktemp("evil\u202e\x1b[1m")
    recipe = Bundled.RECIPE.find("serve_a_drink").read_text()
    for label in ("serve a drink", "grasp a bottle", "where the hand closes", "offer the bottle to the patient"):
        recipe = recipe.replace(f'"{label}"', f'"{EVIL}"')
    (folder / "re\u202ecipe.omn").write_text(recipe)
    room = Bundled.ENVIRONMENT.find("hospital_room").read_text()
    (folder / "room\x1b.omn").write_text(room + f'\nIndividual: odd\n    Annotations: rdfs:label "{EVIL}"\n')
    result = invoke("run", folder / "re\u202ecipe.omn", "--trace", folder / "run\u200b.jsonl", *HERE)
    assert result.exit_code == 0, result.output
    assert hidden(result.output) == []
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ("compile", "re\u202ecipe.omn"),
        ("compile", "re\u202ecipe.omn", "--json"),
        ("compile", "absent\x1b.omn"),
        ("check", "re\u202ecipe.omn", "--verbose"),
        ("check", "re\u202ecipe.omn", "--json"),
        ("check", "."),
        ("check", "room\x1b.omn"),
        ("show", "re\u202ecipe.omn"),
        ("show", "room\x1b.omn"),
        ("show", "run\u200b.jsonl"),
        ("match", "re\u202ecipe.omn", "--robot", "amigo"),
        ("locate", "in reach of the bottle\u202e", *HERE),
        ("run", "re\u202ecipe.omn", "--robot", "ro\u202ebot", "--environment", "\x9b.omn"),
        ("run", "re\u202ecipe.omn", "--set", "\x1b=\u2066", *HERE),
        ("list", "classes", "\u202ebottle"),
        ("list", "\x1b[31m"),
        ("show", "--\x1b[31m"),
        ("search", "\x1b", "--from", "http://\u202e.org"),
        ("sweep-table", "run\u200b.jsonl"),
    ],
    ids=lambda words: ascii(" ".join(words)),
)
def test_nothing_that_is_printed_has_hidden_characters(
    folder: Path, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    result = invoke(*words)
    assert hidden(result.output) == []
    if "--json" in words:
        json.loads(result.stdout)


@pytest.mark.parametrize("suffix", ["svg", "dot", "mmd"])
def test_drawings_of_a_recipe_have_no_hidden_characters(folder: Path, suffix: str) -> None:
    path = folder / f"graph.{suffix}"
    assert invoke("show", folder / "re\u202ecipe.omn", "-o", folder / "graph.svg", "--force").exit_code == 0
    assert invoke("compile", folder / "re\u202ecipe.omn", "--graph", path, "--force").exit_code == 0
    assert hidden(path.read_text()) == []


def test_a_plan_has_no_hidden_characters_and_the_meaning_of_its_recipe(folder: Path) -> None:
    plan = folder / "plan.py"
    assert invoke("compile", folder / "re\u202ecipe.omn", "-o", plan).exit_code == 0
    source = plan.read_text()
    assert hidden(source) == []
    words = " ".join(EVIL.split())
    assert words[1:] in (ast.get_docstring(ast.parse(source)) or "")
    assert "re\\u202ecipe.omn" in source
    checked = invoke("check", plan)
    assert checked.exit_code == 0, "the plan finds its recipe"
    assert "C011" not in checked.output


def test_the_page_of_a_run_has_no_hidden_characters(folder: Path) -> None:
    page = folder / "run.html"
    result = invoke("report", folder / "run\u200b.jsonl", folder / "re\u202ecipe.omn", "-o", page, *HERE)
    assert result.exit_code == 0, result.output
    assert hidden(re.sub(r"<script type=.application/octet-stream.*?</script>", "", page.read_text())) == []


@pytest.mark.parametrize("text", ["a b", "é\u0301 \u65e5\u672c \U0001f600", "a\nb\tc", "a\u00a0b", "\u0627\u0644"])
def test_letters_marks_symbols_and_spaces_stay_as_they_are(text: str) -> None:
    assert visible(text) == text


def test_escaped_text_is_escaped_once_and_can_be_read_back() -> None:
    for sequence in (
        "\x1b]52;c;bHM=\x07",
        "\x1b]8;;file:///etc\x1b\\name\x1b]8;;\x1b\\",
        "\x1b[1A\x1b[K",
        "\x9b2J",
        "\r",
    ):
        assert hidden(visible(sequence)) == []
    assert visible(visible(EVIL)) == visible(EVIL)
    assert meant(visible(EVIL)) == EVIL


def test_a_robot_file_has_no_hidden_characters_and_the_names_of_the_urdf(tmp_path: Path) -> None:
    name = "cart\u202e\u0085\u200b"
    urdf = tmp_path / "cart.urdf"
    urdf.write_text(
        f'<robot name="{name}"><link name="base_{name}"><collision><geometry><box size="0.5 0.5 0.5"/></geometry>'
        "</collision></link></robot>",
        encoding="utf-8",
    )
    result = invoke("robot", "make", urdf, "-o", tmp_path / "cart.toml")
    assert result.exit_code == 0, result.output
    text = (tmp_path / "cart.toml").read_text()
    assert (hidden(text), hidden(result.output)) == ([], [])
    assert tomllib.loads(text)["name"] == name
