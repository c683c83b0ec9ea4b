"""A superclass that nothing defines is the only class of that name beside the vocabulary, if there is one."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.ontology import Ontology, load

HEAD = """Prefix: : <http://example.org/r.owl#>
Prefix: typo: <http://example.org/r.owl.owl#>
Prefix: more: <http://example.org/more.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/r.owl>
Class: Look
    SubClassOf: :exploring
"""
ONE = "Class: typo:exploring\n    SubClassOf: knowrob:EnvironmentExploration\n"
TWO = "Class: more:exploring\n    SubClassOf: knowrob:Waiting\n"
LOOK = "http://example.org/r.owl#Look"


def read(folder: Path, text: str) -> Ontology:
    """The ontology of a text."""
    file = folder / "r.omn"
    file.write_text(HEAD + text)
    return load(file)


def test_the_only_class_of_the_name_is_taken_and_the_warning_says_so(tmp_path: Path) -> None:
    found = read(tmp_path, ONE)
    assert found.is_a(LOOK, "EnvironmentExploration")
    (warning,) = (one for one in found.diagnostics if one.code == "O041")
    assert "http://example.org/r.owl.owl#exploring" in warning.message


@pytest.mark.parametrize("more", ["", ONE + TWO])
def test_of_none_and_of_several_none_is_taken(tmp_path: Path, more: str) -> None:
    found = read(tmp_path, more)
    assert not found.is_a(LOOK, "EnvironmentExploration")
    assert not found.is_a(LOOK, "Waiting")
    assert [one.code for one in found.diagnostics] == ["O041"]


def test_a_class_of_the_vocabulary_is_never_taken(tmp_path: Path) -> None:
    found = read(tmp_path, "Class: Wait\n    SubClassOf: :Waiting\n")
    assert not found.is_a("http://example.org/r.owl#Wait", "Waiting")
