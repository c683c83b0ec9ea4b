"""Each file under tests/diagnostics named R* says in its first lines what a compiler says about it."""

import re
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import CODES, BadInput, Diagnostic

FILES = sorted((Path(__file__).parents[2] / "diagnostics").glob("R*"))
EXPECTED = re.compile(r"# ([A-Z]\d+) (error|warning|note) at line (\d+): ")


def diagnostics_of(path: Path, text: str) -> tuple[Diagnostic, ...]:
    task = re.search(r"^# task: (\S+)", text, re.MULTILINE)
    try:
        plan = compile_recipe(path, task=task[1] if task else None, allow_abstract="# allow abstract" in text)
    except BadInput as problem:
        return problem.diagnostics
    return plan.diagnostics


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_file_gets_exactly_the_diagnostics_that_it_announces(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    expected = sorted((code, severity, int(line)) for code, severity, line in EXPECTED.findall(text))
    found = diagnostics_of(path, text)
    told = sorted((d.code, d.severity.value, d.span.line if d.span else 0) for d in found)
    assert told == expected, "\n".join(map(str, found))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_error_and_warning_says_what_to_do(path: Path) -> None:
    for diagnostic in diagnostics_of(path, path.read_text(encoding="utf-8")):
        assert diagnostic.help or diagnostic.severity.value == "note"


def test_every_code_of_recipes_has_a_file() -> None:
    codes = {path.name[:4] for path in FILES}
    assert codes == {code for code in CODES if code.startswith("R")}
