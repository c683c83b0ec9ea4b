"""Every real file holds what an independent script found in it: triples, imports, mistakes, restrictions."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from planlang.ontology import Literal, Ontology, Term, load
from planlang.ontology.repairs import canonical
from planlang.ontology.terms import OWL, RDFS

MISTAKES = {"malformed XML comment removed x1": "O006", "duplicate XML attribute xmlns:acat removed x1": "O007"}
"""How the truth names a mistake -> the code that tells of it here."""

KINDS = {"some": "someValuesFrom", "value": "hasValue", "only": "allValuesFrom"}


def truths(corpus: Path) -> Iterator[tuple[str, dict[str, Any], Path]]:
    """Name, truth and file of everything that is an ontology."""
    for path in sorted((corpus / "truth").glob("*.owl*.json")):
        truth = json.loads(path.read_text())
        files = [corpus / truth["file"], corpus / "recipes" / truth["file"]]
        yield path.name, truth, next(file for file in files if file.is_file())


@pytest.fixture(scope="module")
def read(corpus: Path) -> dict[str, tuple[dict[str, Any], Ontology]]:
    """Name of a truth -> it, and its file alone."""
    return {name: (truth, load(file, builtin=False)) for name, truth, file in truths(corpus)}


Read = dict[str, tuple[dict[str, Any], Ontology]]


def test_all_truths_are_compared(read: Read) -> None:
    assert len(read) >= 23
    assert sum("triples" in truth for truth, _ in read.values()) >= 21


def test_every_file_has_the_number_of_triples_that_the_truth_states(read: Read) -> None:
    """Without what is stated twice, and without the types that restrictions were given on reading (O014)."""
    for name, (truth, ontology) in read.items():
        if "triples" in truth:
            found = {(t.subject, t.predicate, t.object) for t in main_triples(ontology)}
            added = [d.message.partition(" ")[0] for d in ontology.diagnostics if d.code == "O014"]
            number = sum(1 if words == "a" else int(words) for words in added)
            assert len(found) - number == truth["triples"], name


def main_triples(ontology: Ontology) -> list[Any]:
    file = str(ontology.documents[0].path)
    return [triple for triple in ontology.triples() if triple.span.file == file]


def test_every_repair_is_reported_and_no_other(read: Read) -> None:
    for name, (truth, ontology) in read.items():
        found = [d.code for d in ontology.diagnostics if d.code in ("O005", "O006", "O007", "O010", "O016")]
        assert found == [MISTAKES[words] for words in truth["repairs"]], name


def test_every_import_is_found(read: Read) -> None:
    for name, (truth, ontology) in read.items():
        if "imports" in truth:
            found = sorted({str(t.object) for t in main_triples(ontology) if t.predicate == OWL.imports})
            expected = sorted(canonical(address) for address in truth["imports"])
            assert filled(found) == filled(expected), name


def filled(addresses: list[str]) -> list[str]:
    """Addresses from behind the folder that a build would have filled in."""
    return [address.partition("/owl/")[2] or address for address in addresses]


def test_every_action_has_the_superclasses_labels_and_parameters_that_the_truth_states(read: Read) -> None:
    compared = 0
    for name, (truth, ontology) in read.items():
        for task in truth.get("tasks", ()):
            for iri, action in task["actions"].items():
                if "superclasses" not in action or not iri.startswith("http"):
                    continue
                if not ontology.defined(canonical(iri)):  # what the truth says of it stands in a nameless class
                    assert iri.endswith(("#GraspObjectWithRightGripper", "#GraspBottle"))
                    continue
                above = {canonical(cls) for cls in action["superclasses"] if cls.startswith("http")}
                assert above <= set(ontology.parents(canonical(iri))), (name, iri)
                labels = {v.value for v in ontology.values(canonical(iri), RDFS.label) if isinstance(v, Literal)}
                assert set(action["label"]) <= labels, (name, iri)
                found = {
                    (restriction.property, KINDS.get(restriction.kind), said(restriction.filler))
                    for restriction in ontology.restrictions(canonical(iri))
                }
                for parameter in action["params"]:
                    if "property_iri" in parameter and (value := stated(parameter["value"])) is not None:
                        key = (canonical(parameter["property_iri"]), parameter["kind"], value)
                        assert key in found, (name, iri, key)
                        compared += 1
    assert compared >= 197


def said(term: Term) -> str:
    return term.value if isinstance(term, Literal) else str(term)


def stated(value: object) -> str | None:
    """What the truth has as the value of a parameter; None for what is no name and no literal."""
    if isinstance(value, dict):
        return value.get("literal") or (canonical(value["iri"]) if "iri" in value else None)
    return canonical(value) if isinstance(value, str) and value.startswith("http") else None


@pytest.mark.parametrize("name", ["ONT_knowrob@hydro.owl.json", "ONT_knowrob@2011-09_ias.owl.json"])
def test_the_actions_of_knowrob_have_the_sub_actions_and_orders_that_the_truth_states(read: Read, name: str) -> None:
    truth, ontology = read[name]
    assert len(truth["tasks"]) == 10
    for task in truth["tasks"]:
        own = ontology.restrictions(canonical(task["task"]))
        subs = [said(r.filler) for r in own if r.property.endswith("#subAction")]
        assert sorted(subs) == sorted(map(canonical, task["subactions"])), task["task"]
        orders = [r.filler for r in own if r.property.endswith("#orderingConstraints")]
        ends = {
            tuple(
                said(v) for p in ("occursBeforeInOrdering", "occursAfterInOrdering") for v in ontology.values(str(o), p)
            )
            for o in orders
        }
        assert ends == {tuple(map(canonical, pair)) for pair in task["constraints"]}, task["task"]
