"""Where imports are found, and that nothing else is ever read."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from planlang.ontology import Ontology, load
from planlang.ontology.terms import VOCABULARIES

KNOWROB = VOCABULARIES["knowrob"]
T = "http://example.org/t.owl#"


def importing(folder: Path, *targets: str, name: str = "main.omn") -> Path:
    lines = "".join(f"    Import: <{target}>\n" for target in targets)
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"Prefix: : <{T}>\nOntology: <http://example.org/t.owl>\n{lines}Class: Main\n")
    return path


def importing_in_xml(folder: Path, target: str) -> Path:
    """RDF/XML allows characters in an address that Manchester syntax does not."""
    path = folder / "main.owl"
    path.write_text(
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:owl="http://www.w3.org/2002/07/owl#">'
        f'<owl:Ontology rdf:about="http://example.org/t.owl"><owl:imports rdf:resource="{target}"/></owl:Ontology>'
        "</rdf:RDF>"
    )
    return path


def imported(path: Path, name: str = "Imported", ontology: str = "http://example.org/imported.owl") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"Prefix: : <{T}>\nOntology: <{ontology}>\nClass: {name}\n")
    return path


def codes(ontology: Ontology) -> list[str]:
    return [d.code for d in ontology.diagnostics]


def found(path: Path, folders: Sequence[Path] = ()) -> bool:
    ontology = load(path, folders=folders)
    assert codes(ontology) in ([], ["O030"], ["O031"], ["O032"])
    return ontology.is_class(T + "Imported")


@pytest.mark.parametrize(
    "target",
    [
        "other.omn",
        "other.owl",
        "sub/other.omn",
        "package://knowrob_maps/owl/other.owl",
        "file://@RE_PATH_PREFIX@/owl/other.owl",
        "file://@RE_PATH_PREFIX@other.owl",
        "file:///build/ros/stacks/maps/owl/other.owl",
        "http://example.org/somewhere/other.owl",
        "http://example.org/other.owl#",
        "sub%2Fother.omn",
    ],
)
def test_a_file_beside_the_importing_one_is_found(tmp_path: Path, target: str) -> None:
    imported(tmp_path / "other.omn")
    assert found(importing(tmp_path, target))


@pytest.mark.parametrize("target", ["file:${CMAKE_PREFIX}/other.owl", "${PREFIX}/other.owl", "sub\\other.owl"])
def test_unfilled_templates_of_other_tools_are_left_out_of_the_path(tmp_path: Path, target: str) -> None:
    imported(tmp_path / "other.omn")
    assert found(importing_in_xml(tmp_path, target))


def test_the_file_beside_wins_over_the_given_folders_and_these_over_ours(tmp_path: Path) -> None:
    main = importing(tmp_path / "here", "package://knowrob_common/owl/knowrob.owl")
    assert [d.path.name for d in load(main).documents][1] == "knowrob.omn"
    imported(tmp_path / "given" / "knowrob.owl", "Given")
    assert load(main, folders=[tmp_path / "given"]).is_class(T + "Given")
    imported(tmp_path / "here" / "knowrob.owl", "Beside")
    both = load(main, folders=[tmp_path / "given"])
    assert both.is_class(T + "Beside")
    assert not both.is_class(T + "Given")


def test_given_folders_are_searched_in_order_and_by_the_end_of_the_path(tmp_path: Path) -> None:
    main = importing(tmp_path / "here", "package://maps/owl/other.owl")
    imported(tmp_path / "first" / "owl" / "other.owl", "First")
    imported(tmp_path / "second" / "other.owl", "Second")
    ontology = load(main, folders=[tmp_path / "first", tmp_path / "second"])
    assert ontology.is_class(T + "First")
    assert not ontology.is_class(T + "Second")


@pytest.mark.parametrize(
    "target",
    [
        "package://knowrob_common/owl/knowrob.owl",
        "http://knowrob.org/kb/knowrob.owl",
        "http://ias.cs.tum.edu/kb/knowrob.owl",
        "http://ias.cs.tum.edu/kb/knowrob.owl#",
        "http://knowrob.org/kb/srdl2-comp.owl",
        "http://www.roboearth.org/kb/roboearth.owl",
        "http://ias.cs.tum.edu/kb/roboearth.owl",
        "file://@RE_PATH_PREFIX@/roboearth.owl",
        "package://ias_knowledge_base/owl/computable.owl",
        "http://www.w3.org/2002/07/owl",
        "http://www.w3.org/2000/01/rdf-schema#",
    ],
)
@pytest.mark.parametrize("builtin", [True, False])
def test_the_vocabularies_are_ours_under_all_their_addresses(tmp_path: Path, target: str, builtin: bool) -> None:
    ontology = load(importing(tmp_path, target), builtin=builtin)
    assert set(codes(ontology)) <= {"O015"}


def test_a_bundled_robot_is_found_by_name_but_an_address_must_be_its_own(tmp_path: Path) -> None:
    assert codes(load(importing(tmp_path, "package://robots/owl/amigo.omn"))) == []
    assert codes(load(importing(tmp_path, "http://example.org/amigo.owl"))) == ["O031"]


def test_an_unknown_file_is_one_warning_at_its_import(tmp_path: Path) -> None:
    ontology = load(importing(tmp_path, "package://a/b.owl", "package://a/b.owl"))
    (warning,) = ontology.diagnostics
    assert warning.code == "O030"
    assert warning.span is not None
    assert warning.span.line == 3


@pytest.mark.parametrize(
    "target",
    [
        "../secret.omn",
        "sub/../../secret.omn",
        "%2e%2e/secret.omn",
        "file:../secret.omn",
        "package://../secret.omn",
        "package://a/../../secret.omn",
        "@PREFIX@/../secret.omn",
    ],
)
def test_no_path_leads_out_of_the_folders(tmp_path: Path, target: str) -> None:
    imported(tmp_path / "secret.omn")
    (tmp_path / "here" / "sub").mkdir(parents=True)
    (tmp_path / "here" / "a").mkdir()
    assert not found(importing(tmp_path / "here", target))


def test_an_absolute_path_counts_only_inside_the_folders(tmp_path: Path) -> None:
    secret = imported(tmp_path / "secret.omn")
    main = importing(tmp_path / "here", secret.as_uri())
    assert not found(main)
    assert found(main, [tmp_path])


def test_a_link_out_of_the_folders_is_not_followed(tmp_path: Path) -> None:
    imported(tmp_path / "secret.omn")
    main = importing(tmp_path / "here", "other.omn")
    (tmp_path / "here" / "other.omn").symlink_to(tmp_path / "secret.omn")
    assert not found(main)


@pytest.mark.parametrize("target", ["%00", "x" * 5000, "a/" * 5000 + "b", "", ".", "..", "/", "file:", "http://", "#"])
def test_odd_targets_are_warnings(tmp_path: Path, target: str) -> None:
    ontology = load(importing(tmp_path, target))
    assert set(codes(ontology)) <= {"O030", "O031", "O032"}


def test_imports_in_a_circle_are_read_once(tmp_path: Path) -> None:
    importing(tmp_path, "main.omn", "second.omn", name="second.omn")
    main = importing(tmp_path, "second.omn")
    ontology = load(main, builtin=False)
    assert codes(ontology) == []
    assert [d.path.name for d in ontology.documents] == ["main.omn", "second.omn"]


def test_documents_are_in_load_order_with_the_vocabulary_last(tmp_path: Path) -> None:
    imported(tmp_path / "b.omn", "B")
    importing(tmp_path, "b.omn", name="a.omn")
    main = importing(tmp_path, "a.omn", "b.omn")
    names = [d.path.name for d in load(main).documents]
    assert names[:4] == ["main.omn", "a.omn", "b.omn", "knowrob.omn"]


def test_relative_imports_are_relative_to_the_importing_file(tmp_path: Path) -> None:
    imported(tmp_path / "sub" / "deep.omn")
    importing(tmp_path / "sub", "deep.omn", name="middle.omn")
    assert found(importing(tmp_path, "sub/middle.omn"))


def test_real_import_entities_are_resolved(corpus: Path) -> None:
    ontology = load(corpus / "recipes" / "serve_drink@re_stack.owl")
    assert not [d for d in ontology.diagnostics if d.code.startswith("O03")]
