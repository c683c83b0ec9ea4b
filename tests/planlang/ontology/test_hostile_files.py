"""Files that mean harm, or that are no ontologies at all, end in a diagnostic: quickly, without reading elsewhere."""

import socket
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.diagnostics import BadInput, Diagnostic
from planlang.ontology import load, rdfxml, triples, turtle
from planlang.ontology.rdfxml import read_rdfxml

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


@pytest.mark.parametrize("opening", ["(", "not ", "p some ", "inverse p some ", "{"])
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
@settings(max_examples=200, deadline=None)
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
@settings(max_examples=300, deadline=None)
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
