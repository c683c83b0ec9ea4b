"""Places where imports are found and nothing else is read, and how harmful files and no ontologies are refused."""

import socket
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.diagnostics import BadInput, Diagnostic
from planlang.ontology import Ontology, load, rdfxml, triples, turtle
from planlang.ontology.rdfxml import read_rdfxml
from planlang.ontology.terms import VOCABULARIES
from tests.support.examples import some

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


RDF = (
    '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:owl="http://www.w3.org/2002/07/owl#"'
    ' xmlns:e="http://example.org/t#" xml:base="http://example.org/t">'
)


@pytest.fixture(autouse=True)
def _no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise AssertionError("the network was touched")

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)


def problems(path: Path) -> tuple[Diagnostic, ...]:
    with pytest.raises(BadInput) as caught:
        load(path)
    return caught.value.diagnostics


def file(folder: Path, content: str | bytes, name: str = "t.owl") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def bomb(levels: int, times: int) -> str:
    entities = ['<!ENTITY e0 "0123456789">']
    entities += (f'<!ENTITY e{n + 1} "{f"&e{n};" * times}">' for n in range(levels))
    return f"<!DOCTYPE rdf:RDF [{''.join(entities)}]>"


@pytest.mark.parametrize("place", ["<e:A>{}</e:A>", '<e:A rdf:about="{}"/>', '<e:A><e:p e:q="{}"/></e:A>'])
def test_a_billion_laughs_are_refused_wherever_they_stand(tmp_path: Path, place: str) -> None:
    text = bomb(9, 10) + RDF + place.format("&e9;") + "</rdf:RDF>"
    assert [d.code for d in problems(file(tmp_path, text))] == ["O008"]


def test_many_references_to_a_long_entity_are_refused(tmp_path: Path) -> None:
    text = f'<!DOCTYPE rdf:RDF [<!ENTITY long "{"x" * 50_000}">]>{RDF}<e:A rdf:about="{"&long;" * 20_000}"/></rdf:RDF>'
    assert [d.code for d in problems(file(tmp_path, text))] == ["O008"]


def test_a_bomb_in_a_namespace_is_refused(tmp_path: Path) -> None:
    text = bomb(9, 10) + RDF.replace("http://example.org/t#", "&e9;") + "</rdf:RDF>"
    assert [d.code for d in problems(file(tmp_path, text))] == ["O008"]


def test_entities_for_prefixes_are_read_as_real_files_use_them(tmp_path: Path) -> None:
    doctype = '<!DOCTYPE rdf:RDF [<!ENTITY e "http://example.org/t#"><!ENTITY a "&e;a">]>'
    text = f'{doctype}{RDF}<e:A rdf:about="&a;"/></rdf:RDF>'
    ontology = load(file(tmp_path, text))
    assert ontology.individuals("http://example.org/t#A") == ("http://example.org/t#a",)


@pytest.mark.parametrize(
    "doctype",
    [
        '<!DOCTYPE rdf:RDF [<!ENTITY x SYSTEM "secret.txt">]>',
        '<!DOCTYPE rdf:RDF [<!ENTITY x PUBLIC "x" "http://example.org/secret.txt">]>',
        '<!DOCTYPE rdf:RDF [<!ENTITY % x SYSTEM "secret.txt"> %x;]>',
        "<!DOCTYPE rdf:RDF [<!ENTITY % x '<!ENTITY y \"1\">'> %x;]>",
        '<!DOCTYPE rdf:RDF SYSTEM "secret.txt">',
        '<!DOCTYPE rdf:RDF PUBLIC "x" "http://example.org/x.dtd">',
    ],
)
def test_nothing_outside_the_file_is_an_entity(tmp_path: Path, doctype: str) -> None:
    (tmp_path / "secret.txt").write_text("secret")
    found = problems(file(tmp_path, f"{doctype}{RDF}<e:A>&x;</e:A></rdf:RDF>"))
    assert [d.code for d in found] == ["O009"]


