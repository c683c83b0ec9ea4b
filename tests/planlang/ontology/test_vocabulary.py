"""The bundled vocabulary: complete, consistent in itself, and what the compiler and the executive need of it."""

from pathlib import Path

import pytest

from planlang.compiler.recoveries import NEXT_SOLUTION
from planlang.files import bundled
from planlang.ontology import Literal, Ontology, expand, load, shorten
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, VOCABULARIES, XSD
from planlang.recoveries import registered_strategies


@pytest.fixture(scope="module")
def vocabulary() -> Ontology:
    return load(bundled("ontologies") / "knowrob.omn")


@pytest.fixture(scope="module")
def knowrob(corpus: Path) -> Ontology:
    return load(corpus / "ontologies" / "knowrob@hydro.owl", builtin=False)


MODELS_WANTED = {
    "flipping_table": ("pancake-maker", "spatula-features"),
    "pouring_table": ("pancake-maker", "mondamin-pancake-mix"),
}
"""Environments that import models of KnowRob, which the product does not contain."""


def models_wanted(path: Path) -> list[str]:
    return [f"package://knowrob_cad_models/owl/{name}.owl" for name in MODELS_WANTED.get(path.stem, ())]


@pytest.mark.parametrize("path", sorted(bundled("ontologies").rglob("*.omn")), ids=lambda path: path.name)
def test_no_bundled_file_has_anything_to_say_but_which_models_of_knowrob_it_wants(path: Path) -> None:
    said = [(found.code, found.message) for found in load(path).diagnostics]
    assert said == [("O030", f"import not found: {model}") for model in models_wanted(path)]


@pytest.mark.parametrize("name", MODELS_WANTED)
def test_wanted_models_of_knowrob_are_found_in_their_folder(corpus: Path, name: str) -> None:
    path = bundled("ontologies") / "environments" / f"{name}.omn"
    said = {found.message for found in load(path, folders=[corpus / "objects"]).diagnostics}
    assert not said & {f"import not found: {model}" for model in models_wanted(path)}


def test_everything_that_a_bundled_file_refers_to_is_defined(vocabulary: Ontology) -> None:
    spaces = tuple(VOCABULARIES.values())
    undefined = {
        term
        for triple in vocabulary.triples()
        for term in (triple.subject, triple.predicate, triple.object)
        if isinstance(term, str) and term.startswith(spaces) and not vocabulary.defined(term)
    }
    assert undefined == set()


def test_every_action_class_of_knowrob_is_there_below_the_same_classes(vocabulary: Ontology, knowrob: Ontology) -> None:
    actions = knowrob.subclasses("Action")
    assert len(actions) == 157
    for action in actions:
        assert set(knowrob.ancestors(action)) - {OWL.Thing} <= set(vocabulary.ancestors(action)), action


def test_nothing_is_below_anything_that_knowrob_does_not_say(vocabulary: Ontology, knowrob: Ontology) -> None:
    ours = {"Patient", "HandingOverAnObject", "DrinkingBottle"}  # below Bottle, which RoboEarth's recipes name
    for cls in vocabulary.class_names():
        if cls.startswith(KNOWROB) and knowrob.is_class(cls) and shorten(cls) not in ours:
            above = {name for name in vocabulary.ancestors(cls) if name.startswith(KNOWROB)}
            assert above <= set(knowrob.ancestors(cls)), cls


def test_properties_are_below_the_same_properties_as_in_knowrob(vocabulary: Ontology, knowrob: Ontology) -> None:
    compared = 0
    for triple in vocabulary.triples(p=RDF.type):
        name = triple.subject
        if isinstance(name, str) and vocabulary.is_property(name) and knowrob.is_property(name):
            expected = {p for p in knowrob.superproperties(name) if p.startswith(KNOWROB)}
            assert {p for p in vocabulary.superproperties(name) if p.startswith(KNOWROB)} == expected, name
            compared += 1
    assert compared == 197


def test_every_action_class_has_a_label(vocabulary: Ontology) -> None:
    for action in vocabulary.subclasses("Action"):
        assert vocabulary.label(action) or not action.startswith(KNOWROB), action


