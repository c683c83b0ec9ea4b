"""Descriptions: what an entry adds to the vocabulary, of bounded size, and as bytes."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.knowledge.axioms import NOTHING, Axioms, One, Some, axioms_of, own_axioms_of, together
from planlang.knowledge.completion import TooLarge
from planlang.knowledge.descriptions import Described, Description, contradiction, described
from planlang.knowledge.facts import packed, unpacked
from planlang.ontology import load

TEXT = st.text(max_size=20)
NODES = st.builds(
    Described,
    st.lists(TEXT, max_size=3).map(tuple),
    st.lists(st.tuples(TEXT, TEXT | st.integers(0, 9)), max_size=3).map(tuple),
)
DESCRIPTIONS = st.builds(
    Description,
    st.lists(NODES, max_size=3).map(tuple),
    st.lists(TEXT, max_size=3).map(tuple),
    st.lists(st.tuples(TEXT, TEXT), max_size=3).map(tuple),
)


@given(DESCRIPTIONS)
def test_a_description_is_read_as_it_was_written(description: Description) -> None:
    assert unpacked(packed(description)).description() == description


@pytest.mark.parametrize("data", [b"", b"{}", b"[]", b"\xff", b"5", b"[5, 5, [], []]", b"[[], 0, [], []]\n12345"])
def test_other_bytes_are_no_description(data: bytes) -> None:
    with pytest.raises((ValueError, TypeError)):
        unpacked(data)


def test_what_the_vocabulary_knows_is_named_and_not_repeated() -> None:
    vocabulary, own = Axioms(), Axioms()
    vocabulary.state("urn:Bottle", "urn:Container")
    vocabulary.state("urn:Container", Some("urn:has", "urn:Opening"))
    own.state("urn:mine", Some("urn:on", "urn:Bottle"))
    own.state("urn:mine", "urn:Container")
    own.state("urn:mine", "urn:Bottle")
    (node, *_) = described("urn:mine", vocabulary, own).nodes
    assert set(node.labels) == {"urn:mine", "urn:Bottle"}
    assert ("urn:on", "urn:Bottle") in node.links


@pytest.mark.long
def test_what_reaches_too_much_is_refused_in_time() -> None:
    own = Axioms(chains=[("urn:part",) * 3])
    for number in range(30_000):
        own.state(One(f"urn:{number}"), Some("urn:part", One(f"urn:{number + 1}")))
    began = time.process_time()
    with pytest.raises(TooLarge):
        described("urn:0", Axioms(), own, is_individual=True)
    assert time.process_time() - began < 30


@pytest.mark.long
def test_long_chains_and_wide_classes_are_described() -> None:
    own = Axioms(chains=[("urn:part",) * 3])
    for number in range(400):
        own.state(One(f"urn:{number}"), Some("urn:part", One(f"urn:{number + 1}")))
    wide = together(f"urn:C{number}" for number in range(3000))
    assert wide is not None
    own.state(wide, "urn:Wide")
    own.state(One("urn:0"), wide)
    (node, *_) = described("urn:0", Axioms(), own, is_individual=True).nodes
    assert "urn:Wide" in node.labels
    assert len(node.links) == 400


def test_the_vocabulary_itself_is_no_part_of_an_entrys_axioms(tmp_path: Path) -> None:
    head = "Prefix: : <urn:v#>\nOntology: <urn:{}>\nClass: A SubClassOf: B\nClass: B\n"
    (tmp_path / "v.omn").write_text(head.format("v"))
    vocabulary = axioms_of(load(tmp_path / "v.omn", builtin=False))
    entry = f"{head.format('e')}Class: E SubClassOf: A\n"
    whole = load(tmp_path / "e.omn", builtin=False, also=[tmp_path / "v.omn"], content=entry.encode())
    assert own_axioms_of(whole, vocabulary).above == {"urn:v#E": ["urn:v#A"]}


def test_the_classes_are_named_that_let_nothing_be_what_a_description_says() -> None:
    vocabulary = Axioms(disjoint=[("urn:Wet", "urn:Dry")])
    for lower, upper in (("urn:Towel", "urn:Dry"), ("urn:Damp", "urn:Wet"), ("urn:Sheet", "urn:Towel")):
        vocabulary.state(lower, upper)
    own = Axioms()
    for upper in ("urn:Sheet", "urn:Damp"):
        own.state("urn:DampSheet", upper)
    own.state("urn:Bed", Some("urn:has", "urn:DampSheet"))
    for about in ("urn:DampSheet", "urn:Bed"):
        found = described(about, vocabulary, own)
        assert NOTHING in found.nodes[0].labels
        assert contradiction(found, vocabulary) == ("urn:Dry", "urn:Wet")
    assert contradiction(described("urn:Sheet", vocabulary, Axioms()), vocabulary) is None
