"""Every diagnostic of reading ontologies has a file that shows it, with the line where it is expected."""

import re
from pathlib import Path

import pytest

from planlang.diagnostics import CODES, BadInput, Diagnostic, has_errors
from planlang.ontology import documents, load, xml_text
from planlang.ontology.writing import Target, convert

FOLDER = Path(__file__).resolve().parents[2] / "diagnostics"
FILES = sorted(FOLDER.glob("O*"))
_EXPECTATION = re.compile(rb"expect (O\d\d\d) at line (\d+)")


def diagnostics_of(path: Path) -> tuple[Diagnostic, ...]:
    try:
        if path.name.startswith("O05"):
            return convert(path, Target.MANCHESTER).diagnostics
        return load(path).diagnostics
    except BadInput as problem:
        return problem.diagnostics


def expectation(path: Path) -> tuple[str, int]:
    match = _EXPECTATION.search(path.read_bytes())
    assert match is not None, f"{path.name} does not say what is expected"
    return match[1].decode(), int(match[2])


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_the_file_gives_its_diagnostic_at_the_line_it_says(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, line = expectation(path)
    if code == "O003":
        monkeypatch.setattr(xml_text, "LARGEST_FILE", 100)
    if code == "O033":
        monkeypatch.setattr(documents, "MOST_DOCUMENTS", 1)
    found = [(d.code, d.span.line if d.span else None) for d in diagnostics_of(path)]
    assert (code, line) in found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_the_file_gives_no_other_diagnostic(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, _ = expectation(path)
    if code == "O003":
        monkeypatch.setattr(xml_text, "LARGEST_FILE", 100)
    if code == "O033":
        monkeypatch.setattr(documents, "MOST_DOCUMENTS", 1)
    assert {d.code for d in diagnostics_of(path)} == {code}


def test_every_code_has_a_file() -> None:
    shown = {expectation(path)[0] for path in FILES}
    assert shown == {code for code in CODES if code.startswith("O")}


def test_a_misspelt_section_is_answered_with_the_right_one() -> None:
    (found,) = diagnostics_of(FOLDER / "O020_misspelt_section.omn")
    assert found.span is not None
    assert found.span.column == 5
    assert found.help is not None
    assert found.help.startswith("did you mean SubClassOf:?")


def test_an_undefined_entity_is_named_with_its_column() -> None:
    (found,) = diagnostics_of(FOLDER / "O005_undefined_entity.owl")
    assert found.message.endswith("undefined entity &kitchen;")
    assert found.span is not None
    assert found.span.column == 36


def test_all_syntax_errors_of_a_file_are_reported_in_one_run(tmp_path: Path) -> None:
    path = tmp_path / "wrong.omn"
    path.write_text(
        "Prefix: : <http://example.org/t.owl#>\n"
        "Class: A SubclassOf: B\n"
        "Class: B\n"
        "    SubClassOf: p some\n"
        "Individual: c Facts: p q r\n"
        "Class: nowhere:D\n"
    )
    assert [(d.code, d.span.line) for d in diagnostics_of(path) if d.span] == [
        ("O020", 2),
        ("O020", 5),
        ("O020", 5),
        ("O021", 6),
    ]


def test_rdf_about_and_rdf_resource_may_be_exchanged() -> None:
    thing = load(FOLDER / "O010_resource_of_a_thing.owl")
    assert thing.is_class("http://example.org/t.owl#A")
    ontology = load(FOLDER / "O010_about_of_a_property.owl")
    assert ontology.is_a("http://example.org/t.owl#A", "Door")


def test_warnings_do_not_stop_a_file() -> None:
    found = diagnostics_of(FOLDER / "O012_wrong_namespace.owl")
    assert not has_errors(found)
