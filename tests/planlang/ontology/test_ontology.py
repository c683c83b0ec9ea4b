"""Answers of the facade: names, classes, individuals, restrictions, hierarchies."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from planlang.ontology import BNode, Literal, Ontology, expand, load, shorten
from planlang.ontology.terms import KNOWROB, OWL, RDFS, ROBOEARTH, VOCABULARIES

T = "http://example.org/t.owl#"
HEAD = f"""Prefix: : <{T}>
Prefix: knowrob: <{KNOWROB}>
Prefix: re: <{ROBOEARTH}>
Ontology: <http://example.org/t.owl>
"""


def loaded(folder: Path, text: str, *, builtin: bool = True) -> Ontology:
    path = folder / "t.omn"
    path.write_text(HEAD + text, encoding="utf-8")
    return load(path, builtin=builtin)


# names


def test_bare_names_are_the_vocabularys_and_come_back() -> None:
    assert expand("Reaching") == KNOWROB + "Reaching"
    assert expand("dependsOnCapability") == VOCABULARIES["srdl2-cap"] + "dependsOnCapability"
    assert expand("urdfName") == VOCABULARIES["srdl2-comp"] + "urdfName"
    assert expand("NothingKnown") == KNOWROB + "NothingKnown"
    for name in ("Reaching", "dependsOnCapability", "urdfName", "BaseMotionCapability", "NothingKnown"):
        assert shorten(expand(name)) == name


def test_prefixed_names_and_iris_are_what_they_say() -> None:
    assert expand("srdl2-comp:Camera") == VOCABULARIES["srdl2-comp"] + "Camera"
    assert expand("owl:Thing") == OWL.Thing
    for iri in (T + "A", "urn:x:y", "http://example.org", "file:///a", OWL.Thing, ROBOEARTH + "Reaching"):
        assert expand(iri) == iri
        assert shorten(iri) == iri


def test_a_name_that_two_vocabularies_have_is_knowrobs() -> None:
    assert expand("Camera") == KNOWROB + "Camera"
    assert shorten(VOCABULARIES["srdl2-comp"] + "Camera") == VOCABULARIES["srdl2-comp"] + "Camera"


def test_expand_undoes_shorten_for_every_name_of_the_vocabulary(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, "")
    named = {t.subject for t in ontology.triples() if isinstance(t.subject, str)}
    assert len(named) > 900
    assert [iri for iri in sorted(named) if expand(shorten(iri)) != iri] == []


# terms


@pytest.mark.parametrize(("text", "number"), [("5", 5.0), (" -1.5 ", -1.5), ("1e3", 1000.0)])
def test_a_literal_is_a_number_if_it_looks_like_one(text: str, number: float) -> None:
    assert Literal(text).number() == number


@pytest.mark.parametrize("text", ["", "five", "1_000", "nan", "INF", "0x10", "1,5"])
def test_a_literal_that_is_no_finite_number_says_so(text: str) -> None:
    with pytest.raises(ValueError, match=r"number|float"):
        Literal(text).number()


# restrictions


FORMS = """
Class: A
    SubClassOf: knowrob:Reaching, knowrob:toLocation some B
    SubClassOf: knowrob:Action and (knowrob:subAction some C) and (knowrob:subAction some B and knowrob:goal value x)
    EquivalentTo: D and (knowrob:subAction min 2 C)
    SubClassOf: knowrob:deviceUsed max 1, knowrob:linearVelocity value 0.3