def test_classes_that_real_files_use_are_there(vocabulary: Ontology, knowrob: Ontology, corpus: Path) -> None:
    for folder in ("recipes", "environments", "objects"):
        for path in sorted((corpus / folder).glob("*.owl*")):
            used = {t.object for t in load(path, builtin=False).triples(p=RDF.type) if isinstance(t.object, str)}
            missing = {
                cls
                for cls in used
                if cls.startswith(KNOWROB) and knowrob.is_class(cls) and not vocabulary.is_class(cls)
                if not knowrob.is_a(cls, "SpatialThingTypeByShape")  # cones and spheres, which no recipe names
            }
            assert missing == set(), path.name


@pytest.mark.parametrize(
    ("action", "valid", "invalid"),
    [
        ("Reaching", ["toLocation", "deviceUsed", "objectActedOn", "bodyPartsUsed", "performedBy"], ["objectSought"]),
        ("Translation-LocationChange", ["toLocation", "fromLocation", "linearVelocity"], ["objectSought"]),
        ("GraspingSomething", ["objectActedOn", "deviceUsed"], ["recipient", "inputs-"]),
        ("OpeningAGripper", ["deviceUsed", "objectActedOn"], ["toLocation"]),
        ("LookingForSomething", ["objectActedOn", "objectSought", "detectedObject"], ["toLocation"]),
        ("HandingOverAnObject", ["objectActedOn", "deviceUsed", "recipient"], ["objectSought"]),
    ],
)
def test_properties_of_actions_are_listed(
    vocabulary: Ontology, action: str, valid: list[str], invalid: list[str]
) -> None:
    listed = {shorten(p) for p in vocabulary.valid_properties(action)}
    assert set(valid) <= listed
    assert not set(invalid) & listed


