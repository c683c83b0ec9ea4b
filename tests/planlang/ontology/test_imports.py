"""Imports by the IRI that a file states, and by the catalog that Protege and the OWL API write."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.ontology import Ontology, load

WORDS = "http://example.org/onto/things"
HEADINGS = {
    "omn": "Ontology: <{iri}> <{iri}/1.1.0>\nClass: <{iri}#SoupCup>\n",
    "ofn": "Ontology(<{iri}> <{iri}/1.1.0>\nDeclaration(Class(<{iri}#SoupCup>)))\n",
    "ttl": "@prefix owl: <http://www.w3.org/2002/07/owl#> . @base <{iri}> .\n"
    "<> a owl:Ontology ; owl:versionIRI <{iri}/1.1.0> . <#SoupCup> a owl:Class .\n",
    "nt": "<{iri}> <http://www.w3.org/1999/02/22-rdf-syntax-ns#type> <http://www.w3.org/2002/07/owl#Ontology> .\n"
    "<{iri}> <http://www.w3.org/2002/07/owl#versionIRI> <{iri}/1.1.0> .\n"
    "<{iri}#SoupCup> <http://www.w3.org/1999/02/22-rdf-syntax-ns#type> <http://www.w3.org/2002/07/owl#Class> .\n",
    "owl": '<!DOCTYPE rdf:RDF [<!ENTITY here "{iri}">]>\n'
    '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:owl="http://www.w3.org/2002/07/owl#">'
    '<owl:Ontology rdf:about="&here;"><owl:versionIRI rdf:resource="&here;/1.1.0"/></owl:Ontology>'
    '<owl:Class rdf:about="&here;#SoupCup"/></rdf:RDF>\n',
    "owx": '<Ontology xmlns="http://www.w3.org/2002/07/owl#" ontologyIRI="{iri}" versionIRI="{iri}/1.1.0">'
    '<Declaration><Class IRI="{iri}#SoupCup"/></Declaration></Ontology>\n',
}


def stating(path: Path, iri: str = WORDS) -> Path:
    """A file that states an IRI, and a class SoupCup of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(HEADINGS[path.suffix[1:]].replace("{iri}", iri))
    return path


def importing(folder: Path, target: str = WORDS) -> Ontology:
    path = folder / "main.omn"
    path.write_text(f"Ontology: <http://example.org/main>\n    Import: <{target}>\n")
    return load(path, builtin=False)


def found(ontology: Ontology, iri: str = WORDS) -> bool:
    return ontology.is_class(f"{iri}#SoupCup")


def said(ontology: Ontology) -> list[str]:
    return [one.code for one in ontology.diagnostics]


def catalog(folder: Path, entries: str, *, attributes: str = "") -> Path:
    path = folder / "catalog-v001.xml"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8" standalone="no"?>\n'
        f'<catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog"{attributes}>\n'
        f"{entries}\n</catalog>"
    )
    return path


@pytest.mark.parametrize("suffix", HEADINGS)
@pytest.mark.parametrize("target", [WORDS, f"{WORDS}/1.1.0", f"{WORDS}#"])
def test_a_file_beside_is_found_by_the_iri_and_the_version_iri_that_it_states(
    tmp_path: Path, suffix: str, target: str
) -> None:
    stating(tmp_path / f"my_file.{suffix}")
    ontology = importing(tmp_path, target)
    assert (found(ontology), said(ontology)) == (True, [])


def test_a_file_of_a_folder_of_the_user_is_found_by_its_iri(tmp_path: Path) -> None:
    stating(tmp_path / "words" / "mine.ofn")
    main = tmp_path / "main.omn"
    main.write_text(f"Ontology: <http://example.org/main>\n    Import: <{WORDS}>\n")
    assert found(load(main, folders=(tmp_path / "words",), builtin=False))
    assert said(load(main, builtin=False)) == ["O031"]


