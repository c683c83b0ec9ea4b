"""Individuals that owl:sameAs states to be one are one, under a name that does not depend on the order of reading."""

from itertools import permutations
from pathlib import Path

import pytest

from executive.maps import read_map
from planlang.compiler import compile_recipe
from planlang.ontology import Ontology, load
from planlang.ontology.terms import KNOWROB

OWN, OTHER = "http://example.org/t.owl#", "http://example.org/k.owl#"
HEAD = f"""@prefix : <{OWN}> .
@prefix k: <{OTHER}> .
@prefix knowrob: <{KNOWROB}> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<http://example.org/t.owl> a owl:Ontology .
"""


def loaded(folder: Path, text: str) -> Ontology:
    (folder / "t.ttl").write_text(HEAD + text, encoding="utf-8")
    return load(folder / "t.ttl")


def test_facts_of_two_names_are_those_of_one_individual(tmp_path: Path) -> None:
    ontology = loaded(
        tmp_path,
        'k:a a knowrob:Cup ; rdfs:label "red cup" .\n:c a knowrob:Mug ; owl:sameAs k:a .\n:t knowrob:has k:a .',
    )
    assert ontology.diagnostics == ()
    for name in (OWN + "c", OTHER + "a"):
        assert (ontology.types(name), ontology.label(name)) == ((KNOWROB + "Cup", KNOWROB + "Mug"), "red cup")
    assert ontology.values(OWN + "t", "knowrob:has") == (OWN + "c",)
    assert ontology.alone().is_a(OWN + "c", KNOWROB + "Cup")


@pytest.mark.parametrize("order", list(permutations(("k:a owl:sameAs :c", "k:b owl:sameAs k:a", "k:d owl:sameAs k:b"))))
def test_a_chain_of_names_is_called_by_the_one_of_the_files_own_namespace(
    order: tuple[str, ...], tmp_path: Path
) -> None:
    described = "".join(f"{name} a knowrob:Cup .\n" for name in ("k:d", "k:b", ":c", "k:a"))
    ontology = loaded(tmp_path, described + "".join(f"{one} .\n" for one in order))
    assert ontology.individuals("Cup") == (OWN + "c",)
    assert ontology.same == dict.fromkeys((OTHER + "a", OTHER + "b", OTHER + "d"), OWN + "c")


def test_names_of_other_files_are_called_by_the_first_one(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, "k:b a knowrob:Cup .\nk:a a knowrob:Cup ; owl:sameAs k:b .")
    assert ontology.individuals("Cup") == (OTHER + "b",)


def test_classes_properties_and_names_of_which_nothing_is_said_keep_their_names(tmp_path: Path) -> None:
    ontology = loaded(
        tmp_path,
        ":C rdfs:subClassOf knowrob:Cup ; owl:sameAs :D .\n:D a owl:Class .\n:c a :C ; owl:sameAs k:unknown .\n"
        ":p a owl:ObjectProperty ; owl:sameAs :q .\n:q a owl:ObjectProperty .",
    )
    assert ontology.same == {}
    assert [one.code for one in ontology.diagnostics] == ["O046", "O046"]


def test_a_thing_of_two_names_is_once_in_the_world_and_found_by_both(tmp_path: Path) -> None:
    text = """:c a knowrob:Cup ; owl:sameAs k:a ; knowrob:pose :pose1 .
k:a a knowrob:Cup ; knowrob:depthOfObject "0.1" ; knowrob:widthOfObject "0.1" ; knowrob:heightOfObject "0.2" .
:pose1 a knowrob:Pose ; knowrob:translation "1 2 3" ; knowrob:quaternion "0 0 0 1" .
"""
    semantic_map = read_map(loaded(tmp_path, text))
    (cup,) = semantic_map.objects
    assert (cup.size, cup.pose is not None and cup.pose.position) == ((0.1, 0.1, 0.2), (1.0, 2.0, 3.0))
    assert all(semantic_map.find(name) is cup for name in ("c", "a", OWN + "c", OTHER + "a"))


def test_a_step_acts_on_the_thing_by_whatever_name_the_recipe_has_it(tmp_path: Path) -> None:
    text = """:T rdfs:subClassOf knowrob:PurposefulAction ,
    [ a owl:Restriction ; owl:onProperty knowrob:subAction ; owl:someValuesFrom :S ] .
:S rdfs:subClassOf knowrob:PickingUpAnObject , [ a owl:Restriction ; owl:onProperty knowrob:objectActedOn ;
    owl:hasValue k:a ] .
:cup1 a knowrob:Cup ; owl:sameAs k:a .
"""
    loaded(tmp_path, text)
    plan = compile_recipe(tmp_path / "t.ttl")
    assert plan.diagnostics == ()
    assert "cup1" in plan.source
