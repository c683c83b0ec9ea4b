"""Recipes of any size as files: random orders with ten orderings a step, in each syntax of OWL.

The steps are classes below one action of the vocabulary, the orderings individuals with two facts, as editors write
them: in RDF/XML the restrictions are members of one intersection, in the other syntaxes each stands for itself.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

BASE = "http://planlang.org/bench#"
KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
ACTION = "LookingForSomething"
PER_STEP = 10

Pairs = list[tuple[int, int]]


def random_orders(size: int) -> Pairs:
    """Ten orderings a step, along a hidden linear order."""
    rng = random.Random(size)
    hidden = rng.sample(range(size), size)
    pairs: dict[tuple[int, int], None] = {}
    while len(pairs) < size * PER_STEP:
        a, b = sorted(rng.sample(range(size), 2))
        pairs[hidden[a], hidden[b]] = None
    return list(pairs)


def _rdfxml(size: int, pairs: Pairs) -> Iterator[str]:
    yield f"""<?xml version="1.0"?>
<!DOCTYPE rdf:RDF [
    <!ENTITY owl "http://www.w3.org/2002/07/owl#" >
    <!ENTITY knowrob "{KNOWROB}" >
    <!ENTITY bench "{BASE}" >
]>
<rdf:RDF xmlns="{BASE}" xml:base="{BASE[:-1]}"
     xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"
     xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"
     xmlns:owl="http://www.w3.org/2002/07/owl#"
     xmlns:knowrob="{KNOWROB}">
    <owl:Ontology rdf:about="{BASE[:-1]}"/>
    <owl:Class rdf:about="&bench;Task">
        <rdfs:subClassOf>
            <owl:Class>
                <owl:intersectionOf rdf:parseType="Collection">
                    <rdf:Description rdf:about="&knowrob;PurposefulAction"/>
"""
    fillers = [("subAction", "someValuesFrom", f"step{step}") for step in range(size)]
    fillers += [("orderingConstraints", "hasValue", f"order{number}") for number in range(len(pairs))]
    for prop, kind, filler in fillers:
        yield f"""                    <owl:Restriction>
                        <owl:onProperty rdf:resource="&knowrob;{prop}"/>
                        <owl:{kind} rdf:resource="&bench;{filler}"/>
                    </owl:Restriction>
"""
    yield """                </owl:intersectionOf>
            </owl:Class>
        </rdfs:subClassOf>
    </owl:Class>
"""
    for step in range(size):
        yield f"""    <owl:Class rdf:about="&bench;step{step}">
        <rdfs:subClassOf rdf:resource="&knowrob;{ACTION}"/>
    </owl:Class>
"""
    for number, (before, after) in enumerate(pairs):
        yield f"""    <knowrob:PartialOrdering-Strict rdf:about="&bench;order{number}">
        <knowrob:occursBeforeInOrdering rdf:resource="&bench;step{before}"/>
        <knowrob:occursAfterInOrdering rdf:resource="&bench;step{after}"/>
    </knowrob:PartialOrdering-Strict>
"""
    yield "</rdf:RDF>\n"


def _turtle(size: int, pairs: Pairs) -> Iterator[str]:
    yield f"""@prefix : <{BASE}> .
@prefix knowrob: <{KNOWROB}> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .

<{BASE[:-1]}> a owl:Ontology .

:Task a owl:Class ;
    rdfs:subClassOf knowrob:PurposefulAction"""
    restriction = ",\n        [ a owl:Restriction ; owl:onProperty knowrob:{} ; owl:{} :{} ]"
    yield from (restriction.format("subAction", "someValuesFrom", f"step{step}") for step in range(size))
    for number in range(len(pairs)):
        yield restriction.format("orderingConstraints", "hasValue", f"order{number}")
    yield " .\n\n"
    yield from (f":step{step} a owl:Class ; rdfs:subClassOf knowrob:{ACTION} .\n" for step in range(size))
    for number, (before, after) in enumerate(pairs):
        yield f""":order{number} a knowrob:PartialOrdering-Strict ;
    knowrob:occursBeforeInOrdering :step{before} ;
    knowrob:occursAfterInOrdering :step{after} .
"""


def _manchester(size: int, pairs: Pairs) -> Iterator[str]:
    yield f"""Prefix: : <{BASE}>
Prefix: knowrob: <{KNOWROB}>

Ontology: <{BASE[:-1]}>

Class: Task
    SubClassOf:
        knowrob:PurposefulAction"""
    yield from (f",\n        knowrob:subAction some step{step}" for step in range(size))
    yield from (f",\n        knowrob:orderingConstraints value order{number}" for number in range(len(pairs)))
    yield "\n\n"
    yield from (f"Class: step{step}\n    SubClassOf: knowrob:{ACTION}\n" for step in range(size))
    for number, (before, after) in enumerate(pairs):
        yield f"""Individual: order{number}
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering step{before}, knowrob:occursAfterInOrdering step{after}
"""


SYNTAXES: dict[str, tuple[str, Callable[[int, Pairs], Iterator[str]]]] = {
    "RDF/XML": (".owl", _rdfxml),
    "Turtle": (".ttl", _turtle),
    "Manchester": (".omn", _manchester),
}
"""Name -> suffix of files, and what writes a recipe of so many steps with these orders."""


def write_recipe(folder: Path, syntax: str, size: int) -> Path:
    """A recipe of ``size`` steps and ten times as many orderings, as a file in ``folder``."""
    suffix, write = SYNTAXES[syntax]
    path = folder / f"steps_{size}{suffix}"
    with path.open("w", encoding="utf-8") as file:
        file.writelines(write(size, random_orders(size)))
    return path
