"""Below the command line no message says a word of it: options and calls are objects, which each face says itself."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
BELOW = ("planlang", "executive", "sim")
FACES = (
    "executive/cli/",
    "planlang/testing/plugin.py",  # options of pytest
    "planlang/testing/worlds.py",
    "executive/templates/",  # files of users
)
OF_OTHERS = {
    "executive/options/declaring.py": {"--output"},  # declared
    "executive/options/recipes.py": {"--scopes", "--no-scopes", "--dataflow", "--no-dataflow"},
    "executive/options/running.py": {"--output", "--out"},
    "executive/sweeps/figures.py": {"--ink", "--faint", "--paper", "--line"},  # properties of style sheets
    "planlang/outputs.py": {"--no-scopes", "--no-dataflow"},  # in the header of a plan, which is a file
    "planlang/ontology/reasoning.py": {"--all-unsat", "--inconsistent", "--ignore-imports"},  # options of Openllet
    "executive/robots/draft.py": {"planlang robot"},  # in the head of the file that it makes
    "executive/pictures/reach_recording.py": {"planlang robot"},  # the writer of the file
}
"""File -> words in it that no user of a face reads as advice."""
WORDS = re.compile(
    r"(?<![\w-])--[a-z][a-z-]*"
    r"|\bplanlang (?:new|compile|check|convert|merge|list|show|match|run|sweep|compare|enable|replay|report|export"
    r"|locate|serve|backup|search|pull|push|rate|delete|watch|robot)\b"
)


def words_in(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield words of the command line in the strings of a file, docstrings aside, with their lines."""
    statements = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in statements:
            yield from ((node.lineno, word) for word in WORDS.findall(node.value))


def test_no_message_below_the_command_line_has_a_word_of_it() -> None:
    found = [
        f"{file}:{line}: {word}"
        for package in BELOW
        for path in sorted((CHECKOUT / package).rglob("*.py"))
        if not (file := path.relative_to(CHECKOUT).as_posix()).startswith(FACES)
        for line, word in words_in(ast.parse(path.read_text(encoding="utf-8")))
        if word not in OF_OTHERS.get(file, ())
    ]
    assert found == [], "write Text(..., Option(name, value), ...) or Text(..., calling(command, ...), ...)"


@pytest.mark.parametrize("text", ["add --trust", "planlang run FILE shows it", "`--task` chooses one"])
def test_a_word_of_the_command_line_is_found(text: str) -> None:
    assert [*words_in(ast.parse(f"help = {text!r}"))]
    assert not [*words_in(ast.parse(f"def work():\n    {text!r}"))], "a docstring is for readers of the code"