@pytest.mark.parametrize("depth", [99, 100_000])
def test_elements_are_nested_only_so_deep(tmp_path: Path, depth: int) -> None:
    text = RDF + "<e:A><e:p>" * depth + "</e:p></e:A>" * depth + "</rdf:RDF>"
    assert [d.code for d in problems(file(tmp_path, text))] == ["O008"]


@pytest.mark.parametrize("opening", some(["(", "not ", "p some ", "inverse p some ", "{"], 2))
def test_expressions_are_nested_only_so_deep(tmp_path: Path, opening: str) -> None:
    text = f"Prefix: : <http://x.org/#>\nClass: A SubClassOf: {opening * 20_000}B\n"
    assert {d.code for d in problems(file(tmp_path, text, "t.omn"))} <= {"O008", "O020"}


def test_annotations_are_nested_only_so_deep(tmp_path: Path) -> None:
    inside = 'p "x" ' * 20_000
    text = f"Prefix: : <http://x.org/#>\nClass: A {'Annotations: ' * 20_000}{inside}\n"
    assert {d.code for d in problems(file(tmp_path, text, "t.omn"))} == {"O008"}


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "O002"),
        (b" \n\t", "O002"),
        (b"\xef\xbb\xbf", "O002"),
        (b"\x00\x01\x02\xff" * 100, "O004"),
        (b"\x7fELF\x02\x01\x01" + bytes(64), "O004"),
        (b"\x89PNG\r\n\x1a\n", "O004"),
        (b"PK\x03\x04abc", "O001"),
        (b"{}", "O001"),
        (b"import os\n", "O001"),
        (b"<", "O005"),
        (b"<?xml version='1.0'?>", "O005"),
        (b"<html><body>404</body></html>", "O001"),
        (b"<?xml version='1.0' encoding='zip'?><a/>", "O004"),
        (b"\xff\xfe<\x00r\x00", "O005"),
    ],
)
def test_what_is_no_ontology_is_refused(tmp_path: Path, content: bytes, code: str) -> None:
    assert [d.code for d in problems(file(tmp_path, content))] == [code]


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    assert [d.code for d in problems(tmp_path)] == ["O001"]
    assert [d.code for d in problems(tmp_path / "nothing.owl")] == ["O001"]
    assert [d.code for d in problems(tmp_path / ("x" * 5000))] == ["O001"]


def test_every_prefix_of_a_real_file_is_refused_with_a_position(corpus: Path) -> None:
    content = (corpus / "recipes" / "serve_drink_new@re_stack.owl").read_bytes().rstrip()
    for length in range(0, len(content) - 1, 97):
        with pytest.raises(BadInput) as caught:
            read_rdfxml(content[:length], "t.owl", base="http://example.org/t")
        assert all(d.span is not None and d.span.line > 0 for d in caught.value.diagnostics)


@given(st.binary(max_size=300))
@settings(max_examples=examples(200), deadline=None)
def test_any_bytes_are_read_or_refused(content: bytes) -> None:
    for prefix in (b"", RDF.encode()):
        try:
            read_rdfxml(prefix + content, "t.owl", base="http://example.org/t")
        except BadInput as problem:
            assert problem.diagnostics  # noqa: PT017


PIECES = [
    *('<e:A rdf:about="#a">', "</e:A>", "<e:p>", "</e:p>", '<e:p rdf:resource="#b"/>', '<rdf:li rdf:nodeID="x"/>'),
    *('<e:p rdf:parseType="Collection">', '<e:p rdf:parseType="Resource">', '<e:p rdf:parseType="Literal">', "text"),
    *(
        '<rdf:Description rdf:ID="1 2">',
        "</rdf:Description>",
        '<rdf:RDF e:p="x">',
        "</rdf:RDF>",
        "<A>",
        "</A>",
        "<!-x->",
    ),
    *('<e:p rdf:datatype="" xml:lang="">', '<e:A xml:base="http://[" rdf:about="x">', "&amp;", "<!--", "-->"),
]