def test_a_file_that_states_the_iri_is_read_instead_of_one_that_only_has_its_name(tmp_path: Path) -> None:
    stating(tmp_path / "things.owl", "http://example.com/other")
    stating(tmp_path / "mine.ttl")
    assert found(importing(tmp_path))


def test_two_files_that_state_an_iri_are_named_and_the_one_with_its_name_is_read(tmp_path: Path) -> None:
    stating(tmp_path / "a.ofn")
    stating(tmp_path / "things.omn")
    ontology = importing(tmp_path)
    (only,) = ontology.diagnostics
    assert (only.code, found(ontology)) == ("O035", True)
    assert "things.omn and a.ofn" in only.message
    assert only.message.endswith("things.omn is read")


def test_two_files_of_one_version_each_are_no_conflict_if_the_version_is_imported(tmp_path: Path) -> None:
    stating(tmp_path / "new.ofn")
    (tmp_path / "old.ofn").write_text((tmp_path / "new.ofn").read_text().replace("1.1.0", "1.0.0"))
    assert said(importing(tmp_path, f"{WORDS}/1.0.0")) == []


def test_another_version_beside_is_named(tmp_path: Path) -> None:
    stating(tmp_path / "mine.ofn")
    (only,) = importing(tmp_path, f"{WORDS}/2.0.0").diagnostics
    assert only.code == "O031"
    assert only.help is not None
    assert f"mine.ofn states {WORDS}" in only.help


@pytest.mark.parametrize(
    ("entries", "attributes"),
    [
        ('<uri id="User Entered Import Resolution" name="{iri}" uri="words/mine.ofn"/>', ""),
        ('<group prefer="public" xml:base="words/"><uri name="{iri}" uri="mine.ofn"/></group>', ""),
        ('<uri name="{iri}" uri="mine.ofn"/>', ' xml:base="words/"'),
        ('<rewriteURI uriStartString="http://example.org/onto/" rewritePrefix="words/x/../"/>', ""),
        ('<uriSuffix uriSuffix="onto/things" uri="words/mine.ofn"/>', ""),
        ('<nextCatalog catalog="words/catalog.xml"/>', ""),
        ('<delegateURI uriStartString="http://example.org/" catalog="words/catalog.xml"/>', ""),
        ('<uri name="{iri}" uri="lost.ofn"/><uri name="{iri}" uri="words/mine.ofn"/>', ""),
        ('<uri name="{iri}" uri="words\\mine.ofn"/>', ""),
        ('<uri name="{iri}" uri="http://example.com/mine"/>', ""),
    ],
)
def test_a_catalog_leads_to_the_file(tmp_path: Path, entries: str, attributes: str) -> None:
    stating(tmp_path / "words" / "mine.ofn")
    (tmp_path / "words" / "things").write_text((tmp_path / "words" / "mine.ofn").read_text())
    (tmp_path / "words" / "catalog.xml").write_text(
        f'<!DOCTYPE catalog PUBLIC "-//OASIS//DTD" "http://www.oasis-open.org/catalog.dtd">\n'
        f'<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog"><uri name="{WORDS}" uri="mine.ofn"/></catalog>'
    )
    if "example.com" in entries:
        (tmp_path / "elsewhere.ofn").write_text(
            f"Ontology(<http://example.com/mine> Declaration(Class(<{WORDS}#SoupCup>)))"
        )
    catalog(tmp_path, entries.replace("{iri}", WORDS), attributes=attributes)
    ontology = importing(tmp_path)
    assert found(ontology)
    assert set(said(ontology)) <= {"O036"}