def test_parameters_of_real_recipes_are_valid_properties(vocabulary: Ontology, corpus: Path) -> None:
    ontology = load(corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl")
    structure = {"subAction", "orderingConstraints"}
    for cls in ontology.class_names():
        if ontology.main(cls) and ontology.is_a(cls, "Action"):
            used = {shorten(r.property) for r in ontology.restrictions(cls)} - structure
            assert used <= {shorten(p) for p in ontology.valid_properties(cls)}, cls


def test_domains_and_ranges_are_classes_or_datatypes(vocabulary: Ontology) -> None:
    for predicate in (RDFS.domain, RDFS.range):
        for triple in vocabulary.triples(p=predicate):
            value = triple.object
            assert isinstance(value, str)
            assert value.startswith((XSD, RDFS, OWL)) or vocabulary.is_class(value), triple.subject


def test_a_bottle_is_no_device_and_a_gripper_is_one(vocabulary: Ontology) -> None:
    device = vocabulary.value("deviceUsed", RDFS.range)
    thing = vocabulary.value("objectActedOn", RDFS.range)
    assert isinstance(device, str)
    assert isinstance(thing, str)
    assert not vocabulary.is_a("DrinkingBottle", device)
    assert vocabulary.is_a("HolderGripper", device)
    assert vocabulary.is_a("DrinkingBottle", thing)
    assert vocabulary.is_a("HolderGripper", thing)


@pytest.mark.parametrize("name", ["srdl2-comp", "srdl2-cap"])
def test_components_and_capabilities_are_those_of_srdl(vocabulary: Ontology, corpus: Path, name: str) -> None:
    srdl = load(corpus / "ontologies" / f"{name}@hydro.owl", builtin=False)
    for cls in srdl.class_names():
        if cls.startswith(VOCABULARIES[name]):
            above = {iri for iri in srdl.ancestors(cls) if not iri.startswith(OWL)}
            assert above <= set(vocabulary.ancestors(cls)), cls
            needed = {(r.property, r.filler) for r in srdl.restrictions(cls) if isinstance(r.filler, str)}
            assert needed <= {(r.property, r.filler) for r in vocabulary.restrictions(cls)}, cls


def test_actions_depend_on_the_capabilities_that_srdl_says(vocabulary: Ontology, corpus: Path) -> None:
    srdl = load(corpus / "ontologies" / "srdl2-action@hydro.owl", builtin=False)
    for cls in srdl.class_names():
        for restriction in srdl.restrictions(cls):
            if vocabulary.defined(cls) and restriction.property == expand("dependsOnCapability"):
                inherited = vocabulary.inherited_restrictions(cls, "dependsOnCapability")
                assert restriction.filler in {r.filler for r in inherited}, cls


SOFTWARE = (
    "StartSoftwareModules",
    "StopSoftwareModules",
    "LoadTypicalObjectModels",
    "InferLikelyObjectLocations",
    "UploadMapToRoboEarth",
)
"""Classes of actions that need no part of a robot's body."""


def test_every_primitive_names_a_class_a_module_and_a_resource(vocabulary: Ontology) -> None:
    found = vocabulary.individuals("Primitive")
    performed = {shorten(str(vocabulary.value(primitive, "performsAction"))) for primitive in found}
    assert performed == {
        "Translation-LocationChange",
        "Reaching",
        "OpeningAGripper",
        "ClosingAGripper",
        "LoweringAnObject",
        "SettingAsideAnObject",
        "LookingForSomething",
        "LookingAtSomething",
        "Perceiving",
        "HandingOverAnObject",
        "OpeningAContainerArtifact",
        "ClosingAContainerArtifact",
        "Waiting",
        "TurningOnPoweredDevice",
        "TurningOffPoweredDevice",
        "PreheatOven",
        "OperateOven",
        "CheckingWhetherConditionObtains",
        "SteppingBack",
        "ClosingDoorsAgain",
        "EmptyingTheHands",
        "EnvironmentExploration",
        "ITaSCMotion",
        "CirclingMotion",
        "WipingMotion",
        "PushingMotion",
        *SOFTWARE,
    }
    for primitive in found:
        assert isinstance(vocabulary.value(primitive, "processModule"), Literal)
        needs_no_part = shorten(str(vocabulary.value(primitive, "performsAction"))) in ("Waiting", *SOFTWARE)
        assert needs_no_part or vocabulary.values(primitive, "usesResource")


def test_every_recovery_is_complete_and_of_declared_strategies_and_failures(vocabulary: Ontology) -> None:
    strategies, failures = vocabulary.individuals("RecoveryStrategy"), vocabulary.individuals("FailureOfAPlan")
    registered = {strategy.name for strategy in registered_strategies()}
    assert registered <= {shorten(iri) for iri in strategies} == registered | {NEXT_SOLUTION}
    recoveries = vocabulary.individuals("Recovery")
    assert [shorten(name) for name in recoveries] == [
        "lookElsewhere",
        "lookByMoving",
        "lookAtTheirMarks",
        "putDownFirst",
        "openFirst",
        "openFirstToPut",
        "openOnTheWay",
        "nextPlace",
        "lookAndGraspAgain",
        "fetchAgain",
        "graspOtherwise",
        "moveAgain",
        "openAgain",
        "driveAgain",
        "offerAgain",
        "offerFromFartherBack",
        "turnAgain",
        "pourTheRest",
        "lookIntoTheVessel",
        "operateAgain",
        "switchAgain",
    ]
    for recovery in recoveries:
        assert vocabulary.value(recovery, "strategy") in strategies
        assert set(vocabulary.values(recovery, "recoversFailure")) <= set(failures)
        assert set(vocabulary.values(recovery, "escalatesTo")) <= set(failures)
        assert all(vocabulary.is_a(str(cls), "Action") for cls in vocabulary.values(recovery, "recoversAction"))
        for number in ("attempts", "rank"):
            value = vocabulary.value(recovery, number)
            assert isinstance(value, Literal)
            assert value.number() > 0


def test_declared_failures_are_those_of_the_plan_language(vocabulary: Ontology) -> None:
    failures = pytest.importorskip("planlang.failures")
    for iri in vocabulary.individuals("FailureOfAPlan"):
        assert issubclass(getattr(failures, shorten(iri)), failures.PlanFailure)


def test_default_sizes_are_three_positive_lengths_of_at_most_three_metres(vocabulary: Ontology) -> None:
    lengths = {expand(name) for name in ("depthOfObject", "widthOfObject", "heightOfObject")}
    sized = 0
    for path in sorted((bundled("ontologies") / "objects").glob("*.omn")):
        document = load(path, builtin=False)
        for cls in document.class_names():
            found = [r for r in document.restrictions(cls) if r.property in lengths]
            assert vocabulary.is_a(cls, "SpatialThing"), cls
            for restriction in found:
                assert isinstance(restriction.filler, Literal)
                assert 0 < restriction.filler.number() <= 3, cls
            sized += len(found) == 3
    assert sized > 50