@given(st.lists(st.sampled_from(PIECES), max_size=25))
@settings(max_examples=examples(300), deadline=None)
def test_any_elements_are_read_or_refused(pieces: list[str]) -> None:
    try:
        read_rdfxml((RDF + "".join(pieces) + "</rdf:RDF>").encode(), "t.owl", base="http://example.org/t")
    except BadInput as problem:
        assert problem.diagnostics  # noqa: PT017


def test_a_chain_of_nameless_intersections_is_walked_however_long(tmp_path: Path) -> None:
    steps = "".join(
        f'<owl:Class rdf:nodeID="n{n}"><owl:intersectionOf rdf:parseType="Collection">'
        f'<owl:Class rdf:nodeID="n{n + 1}"/><owl:Class rdf:about="#C{n}"/></owl:intersectionOf></owl:Class>'
        for n in range(3000)
    )
    text = RDF + f'<owl:Class rdf:about="#A"><owl:equivalentClass rdf:nodeID="n0"/></owl:Class>{steps}</rdf:RDF>'
    ontology = load(file(tmp_path, text), builtin=False)
    assert len(ontology.ancestors("http://example.org/t#A")) == 3001


def test_lists_and_intersections_that_contain_themselves_are_walked_once(tmp_path: Path) -> None:
    text = (
        RDF + '<owl:Class rdf:about="#A"><owl:equivalentClass rdf:nodeID="x"/></owl:Class>'
        '<owl:Class rdf:nodeID="x"><owl:intersectionOf rdf:nodeID="l"/></owl:Class>'
        '<rdf:List rdf:nodeID="l"><rdf:first rdf:nodeID="x"/><rdf:rest rdf:nodeID="m"/></rdf:List>'
        '<rdf:List rdf:nodeID="m"><rdf:first rdf:resource="#B"/><rdf:rest rdf:nodeID="l"/></rdf:List></rdf:RDF>'
    )
    ontology = load(file(tmp_path, text), builtin=False)
    assert ontology.ancestors("http://example.org/t#A") == ("http://example.org/t#A", "http://example.org/t#B")
    assert ontology.restrictions("http://example.org/t#A") == ()


@pytest.mark.parametrize(
    ("module", "text"),
    [
        (rdfxml, RDF + "<e:A/>" * 12 + "</rdf:RDF>"),
        (turtle, "<#a> a <#B> .\n" * 12),
        (triples, "".join(f"Class: <http://x.org/{n}>\n" for n in range(12))),
        (triples, "".join(f"Class: c{n}\n" for n in range(12))),
        (triples, f"Class: c SubClassOf: {', '.join(f'c{n}' for n in range(12))}"),
    ],
    ids=["rdf/xml", "turtle", "manchester", "simple frames", "simple descriptions"],
)
def test_a_file_has_only_so_many_triples(
    tmp_path: Path, module: ModuleType, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_TRIPLES", 10)
    assert [d.code for d in problems(file(tmp_path, text))] == ["O003"]


def test_very_many_entities_and_mistakes_take_no_long_time(tmp_path: Path) -> None:
    names = [f"e{n}" for n in range(5000)]
    declared = "".join(f'<!ENTITY {name} "x">' for name in names)
    doctype = f'<!DOCTYPE rdf:RDF [{declared}<!ENTITY all "{"".join(f"&{name};" for name in names)}">]>'
    mistakes = "<!-x->" * 20_000 + '<owl:Class owl:subClassOf="x"/>' * 5000
    found = load(file(tmp_path, f"{doctype}{RDF}{mistakes}</rdf:RDF>")).diagnostics
    assert {d.code for d in found} == {"O006", "O012"}
    assert len(found) == 200