@pytest.mark.parametrize(
    ("entries", "advice"),
    [
        ('<uri name="{iri}" uri="lost.ofn"/>', "names a file that is not there"),
        ('<uri name="{iri}" uri="../outside.ofn"/>', "leads outside the allowed folders"),
        ('<uri name="{iri}" uri="file:///etc/passwd"/>', "leads outside the allowed folders"),
        ('<nextCatalog catalog="../catalog-v001.xml"/>', "leads outside the allowed folders"),
        ("<uri", "this is not XML"),
        ('<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><uri/>', "this is not XML"),
        ('<group><nextCatalog catalog="catalog-v001.xml"/></group>' * 100, None),
        ("<group>" * 60 + "</group>" * 60, "nested"),
    ],
)
def test_a_catalog_that_is_broken_or_hostile_is_a_warning(tmp_path: Path, entries: str, advice: str | None) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    stating(tmp_path / "outside.ofn")
    catalog(tmp_path, f'<uri name="{WORDS}" uri="outside.ofn"/>')
    catalog(folder, entries.replace("{iri}", WORDS))
    ontology = importing(folder)
    assert not found(ontology)
    assert set(said(ontology)) == ({"O031", "O036"} if advice else {"O031"})
    assert advice is None or any(advice in one.message for one in ontology.diagnostics)


def test_an_entity_bomb_in_a_catalog_is_refused(tmp_path: Path) -> None:
    bomb = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 20 if n else "x" * 100}">' for n in range(8))
    (tmp_path / "catalog-v001.xml").write_text(
        f'<!DOCTYPE catalog [{bomb}]><catalog><uri name="&e7;" uri="a"/></catalog>'
    )
    assert set(said(importing(tmp_path))) == {"O031", "O036"}


def test_an_upload_finds_nothing_beside_it_and_is_told_of_nothing(tmp_path: Path) -> None:
    stating(tmp_path / "mine.ofn")
    content = f"Ontology: <http://example.org/main>\n    Import: <{WORDS}>\n".encode()
    ontology = load(tmp_path / "main.omn", content=content, builtin=False)
    (only,) = ontology.diagnostics
    assert (only.code, "mine.ofn" in (only.help or "")) == ("O031", False)


@pytest.mark.parametrize(("target", "iri"), [("https://example.org/a", "http://example.org/a"),
                                             ("http://example.org/a", "https://example.org/a")])  # fmt: skip
def test_an_ontology_is_found_under_http_and_https(tmp_path: Path, target: str, iri: str) -> None:
    stating(tmp_path / "other.ttl", iri)
    assert found(importing(tmp_path, target), iri)


PACKAGED = "package://lab_words/owl/things.ofn"


@pytest.mark.parametrize("place", ["ws/lab_words", "ws/repository/lab_words", "ws/lab_maps/lab_words"])
def test_a_package_of_ros_is_found_above_the_importing_file(tmp_path: Path, place: str) -> None:
    stating(tmp_path / place / "owl" / "things.ofn")
    (tmp_path / place / "package.xml").write_text("<package/>")
    own = tmp_path / "ws" / ("repository/maps/owl" if "repository" in place else "lab_maps/owl")
    own.mkdir(parents=True)
    assert found(importing(own, PACKAGED))


@pytest.mark.parametrize(("variable", "place"), [("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")])
def test_a_package_of_ros_is_found_where_the_environment_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, place: str
) -> None:
    package = tmp_path / "installed" / place / "lab_words"
    stating(package / "owl" / "things.ofn")
    (package / "package.xml").write_text("<package/>")
    monkeypatch.setenv(variable, str(tmp_path / "installed"))
    (tmp_path / "maps").mkdir()
    assert found(importing(tmp_path / "maps", PACKAGED))


@pytest.mark.parametrize("target", [PACKAGED, "package://lab_words/owl/../../secret/things.ofn"])
def test_a_folder_that_is_no_package_is_not_read(tmp_path: Path, target: str) -> None:
    stating(tmp_path / "lab_words" / "owl" / "things.ofn")
    stating(tmp_path / "secret" / "things.ofn")
    (tmp_path / "secret" / "package.xml").write_text("<package/>")
    (tmp_path / "maps" / "owl").mkdir(parents=True)
    ontology = importing(tmp_path / "maps" / "owl", target)
    assert not found(ontology)
    assert said(ontology)[0] in ("O030", "O032")