Class: B
Class: C
Class: D
Individual: x Types: B
"""


def test_restrictions_are_in_source_order_with_their_form(tmp_path: Path) -> None:
    found = loaded(tmp_path, FORMS).restrictions(T + "A")
    assert [(shorten(r.property), r.kind, str(r.filler).rpartition("#")[2], r.cardinality, r.form) for r in found] == [
        ("toLocation", "some", "B", None, "flat"),
        ("subAction", "some", "C", None, "intersection"),
        ("subAction", "some", "B", None, "intersection"),
        ("goal", "value", "x", None, "intersection"),
        ("subAction", "min", "C", 2, "equivalent"),
        ("deviceUsed", "max", "Thing", 1, "flat"),
        ("linearVelocity", "value", "decimal", None, "flat"),
    ]
    assert [r.span.line for r in found] == [7, 8, 8, 8, 9, 10, 10]


def test_a_nameless_class_has_the_restrictions_that_it_consists_of(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, "Class: A SubClassOf: knowrob:subAction some (B and knowrob:goal value x)\nClass: B\n")
    filler = ontology.restrictions(T + "A")[0].filler
    assert isinstance(filler, BNode)
    assert [shorten(r.property) for r in ontology.restrictions(filler)] == ["goal"]
    assert ontology.members(filler)[0] == T + "B"


def test_restrictions_are_inherited_through_sub_properties(tmp_path: Path) -> None:
    found = loaded(tmp_path, "Class: A SubClassOf: knowrob:Translation-LocationChange\n").inherited_restrictions(
        T + "A", "dependsOn"
    )
    assert [shorten(str(r.filler)) for r in found] == ["BaseMotionCapability"]


@pytest.mark.parametrize(
    "name", ["serve_drink@knowrob_hydro_2014-11.owl", "make_pancakes@hydro.owl", "pouring@hydro.owl"]
)
def test_sub_actions_of_real_recipes_are_those_of_the_truth(corpus: Path, name: str) -> None:
    ontology = load(corpus / "recipes" / name)
    truth = json.loads((corpus / "truth" / f"{name}.json").read_text())
    assert truth["tasks"]
    for task in truth["tasks"]:
        restrictions = ontology.restrictions(task["task"])
        found = {str(r.filler) for r in restrictions if shorten(r.property) in ("subAction", "subEvents")}
        assert found == set(task["subactions"])


def test_untyped_restrictions_of_real_recipes_are_seen(corpus: Path) -> None:
    ontology = load(corpus / "recipes" / "exploration-recipe@hydro.owl")
    transitions = [t.subject for t in ontology.triples(p=OWL.onProperty, o=KNOWROB + "stateTransition")]
    found = [
        r for cls in ontology.class_names() for r in ontology.restrictions(cls) if r.property.endswith("Transition")
    ]
    assert len(transitions) == len(found) > 5


# classes and individuals


def test_kinds_of_names_are_told_apart(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, "Class: A SubClassOf: Unknown\nIndividual: a Types: A\nObjectProperty: p\n")
    assert ontology.is_class(T + "A")
    assert not ontology.is_individual(T + "A")
    assert ontology.is_individual(T + "a")
    assert not ontology.is_class(T + "a")
    assert ontology.is_property(T + "p")
    assert ontology.is_class(T + "Unknown")
    assert not ontology.defined(T + "Unknown")
    assert ontology.types(T + "a") == (T + "A",)
    assert ontology.main(T + "a")
    assert not ontology.main("Reaching")


def test_individuals_of_a_class_include_those_of_subclasses_in_document_order(tmp_path: Path) -> None:
    text = "Individual: z Types: B\nIndividual: a Types: A\nClass: A\nClass: B SubClassOf: A\nIndividual: b Types: B\n"
    assert loaded(tmp_path, text).individuals(T + "A") == (T + "z", T + "a", T + "b")


def test_ancestors_are_nearest_first_and_in_document_order(tmp_path: Path) -> None:
    text = (
        "Class: A SubClassOf: C, B\nClass: B SubClassOf: E\nClass: C SubClassOf: D\nClass: D SubClassOf: E\nClass: E\n"
    )
    ontology = loaded(tmp_path, text, builtin=False)
    assert [iri[-1] for iri in ontology.ancestors(T + "A")] == ["A", "C", "B", "D", "E"]
    assert [iri[-1] for iri in ontology.subclasses(T + "E")] == ["E", "B", "D", "A", "C"]


def test_superclasses_come_from_intersections_and_equivalences_too(tmp_path: Path) -> None:
    text = "Class: A SubClassOf: B and (knowrob:goal value x)\nClass: B EquivalentTo: C and D, E\nClass: C\nClass: E\n"
    ontology = loaded(tmp_path, text, builtin=False)
    assert set(ontology.ancestors(T + "A")) == {T + name for name in "ABCDE"}
    assert ontology.is_a(T + "E", T + "D")


def test_a_circle_of_superclasses_is_walked_once(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, "Class: A SubClassOf: B\nClass: B SubClassOf: A, B\n", builtin=False)
    assert ontology.ancestors(T + "A") == (T + "A", T + "B")
    assert ontology.is_a(T + "B", T + "A")


def test_the_store_and_the_documents_agree_on_the_whole_taxonomy(corpus: Path) -> None:
    ontology = load(corpus / "ontologies" / "knowrob@hydro.owl", builtin=False)
    parents = {cls: set(ontology.parents(cls)) for cls in ontology.class_names()}

    def closure(cls: str) -> set[str]:
        reached, stack = {cls}, [cls]
        while stack:
            new = parents.get(stack.pop(), set()) - reached
            reached |= new
            stack += new
        return reached

    for cls in ontology.class_names():
        assert set(ontology.ancestors(cls)) == closure(cls)
    assert len(ontology.subclasses("Action")) == 157


def test_roboearths_classes_are_below_knowrobs_of_the_same_name(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, "Class: A SubClassOf: re:Reaching\nClass: B SubClassOf: re:DrinkingBottle\n")
    assert ontology.is_a(T + "A", "Reaching")
    assert ontology.is_a(T + "B", "DrinkingBottle")
    assert ontology.defined(ROBOEARTH + "DrinkingBottle")
    assert not ontology.defined(ROBOEARTH + "NothingKnown")
    assert ontology.diagnostics == ()


def test_values_follow_sub_properties_only_when_asked(tmp_path: Path) -> None:
    ontology = loaded(
        tmp_path, "Individual: a Facts: knowrob:detectedObject b, knowrob:objectActedOn c, knowrob:goal b\n"
    )
    assert ontology.values(T + "a", "objectActedOn") == (T + "c",)
    assert ontology.values_below(T + "a", "objectActedOn") == (T + "b", T + "c")
    assert ontology.value(T + "a", "deviceUsed") is None


def test_an_english_label_comes_before_others(tmp_path: Path) -> None:
    text = 'Class: A Annotations: rdfs:label "Flasche"@de, rdfs:label "bottle"@en-GB, rdfs:label "flask"\n'
    assert loaded(tmp_path, text).label(T + "A") == "bottle"


def test_triples_are_selected_by_any_part_in_document_order(tmp_path: Path) -> None:
    ontology = loaded(tmp_path, FORMS, builtin=False)
    everything = list(ontology.triples())
    for triple in everything:
        for s in (None, triple.subject):
            for p in (None, triple.predicate):
                for o in (None, triple.object):
                    expected = [
                        t
                        for t in everything
                        if s in (None, t.subject) and p in (None, t.predicate) and o in (None, t.object)
                    ]
                    assert list(ontology.triples(s, p, o)) == expected


def test_old_names_are_read_as_new_ones_but_recipes_maps_and_robots_keep_theirs(corpus: Path) -> None:
    ontology = load(corpus / "recipes" / "pancake-making@groovy_2011-08.owl.in")
    names = {t.subject for t in ontology.triples() if isinstance(t.subject, str)}
    assert "http://ias.cs.tum.edu/kb/pancake-making.owl#MakingPancakes" in names
    assert not any(name.startswith("http://ias.cs.tum.edu/kb/knowrob.owl") for name in names)


def test_two_loads_know_nothing_of_each_other(tmp_path: Path) -> None:
    first = loaded(tmp_path, "Class: A SubClassOf: B\n", builtin=False)
    second = loaded(tmp_path, "Class: A SubClassOf: C\n", builtin=False)
    assert first.ancestors(T + "A") == (T + "A", T + "B")
    assert second.ancestors(T + "A") == (T + "A", T + "C")


def test_loading_is_the_same_in_every_process(corpus: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from planlang.ontology import load\n"
        "o = load(Path(sys.argv[1]))\n"
        "print([str(t) for t in o.triples()], o.diagnostics, [o.ancestors(c) for c in o.class_names()], o.documents)"
    )
    recipe = str(corpus / "recipes" / "serve_drink@re_stack.owl")
    outputs = {
        subprocess.run(
            [sys.executable, "-c", program, recipe],
            check=True,
            capture_output=True,
            env={"PYTHONHASHSEED": seed, "PATH": ""},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(outputs) == 1


def test_importing_loads_no_parser_and_asking_no_reasoner(tmp_path: Path) -> None:
    file = tmp_path / "t.owl"
    file.write_text('<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"/>')
    program = (
        "import sys, planlang.ontology; print([m for m in ('lark', 'pyoxigraph', 'owlready2') if m in sys.modules])\n"
        f"planlang.ontology.load({str(file)!r}).ancestors('Reaching')\n"
        "print('owlready2' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("[]\nFalse\n", "")


def test_loading_and_asking_prints_nothing(corpus: Path, capfd: pytest.CaptureFixture[str]) -> None:
    ontology = load(corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl")
    ontology.ancestors("Reaching")
    assert capfd.readouterr() == ("", "")


def test_superclasses_that_nothing_defines_get_the_nearest_name_as_advice(tmp_path: Path) -> None:
    (warning,) = loaded(tmp_path, "Class: A SubClassOf: knowrob:DrinkingBottel\n").diagnostics
    assert warning.help is not None
    assert warning.help.startswith("did you mean DrinkingBottle?")


def test_a_repaired_subclass_counts(corpus: Path) -> None:
    ontology = load(corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl")
    patient = "http://www.roboearth.org/kb/serve_drink.owl#Patient"
    assert [shorten(r.property) for r in ontology.restrictions(patient)] == ["in-ContGeneric", "in-ContGeneric"]
    assert len(list(ontology.triples(patient, RDFS.subClassOf))) == 2
    assert not list(ontology.triples(patient, OWL + "subClassOf"))
